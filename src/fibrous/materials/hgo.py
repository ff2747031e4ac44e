"""Exponential fibre laws of Holzapfel, Gasser and Ogden: three families (Eq. 10C), or one averaged stretch (Eq. 2).

Both are C2/(2 C3) (exp(C3 x²) − 1) with x = I4 − 1, the square of a stretch less one; C3 = 0 gives the limit C2 x²/2.
They differ in the order of averaging and exponential: with the same constants Eq. 10C is never the softer.

Tension only, the default, x < 0 counts as x = 0. FEBio, which the paper ran, does that to each family of Eq. 10C.
Eq. 2 knows one stretch, λ_f = √⟨I4⟩, so the switch is in λ_f: where λ_f < 1 the law carries nothing, although some
fibres are stretched, just as the fit of the constants leaves out the points with λ_f ≤ 1. Without the switch both laws
are as printed, and push back when shortened as strongly as they pull.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import exprel

from fibrous.materials.contract import PerElement, State, components_first, components_last, refuse

Array = NDArray[np.float64]

# Largest error of unit length, right angle or unit trace that passes for rounding in a file.
ROUNDING = 1e-6
# At rest I4 is 1 to rounding, and whether a family counts in the tangent there must not be chance: it does.
RESTING = 1e-14
AT_LEAST_0 = "a number of at least 0"


class HGO(PerElement):
    """Base of laws W = Σ_p w_p C2/(2 C3) (exp(C3 (M_p : C − 1)²) − 1), which is what `fitting.hgo` fits.

    A law of one's own is one of the two below with another `of_structure_tensor`, or a new one with its `terms`.
    """

    C2: Array | float
    C3: Array | float

    def __post_init__(self) -> None:
        self._check("C2", lambda C2: C2 >= 0.0, AT_LEAST_0)
        self._check("C3", lambda C3: C3 >= 0.0, AT_LEAST_0)

    @classmethod
    def of_structure_tensor(
        cls, structure_tensor: Array, C2: Array | float, C3: Array | float, tension_only: bool = True
    ) -> Self:
        """The law of fibres with H, shape (..., 3, 3); C2 in MPa and C3 are numbers or arrays that broadcast."""
        raise NotImplementedError

    @property
    def terms(self) -> tuple[Array, Array]:
        """w_p, shape (..., terms), and M_p, shape (..., terms, 3, 3)."""
        raise NotImplementedError

    def _set_components(self, name: str, shape: tuple[int, ...]) -> None:
        value = np.asarray(getattr(self, name), dtype=float)
        if value.shape[-len(shape) :] != shape:
            refuse(np.asarray(False), np.asarray(f"of shape {value.shape}"), name, f"an array of shape (..., {shape})")
        object.__setattr__(self, name, value)


@dataclass(frozen=True, repr=False)
class HGOFamilies(HGO):
    """W = C2/(2 C3) Σ_p h_p (exp(C3 (I4_p − 1)²) − 1) with I4_p = N_p · C N_p, three orthogonal families (Eq. 10C).

    Parameters
    ----------
    C2 : fibre modulus, MPa, at least 0; a number or an array that broadcasts against the points
    C3 : fibre nonlinearity, at least 0; likewise
    weights : h_p, shape (..., 3), at least 0
    directions : unit vectors N_p as rows, shape (..., 3, 3), orthogonal
    tension_only : whether a family with I4_p < 1 carries nothing

    Raises MaterialError for constants outside these ranges.

    >>> law = HGOFamilies.of_structure_tensor(np.diag([0.6, 0.3, 0.1]), C2=0.1, C3=0.4)
    >>> law.stress(np.diag([1.2, 0.95, 0.95])).round(4).tolist()
    [[0.0759, 0.0, 0.0], [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]]
    """

    C2: Array | float
    C3: Array | float
    weights: Array
    directions: Array
    tension_only: bool = True

    component_axes: ClassVar[dict[str, int]] = {"weights": 1, "directions": 2}

    def __post_init__(self) -> None:
        super().__post_init__()
        self._set_components("weights", (3,))
        refuse((self.weights >= 0.0).all(-1) & np.isfinite(self.weights).all(-1), self.weights, "weights", AT_LEAST_0)
        self._set_components("directions", (3, 3))
        products = self.directions @ np.swapaxes(self.directions, -1, -2)
        good = (np.abs(products - np.eye(3)) < ROUNDING).all(axis=(-1, -2))
        refuse(good, self.directions, "directions", "three orthogonal unit vectors, one a row")

    @classmethod
    def of_structure_tensor(
        cls, structure_tensor: Array, C2: Array | float, C3: Array | float, tension_only: bool = True
    ) -> Self:
        """Families along the eigenvectors of H, shape (..., 3, 3), weighted by its eigenvalues (section 2.7)."""
        refuse_structure_tensor(structure_tensor)
        eigenvalues, eigenvectors = np.linalg.eigh(structure_tensor)
        return cls(C2, C3, np.maximum(eigenvalues, 0.0), np.swapaxes(eigenvectors, -1, -2), tension_only)

    @property
    def terms(self) -> tuple[Array, Array]:
        """h_p and N_p ⊗ N_p."""
        return self.weights, self.directions[..., :, None] * self.directions[..., None, :]

    def __call__(self, gradient: Array, state: State = None, near: State = None) -> tuple[Array, Array, State]:
        """P = Σ 2W' f ⊗ N, A = Σ 2W' δ_ik N_J N_L + 4W'' f_i N_J f_k N_L with f = F N and W' = ∂W/∂I4, in MPa."""
        F, N, h, C2, C3 = self._components(gradient)
        stress, geometric = np.zeros_like(F), np.zeros_like(F)
        tangent = np.empty(0)  # made by the first family, in the order of F in memory
        for p in range(3):
            f = _applied(F, N[p])
            first, second = _derivatives(C2 * h[p], C3, (f * f).sum(axis=0) - 1.0, self.tension_only)
            outer = f[:, None] * N[p]
            stress += (2.0 * first) * outer
            geometric += (2.0 * first) * (N[p][:, None] * N[p])
            product = ((4.0 * second) * outer)[:, :, None, None] * outer
            tangent = product if p == 0 else np.add(tangent, product, out=tangent)
        _add_geometric(tangent, geometric)
        return components_last(stress, 2), components_last(tangent, 4), state

    def energy(self, gradient: Array) -> Array:
        """W, shape (...), MPa."""
        F, N, h, C2, C3 = self._components(gradient)
        excesses = ((_applied(F, N[p]) ** 2).sum(axis=0) - 1.0 for p in range(3))
        return np.asarray(
            sum(exponential_energy(C2 * h[p], C3, excess, self.tension_only) for p, excess in enumerate(excesses))
        )

    def _components(self, gradient: Array) -> list[Array]:
        return components_first((gradient, 2), (self.directions, 2), (self.weights, 1), (self.C2, 0), (self.C3, 0))


@dataclass(frozen=True, repr=False)
class HGOStructureTensor(HGO):
    """W = C2/(2 C3) (exp(C3 (⟨I4⟩ − 1)²) − 1) with ⟨I4⟩ = H : C = λ_f² (Eq. 2).

    Parameters
    ----------
    C2 : fibre modulus, MPa, at least 0; a number or an array that broadcasts against the points
    C3 : fibre nonlinearity, at least 0; likewise
    structure_tensor : H, shape (..., 3, 3), symmetric, positive semidefinite, trace 1
    tension_only : whether the law carries nothing where λ_f < 1

    Raises MaterialError for constants outside these ranges.

    >>> HGOStructureTensor(0.1, 0.4, np.diag([0.6, 0.3, 0.1]))
    HGOStructureTensor(C2=0.1, C3=0.4, structure_tensor=<3 x 3, 0 to 0.6>, tension_only=True)
    """

    C2: Array | float
    C3: Array | float
    structure_tensor: Array
    tension_only: bool = True

    component_axes: ClassVar[dict[str, int]] = {"structure_tensor": 2}

    def __post_init__(self) -> None:
        super().__post_init__()
        self._set_components("structure_tensor", (3, 3))
        refuse_structure_tensor(self.structure_tensor)

    @classmethod
    def of_structure_tensor(
        cls, structure_tensor: Array, C2: Array | float, C3: Array | float, tension_only: bool = True
    ) -> Self:
        """The law of H, shape (..., 3, 3)."""
        return cls(C2, C3, structure_tensor, tension_only)

    @property
    def terms(self) -> tuple[Array, Array]:
        """1 and H."""
        return np.ones((*self.structure_tensor.shape[:-2], 1)), self.structure_tensor[..., None, :, :]

    def __call__(self, gradient: Array, state: State = None, near: State = None) -> tuple[Array, Array, State]:
        """P = 2W' F H, A = 2W' δ_ik H_JL + 4W'' (F H)_iJ (F H)_kL with W' = ∂W/∂⟨I4⟩, in MPa."""
        F, H, C2, C3 = self._components(gradient)
        mapped = self._mapped(F, H)
        first, second = _derivatives(C2, C3, (mapped * F).sum(axis=(0, 1)) - 1.0, self.tension_only)
        tangent = ((4.0 * second) * mapped)[:, :, None, None] * mapped
        _add_geometric(tangent, (2.0 * first) * H)
        return components_last((2.0 * first) * mapped, 2), components_last(tangent, 4), state

    def energy(self, gradient: Array) -> Array:
        """W, shape (...), MPa."""
        F, H, C2, C3 = self._components(gradient)
        return exponential_energy(C2, C3, (self._mapped(F, H) * F).sum(axis=(0, 1)) - 1.0, self.tension_only)

    def _components(self, gradient: Array) -> list[Array]:
        return components_first((gradient, 2), (self.structure_tensor, 2), (self.C2, 0), (self.C3, 0))

    @staticmethod
    def _mapped(F: Array, H: Array) -> Array:
        return np.stack([_applied(F, H[:, j]) for j in range(3)], axis=1)


def exponential_energy(C2: Array | float, C3: Array | float, excess: Array, tension_only: bool) -> Array:
    """C2/(2 C3) (exp(C3 x²) − 1) at x, any shape, in the unit of C2; infinite beyond the range of numbers."""
    square = (np.maximum(excess, 0.0) if tension_only else excess) ** 2
    with np.errstate(over="ignore"):
        return 0.5 * C2 * square * exprel(C3 * square)


def _derivatives(C2: Array | float, C3: Array | float, excess: Array, tension_only: bool) -> tuple[Array, Array]:
    """W' = C2 x e^{C3 x²} and W'' = C2 (1 + 2 C3 x²) e^{C3 x²} in x = I4 − 1."""
    active = excess > -RESTING if tension_only else 1.0
    nonlinear = C3 * excess * excess
    with np.errstate(over="ignore", invalid="ignore"):
        growth = active * C2 * np.exp(nonlinear)
        return growth * excess, growth * (1.0 + 2.0 * nonlinear)


def _applied(F: Array, vector: Array) -> Array:
    """F v, shape (3, ...), for F of shape (3, 3, ...) and v of shape (3, ...)."""
    return F[:, 0] * vector[0] + F[:, 1] * vector[1] + F[:, 2] * vector[2]


def _add_geometric(tangent: Array, geometric: Array) -> None:
    """Add δ_ik S_JL to A, shape (3, 3, 3, 3, ...), with S of shape (3, 3, ...)."""
    for i in range(3):
        tangent[i, :, i] += geometric


def refuse_structure_tensor(tensor: ArrayLike) -> None:
    """Raise MaterialError for what is no structure tensor, shape (..., 3, 3), naming the first element."""
    H = np.asarray(tensor, dtype=float)
    with np.errstate(invalid="ignore"):
        good = np.isfinite(H).all(axis=(-1, -2))
        good &= (np.abs(H - np.swapaxes(H, -1, -2)) < ROUNDING).all(axis=(-1, -2))
        good &= np.abs(np.trace(H, axis1=-2, axis2=-1) - 1.0) < ROUNDING
    # Eigenvalues of what is no symmetric matrix of numbers would be an error of another kind.
    eigenvalues = np.linalg.eigvalsh(np.where(good[..., None, None], H, np.eye(3)))
    refuse(
        good & (eigenvalues[..., 0] > -ROUNDING),
        H,
        "structure_tensor",
        "symmetric, without negative eigenvalues, of trace 1",
    )
