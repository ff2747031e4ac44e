"""The stages of the study: what each reads, what it writes, and which part of the config it depends on.

The rules of the workflow and ``python -m fibrous check`` both ask here, so they cannot disagree. Everything follows
from the validated config and the files that it names; paths are relative to the folder in which the study runs.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from hashlib import sha256
from itertools import chain
from pathlib import Path
from typing import Any

from fibrous.provenance import code_hash, config_hash

Config = Mapping[str, Any]
Wildcards = Mapping[str, str]

FIGURE_NETWORK = "case"
SURVEY_NETWORKS = ("fig6_1", "fig6_2", "fig6_3", "fig6_4", "fig6_5")
FIGURE_PROTOCOLS = ("large", "small")


@dataclass(frozen=True)
class Stage:
    """One module with its files: patterns of the outputs by name, and functions of config and wildcards."""

    module: str
    outputs: Mapping[str, str]
    inputs: Callable[[Config, Wildcards], dict[str, list[str]]]
    config: Callable[[Config, Wildcards], dict[str, Any]]
    instances: Callable[[Config], list[dict[str, str]]]


def ensembles(config: Config) -> list[str]:
    """Ensembles of the study: the 750 and the named networks, or the user's own."""
    return ["file"] if config["network"] == "file" else ["delaunay", "named"]


def protocols(config: Config) -> list[str]:
    """Names of the protocols in the config's order."""
    return [protocol["name"] for protocol in config["protocols"]]


def batches(config: Config, ensemble: str) -> dict[str, list[int]]:
    """Network numbers of every batch, by the batch's zero-padded name: contiguous parts of nearly equal size.

    >>> batches({"network": "delaunay", "delaunay": {"networks": 5, "batches": 2}}, "delaunay")
    {'00': [0, 1, 2], '01': [3, 4]}
    """
    if ensemble == "delaunay":
        total, parts = config["delaunay"]["networks"], config["delaunay"]["batches"]
    else:
        total = len(config["network_files" if ensemble == "file" else "named"])
        parts = min(config["delaunay"]["batches"], total) if ensemble == "file" else 1
    width = max(2, len(str(parts - 1)))
    share, longer = divmod(total, parts)
    starts = [part * share + min(part, longer) for part in range(parts + 1)]
    return {f"{part:0{width}d}": list(range(starts[part], starts[part + 1])) for part in range(parts)}


def compared_protocols(config: Config) -> list[str]:
    """Protocols that hold every load of every load set, so that Table 1 can be made from them."""
    wanted = {load for load_set in config["load_sets"] for load in load_set["loads"]}
    return [protocol["name"] for protocol in config["protocols"] if wanted <= _loads(protocol)]


def stage_params(stage: str, config: Config, wildcards: Wildcards) -> dict[str, Any]:
    """What a rule hands to the module of `stage`: its name, its part of the config, the hash of its sources.

    The part of the config holds under `upstream` a hash of the params of the stages whose files are read: a result
    whose inputs were made anew with other values is then seen to be old, whatever the files' times say.
    """
    producers = {path: (name, instance) for path, name, instance in expected_files(config)}
    return _params(stage, config, wildcards, producers, {})


def _params(
    stage: str,
    config: Config,
    wildcards: Wildcards,
    producers: Mapping[str, tuple[str, Wildcards]],
    known: dict[str, str],
) -> dict[str, Any]:
    upstream = set()
    for path in chain.from_iterable(STAGES[stage].inputs(config, wildcards).values()):
        if path not in producers:
            continue  # a user's own file
        if path not in known:
            name, instance = producers[path]
            known[path] = config_hash(_params(name, config, instance, producers, known))
        upstream.add(known[path])
    module = STAGES[stage].module
    own = STAGES[stage].config(config, wildcards)
    if upstream:
        own["upstream"] = config_hash({"inputs": sorted(upstream)})
        if config["network"] != "file":
            own["seed"] = config["seed"]  # of the networks that the files come from
    return {"stage": module, "config": own, "code_hash": code_hash(module)}


def expected_files(config: Config) -> Iterator[tuple[str, str, dict[str, str]]]:
    """Every file of the study with the stage that writes it and that stage's wildcards."""
    for name, stage in STAGES.items():
        for wildcards in stage.instances(config):
            for pattern in stage.outputs.values():
                yield pattern.format_map(wildcards), name, wildcards


def files(stage: str, output: str, config: Config, **wanted: str) -> list[str]:
    """Paths of one named output of `stage`, over all of its wildcards that agree with `wanted`."""
    pattern = STAGES[stage].outputs[output]
    return [
        pattern.format_map(wildcards)
        for wildcards in STAGES[stage].instances(config)
        if all(wildcards[name] == value for name, value in wanted.items())
    ]


def _loads(protocol: Config) -> set[str]:
    return {entry["load"] for entry in protocol["loads"]}


def _protocol(config: Config, wildcards: Wildcards) -> Config:
    return next(protocol for protocol in config["protocols"] if protocol["name"] == wildcards["protocol"])


def _alignments(config: Config) -> dict[str, Any]:
    return {key: config["delaunay"][key] for key in ("H11", "smallest_H")}


def _networks_config(config: Config, wildcards: Wildcards) -> dict[str, Any]:
    ensemble = wildcards["ensemble"]
    part = {"ensemble": ensemble, "numbers": batches(config, ensemble)[wildcards["batch"]], "fiber": config["fiber"]}
    if ensemble == "file":
        cube = {"edge_length_um": config["cube"]["edge_length_um"]}
        entries = _entries(config, wildcards)
        contents = [[sha256(path.read_bytes()).hexdigest() for path in _paths(entry)] for entry in entries]
        return {**part, "cube": cube, "network_files": entries, "contents": contents}
    part |= {"seed": config["seed"], "cube": config["cube"]}
    if ensemble == "named":
        return {**part, "named": config["named"]}
    # Not the number of networks: network k must not depend on how many there are.
    return {**part, "delaunay": _alignments(config)}


def _networks_inputs(config: Config, wildcards: Wildcards) -> dict[str, list[str]]:
    entries = _entries(config, wildcards) if wildcards["ensemble"] == "file" else []
    return {"files": [str(path) for entry in entries for path in _paths(entry)]}


def _entries(config: Config, wildcards: Wildcards) -> list[dict[str, str]]:
    """The user's networks that belong to a batch."""
    return [config["network_files"][number] for number in batches(config, "file")[wildcards["batch"]]]


def _paths(entry: Mapping[str, str]) -> list[Path]:
    return [Path(entry[key]) for key in ("nodes", "fibers", "file") if key in entry]


def _batch_instances(config: Config) -> list[dict[str, str]]:
    return [{"ensemble": name, "batch": batch} for name in ensembles(config) for batch in batches(config, name)]


def _network_files(config: Config, wildcards: Wildcards) -> dict[str, list[str]]:
    batch = wildcards.get("batch", "00")
    return {"networks": [f"results/networks/{wildcards['ensemble']}/{batch}.nc"]}


def _load_config(config: Config, wildcards: Wildcards) -> dict[str, Any]:
    limits = {key: config[key] for key in ("principal_stretch_limit", "equilibrium")}
    return {"protocol": _protocol(config, wildcards), **limits}


def _fits_config(config: Config, wildcards: Wildcards) -> dict[str, Any]:
    available = _loads(_protocol(config, wildcards))
    load_sets = [load_set for load_set in config["load_sets"] if set(load_set["loads"]) <= available]
    return {"protocol": wildcards["protocol"], "load_sets": load_sets, "fit": config["fit"]}


def _surface_config(config: Config, _: Wildcards) -> dict[str, Any]:
    return {
        "surface": config["surface"],
        "delaunay": _alignments(config),
    }


def _once_for_delaunay(config: Config) -> list[dict[str, str]]:
    return [] if config["network"] == "file" else [{}]


def _figure(
    number: int,
    data: Mapping[str, str],
    inputs: Callable[[Config], dict[str, list[str]]],
    config: Callable[[Config], dict[str, Any]],
) -> Stage:
    path = f"results/figures/figure_{number}"
    return Stage(
        module=f"fibrous.figures.figure_{number}",
        outputs={name: path + ending for name, ending in {"png": ".png", "svg": ".svg", **data}.items()},
        inputs=lambda study, _: inputs(study),
        config=lambda study, _: config(study),
        instances=_once_for_delaunay,
    )


STAGES: dict[str, Stage] = {
    "networks": Stage(
        module="fibrous.study.networks",
        outputs={"networks": "results/networks/{ensemble}/{batch}.nc"},
        inputs=_networks_inputs,
        config=_networks_config,
        instances=_batch_instances,
    ),
    "curves": Stage(
        module="fibrous.study.curves",
        outputs={"curves": "results/curves/{ensemble}/{protocol}/{batch}.nc"},
        inputs=_network_files,
        config=_load_config,
        instances=lambda config: [
            {**batch, "protocol": name} for name in protocols(config) for batch in _batch_instances(config)
        ],
    ),
    "states": Stage(
        module="fibrous.study.states",
        outputs={"states": "results/states/{ensemble}/{network}_{protocol}.nc"},
        inputs=_network_files,
        config=lambda config, wildcards: {**_load_config(config, wildcards), "network": wildcards["network"]},
        instances=lambda config: [
            {"ensemble": "named", "network": FIGURE_NETWORK, "protocol": name}
            for name in FIGURE_PROTOCOLS
            if config["network"] != "file"
        ],
    ),
    "fits": Stage(
        module="fibrous.study.fits",
        outputs={"fits": "results/fits/{ensemble}/{protocol}.csv"},
        inputs=lambda config, wildcards: {"curves": files("curves", "curves", config, **wildcards)},
        config=_fits_config,
        instances=lambda config: [
            {"ensemble": ensemble, "protocol": name} for ensemble in ensembles(config) for name in protocols(config)
        ],
    ),
    "surface": Stage(
        module="fibrous.study.surface",
        outputs={
            "surface": "results/tables/surface.nc",
            "table_1": "results/tables/table_1.csv",
            "surface_over_triangle": "results/tables/surface_over_triangle.csv",
        },
        inputs=lambda config, _: {"fits": [f"results/fits/delaunay/{name}.csv" for name in compared_protocols(config)]},
        config=_surface_config,
        instances=_once_for_delaunay,
    ),
    "convergence": Stage(
        module="fibrous.study.convergence",
        outputs={"convergence": "results/tables/convergence.csv"},
        inputs=lambda config, _: {"curves": files("curves", "curves", config)},
        config=lambda _, __: {},
        instances=lambda _: [{}],
    ),
    "figure_3": _figure(
        3,
        {"data": ".csv"},
        inputs=lambda config: {
            "states": files("states", "states", config),
            "curves": [f"results/curves/named/{name}/00.nc" for name in FIGURE_PROTOCOLS],
        },
        config=lambda _: {"network": FIGURE_NETWORK, "protocols": list(FIGURE_PROTOCOLS)},
    ),
    "figure_5": _figure(
        5,
        {"data": ".csv"},
        inputs=lambda config: {
            "curves": [f"results/curves/named/{name}/00.nc" for name in FIGURE_PROTOCOLS],
            "fits": [f"results/fits/named/{name}.csv" for name in FIGURE_PROTOCOLS],
        },
        config=lambda config: {
            "network": FIGURE_NETWORK,
            "protocols": list(FIGURE_PROTOCOLS),
            "load_sets": config["load_sets"],
        },
    ),
    "figure_6": _figure(
        6,
        {name: f"_{name}.csv" for name in ("curves", "constants", "surface")},
        inputs=lambda config: {
            "networks": ["results/networks/named/00.nc"],
            "curves": ["results/curves/named/large/00.nc"],
            "fits": ["results/fits/named/large.csv", "results/fits/delaunay/large.csv"],
            "surface": ["results/tables/surface.nc"],
        },
        config=lambda config: {
            "networks": list(SURVEY_NETWORKS),
            "protocol": "large",
            "load_sets": config["load_sets"],
        },
    ),
    "figure_7": _figure(7, {"data": ".csv"}, inputs=lambda _: {}, config=lambda _: {}),
}
