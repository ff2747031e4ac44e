"""What an audit of a statement says: what came out, its spread, the verdict, and why; and how verdicts are reached."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]

SMALLEST = 1e-6  # a number below it is rounding, or as good as nothing


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
    why : the reason of the verdict, in one or two sentences of plain words and of numbers computed
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
    change: float
    same_magnitude: float
    surface_error: float
    shape_error: float
    correction: float
    confident_r_squared: float
    r_squared: float
    orientation: float
    peak_overlap: float
    same_time: float
    order_of_time: float

    def trend_of(self, count: int) -> float:
        """Rank correlation from which on one over `count` networks is a trend: never below what chance reaches.

        Of independent samples ρ has the standard deviation 1/√(count − 1), and one in twenty exceeds 1.96 of it.
        """
        return max(self.trend, min(1.0, 1.96 / np.sqrt(max(count - 1, 1))))


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
    ranks = [_ranks(np.asarray(one, dtype=float)) for one in (first, second)]
    centred = [one - one.mean() for one in ranks]
    norms = [float(np.sqrt(one @ one)) for one in centred]
    return float(centred[0] @ centred[1]) / (norms[0] * norms[1]) if all(norms) else 0.0


def _ranks(values: Array) -> Array:
    _, group, count = np.unique(values, return_inverse=True, return_counts=True)
    last = np.cumsum(count)
    return (last - 0.5 * (count - 1))[group]


def number(value: float, digits: int = 3) -> str:
    """A number with so many digits, thousands apart, and no power of ten.

    >>> number(0.12345), number(2.0), number(-1013.2), number(1772.09), number(0.0), number(1e-16), number(math.nan)
    ('0.123', '2', '-1,010', '1,770', '0', 'less than 0.000001', 'unknown')
    """
    if not math.isfinite(value):
        return "unknown"
    if 0.0 < abs(value) < SMALLEST:
        return f"less than {SMALLEST:f}"
    if value == 0.0:
        return "0"
    decimals = digits - 1 - math.floor(math.log10(abs(value)))
    found = f"{round(value, decimals):,.{max(decimals, 0)}f}"
    return found.rstrip("0").rstrip(".") if "." in found else found


def say(*values: float, unit: str = "") -> str:
    """Numbers with three digits, and their unit.

    >>> say(0.12345, 2.0, unit="MPa")
    '0.123, 2 MPa'
    """
    return ", ".join(number(value) for value in values) + (f" {unit}" if unit else "")


def percent(share: float) -> str:
    """A share in percent, with two digits.

    >>> percent(0.12345), percent(0.0123), percent(11.2)
    ('12 %', '1.2 %', '1,120 %')
    """
    return f"{number(100.0 * share, 2)} %" if abs(share) < 0.0995 else f"{100.0 * share:,.0f} %"


def span(values: ArrayLike, unit: str = "") -> str:
    """Least and largest of values, and their unit.

    >>> span([2.0, 1.0], "MPa")
    '1 to 2 MPa'
    """
    values = np.asarray(values, dtype=float)
    if not values.size:
        return "unknown"
    return f"{number(float(values.min()))} to {number(float(values.max()))}" + (f" {unit}" if unit else "")


def stretches(values: ArrayLike) -> str:
    """Averaged stretches λ_f, or least and largest of them, with two decimals.

    >>> stretches(1.2), stretches([1.64, 1.2])
    ('1.20', '1.20 to 1.64')
    """
    least, largest = f"{np.min(values):.2f}", f"{np.max(values):.2f}"
    return least if least == largest else f"{least} to {largest}"


def percents(values: ArrayLike) -> str:
    """Least and largest of shares, in percent.

    >>> percents([0.5, 0.123])
    '12 % to 50 %'
    """
    values = np.asarray(values, dtype=float)
    if not values.size:
        return "unknown"
    return f"{percent(float(values.min()))} to {percent(float(values.max()))}"


def over_replicates(parts: Sequence[str], count: int) -> str:
    """What a finding spreads over: a range a part, over so many networks beside the paper's.

    >>> over_replicates(["a: 1 to 2", "b: 3 to 4"], 8)
    'a: 1 to 2; b: 3 to 4; over 8 replicates'
    """
    return f"{'; '.join(parts)}; over {counted(count, 'replicate')}"


def listed(parts: Sequence[str]) -> str:
    """Words joined as a sentence joins them.

    >>> listed(["a", "b", "c"])
    'a, b and c'
    """
    return parts[0] if len(parts) == 1 else f"{', '.join(parts[:-1])} and {parts[-1]}"


def where(holds: Mapping[str, bool]) -> str:
    """With which load sets something holds, in words.

    >>> where({"a": True, "b": True}), where({"a": True, "b": False}), where({"a": False, "b": False})
    ('with both load sets', 'with a but not with b', 'with neither load set')
    """
    yes = [name for name, one in holds.items() if one]
    no = [name for name in holds if name not in yes]
    if len(holds) > 1 and not no:
        return "with both load sets" if len(yes) == 2 else "with all load sets"
    if len(holds) > 1 and not yes:
        return "with neither load set" if len(no) == 2 else "with no load set"
    return " but ".join([f"with {listed(yes)}"] * bool(yes) + [f"not with {listed(no)}"] * bool(no))


def counted(count: int, what: str) -> str:
    """So many of something.

    >>> counted(1, "run"), counted(1200, "element")
    ('1 run', '1,200 elements')
    """
    return f"{count:,} {what}" + ("" if count == 1 else "s")
