"""Stages that judge the runs of the tissue against the one with networks: errors, Figure 9, Table 2, microstructure."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from fibrous.materials.registry import LAWS
from fibrous_study import plan
from fibrous_study.network_stages import SPECIMEN, curves_of, figure, once
from fibrous_study.paper import paper, section
from fibrous_study.plan import (
    CASE_PATH,
    CASE_PROTOCOL,
    FIGURE_NETWORK,
    FIGURE_PROTOCOLS,
    REFIT,
    SURVEY_NETWORKS,
    Config,
    Stage,
    Wildcards,
)
from fibrous_study.tissue_stages import TISSUE, networks_of_elements, runs_config

STATES = "results/states/tissue/{run}_{element}.nc"


def _judged(config: Config) -> list[dict[str, str]]:
    """One instance, where there is a run with networks and another one."""
    return once(config) if plan.reference_run(config) and len(plan.runs(config)) > 1 else []


def _timed(config: Config) -> list[dict[str, str]]:
    """One instance, where there is a run with networks and one that is refitted."""
    return _judged(config) if any(run.refits for run in plan.runs(config)) else []


def _audited(config: Config) -> list[dict[str, str]]:
    """One instance, where Table 2 has a line for every statement about time: lagged refits are none of their own."""
    return [] if plan.has_lagged_constants(config) else _timed(config)


def _compared(config: Config) -> dict[str, Any]:
    return {"reference": plan.reference_run(config), **runs_config(config)}


def _tissue(*names: str) -> list[str]:
    return [TISSUE.format(run=name) for name in names]


def _hybrid_runs(config: Config) -> list[plan.Run]:
    """The first model that is refitted, in all of its rounds."""
    model = next(run.model for run in plan.runs(config) if run.refits)
    return [run for run in plan.runs(config) if run.model is model]


def _loads_used(config: Config) -> float:
    """Fraction of the loads of the initial simulation that belong to the load set of the tissue's fits."""
    wanted = next(entry["loads"] for entry in config["load_sets"] if entry["name"] == config["tissue"]["load_set"])
    return len(wanted) / len(plan.loads(plan.protocol(config, config["tissue"]["protocol"])))


def _table_2_inputs(config: Config, _: Wildcards) -> dict[str, list[str]]:
    runs = _hybrid_runs(config)
    protocol = config["tissue"]["protocol"]
    # With lagged constants the second run counts its own fits.
    sources = [run.source for run in runs if run.refits and not plan.is_lagged(config, run)]
    return {
        "networks": networks_of_elements(config),
        "initial": [*curves_of(config, "tissue", protocol), f"results/fits/tissue/{protocol}.csv"],
        "refit": [
            path
            for source in sources
            for path in [
                *curves_of(config, "tissue", f"{REFIT}{source}"),
                f"results/fits/tissue/{REFIT}{source}.csv",
            ]
        ],
        "hybrid": _tissue(*(run.name for run in runs)),
        "multiscale": _tissue(*(run.name for run in plan.runs(config) if LAWS[run.model["law"]].is_solved)),
    }


def _claims_inputs(config: Config) -> dict[str, list[str]]:
    small, large = reversed(FIGURE_PROTOCOLS)
    singled_out = [(name, batch) for name in ("named", "replicates") for batch in plan.batches(config, name)]
    curves = {"small": small, "large": large, "path": CASE_PATH}
    fits = {"fits_small": small, "fits_large": large, "fits_initial": CASE_PROTOCOL, "fits_refit": CASE_PATH}
    return {
        "networks": [f"results/networks/{ensemble}/{batch}.nc" for ensemble, batch in singled_out],
        **{
            name: [path for ensemble in ("named", "replicates") for path in curves_of(config, ensemble, protocol)]
            for name, protocol in curves.items()
        },
        **{
            name: [f"results/fits/{ensemble}/{protocol}.csv" for ensemble in ("named", "replicates")]
            for name, protocol in fits.items()
        },
        "ensemble": curves_of(config, "delaunay", large),
        **{f"ensemble_{name}": [f"results/fits/delaunay/{fits[name]}.csv"] for name in ("fits_small", "fits_large")},
        "surface": ["results/tables/surface.nc"],
        "tissue": _tissue(plan.reference_run(config), *plan.drawn_runs(config)),
        "tissue_networks": networks_of_elements(config),
        "table_2": ["results/tables/table_2.csv"],
    }


def _claims_config(config: Config) -> dict[str, Any]:
    large = FIGURE_PROTOCOLS[0]
    return {
        "paper": paper(),
        "case": FIGURE_NETWORK,
        "survey": list(SURVEY_NETWORKS),
        "large": large,
        "load_set": config["tissue"]["load_set"],
        "tension_only": config["tissue"]["tension_only"],
        "protocol": plan.protocol(config, config["tissue"]["protocol"]),
        **{key: config[key] for key in ("claims", "load_sets", "named", "fit")},
    }


def _microstructures(config: Config) -> list[dict[str, str]]:
    wanted = config["microstructure"] if once(config) else {"runs": [], "elements": []}
    return [{"run": run, "element": str(element)} for run in wanted["runs"] for element in wanted["elements"]]


MULTISCALE_STAGES: dict[str, Stage] = {
    "comparison": Stage(
        module="fibrous_study.steps.comparison",
        outputs={"comparison": "results/tables/comparison.csv", "steps": "results/tables/comparison_steps.csv"},
        inputs=lambda config, _: {"tissue": _tissue(*(run.name for run in plan.runs(config)))},
        config=lambda config, _: _compared(config),
        instances=_judged,
    ),
    "figure_comparison": figure(
        "comparison",
        {"data": ".csv"},
        inputs=lambda _: {
            "comparison": ["results/tables/comparison.csv"],
            "steps": ["results/tables/comparison_steps.csv"],
        },
        config=lambda _: {},
        instances=_judged,
    ),
    "figure_9": figure(
        "figure_9",
        {"data": ".csv"},
        inputs=lambda config: {
            "specimen": [SPECIMEN],
            "tissue": _tissue(plan.reference_run(config), *plan.drawn_runs(config)),
        },
        config=lambda _: {},
        instances=_timed,
    ),
    "table_2": Stage(
        module="fibrous_study.steps.table_2",
        outputs={"table_2": "results/tables/table_2.csv", "parts": "results/tables/table_2_parts.csv"},
        inputs=_table_2_inputs,
        config=lambda config, _: {
            "reference": plan.reference_run(config),
            "model": plan.form_of(_hybrid_runs(config)[0].model),
            "load_set": config["tissue"]["load_set"],
            "loads_used": _loads_used(config),
            "paper": section("table_2"),
        },
        instances=_timed,
    ),
    "claims": Stage(
        module="fibrous_study.steps.claims",
        outputs={"claims": "results/claims.csv"},
        inputs=lambda config, _: _claims_inputs(config),
        config=lambda config, _: _claims_config(config),
        instances=_audited,
    ),
    "microstructure": Stage(
        module="fibrous_study.steps.network_microstructure",
        outputs={"states": STATES},
        inputs=lambda config, wildcards: {
            "networks": networks_of_elements(config),
            "specimen": [SPECIMEN],
            "tissue": _tissue(wildcards["run"]),
        },
        config=lambda config, wildcards: {
            "run": wildcards["run"],
            "element": int(wildcards["element"]),
            "equilibrium": config["equilibrium"],
            "model": plan.run_called(config, wildcards["run"]).model,
        },
        instances=_microstructures,
        on_demand=True,
    ),
    "figure_microstructure": replace(
        figure(
            "microstructure",
            {"data": ".csv"},
            inputs=lambda config: {"states": [STATES.format_map(one) for one in _microstructures(config)]},
            config=lambda _: {},
            instances=lambda config: [{}] if _microstructures(config) else [],
        ),
        on_demand=True,
    ),
}
