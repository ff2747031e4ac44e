"""What the audit of a statement gives: a verdict and numbers; and how verdicts are reached."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from functools import partial
from types import SimpleNamespace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


class Verdict(StrEnum):
    """How a statement of the paper fared."""

    REPRODUCED = "reproduced"
    PARTLY = "partly"
    NOT = "not reproduced"
    CONTRADICTED = "contradicted by the paper itself"
    UNKNOWN = "cannot be checked: data not public"


@dataclass(frozen=True)
class Quantity:
    """A number behind a verdict.

    load_set : that it belongs to, or nothing
    low, high : over the replicates of the network that `value` is of, NaN without any; replicates : their number
    printed : the paper's number, NaN where it prints none
    """

    name: str
    value: float
    unit: str = "1"
    load_set: str = ""
    low: float = np.nan
    high: float = np.nan
    printed: float = np.nan
    replicates: int = 0


@dataclass(frozen=True)
class Finding:
    """The verdict on a statement, and the numbers behind it."""

    verdict: Verdict
    numbers: list[Quantity]


def numbers(
    named: Mapping[str, ArrayLike] | None = None,
    /,
    *,
    unit: str = "1",
    load_set: str = "",
    printed: Mapping[str, Any] | None = None,
    **values: ArrayLike,
) -> list[Quantity]:
    """Quantities by their names: each a number, or an array over a network and its replicates, the network first.

    `printed` holds the paper's numbers by the same names.

    >>> [(one.value, one.low, one.high) for one in numbers(unit="MPa", C2=[2.0, 1.0, 3.0])]
    [(2.0, 1.0, 3.0)]
    """
    quantities = []
    for name, value in {**(named or {}), **values}.items():
        first, *others = np.ravel(np.asarray(value, dtype=float)).tolist()
        low, high = (min(others), max(others)) if others else (np.nan, np.nan)
        paper = (printed or {}).get(name, np.nan)
        quantities.append(Quantity(name, first, unit, load_set, low, high, paper, len(others)))
    return quantities


def ends(name: str, values: ArrayLike, load_set: str = "") -> list[Quantity]:
    """Least and largest of values, those that are unknown left out."""
    known = np.asarray(values)[np.isfinite(values)]
    least, largest = (known.min(), known.max()) if known.size else (np.nan, np.nan)
    return numbers({f"{name}_least": least, f"{name}_largest": largest}, load_set=load_set)


@dataclass(frozen=True)
class Check:
    """How a statement is judged, from the evidence and what is printed; and of which networks (NAMED, ENSEMBLE)."""

    judge: Callable[..., Finding]
    networks: tuple[str, ...]


NAMED, ENSEMBLE = "named", "ensemble"  # those of the survey and the case study with replicates; all others
CHECKS: dict[str, Check] = {}  # by the statement's id


def judges(statement: str, *networks: str, **fixed: Any) -> Callable[[Callable[..., Finding]], Callable[..., Finding]]:
    """Enter a function as the check of a statement, with `fixed` arguments where it judges several."""

    def enter(function: Callable[..., Finding]) -> Callable[..., Finding]:
        CHECKS[statement] = Check(partial(function, **fixed), networks)
        return function

    return enter


class Thresholds(SimpleNamespace):
    """From when on a statement counts as true: the numbers under `claims` in the config, which says what each means."""

    def trend_of(self, count: int) -> float:
        """Rank correlation from which on it is a trend over `count` networks: never below what chance reaches.

        Of independent samples ρ has the standard deviation 1/√(count − 1), and one in twenty exceeds 1.96 of it.
        """
        return max(self.trend, min(1.0, 1.96 / np.sqrt(max(count - 1, 1))))

    def mostly(self, holds: ArrayLike) -> bool:
        """Whether the fraction of true values, of any shape, is at least `most`."""
        return fraction(holds) >= self.most

    def same(self, ratio: ArrayLike) -> bool:
        """Whether most ratios, shape (networks,), are within the factor that counts as the same magnitude."""
        return self.mostly(np.abs(np.log(ratio)) <= np.log(self.same_magnitude))

    def agrees(self, value: ArrayLike, printed: ArrayLike) -> bool:
        """Whether every number is the printed one up to the relative difference that digits leave."""
        value, printed = np.asarray(value, dtype=float), np.asarray(printed, dtype=float)
        return bool((np.abs(value - printed) <= self.printed_digits * np.abs(printed)).all())


def judged(parts: Iterable[bool]) -> Verdict:
    """Reproduced where all parts of a statement hold, not reproduced where none does, else partly.

    >>> [judged(parts).value for parts in ([True, True], [True, False], [False])]
    ['reproduced', 'partly', 'not reproduced']
    """
    held = [bool(part) for part in parts]
    return Verdict.REPRODUCED if all(held) else Verdict.PARTLY if any(held) else Verdict.NOT


def fraction(holds: ArrayLike) -> float:
    """Fraction of true values, of any shape."""
    return float(np.asarray(holds, dtype=bool).mean())


def half_of_last_digit(printed: ArrayLike) -> float:
    """Half a unit in the last place of numbers printed with as many decimals as the longest of them.

    >>> half_of_last_digit([0.69, 0.21, 0.1])
    0.005
    """
    decimals = max(len(repr(float(value)).partition(".")[2]) for value in np.ravel(printed))
    return float(0.5 * 10.0**-decimals)


def alike(first: ArrayLike, second: ArrayLike, factor: float) -> NDArray[np.bool_]:
    """Where two numbers, none negative, are of one magnitude: both zero, or apart by no more than a factor.

    >>> alike([0.0, 1.0, 0.0], [0.0, 1.4, 0.1], 1.5).tolist()
    [True, True, False]
    """
    return np.asarray(np.maximum(first, second) <= factor * np.minimum(first, second))


def rank_correlation(first: ArrayLike, second: ArrayLike) -> float:
    """Spearman's ρ of two samples of one length, equal values with their mean rank; 0 where one does not vary.

    >>> round(rank_correlation([1.0, 2.0, 3.0], [1.0, 4.0, 9.0]), 12), rank_correlation([1.0, 1.0], [1.0, 2.0])
    (1.0, 0.0)
    """
    one, other = (ranks - ranks.mean() for ranks in map(_ranks, (first, second)))
    size = float(np.linalg.norm(one) * np.linalg.norm(other))
    return float(one @ other) / size if size else 0.0


def _ranks(values: ArrayLike) -> Array:
    """As scipy.stats.rankdata, whose import would cost every job that writes a sentence half a second."""
    _, group, count = np.unique(np.asarray(values), return_inverse=True, return_counts=True)
    return (np.cumsum(count) - 0.5 * (count - 1))[group]
