"""Stages of the first half of the study: networks, their curves and fits, Table 1, and the figures of networks."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from hashlib import sha256
from pathlib import Path
from typing import Any

from fibrous_study import plan
from fibrous_study.batches import replicate_numbers, replicated, share
from fibrous_study.paper import section
from fibrous_study.plan import CASE_PATH, CASE_PROTOCOL, FIGURE_NETWORK, FIGURE_PROTOCOLS, Config, Stage, Wildcards

SPECIMEN = "results/tissue/specimen.nc"


def contents(paths: list[str]) -> list[str]:
    """SHA-256 of a user's own files: what they hold is part of what a result depends on."""
    return [sha256(Path(path).read_bytes()).hexdigest() for path in paths]


def once(config: Config) -> list[dict[str, str]]:
    """One instance, unless the networks are a user's own."""
    return [] if plan.own_networks(config) else [{}]


def figure(
    name: str,
    data: Mapping[str, str],
    inputs: Callable[[Config], dict[str, list[str]]],
    config: Callable[[Config], dict[str, Any]],
    instances: Callable[[Config], list[dict[str, str]]] = once,
) -> Stage:
    """The stage of a figure: its module in fibrous_study.figures is called figure_ and its name."""
    path = f"results/figures/{name}"
    return Stage(
        module=f"fibrous_study.figures.figure_{name.removeprefix('figure_')}",
        outputs={key: path + ending for key, ending in {"png": ".png", "svg": ".svg", **data}.items()},
        inputs=lambda study, _: inputs(study),
        config=lambda study, _: config(study),
        instances=instances,
    )


def fits_config(config: Config, name: str, load_sets: list[Config], forms: list[dict[str, str]]) -> dict[str, Any]:
    """The part of the config on which fits depend."""
    # The fit of Eq. 2 is the same with and without the switch.
    of_others = any(form["energy"] != plan.EQ_2["energy"] for form in forms)
    tension_only = config["tissue"]["tension_only"] if of_others else True
    return {
        "protocol": name,
        "load_sets": load_sets,
        "fit": config["fit"],
        "forms": forms,
        "tension_only": tension_only,
    }


def _alignments(config: Config) -> dict[str, Any]:
    return {key: config["delaunay"][key] for key in ("H11", "smallest_H")}


def _networks_config(config: Config, wildcards: Wildcards) -> dict[str, Any]:
    ensemble, batch = wildcards["ensemble"], int(wildcards["batch"])
    part: dict[str, Any] = {"ensemble": ensemble, "network": config["network"], "fiber": config["fiber"]}
    if ensemble == "tissue":
        # How many networks there are is only known to who reads the specimen.
        batches = {"batch": batch, "batches": plan.parts(config, ensemble)}
        return {**part, **batches, "seed": config["seed"], "cube": config["cube"]}
    if ensemble == "replicates":
        every = replicate_numbers(len(config["named"]), config["replicates"]["seeds"])
        numbers = [every[i] for i in share(len(every), plan.parts(config, ensemble), batch)]
        entries = [config["named"][replicated(number)] for number in numbers]
        return {**part, "seed": config["seed"], "cube": config["cube"], "numbers": numbers, "replicated": entries}
    total = {"delaunay": config["delaunay"]["networks"], "named": len(config["named"])}
    total["file"] = len(config["network_files"])
    part["numbers"] = share(total[ensemble], plan.parts(config, ensemble), batch)
    if ensemble == "file":
        cube = {"edge_length_um": config["cube"]["edge_length_um"]}
        entries = [config["network_files"][number] for number in part["numbers"]]
        found = [contents(_paths(entry)) for entry in entries]
        return {**part, "cube": cube, "network_files": entries, "contents": found}
    part |= {"seed": config["seed"], "cube": config["cube"]}
    if ensemble == "named":
        return {**part, "named": config["named"]}
    # Not the number of networks: network k must not depend on how many there are.
    return {**part, "delaunay": _alignments(config)}


def _networks_inputs(config: Config, wildcards: Wildcards) -> dict[str, list[str]]:
    if wildcards["ensemble"] == "tissue":
        return {"files": [SPECIMEN]}
    if wildcards["ensemble"] != "file":
        return {"files": []}
    numbers = _networks_config(config, wildcards)["numbers"]
    return {"files": [path for number in numbers for path in _paths(config["network_files"][number])]}


def _paths(entry: Mapping[str, str]) -> list[str]:
    return [entry[key] for key in ("nodes", "fibers", "file") if key in entry]


def _network_instances(config: Config) -> list[dict[str, str]]:
    return [
        {"ensemble": ensemble, "batch": batch}
        for ensemble in plan.ensembles(config)
        for batch in plan.batches(config, ensemble)
    ]


def _loaded(config: Config) -> list[dict[str, str]]:
    return [
        {"ensemble": ensemble, "protocol": entry["name"]}
        for entry in config["protocols"]
        for ensemble in plan.loaded_ensembles(config, entry)
    ]


def _networks_of(_: Config, wildcards: Wildcards) -> dict[str, list[str]]:
    return {"networks": [f"results/networks/{wildcards['ensemble']}/{wildcards.get('batch', '00')}.nc"]}


def _load_config(config: Config, wildcards: Wildcards) -> dict[str, Any]:
    limits = {key: config[key] for key in ("principal_stretch_limit", "equilibrium")}
    return {"protocol": plan.protocol(config, wildcards["protocol"]), **limits}


def _fits_config(config: Config, wildcards: Wildcards) -> dict[str, Any]:
    ensemble, name = wildcards["ensemble"], wildcards["protocol"]
    available = plan.loads(plan.protocol(config, name))
    load_sets = [load_set for load_set in config["load_sets"] if set(load_set["loads"]) <= available]
    # The tissue, and the case study that tries its models on one network, need more than Eq. 2.
    of_tissue = ensemble == "tissue" or (ensemble == "named" and name in (CASE_PROTOCOL, CASE_PATH))
    return fits_config(config, name, load_sets, plan.forms(config) if of_tissue else [plan.EQ_2])


def _surface_config(config: Config, _: Wildcards) -> dict[str, Any]:
    paper = {name: section(name) for name in ("table_1", "alignments")}
    return {"surface": config["surface"], "delaunay": _alignments(config), "paper": paper}


def curves_of(config: Config, ensemble: str, protocol: str) -> list[str]:
    """Files of the curves of all batches of an ensemble under one protocol."""
    return [f"results/curves/{ensemble}/{protocol}/{batch}.nc" for batch in plan.batches(config, ensemble)]


NETWORK_STAGES: dict[str, Stage] = {
    "networks": Stage(
        module="fibrous_study.steps.network_ensemble",
        outputs={"networks": "results/networks/{ensemble}/{batch}.nc"},
        inputs=_networks_inputs,
        config=_networks_config,
        instances=_network_instances,
    ),
    "curves": Stage(
        module="fibrous_study.steps.network_curves",
        outputs={"curves": "results/curves/{ensemble}/{protocol}/{batch}.nc"},
        inputs=_networks_of,
        config=_load_config,
        instances=lambda config: [
            {**one, "batch": batch} for one in _loaded(config) for batch in plan.batches(config, one["ensemble"])
        ],
    ),
    "states": Stage(
        module="fibrous_study.steps.network_states",
        outputs={"states": "results/states/{ensemble}/{network}_{protocol}.nc"},
        inputs=_networks_of,
        config=lambda config, wildcards: {**_load_config(config, wildcards), "network": wildcards["network"]},
        instances=lambda config: [
            {"ensemble": "named", "network": FIGURE_NETWORK, "protocol": name}
            for name in FIGURE_PROTOCOLS
            if not plan.own_networks(config)
        ],
    ),
    "fits": Stage(
        module="fibrous_study.steps.hgo_fits",
        outputs={"fits": "results/fits/{ensemble}/{protocol}.csv"},
        inputs=lambda config, wildcards: {"curves": curves_of(config, wildcards["ensemble"], wildcards["protocol"])},
        config=_fits_config,
        instances=_loaded,
    ),
    "surface": Stage(
        module="fibrous_study.steps.table_1",
        outputs={
            "surface": "results/tables/surface.nc",
            "table_1": "results/tables/table_1.csv",
            "surface_over_triangle": "results/tables/surface_over_triangle.csv",
        },
        inputs=lambda config, _: {
            "fits": [f"results/fits/delaunay/{name}.csv" for name in plan.compared_protocols(config)]
        },
        config=_surface_config,
        instances=once,
    ),
    "figure_3": figure(
        "figure_3",
        {"data": ".csv"},
        inputs=lambda _: {
            "states": [f"results/states/named/{FIGURE_NETWORK}_{name}.nc" for name in FIGURE_PROTOCOLS],
            "curves": [f"results/curves/named/{name}/00.nc" for name in FIGURE_PROTOCOLS],
        },
        config=lambda _: {"network": FIGURE_NETWORK, "protocols": list(FIGURE_PROTOCOLS)},
    ),
    "figure_5": figure(
        "figure_5",
        {"data": ".csv"},
        inputs=lambda _: {
            "curves": [f"results/curves/named/{name}/00.nc" for name in FIGURE_PROTOCOLS],
            "fits": [f"results/fits/named/{name}.csv" for name in FIGURE_PROTOCOLS],
        },
        config=lambda config: {
            "network": FIGURE_NETWORK,
            "protocols": list(FIGURE_PROTOCOLS),
            "load_sets": config["load_sets"],
        },
    ),
    "figure_6": figure(
        "figure_6",
        {name: f"_{name}.csv" for name in ("curves", "constants", "surface")},
        inputs=lambda _: {
            "networks": ["results/networks/named/00.nc"],
            "curves": ["results/curves/named/large/00.nc"],
            "fits": ["results/fits/named/large.csv", "results/fits/delaunay/large.csv"],
            "surface": ["results/tables/surface.nc"],
        },
        config=lambda config: {
            "networks": list(plan.SURVEY_NETWORKS),
            "protocol": "large",
            "load_sets": config["load_sets"],
        },
    ),
    "figure_7": figure(
        "figure_7", {"data": ".csv"}, inputs=lambda _: {}, config=lambda _: {"paper": section("figure_7")}
    ),
}
