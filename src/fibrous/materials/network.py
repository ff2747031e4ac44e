"""The discrete fibre network as a material: at every Gauss point a network in equilibrium under the local F (FE²).

P and the consistent tangent come from the fibres by static condensation. The state of a Gauss point is the fluctuation
u of its network with what predicts it at the next F: its rate ∂u/∂F and the bend of the path.

A network that leaves the quick way (`networks.relaxation`) is brought to the wanted F from the last equilibrium by the
method that knows indefinite Hessians and cuts (`networks.equilibrium`). Every state that is returned is stable.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field, replace
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from fibrous.clock import Clock
from fibrous.errors import ConvergenceError, NetworkError
from fibrous.materials.contract import MaterialError, State
from fibrous.networks import lane_kernels as kernels
from fibrous.networks.assembly import Assembly
from fibrous.networks.equilibrium import SINGULAR, EquilibriumSolver
from fibrous.networks.equilibrium import State as Equilibrium
from fibrous.networks.fiber_law import FiberLaw
from fibrous.networks.lanes import LANES
from fibrous.networks.network import Network
from fibrous.networks.relaxation import CONVERGED, INDEFINITE, OrderedNetwork, Relaxed, relax

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Count = NDArray[np.int64]


class NetworkState(NamedTuple):
    """Networks in equilibrium. The first axis of every array is the element and the last the Gauss point.

    There are always eight of the latter: fewer are filled up by copies of the last. Nodes are in the order of
    `OrderedNetwork.nodes`; rows beyond an element's own interior nodes, one at the least, are zero.

    gradient : F, shape (elements, 3, 3, 8)
    displacement : fluctuation u, shape (elements, nodes, 3, 8), edges
    rate : ∂u_i/∂F_kL, shape (elements, nodes, 3, 9, 8) with the axis of nine 3 k + L, edges
    increment : F less that of the equilibrium before, shape (elements, 3, 3, 8)
    bend : second and third order of u in the share t of a further `increment`, shape (elements, 2, nodes, 3, 8), edges
    iterations : Newton iterations from rest to here; cuts : times the way of a network was halved; indefinite :
        Hessians met that were not positive definite; all shape (elements, 8)
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
    """W = (1/V) Σ kA L w(λ) over the fibres of a network in equilibrium under F, one network an element (Eq. 4.1).

    Parameters
    ----------
    networks : one an element
    law : fibre law, the same everywhere
    scale : k A/χ² in MPa from `networks.homogenization.stress_scale`, above 0
    rows : nodes that a state has room for in every element, one more than interior nodes at the least
    threads : elements worked on at a time; results do not depend on it
    residual_tolerance : of every network, as of `EquilibriumSolver`
    first_element : number of the first of these elements, for messages
    clock : counts CPU seconds as `networks.relaxation.relax` says

    Raises MaterialError for a scale or a number of threads out of range.
    """

    networks: tuple[OrderedNetwork, ...]
    law: FiberLaw
    scale: float
    rows: int
    threads: int = 1
    residual_tolerance: float = EquilibriumSolver.residual_tolerance
    first_element: int = 0
    clock: Clock = field(default_factory=Clock)

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
        clock: Clock | None = None,
    ) -> Self:
        """The material of one network an element."""
        ordered = tuple(OrderedNetwork.of(network) for network in networks)
        rows = 1 + max(len(one.nodes) for one in ordered)
        return cls(ordered, law, scale, rows, threads, residual_tolerance, clock=clock or Clock())

    def of_elements(self, elements: slice) -> Self:
        """The same law for a range of elements."""
        start = elements.indices(len(self.networks))[0]
        return replace(self, networks=self.networks[elements], first_element=self.first_element + start)

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
        filled = np.minimum(np.arange(LANES), points - 1)
        F = np.ascontiguousarray(np.moveaxis(np.asarray(gradient, dtype=float), 1, -1)[..., filled])
        P, A, new = self._moved(F, self._rest() if state is None else state, near)
        P, A = (self.scale * np.moveaxis(values[..., :points], -1, 1) for values in (P, A))
        return P, A.reshape(*shape[:2], 3, 3, 3, 3), new

    def energy(self, gradient: Array) -> Array:
        """W, shape (elements, Gauss points), MPa, of the networks that come from rest to F."""
        state = self(gradient)[2]
        energies = np.empty(np.shape(gradient)[:2])
        for e, q in np.ndindex(energies.shape):
            network = self.networks[e].network
            position = self.node_position(state, e, q)
            vectors = position[network.fiber_nodes[:, 1]] - position[network.fiber_nodes[:, 0]]
            stretches = np.linalg.norm(vectors, axis=1) / network.fiber_lengths
            energies[e, q] = self.scale * (network.fiber_lengths @ self.law.energy(stretches))
        return energies

    def node_position(self, state: NetworkState, element: int, point: int) -> Array:
        """Deformed positions of the nodes of a Gauss point's network in its own order, shape (nodes, 3), edges."""
        position = self.networks[element].network.node_position @ state.gradient[element, ..., point].T
        return position + self._fluctuation(state, element, point)

    def _fluctuation(self, state: NetworkState, element: int, point: int) -> Array:
        """u of all nodes in the network's own order, shape (nodes, 3), edges."""
        ordered = self.networks[element]
        fluctuation = np.zeros_like(ordered.network.node_position)
        fluctuation[ordered.nodes] = state.displacement[element, : len(ordered.nodes), :, point]
        return fluctuation

    def _rest(self) -> NetworkState:
        """Networks at rest, with the rates there."""
        state = self._room()
        state.gradient[...] = np.eye(3)[..., None]

        def element(e: int) -> None:
            if self._relax(e, state, True, SINGULAR).status[0] != CONVERGED:
                raise NetworkError(
                    f"element {self.first_element + e}: the network is a mechanism at rest: some nodes move without "
                    "stretching a fiber; join more fibers at them (a node needs three out of one plane at the least)"
                )

        self._over_elements(element)
        return state

    def _moved(self, F: Array, before: NetworkState, near: NetworkState | None) -> tuple[Array, Array, NetworkState]:
        """P, (elements, 3, 3, 8), A, (elements, 9, 9, 8), in kA/edge², and the state at F, (elements, 3, 3, 8)."""
        P, A = np.empty(F.shape), np.empty((len(F), 9, 9, LANES))
        status = np.empty((len(F), LANES), dtype=np.int64)
        new, start = self._room(), before if near is None else near
        new.gradient[...] = F
        new.increment[...] = F - before.gradient

        # At the F of the last equilibrium the answer is that of then, to the bit: a run that goes on needs its bend.
        still = [near is None and np.array_equal(new.gradient[e], before.gradient[e]) for e in range(len(F))]

        def element(e: int) -> None:
            size, u = len(self.networks[e].nodes), new.displacement[e]
            # What starts nearby keeps the rates of there: an error in them enters the tangent squared.
            new.rate[e] = start.rate[e]
            kernels.predict(size, F[e], start.gradient[e], start.displacement[e], start.rate[e], u)
            if near is None:
                kernels.add_bend(size, F[e], before.gradient[e], before.increment[e], before.bend[e], u)
            found = self._relax(e, new, near is None and not still[e])
            P[e], A[e], status[e], new.iterations[e] = found.stress, found.tangent, found.status, found.steps

        def bend(e: int) -> None:
            if still[e]:
                new.increment[e], new.bend[e] = before.increment[e], before.bend[e]
                return
            here, there = ((one.gradient[e], one.displacement[e], one.rate[e]) for one in (new, before))
            kernels.find_bend(len(self.networks[e].nodes), *here, *there, new.bend[e])

        self._over_elements(element)
        with np.errstate(invalid="ignore"):
            inverted = ~(np.linalg.det(np.moveaxis(F, -1, 1)) > 0.0)
        for values in (P, A):
            np.moveaxis(values, -1, 1)[inverted] = np.nan
        new.indefinite[...] = status == INDEFINITE
        for e, q in np.argwhere((status != CONVERGED) & ~inverted):
            self._recover(int(e), int(q), before, new, P, A)
        self._over_elements(bend)
        for name in ("iterations", "cuts", "indefinite"):
            total = getattr(new, name)
            total += getattr(start, name)
        return P, A, new

    def _recover(self, e: int, q: int, before: NetworkState, new: NetworkState, P: Array, A: Array) -> None:
        """Bring one network to its F from the last equilibrium by all means; fill its part of P, A and `new`."""
        ordered = self.networks[e]
        solver = EquilibriumSolver(Assembly(ordered.network, self.law), self.residual_tolerance)
        nodes = solver.assembly.nodes
        u = np.zeros((len(nodes) + 1, 3))
        u[:-1] = self._fluctuation(before, e, q)[nodes]
        start = solver.assembly.evaluate(np.ascontiguousarray(before.gradient[e, ..., q]), u)
        found = solver.equilibrium(new.gradient[e, ..., q], near=Equilibrium(start, True, 0))
        new.iterations[e, q] += found.iterations
        new.indefinite[e, q] += found.indefinite
        new.cuts[e, q] += found.cuts

        # Its stress and tangent come from where all others' do: the same network in all lanes.
        alone = self.of_elements(slice(e, e + 1))
        state = alone._room()
        state.gradient[0] = new.gradient[e, ..., q, None]
        place = np.empty(len(ordered.network.node_position), dtype=np.int64)
        place[nodes] = np.arange(len(nodes))
        state.displacement[0, : len(nodes)] = found.point.displacement[place[ordered.nodes], :, None]
        own = alone._relax(0, state, True)
        if not found.converged or own.status[0] != CONVERGED:
            raise ConvergenceError(
                f"element {self.first_element + e}, Gauss point {q}: its network finds no stable equilibrium after "
                f"{new.iterations[e, q]} iterations and {new.cuts[e, q]} cuts"
            )
        for whole, part in ((new.displacement, state.displacement), (new.rate, state.rate)):
            whole[e, ..., q] = part[0, ..., 0]
        new.residual[e, q] = own.residual[0]
        P[e, ..., q], A[e, ..., q] = own.stress[..., 0], own.tangent[..., 0]

    def _relax(self, e: int, state: NetworkState, with_rates: bool, least_pivot: float = 0.0) -> Relaxed:
        """Relax an element's networks from u in `state` at its F."""
        F, u, G = state.gradient[e], state.displacement[e], state.rate[e]
        found = relax(self.networks[e], self.law, self.residual_tolerance, F, u, G, with_rates, least_pivot, self.clock)
        state.residual[e] = found.residual
        return found

    def _over_elements(self, function: Callable[[int], None]) -> None:
        with ThreadPoolExecutor(self.threads) as pool:
            for _ in pool.map(function, range(len(self.networks))):
                pass

    def _room(self) -> NetworkState:
        count = len(self.networks)
        return NetworkState(
            gradient=np.empty((count, 3, 3, LANES)),
            displacement=np.zeros((count, self.rows, 3, LANES)),
            rate=np.zeros((count, self.rows, 3, 9, LANES), dtype=np.float32),
            increment=np.zeros((count, 3, 3, LANES)),
            bend=np.zeros((count, 2, self.rows, 3, LANES), dtype=np.float32),
            iterations=np.zeros((count, LANES), dtype=np.int64),
            cuts=np.zeros((count, LANES), dtype=np.int64),
            indefinite=np.zeros((count, LANES), dtype=np.int64),
            residual=np.empty((count, LANES)),
        )
