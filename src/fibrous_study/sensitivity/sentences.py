"""What the trials say in a sentence for each factor: how far medians move, and whether by more than seeds do anyway."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import pandas as pd

from fibrous_study.sensitivity.summary import FAILED
from fibrous_study.words import number, percent

SHEAR, SEEDS = "shear_directions", "seeds"
# How a quantity is called, and how its numbers are written.
_QUANTITIES: dict[str, tuple[str, Callable[[float], str]]] = {
    "C2_MPa": ("C2", lambda value: f"{number(value)} MPa"),
    "C3": ("C3", number),
    "r_squared": ("R²", number),
    "stress_error": ("the error of stress", percent),
}
_FACTORS = {
    "edge_length_um": "Edge length χ",
    "volume_fraction": "Volume fraction φ",
    "nonlinearity": "Nonlinearity B",
    "amplitude": "Amplitude",
    "steps": "Number of steps",
}


@dataclass(frozen=True)
class Moves:
    """Medians over seeds of one quantity, and what seeds alone make of it.

    medians : a row a case, a column a value of the factor, both in words (`at 10 µm`)
    least, largest : over the seeds of the base, one a case
    """

    medians: pd.DataFrame
    least: pd.Series
    largest: pd.Series

    @property
    def size(self) -> pd.Series:
        """Largest less least median of each case."""
        return self.medians.max(axis=1) - self.medians.min(axis=1)

    @property
    def beyond(self) -> pd.Series:
        """Whether each case moves by more than its seeds are apart."""
        return self.size > self.largest - self.least


def sentences(trials: pd.DataFrame, load_sets: Mapping[str, str], units: Mapping[str, str]) -> dict[str, str]:
    """A sentence for every factor of `completed` trials, for the shear directions, and for the seeds.

    `load_sets` holds the words for each load set, `units` the unit of each factor, 1 where it has none.
    """
    trials = trials.assign(load_set=trials["load_set"].map(load_sets))
    factors = list(dict.fromkeys(trials["factor"]))
    base = trials[(trials["factor"] == factors[0]) & trials["is_base"]]
    found = {factor: _of_factor(trials[trials["factor"] == factor], units[factor]) for factor in factors}
    return {**found, SHEAR: _of_shear(base), SEEDS: _of_seeds(base)}


def _of_factor(trials: pd.DataFrame, unit: str) -> str:
    """How medians move with the values of one factor, in cases of a network and a load set each."""
    ending = "" if unit == "1" else f" {unit}"
    values = {value: f"at {value:.4g}{ending}" for value in dict.fromkeys(trials["value"])}
    own, least, largest = trials.loc[trials["is_base"], "value"].iloc[0], min(values), max(values)
    what = f"{_FACTORS[trials['factor'].iloc[0]]} from {least:.4g} to {largest:.4g}{ending} (the study's: {own:.4g})"
    return _sentence(what, trials.assign(case=_cases(trials), at=trials["value"].map(values)))


def _of_shear(base: pd.DataFrame) -> str:
    """How medians move from one load set to another, in cases of a network each."""
    sets = list(dict.fromkeys(base["load_set"]))
    said = base.assign(case=base["network"], at="under " + base["load_set"])
    return _sentence(f"Shear directions, {' against '.join(sets)}", said)


def _of_seeds(base: pd.DataFrame) -> str:
    """How far networks of one alignment are apart, of each quantity in the case where that is farthest."""
    said = base.assign(case=_cases(base), at="")
    clauses = []
    for quantity, (name, words) in _QUANTITIES.items():
        moves = _moves(said, quantity)
        case = str((moves.largest - moves.least).idxmax())
        clauses.append(f"{name} from {words(moves.least[case])} to {words(moves.largest[case])} ({case})")
    seeds = base.groupby("network")["replicate"].nunique().max()
    return f"Seeds: {seeds} networks of one alignment are farthest apart with {'; '.join(clauses)}."


def _cases(trials: pd.DataFrame) -> pd.Series:
    return trials["network"] + " under " + trials["load_set"]


def _sentence(what: str, trials: pd.DataFrame) -> str:
    """What moves with `at` in each `case`, beyond or within the spread over seeds."""
    if trials["at"].nunique() == 1:
        return f"{what}: one value alone, so that there is nothing to compare."
    clauses = [_clause(_moves(trials, quantity), *said) for quantity, said in _QUANTITIES.items()]
    failed = int(trials[list(FAILED)].to_numpy().sum())
    lost = f"; {failed} states found no equilibrium and are left out" if failed else ""
    return f"{what}: {'; '.join(clauses)}{lost}."


def _moves(trials: pd.DataFrame, quantity: str) -> Moves:
    """Of one quantity; where the base has a case under several load sets, seeds count where they are farthest apart."""
    medians = trials.pivot_table(quantity, "case", "at", "median", sort=False)
    base = trials[trials["is_base"]].groupby(["case", "at"], sort=False)[quantity].agg(["min", "max"])
    widest = (base["max"] - base["min"]).groupby("case", sort=False).idxmax()
    chosen = base.loc[list(widest)].droplevel("at")
    return Moves(medians, chosen["min"], chosen["max"])


def _clause(moves: Moves, name: str, words: Callable[[float], str]) -> str:
    """In how many cases a quantity moves, and from where to where in the one that moves most."""
    size, beyond = moves.size, moves.beyond
    if not size.max() > 0.0:
        return f"{name} does not move"
    count = int(beyond.sum())
    every = {1: "the one case", 2: "both cases"}.get(len(beyond), f"all {len(beyond)} cases")
    share = f"in {count} of {len(beyond)} cases" if 0 < count < len(beyond) else f"in {every}"
    verb = f"moves by more than seeds do {share}" if count else f"stays within the spread over seeds {share}"
    case = str((size[beyond] if count else size).idxmax())
    medians = moves.medians.loc[case].to_dict()
    ends = (min(medians, key=medians.__getitem__), max(medians, key=medians.__getitem__))
    ways = " and ".join(f"{words(medians[end])} {end}" for end in medians if end in ends)
    seeds = f"{words(moves.least[case])} to {words(moves.largest[case])}"
    return f"{name} {verb}, most for {case} ({ways}; seeds {seeds})"
