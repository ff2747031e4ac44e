"""Equilibrium of a mesh along a path of prescribed displacements: Newton's method with load steps that land on targets.

An increment that does not converge is halved, and doubled again once Newton's method is quick; targets are met
exactly. The criterion compares forces with forces, so that units change no iteration.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from fibrous.errors import ConvergenceError
from fibrous.fe.assembly import Assembly, Point
from fibrous.fe.boundary import PrescribedDisplacement
from fibrous.fe.linear import LinearSolver, Name, linear_solver
from fibrous.fe.mesh import Mesh
from fibrous.materials.contract import Material, State

Array = NDArray[np.float64]

# An increment that converged within this many iterations lets the next one be twice as long.
QUICK = 5
# Relative residual of a linear solution far from equilibrium; nearer, it falls with the residual of the forces.
LOOSE = 1e-3


@dataclass(frozen=True)
class Attempt:
    """One increment that was tried.

    step : number of its target; start, end : parts of the way from the target before, 0 to 1
    residuals : relative residual after each iteration
    failure : why it was given up, empty where it converged
    """

    step: int
    start: float
    end: float
    residuals: tuple[float, ...]
    failure: str


@dataclass(frozen=True)
class Solution:
    """Equilibria at the targets; the leading axis is the step.

    displacement : shape (steps, nodes, 3), mm
    internal_force : shape (steps, nodes, 3), N; at prescribed components the reaction, elsewhere zero to tolerance
    newton_iterations, cuts : shape (steps,), all increments of a step together
    converged : shape (steps,); where it is false, the displacement and force are NaN
    linear_solvers : how many linear systems each solver solved
    state : of the material at the last equilibrium
    attempts : every increment that was tried
    """

    displacement: Array
    internal_force: Array
    newton_iterations: NDArray[np.int64]
    cuts: NDArray[np.int64]
    converged: NDArray[np.bool_]
    linear_solvers: Mapping[str, int]
    state: State
    attempts: tuple[Attempt, ...]


class LoadStepError(ConvergenceError):
    """A target was not reached; `solution` is the part that converged, and holds the attempts."""

    def __init__(self, text: str, solution: Solution) -> None:
        super().__init__(text)
        self.solution = solution


@dataclass(frozen=True)
class LoadStepper:
    """Newton's method for one mesh and one set of prescribed components.

    Parameters
    ----------
    assembly : the mesh and its material
    solve : a linear solver
    tolerance : ‖residual‖ over the norm of the nodal sums of the magnitudes of the elements' forces
    largest_number_of_iterations : for one increment
    largest_number_of_cuts : how often in a row an increment is halved before the target is given up
    """

    assembly: Assembly
    solve: LinearSolver
    tolerance: float = 1e-8
    largest_number_of_iterations: int = 12
    largest_number_of_cuts: int = 8

    @classmethod
    def of(
        cls,
        mesh: Mesh,
        material: Material,
        prescribed: PrescribedDisplacement,
        solver: Name = "auto",
        **limits: float | int,
    ) -> Self:
        """The stepper for the components that are prescribed, whatever their values."""
        assembly = Assembly(mesh, material, prescribed.unknowns(mesh))
        return cls(assembly, linear_solver(solver), **limits)  # type: ignore[arg-type]

    def follow(self, targets: Array, start: Array | None = None, state: State = None) -> Solution:
        """Equilibria at prescribed values, shape (steps, prescribed), mm, in the order of the assembly.

        `start` is the displacement to begin from, shape (nodes, 3), mm, by default none, and `state` the material's
        there. Raises LoadStepError where a target is not reached, with the part before it.
        """
        with threadpool_limits(limits=1, user_api="blas"):
            return _Path(self, targets).follow(start, state)

    def _attempt(self, here: Point, target: Array, used: Counter[str], residuals: list[float]) -> Point:
        """The equilibrium at prescribed values, shape (prescribed,); raises ConvergenceError where none was found.

        Appends to `residuals` and counts solvers in `used`.
        """
        assembly, free, prescribed = self.assembly, self.assembly.free, self.assembly.prescribed
        displacement = here.displacement.copy()
        components = displacement.reshape(-1)
        # The first move answers to the change of the prescribed values with the tangent of the last equilibrium.
        right = -here.internal_force.reshape(-1)[free] - here.coupling @ (target - components[prescribed])
        components[prescribed] = target
        point = here
        for _ in range(self.largest_number_of_iterations):
            size = float(np.linalg.norm(right))
            wanted = self.tolerance * point.force_scale
            accuracy = max(min(LOOSE, size / point.force_scale), 0.1 * wanted / size if size > wanted else 0.1)
            linear = self.solve(point.stiffness, right, accuracy)
            used[linear.solver] += 1
            components[free] += linear.values
            point = assembly.evaluate(displacement.copy(), here.state)
            right = -point.internal_force.reshape(-1)[free]
            residuals.append(float(np.linalg.norm(right)) / point.force_scale)
            if residuals[-1] <= self.tolerance:
                return point
            if not np.isfinite(residuals[-1]):
                raise ConvergenceError(assembly.what_is_not_finite(displacement))
        raise ConvergenceError(f"the residual is {residuals[-1]:.1e} after {len(residuals)} iterations")


class _Path:
    """One walk along targets, with what has been recorded of it."""

    def __init__(self, stepper: LoadStepper, targets: Array) -> None:
        self.stepper, self.targets = stepper, np.asarray(targets, dtype=float)
        steps, nodes = len(self.targets), len(stepper.assembly.mesh.node_position)
        self.displacement, self.force = np.full((2, steps, nodes, 3), np.nan)
        self.iterations, self.cuts = np.zeros((2, steps), dtype=np.int64)
        self.used: Counter[str] = Counter()
        self.attempts: list[Attempt] = []

    def follow(self, start: Array | None, state: State) -> Solution:
        assembly = self.stepper.assembly
        nothing = np.zeros((len(assembly.mesh.node_position), 3))
        here = assembly.evaluate(nothing if start is None else np.asarray(start, dtype=float), state)
        increment = 1.0
        for step in range(len(self.targets)):
            here, increment = self._step(here, step, increment)
            self.displacement[step], self.force[step] = here.displacement, here.internal_force
        return self._solution(len(self.targets), here.state)

    def _step(self, here: Point, step: int, increment: float) -> tuple[Point, float]:
        """The equilibrium at a target, and the increment, as a part of a step, to go on with."""
        before = here.displacement.reshape(-1)[self.stepper.assembly.prescribed]
        reached, cuts_in_a_row = 0.0, 0
        while reached < 1.0:
            end = min(1.0, reached + increment)
            values = self.targets[step] if end == 1.0 else before + end * (self.targets[step] - before)
            residuals: list[float] = []
            failure = ""
            try:
                here = self.stepper._attempt(here, values, self.used, residuals)
            except ConvergenceError as error:
                failure = str(error)
            self.attempts.append(Attempt(step, reached, end, tuple(residuals), failure))
            self.iterations[step] += len(residuals)
            if not failure:
                reached, cuts_in_a_row = end, 0
                increment = min(1.0, 2.0 * increment) if len(residuals) <= QUICK else increment
                continue
            self.cuts[step] += 1
            cuts_in_a_row += 1
            if cuts_in_a_row > self.stepper.largest_number_of_cuts:
                raise LoadStepError(
                    f"step {step}: no equilibrium found beyond {100.0 * reached:.3g} % of its way, with increments "
                    f"down to {100.0 * (end - reached):.2g} %: {failure}; prescribe less, or in more steps",
                    self._solution(step, here.state),
                )
            increment = 0.5 * (end - reached)
        return here, increment

    def _solution(self, converged: int, state: State) -> Solution:
        return Solution(
            self.displacement,
            self.force,
            self.iterations,
            self.cuts,
            np.arange(len(self.targets)) < converged,
            dict(self.used),
            state,
            tuple(self.attempts),
        )
