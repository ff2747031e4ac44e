"""Stages of the second half of the study: the specimen, its finite element runs, refits, and the case study of 2.6."""

from __future__ import annotations

from typing import Any

from fibrous.materials.registry import LAWS
from fibrous_study import plan
from fibrous_study.network_stages import SPECIMEN, contents, curves_of, figure, fits_config, once
from fibrous_study.plan import CASE_PATH, CASE_PROTOCOL, FIGURE_NETWORK, REFIT, Config, Run, Stage, Wildcards


def _specimen_files(config: Config) -> dict[str, list[str]]:
    if not plan.own_specimen(config):
        return {}
    return {key: [path] for key, path in config["specimen_files"].items()}


def _specimen_config(config: Config) -> dict[str, Any]:
    if not plan.own_specimen(config):
        return {"seed": config["seed"], "synthetic_specimen": config["synthetic_specimen"]}
    files = config["specimen_files"]
    return {"specimen_files": files, "contents": contents(list(files.values()))}


def _runs(config: Config, lagged: bool) -> list[Run]:
    return [run for run in plan.runs(config) if plan.is_lagged(config, run) == lagged]


def _with_networks(config: Config) -> list[Run]:
    return [run for run in plan.runs(config) if LAWS[run.model["law"]].is_solved]


def _continuous(config: Config) -> list[Run]:
    """Runs whose fibres are a law of the continuum."""
    return [run for run in _runs(config, lagged=False) if not LAWS[run.model["law"]].is_solved]


def _instances(runs: list[Run]) -> list[dict[str, str]]:
    return [{"run": run.name} for run in runs]


def _refitted(config: Config) -> list[Run]:
    """Runs whose constants are fitted to curves along the deformation that another run found."""
    return [run for run in _runs(config, lagged=False) if run.refits]


def _tissue_inputs(config: Config, wildcards: Wildcards) -> dict[str, list[str]]:
    run = plan.run_called(config, wildcards["run"])
    found: dict[str, list[str]] = {"specimen": [SPECIMEN], "fits": [], "surface": [], "networks": []}
    match run.model.get("constants"):
        case "fit":
            protocol = f"{REFIT}{run.source}" if run.refits else config["tissue"]["protocol"]
            found["fits"] = [f"results/fits/tissue/{protocol}.csv"]
        case "surface":
            found["surface"] = ["results/tables/surface.nc"]
    if LAWS[run.model["law"]].has_networks:
        found["networks"] = networks_of_elements(config)
    return found


def networks_of_elements(config: Config) -> list[str]:
    """Files of the networks of the tissue."""
    return [f"results/networks/tissue/{batch}.nc" for batch in plan.batches(config, "tissue")]


def _tissue_config(config: Config, wildcards: Wildcards) -> dict[str, Any]:
    run, tissue = plan.run_called(config, wildcards["run"]), config["tissue"]
    part = {"run": run.name, "model": run.model, "refits": run.refits, "matrix": config["matrix"]}
    part["linear_solver"] = tissue["linear_solver"]
    if LAWS[run.model["law"]].has_constants:
        part["tension_only"] = tissue["tension_only"]
    match run.model.get("constants"):
        case "fit" if not run.refits:
            part["load_set"] = tissue["load_set"]
        case "surface":
            part |= {"load_set": tissue["load_set"], "surface_protocol": tissue["surface_protocol"]}
    return part


def _lagged_inputs(config: Config, _: Wildcards) -> dict[str, list[str]]:
    fits = [f"results/fits/tissue/{config['tissue']['protocol']}.csv"]
    return {"specimen": [SPECIMEN], "fits": fits, "networks": networks_of_elements(config)}


def _lagged_config(config: Config, wildcards: Wildcards) -> dict[str, Any]:
    tissue = config["tissue"]
    return {
        **_tissue_config(config, wildcards),
        "load_set": tissue["load_set"],
        "iterations_of_last_step": tissue["refit_rounds"],
        "fit": config["fit"],
        "equilibrium": config["equilibrium"],
    }


def _in_febio(config: Config) -> list[Run]:
    """Runs whose problem FEBio can be given: families that carry tension alone, with constants that never change."""
    if plan.own_networks(config) or not config["tissue"]["tension_only"]:
        return []
    return [run for run in _runs(config, lagged=False) if LAWS[run.model["law"]].in_febio]


def runs_config(config: Config) -> dict[str, Any]:
    """Every run in words for the stages that set them side by side."""
    return {
        "runs": [
            {"name": run.name, "source": run.source, "refits": run.refits, "model": run.model}
            for run in plan.runs(config)
        ]
    }


def _case_models(config: Config) -> list[Config]:
    return [
        model
        for model in config["tissue"]["models"]
        if model.get("constants") == "fit" or (LAWS[model["law"]].has_networks and not LAWS[model["law"]].is_solved)
    ]


def _tried(config: Config) -> list[dict[str, str]]:
    """One instance, where there is a law to be tried on the case-study network."""
    return once(config) if _case_models(config) else []


TISSUE = "results/tissue/{run}.nc"
VTU = "results/tissue/{run}.vtu"

TISSUE_STAGES: dict[str, Stage] = {
    "specimen": Stage(
        module="fibrous_study.steps.specimen",
        outputs={"specimen": SPECIMEN},
        inputs=lambda config, _: _specimen_files(config),
        config=lambda config, _: _specimen_config(config),
        instances=once,
    ),
    "refit_curves": Stage(
        module="fibrous_study.steps.refit_curves",
        outputs={"curves": f"results/curves/tissue/{REFIT}{{each}}/{{batch}}.nc"},
        inputs=lambda config, wildcards: {
            "networks": [f"results/networks/tissue/{wildcards['batch']}.nc"],
            "specimen": [SPECIMEN],
            "tissue": [TISSUE.format(run=run) for run in plan.refit_sources(config)[wildcards["round"]]],
        },
        config=lambda config, wildcards: {
            "equilibrium": config["equilibrium"],
            "runs": plan.refit_sources(config)[wildcards["round"]],
        },
        instances=lambda config: [
            {"round": number, "batch": batch}
            for number in plan.refit_sources(config)
            for batch in plan.batches(config, "tissue")
        ],
        each=lambda config, wildcards: plan.refit_sources(config)[wildcards["round"]],
    ),
    "refits": Stage(
        module="fibrous_study.steps.hgo_fits",
        outputs={"fits": f"results/fits/tissue/{REFIT}{{run}}.csv"},
        inputs=lambda config, wildcards: {"curves": curves_of(config, "tissue", f"{REFIT}{wildcards['run']}")},
        config=lambda config, wildcards: fits_config(
            config,
            f"{REFIT}{wildcards['run']}",
            [],
            [plan.form_of(plan.run_called(config, wildcards["run"]).model)],
        ),
        instances=lambda config: [{"run": run.source} for run in _refitted(config)],
    ),
    "tissue": Stage(
        module="fibrous_study.steps.tissue_run",
        outputs={"tissue": TISSUE, "vtu": VTU},
        inputs=_tissue_inputs,
        config=_tissue_config,
        instances=lambda config: _instances(_continuous(config)),
    ),
    "lagged": Stage(
        module="fibrous_study.steps.tissue_lagged",
        outputs={"tissue": TISSUE, "vtu": VTU},
        inputs=_lagged_inputs,
        config=_lagged_config,
        instances=lambda config: _instances(_runs(config, lagged=True)),
    ),
    "multiscale": Stage(
        module="fibrous_study.steps.tissue_coupled",
        outputs={"tissue": TISSUE, "vtu": VTU},
        inputs=lambda config, _: {"specimen": [SPECIMEN], "networks": networks_of_elements(config)},
        config=lambda config, wildcards: {
            "run": wildcards["run"],
            "model": plan.run_called(config, wildcards["run"]).model,
            "matrix": config["matrix"],
            "linear_solver": config["tissue"]["linear_solver"],
            "equilibrium": config["equilibrium"],
        },
        instances=lambda config: _instances(_with_networks(config)),
    ),
    "febio": Stage(
        module="fibrous_study.steps.febio",
        outputs={"feb": "results/tissue/{run}.feb"},
        inputs=lambda _, wildcards: {"specimen": [SPECIMEN], "tissue": [TISSUE.format_map(wildcards)]},
        config=lambda config, _: {"matrix": config["matrix"]},
        instances=lambda config: _instances(_in_febio(config)),
    ),
    "tissue_table": Stage(
        module="fibrous_study.steps.tissue_table",
        outputs={"table": "results/tables/tissue.csv"},
        inputs=lambda config, _: {"tissue": [TISSUE.format(run=run.name) for run in plan.runs(config)]},
        config=lambda config, _: runs_config(config),
        instances=once,
    ),
    "case_study": Stage(
        module="fibrous_study.steps.case_study",
        outputs={
            "stresses": "results/tables/section_2_6_stresses.csv",
            "errors": "results/tables/section_2_6_errors.csv",
        },
        inputs=lambda _, __: {
            "networks": ["results/networks/named/00.nc"],
            "curves": [f"results/curves/named/{CASE_PATH}/00.nc"],
            "fits": [f"results/fits/named/{name}.csv" for name in (CASE_PROTOCOL, CASE_PATH)],
        },
        config=lambda config, _: {
            "network": FIGURE_NETWORK,
            "load_set": config["tissue"]["load_set"],
            "tension_only": config["tissue"]["tension_only"],
            "models": _case_models(config),
        },
        instances=_tried,
    ),
    "figure_8": figure(
        "figure_8",
        {"data": ".csv"},
        inputs=lambda _: {"stresses": ["results/tables/section_2_6_stresses.csv"]},
        config=lambda _: {},
        instances=_tried,
    ),
    "figure_specimen": figure(
        "specimen",
        {"data": ".csv"},
        inputs=lambda config: {
            "specimen": [SPECIMEN],
            "tissue": [TISSUE.format(run=name) for name in plan.drawn_runs(config)],
        },
        config=lambda _: {},
    ),
}
