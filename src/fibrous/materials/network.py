"""The discrete fibre network as a material: at every Gauss point a network in equilibrium under the local F (FE²).

P and the consistent tangent come from the fibres by static condensation. The state of a Gauss point is the fluctuation
u of its network with what predicts it at the next F: its rate ∂u/∂F and the bend of the path.

A network that leaves the quick way (`networks.relaxation`) is brought to the wanted F from the last equilibrium by the
method that knows indefinite Hessians and cuts (`networks.equilibrium`). Every state that is returned is stable.
"""

from __future__ import annotations

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from fibrous.errors import ConvergenceError, NetworkError
from fibrous.materials.contract import MaterialError, State
from fibrous.networks import lapack, relaxation
from fibrous.networks.equilibrium import LARGEST_MOVE, SINGULAR, EquilibriumSolver, reproducible
from fibrous.networks.equilibrium import State as Equilibrium
from fibrous.networks.fiber_law import FiberLaw
from fibrous.networks.network import Network

Array = NDArray[np.float64]
Single = NDArray[np.float32]
Count = NDArray[np.int64]


class NetworkState(NamedTuple):
    """Networks in equilibrium; the leading axes of every array are (elements, Gauss points).

    Nodes are in the order of `Assembly.nodes`; rows beyond an element's own interior nodes, one at the least, are zero.

    gradient : F, shape (..., 3, 3)
    displacement : fluctuation u, shape (..., nodes, 3), edges
    rate : ∂u_i/∂F_kL, shape (..., nodes, 3, 9) with the last axis 3 k + L, edges
    increment : F less that of the equilibrium before, shape (..., 3, 3)
    bend : second and third order of u in the share t of a further `increment`, shape (..., 2, nodes, 3), edges
    iterations : Newton iterations from rest to here; cuts : times the way of a network was halved; indefinite : Hessians
        met that were not positive definite; all shape (...)
    residual : ‖r‖/(√n max(1, f_rms)) with n interior nodes and forces in kA, shape (...)
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
    solvers : one an element, all with the same fibre law
    scale : k A/χ² in MPa from `networks.homogenization.stress_scale`, above 0
    threads : networks worked on at a time; results do not depend on it
    first_element : number of the first of these elements, for messages

    Raises MaterialError for a scale or a number of threads out of range.
    """

    solvers: tuple[EquilibriumSolver, ...]
    scale: float
    threads: int = 1
    first_element: int = 0

    def __post_init__(self) -> None:
        if not (np.isfinite(self.scale) and self.scale > 0.0):
            raise MaterialError(f"scale is {self.scale}; it must be a number above 0")
        if self.threads < 1:
            raise MaterialError(f"threads is {self.threads}; it must be at least 1")

    @classmethod
    def of(cls, networks: Sequence[Network], law: FiberLaw, scale: float, threads: int = 1) -> Self:
        """The material of one network an element, with a solver of default limits for each."""
        return cls(tuple(EquilibriumSolver.of(network, law) for network in networks), scale, threads)

    def of_elements(self, elements: slice) -> Self:
        """The same law for a range of elements."""
        start = elements.indices(len(self.solvers))[0]
        return replace(self, solvers=self.solvers[elements], first_element=self.first_element + start)

    def __call__(self, gradient: Array, state: State = None, near: State = None) -> tuple[Array, Array, NetworkState]:
        """P, A, both in MPa, and the new state, for F of shape (elements, Gauss points, 3, 3).

        Without a state the networks come from rest. Raises ConvergenceError, naming element and Gauss point, where a
        network finds no stable equilibrium, NetworkError where one is a mechanism at rest, and MaterialError where F
        has other leading axes.
        """
        F = np.ascontiguousarray(gradient, dtype=float)
        if F.ndim != 4 or len(F) != len(self.solvers):
            raise MaterialError(
                f"deformation gradients have the shape {F.shape}; {len(self.solvers)} networks, one an element, "
                f"need ({len(self.solvers)}, Gauss points, 3, 3)"
            )
        with reproducible():
            before = self._rest(F.shape[1]) if state is None else state
            return self._advanced(F, before, near)

    def energy(self, gradient: Array) -> Array:
        """W, shape (elements, Gauss points), MPa, of the networks that come from rest to F."""
        F = np.ascontiguousarray(gradient, dtype=float)
        state = self(F)[2]
        energies = np.empty(F.shape[:2])
        for e, q in np.ndindex(F.shape[:2]):
            assembly = self.solvers[e].assembly
            point = assembly.evaluate(F[e, q], state.displacement[e, q, : assembly.size + 1])
            energies[e, q] = self.scale * assembly.energy(point)
        return energies

    def _rest(self, points: int) -> NetworkState:
        """Networks at rest, with the rates there."""
        state = self._empty(1)
        state.displacement[...] = 0.0
        state.gradient[...] = np.eye(3)
        none = (np.empty((1, 3, 3)), np.empty((1, 9, 9)))

        def element(e: int) -> None:
            counts = self._relax(e, slice(None), state, True, *none, least_pivot=SINGULAR)
            if counts[0, 0] != relaxation.CONVERGED:
                raise NetworkError(
                    f"element {self.first_element + e}: the network is a mechanism at rest: some nodes move without "
                    "stretching a fiber; join more fibers at them (a node needs three out of one plane at the least)"
                )

        self._over_elements(element)
        return NetworkState(*(np.repeat(part, points, axis=1) for part in state))

    def _advanced(self, F: Array, before: NetworkState, near: NetworkState | None) -> tuple[Array, Array, NetworkState]:
        points = F.shape[1]
        P, A = np.empty((len(F), points, 3, 3)), np.empty((len(F), points, 9, 9))
        new = self._empty(points)
        start = before if near is None else near
        # What is reached from nearby keeps the rates of there: an error in them enters the tangent squared.
        new.rate[...] = start.rate
        new.gradient[...] = F
        new.increment[...] = F - before.gradient
        found = np.empty((*F.shape[:2], 3), dtype=np.int64)

        def element(e: int) -> None:
            size = self.solvers[e].assembly.size
            u = new.displacement[e]
            u[...] = 0.0
            relaxation.predict(size, F[e], start.gradient[e], start.displacement[e], start.rate[e], u)
            if near is None:
                relaxation.add_bend(size, F[e], before.gradient[e], before.increment[e], before.bend[e], u)
            found[e] = self._relax(e, slice(None), new, near is None, P[e], A[e])

        self._over_elements(element)
        status = found[..., 0]
        for part, now in (
            (new.iterations, found[..., 1]),
            (new.cuts, 0),
            (new.indefinite, status == relaxation.INDEFINITE),
        ):
            part[...] = now
        for e, q in np.argwhere(status != relaxation.CONVERGED):
            self._recover(int(e), int(q), before, new, P, A)
        for total, part in zip(
            (new.iterations, new.cuts, new.indefinite), (start.iterations, start.cuts, start.indefinite), strict=True
        ):
            total += part

        def bend(e: int) -> None:
            relaxation.find_bend(
                self.solvers[e].assembly.size,
                *(F[e], new.displacement[e], new.rate[e]),
                *(before.gradient[e], before.displacement[e], before.rate[e]),
                new.bend[e],
            )

        self._over_elements(bend)
        P *= self.scale
        A *= self.scale
        return P, A.reshape(*F.shape[:2], 3, 3, 3, 3), new

    def _recover(self, e: int, q: int, before: NetworkState, new: NetworkState, P: Array, A: Array) -> None:
        """Bring one network to its F from the last equilibrium by all means; fill its part of P, A and `new`."""
        solver = self.solvers[e]
        size = solver.assembly.size
        start = solver.assembly.evaluate(before.gradient[e, q], before.displacement[e, q, : size + 1])
        there = solver.equilibrium(new.gradient[e, q], near=Equilibrium(start, True, 0))
        new.displacement[e, q, :size] = there.point.displacement[:size]
        spent = new.iterations[e, q] + there.iterations
        one = slice(q, q + 1)
        if (
            not there.converged
            or self._relax(e, one, new, True, P[e, one], A[e, one])[0, 0] != relaxation.CONVERGED
        ):
            raise ConvergenceError(
                f"element {self.first_element + e}, Gauss point {q}: its network finds no stable equilibrium after "
                f"{spent} iterations and {there.cuts} cuts"
            )
        new.iterations[e, q] = spent
        new.cuts[e, q] = there.cuts
        new.indefinite[e, q] += there.indefinite

    def _relax(
        self, e: int, points: slice, state: NetworkState, with_rates: bool, P: Array, A: Array, least_pivot: float = 0.0
    ) -> Count:
        """Relax an element's networks from u in `state` at its F; what became of them, steps and factors."""
        solver = self.solvers[e]
        assembly = solver.assembly
        counts = np.empty((len(P), 3), dtype=np.int64)
        relaxation.relax(
            lapack.ADDRESSES,
            (assembly.law.nonlinearity, assembly.law.linear_beyond),
            (assembly.reference, assembly.lengths, assembly.tails, assembly.heads),
            assembly.size,
            assembly.width,
            solver.residual_tolerance,
            LARGEST_MOVE,
            least_pivot,
            state.gradient[e, points],
            state.displacement[e, points],
            state.rate[e, points],
            with_rates,
            P,
            A,
            state.residual[e, points],
            counts,
        )
        return counts

    def _over_elements(self, function) -> None:
        with ThreadPoolExecutor(self.threads) as pool:
            for _ in pool.map(function, range(len(self.solvers))):
                pass

    def _empty(self, points: int) -> NetworkState:
        leading = (len(self.solvers), points)
        nodes = 1 + max(solver.assembly.size for solver in self.solvers)
        return NetworkState(
            np.empty((*leading, 3, 3)),
            np.empty((*leading, nodes, 3)),
            np.zeros((*leading, nodes, 3, 9), dtype=np.float32),
            np.zeros((*leading, 3, 3)),
            np.zeros((*leading, 2, nodes, 3), dtype=np.float32),
            *(np.zeros(leading, dtype=np.int64) for _ in range(3)),
            np.empty(leading),
        )
