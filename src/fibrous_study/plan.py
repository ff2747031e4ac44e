"""What the config asks for, in words that stages share: ensembles, protocols, batches, and runs of the tissue."""

from __future__ import annotations

import math
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pandas as pd

from fibrous.errors import ConfigError
from fibrous.materials.registry import LAWS, Law
from fibrous.networks import GENERATORS
from fibrous_study.batches import replicate_numbers

Config = Mapping[str, Any]

REFIT = "refit_"  # protocol of the deformation that a run of the tissue found
EQ_2 = {"energy": "structure_tensor", "objective": "energy"}


@dataclass(frozen=True)
class Run:
    """One finite element run of the tissue.

    name : of its files; model : its entry in the config
    refits : how often its constants were fitted anew; 0 for the initial ones
    source : run whose deformation the constants were fitted to, empty for the initial ones
    lagged : whether they are fitted anew at every load step (Fig. 4b) instead of between runs
    """

    name: str
    model: Config
    refits: int = 0
    source: str = ""
    lagged: bool = False

    @property
    def law(self) -> Law:
        """The law of the fibres."""
        return LAWS[self.model["law"]]

    @property
    def constants(self) -> str:
        """Where the law's constants come from: fit, surface, or nothing."""
        return self.model.get("constants", "")


def own_networks(config: Config) -> bool:
    """Whether the networks are a user's own. Raises ConfigError for a kind that nobody knows."""
    kind = config["network"]
    if kind not in (*GENERATORS, "file"):
        raise ConfigError(f"network is '{kind}', must be {', '.join(GENERATORS)} or file")
    return bool(kind == "file")


def own_specimen(config: Config) -> bool:
    """Whether the specimen is a user's own. Raises ConfigError likewise."""
    return _is_second(config["specimen"], "specimen", "synthetic", "file")


def has_lagged_constants(config: Config) -> bool:
    """Whether constants are fitted anew after each load step, not between runs. Raises ConfigError likewise."""
    return _is_second(config["tissue"]["update"], "tissue.update", "rounds", "lagged")


def _is_second(value: str, key: str, first: str, second: str) -> bool:
    if value not in (first, second):
        raise ConfigError(f"{key} is '{value}', must be {first} or {second}")
    return value == second


def ensembles(config: Config) -> list[str]:
    """Ensembles of the study: the 750, the named networks, replicates of these, the tissue's; or the user's own."""
    return ["file"] if own_networks(config) else ["delaunay", "named", "replicates", "tissue"]


def protocols(config: Config) -> list[str]:
    """Names of the protocols in the config's order."""
    return [protocol["name"] for protocol in config["protocols"]]


def protocol(config: Config, name: str) -> Config:
    """The protocol called `name`."""
    return next(entry for entry in config["protocols"] if entry["name"] == name)


def loads(entry: Config) -> set[str]:
    """Names of the loads of a protocol."""
    return {load["load"] for load in entry["loads"]}


def compared_protocols(config: Config) -> list[str]:
    """Protocols of the 750 networks that hold every load of every load set, so that Table 1 can be made from them."""
    wanted = {load for load_set in config["load_sets"] for load in load_set["loads"]}
    return [
        entry["name"] for entry in config["protocols"] if wanted <= loads(entry) and "delaunay" in entry["ensembles"]
    ]


def network_numbers(config: Config, ensemble: str) -> list[int]:
    """Numbers of the networks of an ensemble that needs no specimen to be made."""
    match ensemble:
        case "replicates":
            return replicate_numbers(len(config["named"]), config["replicates"]["seeds"])
        case "delaunay":
            return list(range(config["delaunay"]["networks"]))
    return list(range(len(config["named" if ensemble == "named" else "network_files"])))


def parts(config: Config, ensemble: str) -> int:
    """Number of batches of an ensemble."""
    match ensemble:
        case "file":
            return min(config["delaunay"]["batches"], len(config["network_files"]))
        case "named":
            return 1
        case "tissue":
            return min(config["tissue"]["batches"], element_count(config) or config["tissue"]["batches"])
    return config[ensemble]["batches"]


def element_count(config: Config) -> int:
    """Elements of the specimen; of a user's own the rows of its table of fibres, 0 where that cannot be read."""
    if not own_specimen(config):
        return math.prod(config["synthetic_specimen"]["elements"])
    return len(fiber_eigenvalues(config))


def fiber_eigenvalues(config: Config) -> list[list[float]]:
    """H11, H22, H33 of every row of a user's table of fibres; none where it cannot be read, as the rule will say."""
    path = Path(config["specimen_files"].get("fibers", ""))
    return _eigenvalues(path, path.stat().st_mtime_ns) if path.is_file() else []


@cache
def _eigenvalues(path: Path, _: int) -> list[list[float]]:
    with suppress(OSError, ValueError, KeyError):
        table = pd.read_csv(path, skipinitialspace=True)
        return table[["H11", "H22", "H33"]].to_numpy(dtype=float).tolist()
    return []


def batches(config: Config, ensemble: str) -> list[str]:
    """Names of an ensemble's batches: zero-padded numbers.

    >>> batches({"delaunay": {"batches": 2}}, "delaunay")
    ['00', '01']
    """
    count = parts(config, ensemble)
    return [f"{part:0{max(2, len(str(count - 1)))}d}" for part in range(count)]


def networks(config: Config) -> list[str]:
    """Ensembles whose networks the whole study makes; with a tissue of one's own, those that its models need."""
    models = config["tissue"]["models"]
    if own_networks(config) or not own_specimen(config):
        return ensembles(config)
    of_surface = any(model.get("constants") == "surface" for model in models)
    of_elements = any(LAWS[model["law"]].has_networks or model.get("constants") == "fit" for model in models)
    return ["delaunay"] * of_surface + ["tissue"] * of_elements


def loaded(config: Config) -> list[tuple[str, str]]:
    """Ensemble and protocol of all curves that the whole study makes, but for those of refits."""
    if own_networks(config):
        return [("file", name) for name in protocols(config)]
    every = [(ensemble, entry["name"]) for entry in config["protocols"] for ensemble in entry["ensembles"]]
    if not own_specimen(config):
        return every
    tissue = config["tissue"]
    wanted = [("tissue", tissue["protocol"])] if any(run.constants == "fit" for run in runs(config)) else []
    wanted += [("delaunay", name) for name in compared_protocols(config) if "delaunay" in networks(config)]
    return [pair for pair in every if pair in wanted]


def runs(config: Config) -> list[Run]:
    """Every run of the tissue: each model with its initial constants, then with those fitted anew round by round.

    >>> two = {"models": [{"name": "a", "refit": True}], "refit_rounds": 2, "update": "rounds"}
    >>> [(run.name, run.source) for run in runs({"network": "delaunay", "tissue": two})]
    [('a', ''), ('a_refit', 'a'), ('a_refit_2', 'a_refit')]
    """
    if own_networks(config):
        return []
    tissue, lagged, every = config["tissue"], has_lagged_constants(config), []
    # With lagged constants the rounds are iterations of the last step, inside one run.
    rounds = 1 if lagged else tissue["refit_rounds"]
    for model in tissue["models"]:
        run = Run(model["name"], model)
        every.append(run)
        for refits in range(1, rounds + 1 if model.get("refit") else 1):
            name = f"{model['name']}_refit" + (f"_{refits}" if refits > 1 else "")
            run = Run(name, model, refits, run.name, lagged)
            every.append(run)
    return every


def run_called(config: Config, name: str) -> Run:
    """The run of that name."""
    return next(run for run in runs(config) if run.name == name)


def refitted(config: Config) -> list[Run]:
    """Runs whose constants are fitted to curves along the deformation that an earlier run found."""
    return [run for run in runs(config) if run.refits and not run.lagged]


def refit_rounds(config: Config) -> dict[int, list[str]]:
    """Runs to whose deformation constants are fitted between runs, by the number of the round."""
    rounds: dict[int, list[str]] = {}
    for run in refitted(config):
        rounds.setdefault(run.refits, []).append(run.source)
    return rounds


def reference_run(config: Config) -> str:
    """The run against which all others are judged: the first with networks at every load step; empty without one."""
    # A user's own motion says itself how many steps it has.
    steps = None if own_specimen(config) else config["synthetic_specimen"]["load_steps"]
    coupled = (run for run in runs(config) if run.law.is_solved)
    return next((run.name for run in coupled if run.model.get("load_steps", steps) == steps), "")


def drawn_runs(config: Config) -> list[Run]:
    """Runs that figures of the tissue show: the first model that is refitted, first and last, or else the first."""
    every = runs(config)
    hybrid = hybrid_runs(config)
    return [hybrid[0], hybrid[-1]] if hybrid else [next((run for run in every if run.constants), every[0])]


def hybrid_runs(config: Config) -> list[Run]:
    """The first model that is refitted, in all of its rounds; nothing where none is."""
    model = next((run.model for run in runs(config) if run.refits), None)
    return [run for run in runs(config) if run.model is model]


def tried_models(config: Config) -> list[Config]:
    """Models that section 2.6 tries on one network: those with constants fitted to it, and its fibres alone."""

    def is_tried(model: Config) -> bool:
        law = LAWS[model["law"]]
        return model.get("constants") == "fit" or (law.has_networks and not law.is_solved)

    return [model for model in config["tissue"]["models"] if is_tried(model)]


def loads_used(config: Config) -> float:
    """Fraction of the loads of the initial simulation that belong to the load set of the tissue's fits."""
    tissue = config["tissue"]
    wanted = next(entry["loads"] for entry in config["load_sets"] if entry["name"] == tissue["load_set"])
    return len(wanted) / len(loads(protocol(config, tissue["protocol"])))


def forms(config: Config) -> list[dict[str, str]]:
    """Energies and objectives that the models of the tissue ask to be fitted, each once, Eq. 2's energy first."""
    wanted = [EQ_2, *(form_of(model) for model in config["tissue"]["models"] if model.get("constants") == "fit")]
    return [form for i, form in enumerate(wanted) if form not in wanted[:i]]


def form_of(model: Config) -> dict[str, str]:
    """Energy and objective of the fits behind a model's constants."""
    return {key: model[key] for key in EQ_2}
