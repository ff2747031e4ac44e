"""The discrete fibre network as a material: at every Gauss point a network in equilibrium under the local F (FE²).

P and the consistent tangent come from the fibres by static condensation. The state of a Gauss point is the fluctuation
u of its network with what predicts it at the next F: its rate ∂u/∂F and the bend of the path.

A network that leaves the quick way (`networks.relaxation`) is brought to the wanted F from the last equilibrium by the
method that knows indefinite Hessians and cuts (`networks.equilibrium`). Every state that is returned is stable.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from fibrous.errors import ConvergenceError, NetworkError
from fibrous.materials.contract import MaterialError, State
from fibrous.networks import relaxation
from fibrous.networks.assembly import Assembly
from fibrous.networks.equilibrium import LARGEST_MOVE, SINGULAR, EquilibriumSolver, reproducible
from fibrous.networks.equilibrium import State as Equilibrium
from fibrous.networks.fiber_law import FiberLaw
from fibrous.networks.lanes import LANES
from fibrous.networks.network import Network
from fibrous.networks.relaxation import Ordered

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Count = NDArray[np.int64]


class NetworkState(NamedTuple):
    """Networks in equilibrium. The first axis of every array is the element and the last the Gauss point.

    There are always eight of the latter: fewer are filled up by copies of the last. Nodes are in the order of
    `Ordered.nodes`; rows beyond an element's own interior nodes, one at the least, are zero.

    gradient : F, shape (elements, 3, 3, 8)
    displacement : fluctuation u, shape (elements, nodes, 3, 8), edges
    rate : ∂u_i/∂F_kL, shape (elements, nodes, 3, 9, 8) with the axis of nine 3 k + L, edges
    increment : F less that of the equilibrium before, shape (elements, 3, 3, 8)
    bend : second and third order of u in the share t of a further `increment`, shape (elements, 2, nodes, 3, 8), edges
    iterations : Newton iterations from rest to here; cuts : times the way of a network was halved; indefinite : Hessians
        met that were not positive definite; all shape (elements, 8)
    residual : ‖r‖/(√n max(1, f_rms)) with n interior nodes and forces in kA, shape (elements, 8)
    """

    gradient: Array
    displacement: Array
    rate: Single
    increment: Array
    bend: Single
    iterations: Count
    cuts: Count
    indefinite: Count
    residual: Array


@dataclass(frozen=True)
class FiberNetworks:
    """W = (1/V) Σ kA L w(λ) over the fibres of a network in equilibrium under F, one network an element.

    Parameters
    ----------
    networks, ordered : one network an element, as it is and in the order of elimination
    most_nodes : interior nodes that a state has room for in every element
    law : fibre law, the same everywhere
    scale : k A/χ² in MPa from `networks.homogenization.stress_scale`, above 0
    threads : elements worked on at a time; results do not depend on it
    residual_tolerance : of every network, as of `EquilibriumSolver`
    first_element : number of the first of these elements, for messages

    Raises MaterialError for a scale or a number of threads out of range.
    """

    networks: tuple[Network, ...]
    ordered: tuple[Ordered, ...]
    most_nodes: int
    law: FiberLaw
    scale: float
    threads: int = 1
    residual_tolerance: float = EquilibriumSolver.residual_tolerance
    first_element: int = 0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.scale) and self.scale > 0.0):
            raise MaterialError(f"scale is {self.scale}; it must be a number above 0")
        if self.threads < 1:
            raise MaterialError(f"threads is {self.threads}; it must be at least 1")

    @classmethod
    def of(
        cls,
        networks: Sequence[Network],
        law: FiberLaw,
        scale: float,
        threads: int = 1,
        residual_tolerance: float = EquilibriumSolver.residual_tolerance,
    ) -> Self:
        """The material of one network an element."""
        ordered = tuple(Ordered.of(network) for network in networks)
        most_nodes = max(len(one.nodes) for one in ordered)
        return cls(tuple(networks), ordered, most_nodes, law, scale, threads, residual_tolerance)

    def of_elements(self, elements: slice) -> Self:
        """The same law for a range of elements."""
        start = elements.indices(len(self.networks))[0]
        return replace(
            self,
            networks=self.networks[elements],
            ordered=self.ordered[elements],
            first_element=self.first_element + start,
        )

    def __call__(self, gradient: Array, state: State = None, near: State = None) -> tuple[Array, Array, NetworkState]:
        """P, A, both in MPa, and the new state, for F of shape (elements, Gauss points, 3, 3), at most eight points.

        Without a state the networks come from rest. Raises ConvergenceError, naming element and Gauss point, where a
        network finds no stable equilibrium, NetworkError where one is a mechanism at rest, and MaterialError where F
        has other leading axes.
        """
        shape = np.shape(gradient)
        if len(shape) != 4 or shape[0] != len(self.networks) or not 1 <= shape[1] <= LANES:
            raise MaterialError(
                f"deformation gradients have the shape {shape}; {len(self.networks)} networks, one an element, "
                f"need ({len(self.networks)}, Gauss points, 3, 3) with at most {LANES} points"
            )
        points = shape[1]
        lanes = np.minimum(np.arange(LANES), points - 1)
        F = np.ascontiguousarray(np.moveaxis(np.asarray(gradient, dtype=float), 1, -1)[..., lanes])
        with reproducible():
            P, A, new = self._advanced(F, self._rest() if state is None else state, near)
        stress, tangent = (np.moveaxis(values[..., :points], -1, 1) for values in (P, A))
        return stress, tangent.reshape(*shape[:2], 3, 3, 3, 3), new

    def energy(self, gradient: Array) -> Array:
        """W, shape (elements, Gauss points), MPa, of the networks that come from rest to F."""
        state = self(gradient)[2]
        energies = np.empty(np.shape(gradient)[:2])
        for e, q in np.ndindex(energies.shape):
            assembly = Assembly(self.networks[e], self.law)
            displacement = self._in_order_of(assembly, e, state.displacement[e, ..., q])
            point = assembly.evaluate(np.ascontiguousarray(state.gradient[e, ..., q]), displacement)
            energies[e, q] = self.scale * assembly.energy(point)
        return energies

    def _rest(self) -> NetworkState:
        """Networks at rest, with the rates there."""
        state = self._empty()
        state.displacement[...] = 0.0
        state.gradient[...] = np.eye(3)[..., None]
        P, A = np.empty((3, 3, LANES)), np.empty((9, 9, LANES))

        def element(e: int) -> None:
            if self._relax(e, state, True, P.copy(), A.copy(), least_pivot=SINGULAR)[0, 0] != relaxation.CONVERGED:
                raise NetworkError(
                    f"element {self.first_element + e}: the network is a mechanism at rest: some nodes move without "
                    "stretching a fiber; join more fibers at them (a node needs three out of one plane at the least)"
                )

        self._over_elements(element)
        return state

    def _advanced(self, F: Array, before: NetworkState, near: NetworkState | None) -> tuple[Array, Array, NetworkState]:
        """P, (elements, 3, 3, lanes), A, (elements, 9, 9, lanes), and the state at F, (elements, 3, 3, lanes)."""
        P, A = np.empty(F.shape), np.empty((len(F), 9, 9, LANES))
        new = self._empty()
        start = before if near is None else near
        new.gradient[...] = F
        new.increment[...] = F - before.gradient
        found = np.empty((len(F), 2, LANES), dtype=np.int64)

        def element(e: int) -> None:
            size, u = len(self.ordered[e].nodes), new.displacement[e]
            # What is reached from nearby keeps the rates of there: an error in them enters the tangent squared.
            new.rate[e] = start.rate[e]
            relaxation.predict(size, F[e], start.gradient[e], start.displacement[e], start.rate[e], u)
            if near is None:
                relaxation.add_bend(size, F[e], before.gradient[e], before.increment[e], before.bend[e], u)
            found[e] = self._relax(e, new, near is None, P[e], A[e])

        self._over_elements(element)
        status = found[:, 0]
        new.iterations[...] = found[:, 1]
        new.indefinite[...] = status == relaxation.INDEFINITE
        for e, q in np.argwhere(status != relaxation.CONVERGED):
            self._recover(int(e), int(q), before, new, P, A)
        for name in ("iterations", "cuts", "indefinite"):
            getattr(new, name)[...] += getattr(start, name)

        def bend(e: int) -> None:
            relaxation.find_bend(
                len(self.ordered[e].nodes),
                *(F[e], new.displacement[e], new.rate[e]),
                *(before.gradient[e], before.displacement[e], before.rate[e]),
                new.bend[e],
            )

        self._over_elements(bend)
        P *= self.scale
        A *= self.scale
        return P, A, new

    def _recover(self, e: int, q: int, before: NetworkState, new: NetworkState, P: Array, A: Array) -> None:
        """Bring one network to its F from the last equilibrium by all means; fill its part of P, A and `new`."""
        solver = EquilibriumSolver(Assembly(self.networks[e], self.law), self.residual_tolerance)
        displacement = self._in_order_of(solver.assembly, e, before.displacement[e, ..., q])
        start = solver.assembly.evaluate(np.ascontiguousarray(before.gradient[e, ..., q]), displacement)
        there = solver.equilibrium(new.gradient[e, ..., q], near=Equilibrium(start, True, 0))
        alone = self.of_elements(slice(e, e + 1))._empty()
        nodes = self.ordered[e].nodes
        place = np.argsort(solver.assembly.nodes)[np.searchsorted(np.sort(nodes), nodes)]
        alone.gradient[...] = new.gradient[[e], ..., q][..., None]
        alone.displacement[...] = 0.0
        alone.displacement[0, : len(nodes)] = there.point.displacement[place][..., None]
        found_P, found_A = np.empty((3, 3, LANES)), np.empty((9, 9, LANES))
        relaxed = there.converged and self.of_elements(slice(e, e + 1))._relax(0, alone, True, found_P, found_A)[0, 0] == 0
        spent = new.iterations[e, q] + there.iterations
        if not relaxed:
            raise ConvergenceError(
                f"element {self.first_element + e}, Gauss point {q}: its network finds no stable equilibrium after "
                f"{spent} iterations and {there.cuts} cuts"
            )
        new.displacement[e, ..., q] = alone.displacement[0, ..., 0]
        new.rate[e, ..., q] = alone.rate[0, ..., 0]
        P[e, ..., q], A[e, ..., q] = found_P[..., 0], found_A[..., 0]
        new.residual[e, q] = alone.residual[0, 0]
        new.iterations[e, q] = spent
        new.cuts[e, q] = there.cuts
        new.indefinite[e, q] += there.indefinite

    def _in_order_of(self, assembly: Assembly, e: int, displacement: Array) -> Array:
        """A network's displacement, (≥ n + 1, 3) in the order of elimination, in an assembly's, (n + 1, 3)."""
        nodes = self.ordered[e].nodes
        ordered = np.zeros((len(nodes) + 1, 3))
        ordered[np.argsort(assembly.nodes)[np.searchsorted(np.sort(nodes), nodes)]] = displacement[: len(nodes)]
        return ordered

    def _relax(
        self, e: int, state: NetworkState, with_rates: bool, P: Array, A: Array, least_pivot: float = 0.0
    ) -> Count:
        """Relax an element's networks from u in `state` at its F; what became of them and their steps, (2, lanes)."""
        counts = np.empty((2, LANES), dtype=np.int64)
        relaxation.relax(
            self.ordered[e].topology,
            (self.law.nonlinearity, self.law.linear_beyond),
            self.residual_tolerance,
            LARGEST_MOVE,
            least_pivot,
            *(state.gradient[e], state.displacement[e], state.rate[e], with_rates),
            *(P, A, state.residual[e], counts),
        )
        return counts

    def _over_elements(self, function: Callable[[int], None]) -> None:
        with ThreadPoolExecutor(self.threads) as pool:
            for _ in pool.map(function, range(len(self.networks))):
                pass

    def _empty(self) -> NetworkState:
        count, nodes = len(self.networks), self.most_nodes + 1
        return NetworkState(
            np.empty((count, 3, 3, LANES)),
            np.empty((count, nodes, 3, LANES)),
            np.zeros((count, nodes, 3, 9, LANES), dtype=np.float32),
            np.zeros((count, 3, 3, LANES)),
            np.zeros((count, 2, nodes, 3, LANES), dtype=np.float32),
            *(np.zeros((count, LANES), dtype=np.int64) for _ in range(3)),
            np.empty((count, LANES)),
        )
