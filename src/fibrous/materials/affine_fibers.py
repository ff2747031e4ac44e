"""The affine fibre sum: every fibre of a network stretched with F, with the network's own fibre law (Eq. 6).

No constant is fitted, so this is the baseline that every law fitted to a network must beat. The fibres are those of
the network, or a quadrature of the sphere for the cloud from which networks of a structure tensor are cut.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from fibrous.materials.contract import MaterialError, PerElement, State, refuse
from fibrous.networks.fiber_law import FiberLaw
from fibrous.networks.generation import stretch_tensor_for
from fibrous.networks.network import Network

Array = NDArray[np.float64]

# Fibres times points that are worked on at a time: arrays of this many numbers stay in the cache.
BLOCK = 2**16
PAIRS = ((0, 0), (1, 1), (2, 2), (1, 2), (0, 2), (0, 1))
QUADRUPLES = tuple((i, j, k, m) for i in range(3) for j in range(i, 3) for k in range(j, 3) for m in range(k, 3))
# Where component ijkl of a fully symmetric tensor stands among the quadruples, and ij of a symmetric one among pairs.
FOURTH = np.array([QUADRUPLES.index(tuple(sorted(index))) for index in np.ndindex(3, 3, 3, 3)]).reshape(3, 3, 3, 3)
SECOND = np.array([PAIRS.index((min(index), max(index))) for index in np.ndindex(3, 3)]).reshape(3, 3)


@dataclass(frozen=True, repr=False)
class AffineFibers(PerElement):
    """W = Σ_m v_m w(λ_m) with λ_m = |F N_m| and w the reduced energy of the fibre law (Eq. 6).

    Parameters
    ----------
    directions : unit vectors N_m, shape (fibers, 3), or (elements, 1, fibers, 3) for fibres of each element
    weights : v_m = kA L_m/V, MPa, at least 0, shape (fibers,) or (elements, 1, fibers)
    law : fibre law, the same everywhere

    Raises MaterialError for directions that are no unit vectors, negative weights, and shapes other than these.

    >>> from fibrous import Fiber
    >>> fiber = Fiber(modulus_MPa=10.0, nonlinearity=2.5, radius_um=0.1)
    >>> law = AffineFibers(np.array([[1.0, 0.0, 0.0]]), np.array([2.0]), fiber)
    >>> float(law.tangent(np.eye(3))[0, 0, 0, 0])
    2.0
    """

    directions: Array
    weights: Array
    law: FiberLaw

    component_axes: ClassVar[dict[str, int]] = {"directions": 2, "weights": 1}

    def __post_init__(self) -> None:
        N, v = (np.asarray(values, dtype=float) for values in (self.directions, self.weights))
        if N.shape[-1] != 3 or v.shape != N.shape[:-1] or v.ndim not in (1, 3) or (v.ndim == 3 and v.shape[1] != 1):
            raise MaterialError(
                f"fibers have directions of shape {N.shape} and weights of shape {v.shape}; they must be (fibers, 3) "
                "and (fibers,), or (elements, 1, fibers, 3) and (elements, 1, fibers)"
            )
        refuse((np.isfinite(v) & (v >= 0.0)).all(axis=-1), v, "weights", "numbers of at least 0")
        refuse((np.abs((N * N).sum(-1) - 1.0) < 1e-6).all(axis=-1), N, "directions", "unit vectors, one a row")
        object.__setattr__(self, "directions", N)
        object.__setattr__(self, "weights", v)

    @classmethod
    def of_networks(cls, networks: Sequence[Network]) -> Self:
        """The fibres of one network per element, all of one law.

        Raises MaterialError for networks of several laws, a law with numbers per fibre, or with rest lengths other than
        in the networks.
        """
        law = networks[0].fiber
        if any(not _alike(network.fiber, law) for network in networks):
            raise MaterialError("the affine sum has a law for all fibers: give it networks of one")
        if any(np.ndim(number) for number in (law.section, *law.constants())) or np.any(
            np.asarray(law.rest_length) != 1
        ):
            raise MaterialError("the affine sum has a law for all fibers: give it numbers, and rest_length 1")
        most = max(len(network.fiber_nodes) for network in networks)
        directions, weights = np.zeros((len(networks), 1, most, 3)), np.zeros((len(networks), 1, most))
        directions[..., 0] = 1.0  # fibres of no weight, that fill up
        for element, network in enumerate(networks):
            count, lengths = len(network.fiber_nodes), network.fiber_lengths
            directions[element, 0, :count] = network.fiber_vectors / lengths[:, None]
            weights[element, 0, :count] = network.stress_unit_MPa * law.section * lengths
        return cls(directions, weights, law)

    @classmethod
    def of_structure_tensor(
        cls, structure_tensor: Array, volume_fraction: float, law: FiberLaw, order: int = 12
    ) -> Self:
        """The expected fibres of networks with H, shape (3, 3), and a volume fraction.

        They are an isotropic cloud's, stretched: an edge along n becomes S n, and weighs its length. `order` squared
        times two directions stand for the half sphere. Raises NetworkError for an H that no cloud can have.
        """
        directions, weights = half_sphere(order)
        vectors = directions @ stretch_tensor_for(structure_tensor)
        lengths = np.linalg.norm(vectors, axis=1)
        shares = weights * lengths / (weights @ lengths)
        return cls(vectors / lengths[:, None], law.modulus_MPa * volume_fraction * shares, law)

    def __call__(self, gradient: Array, state: State = None, near: State = None) -> tuple[Array, Array, State]:
        """P = F S, A_iJkL = δ_ik S_JL + F_iM F_kN D_MJNL, in MPa.

        With fibre force f and stiffness f' over λ: S = Σ v (f/λ) N ⊗ N and D = Σ v ((f' − f/λ)/λ²) N ⊗ N ⊗ N ⊗ N.
        """
        F = np.asarray(gradient, dtype=float)

        def moments(right: Array, directions: Array, weights: Array) -> Array:
            stretch = _stretches(right, directions)
            with np.errstate(over="ignore", invalid="ignore"):
                force, stiffness = self.law.response(stretch)
                tension = force / stretch
                axial = (stiffness - tension) / (stretch * stretch)
                second = (weights * tension) @ _products(directions, PAIRS)
                fourth = (weights * axial) @ _products(directions, QUADRUPLES)
                return np.concatenate([second, fourth], axis=-1)

        sums = self._over_blocks(F, moments, len(PAIRS) + len(QUADRUPLES))
        S, D = sums[..., : len(PAIRS)][..., SECOND], sums[..., len(PAIRS) :][..., FOURTH]
        tangent = np.einsum("...kN,...iNJL->...iJkL", F, np.einsum("...iM,...MNJL->...iNJL", F, D))
        for i in range(3):
            tangent[..., i, :, i, :] += S
        return F @ S, tangent, state

    def energy(self, gradient: Array) -> Array:
        """W, shape (...), MPa."""

        def sums(right: Array, directions: Array, weights: Array) -> Array:
            return (self.law.energy(_stretches(right, directions)) * weights).sum(axis=-1, keepdims=True)

        return self._over_blocks(np.asarray(gradient, dtype=float), sums, 1)[..., 0]

    def _over_blocks(self, F: Array, function: Callable[[Array, Array, Array], Array], size: int) -> Array:
        """`function` of C's pairs, fibre directions and weights, for as many points at a time as fit the cache.

        Returns shape (..., size) for F of shape (..., 3, 3).
        """
        right = np.swapaxes(F, -1, -2) @ F
        pairs = np.stack([right[..., i, j] for i, j in PAIRS], axis=-1)
        shared, fibers = self.weights.ndim == 1, self.weights.shape[-1]
        if shared:
            leading = pairs.shape[:-1]
            pairs = pairs.reshape(-1, len(PAIRS))
        else:
            leading = np.broadcast_shapes(pairs.shape[:-1], self.weights.shape[:-1])
            pairs = np.broadcast_to(pairs, (*leading, len(PAIRS)))
        result = np.empty((*pairs.shape[:-1], size))
        at_a_time = max(1, BLOCK * len(pairs) // (fibers * max(1, pairs[..., 0].size)))
        for start in range(0, len(pairs), at_a_time):
            part = slice(start, start + at_a_time)
            directions, weights = (
                (self.directions, self.weights) if shared else (self.directions[part, 0], self.weights[part])
            )
            result[part] = function(pairs[part], directions, weights)
        return result.reshape(*leading, size)


def _alike(one: FiberLaw, two: FiberLaw) -> bool:
    """Whether two laws have the same force over stretch and the same section."""
    return one.kind == two.kind and all(
        np.array_equal(a, b)
        for a, b in zip((one.section, *one.constants()), (two.section, *two.constants()), strict=True)
    )


def half_sphere(order: int) -> tuple[Array, Array]:
    """Unit vectors over the half sphere z > 0, shape (2 order², 3), and weights of sum 1: Gauss in z, equal angles.

    Exact for the mean over the sphere of even polynomials of degree below 2 order.
    """
    z, weights = np.polynomial.legendre.leggauss(2 * order)
    z, weights = z[order:], weights[order:]
    angle = np.pi * (np.arange(2 * order) + 0.5) / order
    ring = np.sqrt(1.0 - z * z)[:, None]
    height = np.broadcast_to(z[:, None], (order, 2 * order))
    directions = np.stack([ring * np.cos(angle), ring * np.sin(angle), height], axis=-1)
    return directions.reshape(-1, 3), np.repeat(weights / (2 * order), 2 * order)


def _products(vectors: Array, indices: tuple[tuple[int, ...], ...]) -> Array:
    """Products of components of vectors (..., n, 3) for each tuple of indices, shape (..., n, indices)."""
    return np.stack([np.prod([vectors[..., i] for i in index], axis=0) for index in indices], axis=-1)


def _stretches(pairs: Array, directions: Array) -> Array:
    """λ of the fibres, shape (..., points, fibers), from C's pairs (..., points, 6) and directions (..., fibers, 3)."""
    products = _products(directions, PAIRS)
    products[..., 3:] *= 2.0
    return np.sqrt(pairs @ np.swapaxes(products, -1, -2))
