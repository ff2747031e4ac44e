"""What an audit of a statement says: what came out, its spread, the verdict, and why; and how verdicts are reached."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum

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
class Finding:
    """The answer to one statement.

    here : what came out, with units; spread : its range over replicates, empty where one network cannot mislead
    why : the reason of the verdict, in one or two sentences
    """

    here: str
    verdict: Verdict
    why: str
    spread: str = ""


@dataclass(frozen=True)
class Statement:
    """A statement of the paper: where it stands, what it says, and what is printed, numbers or nothing.

    half_width : of the printed confidence intervals, one a value, NaN where none is printed; or nothing
    """

    id: str
    where: str
    says: str
    value: tuple[float, ...] = ()
    half_width: tuple[float, ...] = ()


@dataclass(frozen=True)
class Thresholds:
    """From when on a statement counts as true; the config says what each means and why."""

    printed_digits: float
    most: float
    trend: float
    same_magnitude: float
    shape_error: float
    correction: float
    confident_r_squared: float
    r_squared: float
    orientation: float
    peak_overlap: float
    same_time: float
    order_of_time: float


def judged(parts: Iterable[bool]) -> Verdict:
    """Reproduced where all parts of a statement hold, not where none does, else partly; there is one at the least.

    >>> [judged(parts).value for parts in ([True, True], [True, False], [False])]
    ['reproduced', 'partly', 'not reproduced']
    """
    held = [bool(part) for part in parts]
    return Verdict.REPRODUCED if all(held) else Verdict.PARTLY if any(held) else Verdict.NOT


def holds_for_most(holds: ArrayLike, most: float) -> bool:
    """Whether the share of true values, shape (networks,), is at least `most`."""
    return share_of(holds) >= most


def share_of(holds: ArrayLike) -> float:
    """Share of true values, of any shape."""
    return float(np.asarray(holds, dtype=bool).mean())


def agrees(found: ArrayLike, printed: ArrayLike, tolerance: float) -> bool:
    """Whether every number is the printed one up to a relative difference of `tolerance`."""
    found, printed = np.asarray(found, dtype=float), np.asarray(printed, dtype=float)
    return bool((np.abs(found - printed) <= tolerance * np.abs(printed)).all())


def rank_correlation(first: ArrayLike, second: ArrayLike) -> float:
    """Spearman's ρ of two samples of one length, equal values with their mean rank; 0 where one does not vary.

    >>> round(rank_correlation([1.0, 2.0, 3.0], [1.0, 4.0, 9.0]), 12), rank_correlation([1.0, 1.0], [1.0, 2.0])
    (1.0, 0.0)
    """
    ranks = [_ranks(np.asarray(one, dtype=float)) for one in (first, second)]
    centred = [one - one.mean() for one in ranks]
    norms = [float(np.sqrt(one @ one)) for one in centred]
    return float(centred[0] @ centred[1]) / (norms[0] * norms[1]) if all(norms) else 0.0


def _ranks(values: Array) -> Array:
    _, group, count = np.unique(values, return_inverse=True, return_counts=True)
    last = np.cumsum(count)
    return (last - 0.5 * (count - 1))[group]


def say(*values: float, unit: str = "") -> str:
    """Numbers with three digits, and their unit.

    >>> say(0.12345, 2.0, unit="MPa")
    '0.123, 2 MPa'
    """
    return ", ".join(f"{value:.3g}" for value in values) + (f" {unit}" if unit else "")


def percent(share: float) -> str:
    """A share in percent, with two digits.

    >>> percent(0.12345)
    '12 %'
    """
    return f"{100.0 * share:.2g} %" if abs(share) < 0.0995 else f"{100.0 * share:.0f} %"


def span(values: ArrayLike, unit: str = "") -> str:
    """Least and largest of values, and their unit.

    >>> span([2.0, 1.0], "MPa")
    '1 to 2 MPa'
    """
    values = np.asarray(values, dtype=float)
    return f"{np.min(values):.3g} to {np.max(values):.3g}" + (f" {unit}" if unit else "")


def listed(parts: Sequence[str]) -> str:
    """Words joined as a sentence joins them.

    >>> listed(["a", "b", "c"])
    'a, b and c'
    """
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"
