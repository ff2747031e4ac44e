"""The junction law: fibres that stretch affinely, less the energy that their junctions release when each gives way.

W(C) = Σ_q v_q w(λ_q) − κ v tr[A M] with λ_q = |F N_q|, s = f/λ and s' = ds/de, e = (λ² − 1)/2, v = Σ v_q,
A = ⟨s² N ⊗ N⟩, B = ⟨s' N ⊗ N⟩, σ = ⟨s⟩ and ⟨·⟩ the mean over the fibres weighted by v_q; M = (B + σ C⁻¹)⁻¹ where σ ≥ 0,
and its series to second order, B⁻¹ − σ B⁻¹C⁻¹B⁻¹ + σ² B⁻¹C⁻¹B⁻¹C⁻¹B⁻¹, where σ < 0. Nothing is fitted and nothing
simulated: κ follows from the geometry of the network (`release`). docs/junction.md derives it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import nnls

from fibrous.errors import NetworkError
from fibrous.materials import junction_kernels as kernels
from fibrous.materials.affine_fibers import PAIRS, AffineFibers
from fibrous.materials.contract import MaterialError, PerElement, State, refuse
from fibrous.networks.fiber_law import FiberLaw
from fibrous.networks.geometry import Geometry
from fibrous.networks.lanes import LANES
from fibrous.networks.network import Network

Array = NDArray[np.float64]

# Directions among which few are chosen, and the degree of the moments that these keep: 28 of them.
GRID, DEGREE = 250, 6
FEW = (DEGREE + 1) * (DEGREE + 2) // 2
# Fibres are in a plane where their mean stiffness across it is not more than this part of the largest.
PLANAR = 1e-9


@dataclass(frozen=True, repr=False)
class Junction(PerElement):
    """Few fibres whose junctions give way.

    Parameters
    ----------
    directions : unit vectors N_q, shape (fibers, 3), or (elements, 1, fibers, 3) for fibres of each element
    weights : v_q, MPa, at least 0, shape (fibers,) or (elements, 1, fibers)
    law : of the fibres, the same everywhere
    release : κ, at least 0, a number, or shape (elements, 1) with fibres of each element

    Raises MaterialError for numbers out of these ranges, shapes other than these, a law with numbers per fibre, and
    fibres that lie in a plane, against whose mean stiffness nothing gives way out of it.

    >>> from fibrous import Fiber, delaunay
    >>> fiber = Fiber(modulus_MPa=10.0, nonlinearity=2.5, radius_um=0.1)
    >>> network = delaunay((0.6, 0.25, 0.15), fiber, volume_fraction=0.04, edge_um=20.0, seed=1)
    >>> law, F = Junction.of_networks([network]), np.diag([1.2, 0.95, 0.9])
    >>> float((abs(law.stress(F[None, None])[0, 0] - network.stress(F)).max() / network.stress(F).max()).round(2))
    0.01
    """

    directions: Array
    weights: Array
    law: FiberLaw
    release: Array | float

    component_axes: ClassVar[dict[str, int]] = {"directions": 2, "weights": 1}

    def __post_init__(self) -> None:
        fibers = AffineFibers(self.directions, self.weights, self.law)
        object.__setattr__(self, "directions", fibers.directions)
        object.__setattr__(self, "weights", fibers.weights)
        self._check("release", lambda release: release >= 0.0, "a number of at least 0")
        per_element = np.shape(self.release) == (len(self.weights), 1) and self.weights.ndim == 3
        if not (np.ndim(self.release) == 0 or per_element):
            raise MaterialError(f"release has the shape {np.shape(self.release)}; it must be a number or (elements, 1)")
        refuse(self.weights.sum(axis=-1) > 0.0, self.weights, "weights", "above 0 in sum")
        if any(np.ndim(number) for number in self.law.constants()):
            raise MaterialError("the junction law has a law for all fibers: give it numbers, not numbers per fiber")
        stiffness = np.linalg.eigvalsh(np.einsum("...q,...qi,...qj->...ij", self.weights, *[self.directions] * 2))
        refuse(stiffness[..., 0] > PLANAR * stiffness[..., 2], self.directions, "directions", "out of one plane")

    @classmethod
    def of_networks(cls, networks: Sequence[Network]) -> Self:
        """The law of one network per element, all of one fibre law, without a simulation.

        Raises MaterialError as `AffineFibers.of_networks` does.
        """
        fibers = AffineFibers.of_networks(networks)
        directions, weights = np.zeros((len(networks), 1, FEW, 3)), np.zeros((len(networks), 1, FEW))
        directions[..., 0] = 1.0  # fibres of no weight, that fill up
        for element in range(len(networks)):
            N, v = few_fibers(fibers.directions[element, 0], fibers.weights[element, 0])
            directions[element, 0, : len(v)], weights[element, 0, : len(v)] = N, v
        return cls(directions, weights, fibers.law, np.array([[release(network)] for network in networks]))

    def __call__(self, gradient: Array, state: State = None, near: State = None) -> tuple[Array, Array, State]:
        """P and its exact derivative, in MPa."""
        F, possible = self._in_lanes(gradient)
        P, A = np.empty(F.shape), np.empty((len(F), 81, LANES))
        kernels.respond(F, *self._fibers(len(F)), P, A)
        return self._from_lanes(P, possible, (3, 3)), self._from_lanes(A, possible, (3, 3, 3, 3)), state

    def energy(self, gradient: Array) -> Array:
        """W, shape (...), MPa."""
        F, possible = self._in_lanes(gradient)
        W = np.empty((len(F), 1, LANES))
        kernels.stored_energy(F, *self._fibers(len(F)), W[:, 0])
        return self._from_lanes(W, possible, ())

    def _in_lanes(self, gradient: Array) -> tuple[Array, NDArray[np.bool_]]:
        """F of eight points of one element at a time, shape (groups, 9, 8), filled up, and where det F > 0.

        Points where it is not, shape (...), stand at rest meanwhile.
        """
        F = np.asarray(gradient, dtype=float)
        leading = np.broadcast_shapes(F.shape[:-2], self.weights.shape[:-1])
        with np.errstate(invalid="ignore"):
            possible = np.broadcast_to(np.linalg.det(F) > 0.0, leading)
        F = np.where(possible[..., None, None], F, np.eye(3)).reshape(self._elements, -1, 9)
        count = F.shape[1]
        filled = np.minimum(np.arange(-(-count // LANES) * LANES), count - 1)
        lanes = F[:, filled].reshape(-1, LANES, 9).transpose(0, 2, 1)
        return np.ascontiguousarray(lanes), possible

    def _from_lanes(self, values: Array, possible: NDArray[np.bool_], components: tuple[int, ...]) -> Array:
        count = possible.size // self._elements
        rows = values.transpose(0, 2, 1).reshape(self._elements, -1, values.shape[1])[:, :count]
        result = np.ascontiguousarray(rows).reshape((*possible.shape, *components))
        result[~possible] = np.nan
        return result

    @property
    def _elements(self) -> int:
        return len(self.weights) if self.weights.ndim == 3 else 1

    def _fibers(self, groups: int) -> tuple[Array, Array, Array, tuple[int, float, float]]:
        """Products of the directions' components, weights and κ of each group of points, and the fibres' law."""
        products = self.directions[..., kernels.ROWS] * self.directions[..., kernels.COLUMNS]
        count, elements = self.weights.shape[-1], self._elements
        of_elements = (
            products.reshape(elements, count, 6),
            self.weights.reshape(elements, count),
            np.broadcast_to(np.ravel(self.release), elements),
        )
        first, second = (float(number) for number in self.law.constants())
        constants = (self.law.kind, first, second)
        per_group = [np.repeat(values, groups // elements, axis=0) for values in of_elements]
        return per_group[0], per_group[1], per_group[2], constants


def few_fibers(directions: Array, weights: Array) -> tuple[Array, Array]:
    """At most 28 directions, shape (few, 3), and weights, (few,), with all moments of degree 6 of many fibres.

    `directions`, shape (fibers, 3), are unit vectors, `weights`, (fibers,), at least 0. Moments of degree 4, 2 and 0
    are kept with those of degree 6. Non-negative least squares over a grid of directions (`scipy.optimize.nnls`).
    """
    grid, moments = _grid()
    cubic = _cubic(directions)
    wanted = (cubic.T * weights) @ cubic
    shares, _ = nnls(moments, wanted[np.triu_indices(10)][_places()] / weights.sum(), maxiter=20 * GRID)
    chosen = shares > 0.0
    return grid[chosen], shares[chosen] * weights.sum()


def _cubic(directions: Array) -> Array:
    """The ten products of third degree of each direction, shape (n, 10)."""
    x, y, z = directions.T
    xx, yy, zz = x * x, y * y, z * z
    return np.stack([xx * x, xx * y, xx * z, x * yy, x * y * z, x * zz, yy * y, yy * z, y * zz, zz * z], axis=1)


@cache
def _places() -> NDArray[np.int64]:
    """Where each of the 28 moments of degree 6 first stands among the 55 products of two cubic ones."""
    powers = np.array([(3, 0), (2, 1), (2, 0), (1, 2), (1, 1), (1, 0), (0, 3), (0, 2), (0, 1), (0, 0)])
    i, j = np.triu_indices(10)
    return np.unique(powers[i] + powers[j], axis=0, return_index=True)[1]


@cache
def _grid() -> tuple[Array, Array]:
    """Directions spread evenly over the half sphere, shape (GRID, 3), and their moments of degree 6, (28, GRID)."""
    height = (np.arange(GRID) + 0.5) / GRID
    angle = np.pi * (1.0 + np.sqrt(5.0)) * np.arange(GRID)
    ring = np.sqrt(1.0 - height * height)
    grid = np.stack([ring * np.cos(angle), ring * np.sin(angle), height], axis=1)
    cubic = _cubic(grid)
    i, j = np.triu_indices(10)
    return grid, (cubic[:, i] * cubic[:, j]).T[_places()]


def release(network: Geometry) -> float:
    """κ = tr Q / tr R of a network, from its geometry alone.

    Stretched affinely by a small strain ε, the fibres at node i pull with g_i = Σ ± N (N · ε N); it gives way against
    K_i = Σ N ⊗ N/L: all nodes, each for itself, release Q(ε) = Σ ½ g_i · K_i⁻¹ g_i, where the law has κ R(ε) with
    R(ε) = Σ L (N · ε N)² N · B⁻¹ N, B = Σ L N ⊗ N / Σ L. Both are quadratic in ε, and κ is the ratio of their means.
    Raises NetworkError for a node whose fibres lie in a plane.
    """
    lengths = network.fiber_lengths
    N = network.fiber_vectors / lengths[:, None]
    # Products of N with components of an orthonormal basis of symmetric tensors.
    strain = np.stack([N[:, i] * N[:, j] * (1.0 if i == j else np.sqrt(2.0)) for i, j in PAIRS], axis=1)
    pull = (N[:, :, None] * strain[:, None, :]).reshape(len(N), 18)
    stiffness = (N[:, :, None] * (N / lengths[:, None])[:, None, :]).reshape(len(N), 9)
    count = len(network.node_position)
    tails, heads = network.fiber_nodes.T
    g = np.stack([np.bincount(tails, one, count) - np.bincount(heads, one, count) for one in pull.T], axis=1)
    K = np.stack([np.bincount(tails, one, count) + np.bincount(heads, one, count) for one in stiffness.T], axis=1)
    inside = ~network.node_is_boundary
    g, K = g[inside].reshape(-1, 3, 6), K[inside].reshape(-1, 3, 3)
    stiffness = np.linalg.eigvalsh(K)
    floppy = np.flatnonzero(inside)[stiffness[:, 0] <= PLANAR * stiffness[:, 2]]
    if floppy.size:
        raise NetworkError(f"node {floppy[0]}: its fibers lie in a plane; join it to a node out of that plane")
    Q = 0.5 * (g * np.linalg.solve(K, g)).sum()
    B = (N.T * lengths) @ N / lengths.sum()
    R = (lengths * (strain * strain).sum(axis=1) * (N * np.linalg.solve(B, N.T).T).sum(axis=1)).sum()
    return float(Q / R)
