"""What the config asks for, in words that stages share: ensembles, protocols, batches, and runs of the tissue."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pandas as pd

from fibrous.errors import ConfigError
from fibrous.materials.registry import LAWS
from fibrous.networks import GENERATORS
from fibrous.specimen import SYNTHETIC

Config = Mapping[str, Any]
Wildcards = Mapping[str, str]

FIGURE_NETWORK = "case"
SURVEY_NETWORKS = ("fig6_1", "fig6_2", "fig6_3", "fig6_4", "fig6_5")
FIGURE_PROTOCOLS = ("large", "small")
# Section 2.6: where the constants come from, and the deformation on which they are tried.
CASE_PROTOCOL, CASE_PATH = "section_2_6", "eq9"
REFIT = "refit_"  # protocol of the deformations that a run of the tissue found
EQ_2 = {"energy": "structure_tensor", "objective": "energy"}


@dataclass(frozen=True)
class Stage:
    """One module with its files: patterns of the outputs by name, and functions of config and wildcards.

    What is `on_demand` is made when it is asked for by name, and is no part of the whole study. A job that writes one
    file for `each` of some names has one output, whose pattern holds {each}; its files are called by these names.
    """

    module: str
    outputs: Mapping[str, str]
    inputs: Callable[[Config, Wildcards], dict[str, list[str]]]
    config: Callable[[Config, Wildcards], dict[str, Any]]
    instances: Callable[[Config], list[dict[str, str]]]
    on_demand: bool = False
    each: Callable[[Config, Wildcards], list[str]] | None = None

    def files(self, config: Config, wildcards: Wildcards) -> dict[str, str]:
        """Paths of the files that one job writes, by name."""
        if self.each is None:
            return {name: pattern.format_map(wildcards) for name, pattern in self.outputs.items()}
        (pattern,) = self.outputs.values()
        return {name: pattern.format_map({**wildcards, "each": name}) for name in self.each(config, wildcards)}


@dataclass(frozen=True)
class Run:
    """One finite element run of the tissue.

    name : of its files; model : its entry in the config
    refits : how often its constants were fitted anew; 0 for the initial ones
    source : run whose deformation the constants were fitted to, empty for the initial ones
    """

    name: str
    model: Config
    refits: int = 0
    source: str = ""


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


def loaded_ensembles(config: Config, entry: Config) -> list[str]:
    """Ensembles that a protocol loads: those it names, or the user's networks, which take every protocol."""
    return ["file"] if own_networks(config) else list(entry["ensembles"])


def compared_protocols(config: Config) -> list[str]:
    """Protocols of the 750 networks that hold every load of every load set, so that Table 1 can be made from them."""
    wanted = {load for load_set in config["load_sets"] for load in load_set["loads"]}
    return [
        entry["name"] for entry in config["protocols"] if wanted <= loads(entry) and "delaunay" in entry["ensembles"]
    ]


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


def origin(config: Config) -> str:
    """Where the tissue comes from, in a few words."""
    return f"mesh of {config['specimen_files']['mesh']}" if own_specimen(config) else SYNTHETIC


def batches(config: Config, ensemble: str) -> list[str]:
    """Names of an ensemble's batches: zero-padded numbers.

    >>> batches({"delaunay": {"batches": 2}}, "delaunay")
    ['00', '01']
    """
    count = parts(config, ensemble)
    return [f"{part:0{max(2, len(str(count - 1)))}d}" for part in range(count)]


def runs(config: Config) -> list[Run]:
    """Every run of the tissue: each model with its initial constants, then with those fitted anew round by round.

    >>> two = {"models": [{"name": "a", "refit": True}], "refit_rounds": 2, "update": "rounds"}
    >>> [(run.name, run.source) for run in runs({"network": "delaunay", "tissue": two})]
    [('a', ''), ('a_refit', 'a'), ('a_refit_2', 'a_refit')]
    """
    if own_networks(config):
        return []
    tissue, found = config["tissue"], []
    # With lagged constants the rounds are iterations of the last step, inside one run.
    rounds = 1 if has_lagged_constants(config) else tissue["refit_rounds"]
    for model in tissue["models"]:
        run = Run(model["name"], model)
        found.append(run)
        for refits in range(1, rounds + 1 if model.get("refit") else 1):
            run = Run(f"{model['name']}_refit" + (f"_{refits}" if refits > 1 else ""), model, refits, run.name)
            found.append(run)
    return found


def refit_sources(config: Config) -> dict[str, list[str]]:
    """Runs to whose deformation constants are fitted between runs, by the number of the round."""
    rounds: dict[str, list[str]] = {}
    for run in runs(config):
        if run.refits and not is_lagged(config, run):
            rounds.setdefault(str(run.refits), []).append(run.source)
    return rounds


def reference_run(config: Config) -> str:
    """The run against which all others are judged: the first with networks at every load step; empty without one."""
    # A user's own motion says itself how many steps it has.
    steps = None if own_specimen(config) else config["synthetic_specimen"]["load_steps"]
    found = (run for run in runs(config) if LAWS[run.model["law"]].is_solved)
    return next((run.name for run in found if run.model.get("load_steps", steps) == steps), "")


def run_called(config: Config, name: str) -> Run:
    """The run of that name."""
    return next(run for run in runs(config) if run.name == name)


def is_lagged(config: Config, run: Run) -> bool:
    """Whether the run's constants are fitted anew at every load step (Fig. 4b) instead of between runs."""
    return bool(run.refits) and has_lagged_constants(config)


def drawn_runs(config: Config) -> list[str]:
    """Runs that figures of the tissue show: the first model that is refitted, first and last, or else the first."""
    every = runs(config)
    refitted = [run for run in every if run.refits]
    if refitted:
        name = refitted[0].model["name"]
        return [name, [run for run in refitted if run.model["name"] == name][-1].name]
    return [next((run for run in every if run.model.get("constants")), every[0]).name]


def forms(config: Config) -> list[dict[str, str]]:
    """Energies and objectives that the models of the tissue ask to be fitted, each once, Eq. 2's energy first."""
    wanted = [form_of(model) for model in config["tissue"]["models"] if model.get("constants") == "fit"]
    return [form for i, form in enumerate([EQ_2, *wanted]) if form not in [EQ_2, *wanted][:i]]


def form_of(model: Config) -> dict[str, str]:
    """Energy and objective of the fits behind a model's constants."""
    return {key: model[key] for key in EQ_2}
