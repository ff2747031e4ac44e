"""Forces and Hessian of one network in the order that makes its Hessian's band narrow.

Positions are x = F X + u, with the fluctuation u of the interior nodes as unknown and u = 0 on the boundary, so a
fibre's end-to-end vector is F D + u_head − u_tail. Lengths are in edges, forces in kA, energies in kA edges.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import lapack
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import reverse_cuthill_mckee

from fibrous.networks import banded_kernels as kernels
from fibrous.networks.fiber_law import SECTION, FiberLaw
from fibrous.networks.geometry import Geometry

Array = NDArray[np.float64]
Index = NDArray[np.int64]


@dataclass(frozen=True)
class Point:
    """A network at some F and u, in equilibrium or not.

    gradient : F, shape (3, 3)
    displacement : u in the order of the band and a last row of zeros for the boundary, shape (n + 1, 3), edges
    vectors : end-to-end vectors of the fibres, shape (fibers, 3), edges
    stretches : shape (fibers,)
    forces : force vectors of the fibres, shape (fibers, 3), kA
    tension, axial : of the stiffness block ``tension I + axial d ⊗ d``, shape (fibers,)
    residual : gradient of the energy in u, shape (3 n,), kA
    """

    gradient: Array
    displacement: Array
    vectors: Array
    stretches: Array
    forces: Array
    tension: Array
    axial: Array
    residual: Array

    @property
    def force_scale(self) -> float:
        """Root mean square of the fibre forces over kA, and no less than 1."""
        return max(1.0, float(np.sqrt(np.einsum("mi,mi->", self.forces, self.forces) / len(self.forces))))


class Assembly:
    """One network with its fibre law, ordered once; every method is a function of its arguments.

    Factors live in one buffer: a factor is valid until the next call of `factor`.

    Attributes
    ----------
    size : number n of interior nodes
    nodes : the network's number of the node at each place of the order, shape (n,)
    reference : end-to-end vectors D at rest from tail to head, shape (fibers, 3), edges
    lengths : rest lengths, shape (fibers,), edges
    section : kA of the fibres over the network's kA, shape (fibers,) or (1,)
    """

    def __init__(self, network: Geometry, law: FiberLaw) -> None:
        self.network, self.law = network, law
        interior = np.flatnonzero(~network.node_is_boundary)
        self.size = len(interior)
        number = np.full(len(network.node_position), self.size)
        number[interior] = np.arange(self.size)
        self.nodes = interior[narrowest_order(number[network.fiber_nodes], network.node_position[interior])]
        number[self.nodes] = np.arange(self.size)
        ends = number[network.fiber_nodes]
        backward = ends[:, 0] > ends[:, 1]
        ends.sort(axis=1)
        self._tails, self._heads = np.ascontiguousarray(ends.T)
        self.reference = np.where(backward[:, None], -1.0, 1.0) * network.fiber_vectors
        fibers = law.fibers(network.fiber_lengths)
        self.lengths, self.section = fibers.rest_lengths, fibers.constants[:, SECTION]
        self._band = np.empty((3 * self.size, 3 * (_bandwidth(ends, self.size) + 1)))

    def evaluate(self, gradient: Array, displacement: Array) -> Point:
        """Stretches, forces and residual at F, shape (3, 3), and u, shape (n + 1, 3)."""
        vectors = np.empty_like(self.reference)
        stretches = kernels.stretch_fibers(
            gradient, displacement, self.reference, self.lengths, self._tails, self._heads, vectors
        )
        # A trial may stretch a fibre beyond the range of floats; whoever asked refuses it for not being finite.
        with np.errstate(over="ignore", invalid="ignore", divide="ignore"):
            force, stiffness = (self.section * values for values in self.law.response(stretches))
            current = stretches * self.lengths
            tension = force / current
            axial = (stiffness / self.lengths - tension) / (current * current)
            forces = tension[:, None] * vectors
        residual = kernels.sum_at_nodes(forces, self._tails, self._heads, self.size).ravel()
        return Point(gradient, displacement, vectors, stretches, forces, tension, axial, residual)

    def energy(self, point: Point) -> float:
        """Energy of all fibres, kA edges."""
        with np.errstate(over="ignore", invalid="ignore"):
            return float((self.section * self.lengths) @ self.law.energy(point.stretches))

    def hessian(self, point: Point, share: float = 0.0) -> Array:
        """Lower band of the Hessian, shape (width, 3 n), in the layout of LAPACK; valid until the next call.

        `share` of the compressed fibres' negative tension is left out across them, and none along them: with 1 the
        matrix is positive semidefinite.
        """
        tension, axial = point.tension, point.axial
        if share:
            removed = share * np.minimum(tension, 0.0)
            axial = axial + removed / np.einsum("mi,mi->m", point.vectors, point.vectors)
            tension = tension - removed
        kernels.assemble(point.vectors, tension, axial, self._tails, self._heads, self._band)
        return self._band.T

    def factor(self, point: Point, share: float = 0.0) -> Array | None:
        """Banded Cholesky factor of the Hessian, or None where it is not positive definite."""
        if self.size == 0:
            return self._band.T
        factor, info = lapack.dpbtrf(self.hessian(point, share), lower=1, overwrite_ab=1)
        return factor if info == 0 else None

    def solve(self, factor: Array, right: Array) -> Array:
        """K⁻¹ applied to one or several right sides, shape (3 n,) or (3 n, m)."""
        return lapack.dpbtrs(factor, right, lower=1)[0] if self.size else right

    def displacement_rate(self, point: Point, factor: Array, gradient_rate: Array) -> Array:
        """∂u/∂F : dF = −K_uu⁻¹ K_uF dF for dF of shape (3, 3); shape (3 n,), edges."""
        return -self.solve(factor, self._residual_rate(point, gradient_rate)[1])

    def stress(self, point: Point) -> Array:
        """Σ f ⊗ D, shape (3, 3), kA edges: with the volume, the first Piola-Kirchhoff stress dW/dF."""
        return point.forces.T @ self.reference

    def condensed_tangent(self, point: Point, factor: Array) -> Array:
        """K_FF − K_Fu K_uu⁻¹ K_uF, the derivative of `stress` along equilibria, (3, 3, 3, 3) as ∂P_iJ/∂F_kL."""
        rates = [self._residual_rate(point, unit) for unit in np.eye(9).reshape(9, 3, 3)]
        direct = np.stack([(forces.T @ self.reference).ravel() for forces, _ in rates], axis=1)
        coupling = np.stack([residual for _, residual in rates], axis=1)
        return (direct - coupling.T @ self.solve(factor, coupling)).reshape(3, 3, 3, 3)

    def moved(self, displacement: Array, move: Array) -> Array:
        """The displacement, shape (n + 1, 3), after a move of the unknowns, shape (3 n,)."""
        moved = displacement.copy()
        moved[:-1] += move.reshape(self.size, 3)
        return moved

    def _residual_rate(self, point: Point, gradient_rate: Array) -> tuple[Array, Array]:
        forces = kernels.force_rates(gradient_rate, self.reference, point.vectors, point.tension, point.axial)
        return forces, kernels.sum_at_nodes(forces, self._tails, self._heads, self.size).ravel()


def narrowest_order(ends: Index, position: Array) -> Index:
    """Order of the interior nodes whose Hessian has the narrowest band, shape (n,).

    Reverse Cuthill-McKee, or sweeping the nodes along one axis: in an aligned network, whose fibres span few layers
    across their direction, the sweep is often the narrower. `ends` are interior numbers of the fibres' ends, shape
    (fibers, 2), with n for every boundary node; `position` is theirs, shape (n, 3).
    """
    size = len(position)
    inside = ends[(ends < size).all(axis=1)]
    graph = coo_array((np.ones(len(inside)), (inside[:, 0], inside[:, 1])), shape=(size, size))
    sweeps = [np.argsort(along, kind="stable") for along in position.T]
    orders = [*sweeps, reverse_cuthill_mckee(csr_array(graph + graph.T), symmetric_mode=True) if size else sweeps[0]]

    def bandwidth(order: Index) -> int:
        place = np.full(size + 1, size)
        place[order] = np.arange(size)
        return _bandwidth(place[ends], size)

    return np.asarray(min(orders, key=bandwidth), dtype=np.int64)


def _bandwidth(ends: Index, size: int) -> int:
    inside = (ends < size).all(axis=1)
    return int(np.abs(ends[inside, 0] - ends[inside, 1]).max(initial=0))
