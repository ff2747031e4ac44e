"""The discrete fibre network as a material: at every Gauss point a network in equilibrium under the local F (FE²).

P and the consistent tangent come from the fibres by static condensation. The state of a Gauss point is the fluctuation
u of its network with what predicts it at the next F: its rate ∂u/∂F and the bend of the path. Every state that is
returned is a stable equilibrium, found by `networks.engine`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import cache
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from fibrous.clock import Clock
from fibrous.errors import ConvergenceError, FibrousError, naming
from fibrous.materials.contract import Material, MaterialError, State
from fibrous.networks import kernels
from fibrous.networks.engine import Engine
from fibrous.networks.guard import LIMITS, Limits
from fibrous.networks.lanes import LANES
from fibrous.networks.network import Network
from fibrous.networks.relaxation import CONVERGED

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Count = NDArray[np.int64]


class NetworkState(NamedTuple):
    """Networks in equilibrium. The first axis of every array is the element and the last the Gauss point.

    There are always eight of the latter: fewer are filled up by copies of the last. Nodes are in the order of
    `Engine.nodes`; rows beyond an element's own interior nodes, one at the least, are zero.

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


@cache
def _pool(threads: int) -> ThreadPoolExecutor:
    """Threads that stay, since each has a room of its own for what it solves."""
    return ThreadPoolExecutor(threads)


@dataclass(frozen=True, repr=False)
class FiberNetworks(Material):
    """W = (1/V) Σ kA L w(λ) over the fibres of a network in equilibrium under F, one network per element (Eq. 4.1).

    Parameters
    ----------
    engines : of the elements' networks
    scale : k A/χ² of the elements' networks, shape (elements,), MPa
    rows : nodes that a state has room for in every element, one more than interior nodes at the least
    threads : elements worked on at a time; results do not depend on it
    first_element : number of the first of these elements, for messages

    Raises MaterialError for a number of threads out of range.
    """

    engines: tuple[Engine, ...]
    scale: Array
    rows: int
    threads: int = 1
    first_element: int = 0

    def __post_init__(self) -> None:
        if self.threads < 1:
            raise MaterialError(f"threads is {self.threads}; it must be at least 1")

    @classmethod
    def of(
        cls, networks: Sequence[Network], threads: int = 1, limits: Limits = LIMITS, clock: Clock | None = None
    ) -> Self:
        """The material of one network per element; the rest as of `Engine`."""
        clock = clock or Clock()
        engines = tuple(network.engine(limits, clock) for network in networks)
        scale = np.array([network.stress_unit_MPa for network in networks])
        return cls(engines, scale, 1 + max(engine.size for engine in engines), threads)

    def __repr__(self) -> str:
        return f"<FiberNetworks: one in each of {len(self.engines)} elements>"

    def of_elements(self, elements: slice) -> Self:
        """The same law for a range of elements."""
        start = elements.indices(len(self.engines))[0]
        return replace(
            self, engines=self.engines[elements], scale=self.scale[elements], first_element=self.first_element + start
        )

    def __call__(self, gradient: Array, state: State = None, near: State = None) -> tuple[Array, Array, NetworkState]:
        """P, A, both in MPa, and the new state, for F of shape (elements, Gauss points, 3, 3), at most eight points.

        Without a state the networks come from rest. Raises ConvergenceError, naming element and Gauss point, where a
        network finds no stable equilibrium, NetworkError where one is a mechanism at rest, and MaterialError where F
        has other leading axes.
        """
        shape = np.shape(gradient)
        if len(shape) != 4 or shape[0] != len(self.engines) or not 1 <= shape[1] <= LANES:
            raise MaterialError(
                f"deformation gradients have the shape {shape}; {len(self.engines)} networks, one per element, "
                f"need ({len(self.engines)}, Gauss points, 3, 3) with at most {LANES} points"
            )
        points = shape[1]
        filled = np.minimum(np.arange(LANES), points - 1)
        F = np.ascontiguousarray(np.moveaxis(np.asarray(gradient, dtype=float), 1, -1)[..., filled])
        P, A, new = self._moved(F, self._rest() if state is None else state, near)
        P, A = (self.scale[:, None, None, None] * np.moveaxis(values[..., :points], -1, 1) for values in (P, A))
        return P, A.reshape(*shape[:2], 3, 3, 3, 3), new

    def energy(self, gradient: Array) -> Array:
        """W, shape (elements, Gauss points), MPa, of the networks that come from rest to F."""
        state = self(gradient)[2]
        energies = np.empty(np.shape(gradient)[:2])
        for e, q in np.ndindex(*energies.shape):
            engine = self.engines[e]
            energies[e, q] = kernels.stored_energy(
                engine.topology, engine.fibers, state.gradient[e], state.displacement[e], q
            )
        energies[~(np.linalg.det(gradient) > 0.0)] = np.nan
        return self.scale[:, None] * energies

    def node_position(self, state: NetworkState, element: int, point: int) -> Array:
        """Deformed positions of the nodes of a Gauss point's network in its own order, shape (nodes, 3), edges."""
        lane = slice(point, point + 1)
        F, u = state.gradient[element, ..., lane], state.displacement[element, ..., lane]
        return self.engines[element].node_position(F, u)[0]

    def _rest(self) -> NetworkState:
        """Networks at rest, with the rates there."""
        state = self._room()
        state.gradient[...] = np.eye(3)[..., None]

        def element(e: int) -> None:
            with naming(f"element {self.first_element + e}"):
                rest = self.engines[e].rest()
            state.displacement[e, : len(rest.displacement)] = rest.displacement
            self.engines[e].rates(state.rate[e])

        self._over_elements(element)
        return state

    def _moved(self, F: Array, before: NetworkState, near: NetworkState | None) -> tuple[Array, Array, NetworkState]:
        """P, (elements, 3, 3, 8), A, (elements, 9, 9, 8), in kA/edge², and the state at F, (elements, 3, 3, 8)."""
        P, A = np.empty(F.shape), np.empty((len(F), 9, 9, LANES))
        start = before if near is None else near
        # What starts nearby keeps the rates of there: an error in them enters the tangent squared.
        new = self._room(None if near is None else near.rate)
        new.gradient[...] = F
        new.increment[...] = F - before.gradient
        with np.errstate(invalid="ignore"):
            inverted = ~(np.linalg.det(np.moveaxis(F, -1, 1)) > 0.0)
        # At the F of the last equilibrium the answer is that of then, to the bit: a run that goes on needs its bend.
        still = (before.gradient == F).all(axis=(1, 2, 3)) & (near is None)
        goals = np.where(inverted[:, None, None], before.gradient, F)
        guarded: dict[int, Single] = {}

        def element(e: int) -> None:
            engine, u, goal = self.engines[e], new.displacement[e], goals[e]
            kernels.predict(engine.size, goal, start.gradient[e], start.displacement[e], start.rate[e], u)
            if near is None:
                kernels.add_bend(engine.size, goal, before.gradient[e], before.increment[e], before.bend[e], u)
            found = engine.reach(goal, u, before.gradient[e], before.displacement[e], quick=True)
            new.residual[e], new.iterations[e] = found.residual, found.steps
            new.cuts[e], new.indefinite[e] = found.cuts, found.indefinite
            lost = np.flatnonzero((found.status != CONVERGED) & ~inverted[e])
            if lost.size:
                q = lost[0]
                raise ConvergenceError(
                    f"element {self.first_element + e}, Gauss point {q}: its network finds no stable equilibrium after "
                    f"{found.steps[q]} iterations and {found.cuts[q]} cuts"
                )
            rate = new.rate[e]
            if still[e]:
                rate[...] = before.rate[e]
            elif near is None:
                engine.rates(rate, exact=not found.direct.all())
            elif not found.direct.all():
                rate = rate.copy()
                engine.rates(rate, ~found.direct, exact=True)
                guarded[e] = rate
            P[e], A[e] = engine.condense(rate)
            if still[e]:
                new.increment[e], new.bend[e] = before.increment[e], before.bend[e]
                return
            there = before.gradient[e], before.displacement[e], before.rate[e]
            kernels.find_bend(engine.size, F[e], u, rate, *there, new.bend[e])

        self._over_elements(element)
        if guarded:
            new = new._replace(rate=new.rate.copy())
            for e, rate in guarded.items():
                new.rate[e] = rate
        for values in (P, A):
            np.moveaxis(values, -1, 1)[inverted] = np.nan
        for name in ("iterations", "cuts", "indefinite"):
            total = getattr(new, name)
            total += getattr(start, name)
        return P, A, new

    def _over_elements(self, function: Callable[[int], None]) -> None:
        """Each thread takes the next element; of several errors the first element's is raised, whatever the threads."""
        waiting, errors = iter(range(len(self.engines))), dict[int, FibrousError]()

        def work(_: int) -> None:
            for e in waiting:
                try:
                    function(e)
                except FibrousError as error:
                    errors[e] = error

        for _ in _pool(self.threads).map(work, range(self.threads)):
            pass
        if errors:
            raise errors[min(errors)]

    def _room(self, rate: Single | None = None) -> NetworkState:
        """A state to be filled, with rates that are there already or with new ones."""
        count = len(self.engines)
        return NetworkState(
            gradient=np.empty((count, 3, 3, LANES)),
            displacement=np.zeros((count, self.rows, 3, LANES)),
            rate=np.zeros((count, self.rows, 3, 9, LANES), dtype=np.float32) if rate is None else rate,
            increment=np.zeros((count, 3, 3, LANES)),
            bend=np.zeros((count, 2, self.rows, 3, LANES), dtype=np.float32),
            iterations=np.zeros((count, LANES), dtype=np.int64),
            cuts=np.zeros((count, LANES), dtype=np.int64),
            indefinite=np.zeros((count, LANES), dtype=np.int64),
            residual=np.empty((count, LANES)),
        )
