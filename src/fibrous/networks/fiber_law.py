"""Laws of a fibre: reduced force, stiffness and energy as functions of its stretch (Eq. 6, and a fibre that buckles).

A fibre of rest length L, modulus k and section A has the force kA f(λ) and the energy kA L w(λ), w = ∫ f dλ from 1, at
the stretch λ = length/L. Every law stands here once, as compiled functions of a stretch and two constants that work on
eight numbers at a time; the engine, the guard and the laws of tissue all call them.

To add a law: a number for it, two compiled functions with their branch in `respond` and `store_energy`, and a subclass
of `FiberLaw`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import ClassVar, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from fibrous.compiled import njit
from fibrous.errors import ConfigError
from fibrous.networks.lanes import (
    LANES,
    LARGEST_EXPONENT,
    choose,
    exponential_less_one,
    greatest,
    least,
    load,
    magnitude,
    square_root,
    store,
)

Array = NDArray[np.float64]
#: A number for all fibres, or numbers of shape (fibers,).
Number = float | Array

#: Numbers of the laws in compiled code.
EXPONENTIAL, BUCKLING = range(2)
#: Columns of the constants of fibres.
SECTION, FIRST, SECOND = range(3)


class Fibers(NamedTuple):
    """Fibres as compiled code takes them.

    kind : number of their law
    rest_lengths : lengths without force, shape (fibers,), edges
    constants : section and the two constants of the law, shape (fibers, 3), or (1, 3) where all fibres have the same
    """

    kind: int
    rest_lengths: Array
    constants: Array


# Gauss's rule for the energy of Eq. 6, and how far the exponent may run over an interval for rounding to be all it
# misses.
_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(8)
LONGEST_INTERVAL = 1.0
# A fibre at rest counts as stretched, whatever rounding makes of its length.
SLACK = 1e-12


@njit(nogil=True, error_model="numpy")
def _exponential(stretch, nonlinearity, linear_beyond):  # type: ignore[no-untyped-def]
    """f and df/dλ of Eq. 6, continued along its tangent beyond a stretch."""
    cut = least(stretch, linear_beyond)
    growth = exponential_less_one(0.5 * nonlinearity * (cut * cut - 1.0))
    stiffness = cut * (growth + 1.0)
    return growth * (1.0 / nonlinearity) + stiffness * (stretch - cut), stiffness


@njit(nogil=True, error_model="numpy")
def _exponential_energy(stretch, nonlinearity, linear_beyond):  # type: ignore[no-untyped-def]
    """w of Eq. 6, which has no elementary form, by Gauss's rule over intervals of the way from 1 to the stretch."""
    cut = least(stretch, linear_beyond)
    exponent = magnitude(0.5 * nonlinearity * (cut * cut - 1.0))
    intervals = 1 + int(greatest(least(exponent, LARGEST_EXPONENT)) / LONGEST_INTERVAL)
    half = (cut - 1.0) * (0.5 / intervals)
    total = 0.0 * cut
    for i in range(intervals):
        for p in range(len(_NODES)):
            along = 1.0 + half * (2.0 * i + 1.0 + _NODES[p])
            total = total + _WEIGHTS[p] * exponential_less_one(0.5 * nonlinearity * (along * along - 1.0))
    beyond = stretch - cut
    force, stiffness = _exponential(cut, nonlinearity, linear_beyond)
    return half * total * (1.0 / nonlinearity) + beyond * (force + 0.5 * beyond * stiffness)


@njit(nogil=True, error_model="numpy")
def _buckling(stretch, compressive, unused):  # type: ignore[no-untyped-def]
    """f and df/dλ of a linear fibre with another stiffness in compression."""
    strain = stretch - 1.0
    stiffness = choose(stretch, 1.0 - SLACK, compressive, 1.0)
    return stiffness * strain, stiffness


@njit(nogil=True, error_model="numpy")
def _buckling_energy(stretch, compressive, unused):  # type: ignore[no-untyped-def]
    """w = f²/(2 df/dλ), on either side of rest."""
    return 0.5 * _buckling(stretch, compressive, unused)[0] * (stretch - 1.0)


@njit(nogil=True, error_model="numpy")
def respond(kind, stretch, first, second):  # type: ignore[no-untyped-def]
    """f and df/dλ of the law of that number with its constants; vectors of lanes, or numbers beside such."""
    if kind == EXPONENTIAL:
        return _exponential(stretch, first, second)
    return _buckling(stretch, first, second)


@njit(nogil=True, error_model="numpy")
def energy(kind, stretch, first, second):  # type: ignore[no-untyped-def]
    """w of the law of that number, as `respond`."""
    if kind == EXPONENTIAL:
        return _exponential_energy(stretch, first, second)
    return _buckling_energy(stretch, first, second)


@njit(nogil=True, error_model="numpy")
def force_per_stretch(kind, strain, first, second):  # type: ignore[no-untyped-def]
    """s = f/λ of the law of that number and its first three derivatives by the Green strain e = (λ² − 1)/2 > −1/2."""
    # 1/λ and its derivatives by e: −1/λ³, 3/λ⁵, −15/λ⁷.
    d0 = 1.0 / square_root(1.0 + 2.0 * strain)
    square = d0 * d0
    d1 = -1.0 * d0 * square
    d2 = -3.0 * d1 * square
    d3 = -5.0 * d2 * square
    if kind == EXPONENTIAL:
        most = 0.5 * (second * second - 1.0)
        growth = exponential_less_one(first * least(strain, most))
        force, slope = growth * (1.0 / first), growth + 1.0
        curved = first * slope
        s0 = force * d0
        s1 = slope * d0 + force * d1
        s2 = curved * d0 + 2.0 * slope * d1 + force * d2
        s3 = first * curved * d0 + 3.0 * curved * d1 + 3.0 * slope * d2 + force * d3
        if second == np.inf:
            return s0, s1, s2, s3
        # Beyond, f = stiffness λ − intercept.
        stiffness = second * slope
        intercept = stiffness * second - force
        return (
            choose(strain, most, s0, stiffness - intercept * d0),
            choose(strain, most, s1, -1.0 * intercept * d1),
            choose(strain, most, s2, -1.0 * intercept * d2),
            choose(strain, most, s3, -1.0 * intercept * d3),
        )
    stiffness = choose(strain, -SLACK, first, 1.0)
    return stiffness * (1.0 - d0), -1.0 * stiffness * d1, -1.0 * stiffness * d2, -1.0 * stiffness * d3


@njit(nogil=True, error_model="numpy")
def _evaluate(kind: int, stretch: Array, first: Array, second: Array, result: Array, with_energy: bool) -> None:
    """Fill `result`, (n, 3, lanes), with f, df/dλ and, if asked for, w at stretches and constants (n, lanes)."""
    for m in range(len(stretch)):
        x, a, b = load(stretch, (m,)), load(first, (m,)), load(second, (m,))
        force, stiffness = respond(kind, x, a, b)
        store(result, (m, 0), force)
        store(result, (m, 1), stiffness)
        if with_energy:
            store(result, (m, 2), energy(kind, x, a, b))


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class FiberLaw(ABC):
    """What all laws share: how stiff, thick and long the fibres are. Arguments are named.

    Parameters
    ----------
    modulus_MPa : k, above 0
    radius_um : R, above 0; the section is A = π R²
    section : of a fibre over A, above 0, a number or shape (fibers,)
    rest_length : a fibre's length without force over the distance of its ends in the network as it is given, above 0,
        a number or shape (fibers,); other numbers than 1 put the network under stress at rest

    Raises ConfigError for numbers outside these ranges.
    """

    kind: ClassVar[int]

    modulus_MPa: float
    radius_um: float
    section: Number = 1.0
    rest_length: Number = 1.0

    def __post_init__(self) -> None:
        for name in ("modulus_MPa", "radius_um"):
            _check(name, getattr(self, name), _positive, "a number above 0", per_fiber=False)
        for name in ("section", "rest_length"):
            _check(name, getattr(self, name), _positive, "a number above 0")

    def __repr__(self) -> str:
        """Its class and the numbers that are not the default."""
        numbers = (
            f"{entry.name}={_shown(getattr(self, entry.name))}"
            for entry in fields(self)
            if np.ndim(getattr(self, entry.name)) or getattr(self, entry.name) != entry.default
        )
        return f"{type(self).__name__}({', '.join(numbers)})"

    @property
    def section_um2(self) -> float:
        """A = π R², µm²."""
        return float(np.pi * self.radius_um**2)

    @abstractmethod
    def constants(self) -> tuple[Number, Number]:
        """The two constants of the compiled functions, numbers or of shape (fibers,)."""

    def fibers(self, lengths: Array) -> Fibers:
        """The fibres of a network with distances of their ends, shape (fibers,), edges.

        Raises ConfigError where the law has numbers for another number of fibres.
        """
        columns = (self.section, *self.constants())
        for values in (self.rest_length, *columns):
            if np.ndim(values) and np.shape(values) != lengths.shape:
                raise ConfigError(
                    f"the fibre law has {np.shape(values)[0]} numbers where the network has {len(lengths)} fibers"
                )
        constants = np.stack(np.broadcast_arrays(*columns), axis=-1, dtype=float).reshape(-1, 3)
        return Fibers(self.kind, lengths * self.rest_length, np.ascontiguousarray(constants))

    def response(self, stretch: ArrayLike) -> tuple[Array, Array]:
        """f and df/dλ for stretches λ of any shape; with numbers per fibre the last axis is the fibre."""
        force, stiffness, _ = self._evaluated(stretch, with_energy=False)
        return force, stiffness

    def energy(self, stretch: ArrayLike) -> Array:
        """w(λ) = ∫ f dλ from 1, for stretches λ as of `response`."""
        return self._evaluated(stretch, with_energy=True)[2]

    def _evaluated(self, stretch: ArrayLike, with_energy: bool) -> Array:
        stretch, first, second = np.broadcast_arrays(np.asarray(stretch, dtype=float), *self.constants())
        count = -(-stretch.size // LANES)
        stretches, *constants = np.ones((3, count * LANES))
        for padded, values in zip((stretches, *constants), (stretch, first, second), strict=True):
            padded[: values.size] = values.ravel()
        result = np.empty((count, 3, LANES))
        rows = (count, LANES)
        _evaluate(
            self.kind,
            stretches.reshape(rows),
            constants[0].reshape(rows),
            constants[1].reshape(rows),
            result,
            with_energy,
        )
        return result.transpose(1, 0, 2).reshape(3, -1)[:, : stretch.size].reshape(3, *stretch.shape)


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class Fiber(FiberLaw):
    """Force f = (exp[B E] − 1)/B with E = (λ² − 1)/2 (Eq. 6).

    Parameters
    ----------
    nonlinearity : B > 0, a number or shape (fibers,)
    linear_beyond_stretch : stretch above 1 beyond which the force continues along its tangent, a number or shape
        (fibers,); infinity for Eq. 6 as printed
    modulus_MPa, radius_um, section, rest_length : as of `FiberLaw`

    Raises ConfigError for numbers outside these ranges.

    >>> fiber = Fiber(modulus_MPa=10.0, nonlinearity=2.5, radius_um=0.1)
    >>> fiber
    Fiber(modulus_MPa=10.0, radius_um=0.1, nonlinearity=2.5)
    >>> force, stiffness = fiber.response(1.0)
    >>> float(force), float(stiffness)
    (0.0, 1.0)
    """

    kind: ClassVar[int] = EXPONENTIAL

    nonlinearity: Number
    linear_beyond_stretch: Number = np.inf

    def __post_init__(self) -> None:
        super().__post_init__()
        _check("nonlinearity", self.nonlinearity, _positive, "a number above 0")
        _check("linear_beyond_stretch", self.linear_beyond_stretch, lambda value: value > 1.0, "above 1")

    def constants(self) -> tuple[Number, Number]:
        """B and the stretch beyond which the force is linear."""
        return self.nonlinearity, self.linear_beyond_stretch


@dataclass(frozen=True, eq=False, repr=False, kw_only=True)
class BucklingFiber(FiberLaw):
    """A linear fibre, f = λ − 1, with another stiffness in compression: f = c (λ − 1) for λ < 1.

    Parameters
    ----------
    compressive : c > 0, stiffness in compression over that in tension, a number or shape (fibers,)
    modulus_MPa, radius_um, section, rest_length : as of `FiberLaw`

    Raises ConfigError for numbers outside these ranges.

    >>> BucklingFiber(modulus_MPa=10.0, compressive=0.1, radius_um=0.1).response([0.9, 1.0, 1.1])[0].round(12).tolist()
    [-0.01, 0.0, 0.1]
    """

    kind: ClassVar[int] = BUCKLING

    compressive: Number

    def __post_init__(self) -> None:
        super().__post_init__()
        _check("compressive", self.compressive, _positive, "a number above 0")

    def constants(self) -> tuple[Number, Number]:
        """c, and nothing more."""
        return self.compressive, 0.0


#: Laws by the name that files have for them.
FIBER_LAWS: dict[str, type[FiberLaw]] = {"exponential": Fiber, "buckling": BucklingFiber}


def _positive(values: Array) -> NDArray[np.bool_]:
    return np.isfinite(values) & (values > 0.0)


def _check(
    name: str, value: Number, allowed: Callable[[Array], NDArray[np.bool_]], range_: str, per_fiber: bool = True
) -> None:
    """Raise ConfigError, naming the fibre if there are numbers per fibre, where `value` is out of range."""
    values = np.asarray(value, dtype=float)
    bad = np.flatnonzero(~allowed(values))
    if values.ndim > per_fiber or bad.size:
        where = f" of fiber {bad[0]}" if values.ndim == 1 and bad.size else ""
        shown = values.ravel()[bad[0]] if bad.size else f"of shape {values.shape}"
        raise ConfigError(f"fiber.{name}{where} is {shown}; it must be {range_}")


def _shown(value: Number) -> str:
    return f"<{np.size(value)} numbers>" if np.ndim(value) else f"{value}"
