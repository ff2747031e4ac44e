"""The surface of Eq. 11: a constant of the HGO law as a quadratic of a network's alignment, over many networks.

value = Σ_ij coefficient_ij H11^i H22^j, i, j = 0, 1, 2, with H11 and H22 the diagonal of the structure tensor.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import stdtrit

from fibrous.errors import FitError
from fibrous.materials.contract import MaterialError
from fibrous.materials.hgo import refuse_structure_tensor

Array = NDArray[np.float64]

TERMS = ((0, 0), (0, 1), (1, 0), (1, 1), (0, 2), (2, 0), (1, 2), (2, 1), (2, 2))  # (i, j), in Table 1's order
LABELS = tuple(f"{i}{j}" for i, j in TERMS)
EIGHT = 8  # terms without H11² H22², as Table 1 prints for C3
NINE = 9

CONFIDENCE = 0.95
FOLD_SEED = 0  # the numbering of networks follows a low-discrepancy sequence, so folds are drawn, not counted off
RESOLUTION = 400  # of a region, in either direction: fractions to about 1e-3
SLACK = 0.005  # alignments are printed with two decimals
OFF_DIAGONAL = 0.01  # below it a tensor counts as given in its principal axes


@dataclass(frozen=True)
class Surface:
    """Ordinary least squares of Eq. 11; all arrays in the order of TERMS, terms left out being zero."""

    coefficient: Array  # (9,), unit of the constant
    covariance: Array  # (9, 9), its square
    residual_variance: float  # its square: variance of one network about the surface
    degrees_of_freedom: int
    r_squared: float
    cross_validated_r_squared: float

    @property
    def half_width(self) -> Array:
        """95 % half-widths of the coefficients, shape (9,); NaN for a term left out."""
        variance = np.diag(self.covariance)
        return np.where(variance > 0.0, _quantile(self.degrees_of_freedom) * np.sqrt(variance), np.nan)


@dataclass(frozen=True)
class Region:
    """The alignments with H11 between two values and H22, H33 ≥ smallest_H: a trapezium, or the whole triangle."""

    least_H11: float
    largest_H11: float
    smallest_H: float

    def points(self, u: Array, v: Array) -> tuple[Array, Array, Array]:
        """H11, H22 and the width of the region there, at u along H11 and v across it, both from 0 to 1."""
        H11 = self.least_H11 + (self.largest_H11 - self.least_H11) * u
        width = 1.0 - 2.0 * self.smallest_H - H11
        return H11, self.smallest_H + width * v, width


TRIANGLE = Region(0.0, 1.0, 0.0)


@dataclass(frozen=True)
class Summary:
    """What a surface does over a region, in the unit of its constant."""

    negative_fraction: float  # of the area
    least: float
    largest: float


def monomials(H11: ArrayLike, H22: ArrayLike) -> Array:
    """H11^i H22^j in the order of TERMS, shape (..., 9), for H11 and H22 of shape (...).

    >>> monomials(2.0, 3.0).astype(int).tolist()
    [1, 3, 2, 6, 9, 4, 18, 12, 36]
    """
    H11, H22 = np.broadcast_arrays(np.asarray(H11, dtype=float), np.asarray(H22, dtype=float))
    return np.stack([H11**i * H22**j for i, j in TERMS], axis=-1)


def evaluate(coefficient: ArrayLike, H11: ArrayLike, H22: ArrayLike) -> Array:
    """Eq. 11 with coefficients of shape (9,) at H11 and H22 of shape (...); shape (...), unit of the coefficients."""
    return monomials(H11, H22) @ np.asarray(coefficient, dtype=float)


def indices_swapped(coefficient: ArrayLike) -> Array:
    """The coefficients, shape (9,), read as if the first index belonged to H22 and the second to H11."""
    return np.asarray(coefficient, dtype=float)[[TERMS.index((j, i)) for i, j in TERMS]]


def fit_surface(H11: Array, H22: Array, value: Array, terms: int, folds: int) -> Surface:
    """Least squares of Eq. 11 with its first `terms` terms over networks; all arrays of shape (networks,).

    R² and cross-validated R² are 1 − Σ residual² / Σ (value − mean)², the latter with each network's residual taken
    from a fit without its fold (at most `folds` folds, always the same ones for the same number of networks).
    Raises FitError where the networks do not outnumber the terms or their alignments do not span them.
    """
    matrix = monomials(H11, H22)[:, :terms]
    freedom = len(matrix) - terms
    if freedom < 1 or np.linalg.matrix_rank(matrix) < terms:
        raise FitError(
            f"the surface of Eq. 11 has {terms} terms and {len(matrix)} fitted networks do not determine them: "
            "ask for more networks, or a wider range of H11"
        )
    orthogonal, triangular = np.linalg.qr(matrix)
    inverse = np.linalg.inv(triangular)
    fitted = inverse @ (orthogonal.T @ value)
    residual = value - matrix @ fitted
    variance = float(residual @ residual) / freedom

    coefficient, covariance = np.zeros(NINE), np.zeros((NINE, NINE))
    coefficient[:terms] = fitted
    covariance[:terms, :terms] = variance * inverse @ inverse.T
    held_out = _held_out_residual(matrix, value, min(folds, len(value)))
    return Surface(
        coefficient,
        covariance,
        variance,
        freedom,
        _r_squared(residual, value),
        _r_squared(held_out, value),
    )


def prediction(surface: Surface, H11: float, H22: float) -> tuple[float, float]:
    """Value for a new network and its 95 % half-width t √(residual variance + mᵀ Cov m), m the monomials."""
    row = monomials(H11, H22)
    variance = surface.residual_variance + row @ surface.covariance @ row
    return float(row @ surface.coefficient), float(_quantile(surface.degrees_of_freedom) * np.sqrt(variance))


def summary(coefficient: ArrayLike, region: Region) -> Summary:
    """Fraction of the region's area where Eq. 11 is negative, and its extremes there; coefficients of shape (9,)."""
    inner = (np.arange(RESOLUTION) + 0.5) / RESOLUTION
    H11, H22, width = region.points(*np.meshgrid(inner, inner, indexing="ij"))
    negative = evaluate(coefficient, H11, H22) < 0.0
    closed = np.linspace(0.0, 1.0, RESOLUTION + 1)
    values = evaluate(coefficient, *region.points(*np.meshgrid(closed, closed, indexing="ij"))[:2])
    return Summary(float(width[negative].sum() / width.sum()), float(values.min()), float(values.max()))


def alignment(structure_tensor: ArrayLike, ranges: ArrayLike) -> tuple[float, float]:
    """(H11, H22) of a structure tensor of shape (3, 3), checked against the ranges of H11, H22, H33, shape (3, 2).

    Raises FitError where it is no structure tensor, not in its principal axes, or outside the ranges.
    """
    try:
        tensor = np.asarray(structure_tensor, dtype=float)
    except (TypeError, ValueError):
        raise FitError("the structure tensor holds something that is not a number: give 3 by 3 numbers") from None
    if tensor.shape != (3, 3):
        raise FitError(f"the structure tensor has shape {tensor.shape}: give 3 by 3 numbers")
    try:
        refuse_structure_tensor(tensor)
    except MaterialError as error:
        raise FitError(str(error)) from None
    off_diagonal = np.abs(tensor[np.triu_indices(3, 1)]).max()
    if off_diagonal > OFF_DIAGONAL:
        raise FitError(
            f"the structure tensor has an off-diagonal component of {off_diagonal:.3g}: "
            "rotate it into its principal axes first"
        )
    for name, component, (least, largest) in zip(
        ("H11", "H22", "H33"), np.diag(tensor), np.asarray(ranges, dtype=float), strict=True
    ):
        if not least - SLACK <= component <= largest + SLACK:
            raise FitError(
                f"{name} = {component:.3f} is outside the fitted range, {least:.3f} to {largest:.3f}: "
                "the surface says nothing there; fit a network of this alignment instead"
            )
    return float(tensor[0, 0]), float(tensor[1, 1])


def _quantile(freedom: int) -> float:
    return float(stdtrit(freedom, 0.5 + CONFIDENCE / 2.0))


def _r_squared(residual: Array, value: Array) -> float:
    about_mean = float(np.sum((value - value.mean()) ** 2))
    return 1.0 - float(residual @ residual) / about_mean if about_mean > 0.0 else np.nan


def _held_out_residual(matrix: Array, value: Array, folds: int) -> Array:
    """Residual of every network from the fit without its fold; NaN where that fit is not determined."""
    order = np.random.default_rng(FOLD_SEED).permutation(len(value))
    residual = np.full(len(value), np.nan)
    for held in np.array_split(order, folds):
        rest = np.setdiff1d(order, held)
        coefficient, _, rank, _ = np.linalg.lstsq(matrix[rest], value[rest], rcond=None)
        if rank == matrix.shape[1]:
            residual[held] = value[held] - matrix[held] @ coefficient
    return residual
