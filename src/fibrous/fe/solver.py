"""Equilibrium of a mesh along a path of prescribed displacements: Newton's method with load steps that land on targets.

An increment that does not converge is halved, and doubled again once Newton's method is quick; targets are met
exactly. The criterion compares forces with forces, so that units change no iteration.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray
from threadpoolctl import threadpool_limits

from fibrous.clock import Clock
from fibrous.errors import ConvergenceError
from fibrous.fe.assembly import Assembly, Point
from fibrous.fe.boundary import PrescribedDisplacement
from fibrous.fe.linear import LinearSolver, Name, linear_solver
from fibrous.fe.mesh import Mesh
from fibrous.materials.contract import Material, State, arrays_of, join

Array = NDArray[np.float64]

# An increment that converged within this many iterations lets the next one be twice as long.
QUICK = 5
# Relative residual of a linear solution far from equilibrium; nearer, it falls with the residual of the forces.
LOOSE = 1e-5
# Largest part of a change of the prescribed values that may lie off the line of the change before, for the two to tell
# the curvature of the path.
STRAIGHT = 0.1
# Changes, in the length of the change before, over which the curvature still predicts; beyond, rounding is blown up.
LONGEST = 4.0


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
    deformation_gradient, stress : F and the first Piola–Kirchhoff stress at the Gauss points, MPa, shape
        (steps, elements, 8, 3, 3)
    newton_iterations, cuts : shape (steps,), all increments of a step together
    converged : shape (steps,); where it is false, the fields are NaN
    linear_solvers : how many linear systems each solver solved
    state : of the material at the last equilibrium
    attempts : every increment that was tried
    """

    displacement: Array
    internal_force: Array
    deformation_gradient: Array
    stress: Array
    newton_iterations: NDArray[np.int64]
    cuts: NDArray[np.int64]
    converged: NDArray[np.bool_]
    linear_solvers: Mapping[str, int]
    state: State
    attempts: tuple[Attempt, ...]


class LoadStepError(ConvergenceError):
    """A target was not reached; `solution` is the part that converged, and holds the attempts.

    step : number of the target, from 0; the text counts steps from 1, as files do
    reason : why it was given up, and what to do
    """

    def __init__(self, step: int, reason: str, solution: Solution) -> None:
        super().__init__(f"step {step + 1}: {reason}")
        self.step, self.reason, self.solution = step, reason, solution


@dataclass(frozen=True)
class LoadStepper:
    """Newton's method for one mesh and one set of prescribed components.

    Parameters
    ----------
    assembly : the mesh and its material
    solve : a linear solver
    tolerance : ‖residual‖ over the norm of the nodal sums of the magnitudes of the elements' forces
    largest_number_of_iterations : for one increment
    smallest_increment : part of a step below which an increment is not cut; the target is then given up
    clock : counts CPU seconds of `macroscopic solve`
    """

    assembly: Assembly
    solve: LinearSolver
    tolerance: float = 1e-8
    largest_number_of_iterations: int = 12
    smallest_increment: float = 1.0 / 256.0
    clock: Clock = field(default_factory=Clock)

    @classmethod
    def of(
        cls,
        mesh: Mesh,
        material: Material,
        prescribed: PrescribedDisplacement,
        solver: Name = "auto",
        **limits: Any,
    ) -> Self:
        """The stepper for the components that are prescribed, whatever their values."""
        assembly = Assembly(mesh, material, prescribed.unknowns(mesh))
        return cls(assembly, linear_solver(solver), **limits)

    def follow(self, targets: Array, start: Array | None = None, state: State = None) -> Solution:
        """Equilibria at prescribed values, shape (steps, prescribed), mm, in the order of the assembly.

        `start` is the displacement to begin from, shape (nodes, 3), mm, by default none, and `state` the material's
        there. Raises LoadStepError where a target is not reached, with the part before it.
        """
        walk = Walk(self, targets, start, state)
        while not walk.is_over:
            walk.advance()
        return walk.solution

    def attempt(
        self,
        here: Point,
        target: Array,
        before: Move,
        used: Counter[str],
        residuals: list[float],
        watch: Callable[[], None],
    ) -> tuple[Point, Move]:
        """The equilibrium at prescribed values, shape (prescribed,), and the move of the tangent at `here` towards it.

        `before` is the move that led to `here`. Appends to `residuals`, calling `watch` each time, and counts linear
        solvers in `used`. Raises ConvergenceError where none is found.
        """
        assembly, free, prescribed = self.assembly, self.assembly.free, self.assembly.prescribed
        displacement = here.displacement.copy()
        components = displacement.reshape(-1)
        change = target - components[prescribed]
        components[prescribed] = target
        right = -here.internal_force.reshape(-1)[free] - here.coupling @ change
        move = Move(change, self._linear(here, right, used))
        components[free] += move.response + move.bend(before)
        near = None
        for _ in range(self.largest_number_of_iterations):
            point = assembly.evaluate(displacement.copy(), here.states, near)
            near = point.states
            right = -point.internal_force.reshape(-1)[free]
            size = float(np.linalg.norm(right))
            # Without a free component nothing is out of balance, however small the forces.
            residuals.append(0.0 if size == 0.0 and np.isfinite(point.force_scale) else size / point.force_scale)
            watch()
            if residuals[-1] <= self.tolerance:
                return point, move
            if not np.isfinite(residuals[-1]):
                raise ConvergenceError(assembly.what_is_not_finite(displacement))
            if len(residuals) < self.largest_number_of_iterations:
                components[free] += self._linear(point, right, used)
        raise ConvergenceError(f"the residual is {residuals[-1]:.1e} after {len(residuals)} iterations")

    def _linear(self, point: Point, right: Array, used: Counter[str]) -> Array:
        size = float(np.linalg.norm(right))
        if size == 0.0:
            return np.zeros_like(right)
        # Newton's method squares a small residual; a linear solution better than that would be wasted.
        relative = size / point.force_scale
        with self.clock.of("macroscopic solve"):
            linear = self.solve(
                point.stiffness, right, max(min(LOOSE, 0.1 * relative), 0.01 * self.tolerance / relative)
            )
        used[linear.solver] += 1
        return linear.values


@dataclass(frozen=True)
class Move:
    """A change of the prescribed values, and how the free components answer to it by the tangent at its start.

    change : shape (prescribed,), mm; response : shape (free,), mm
    """

    change: Array
    response: Array

    def bend(self, before: Move) -> Array:
        """Second order of the free components' path, shape (free,), mm: from the tangents here and at the move before.

        With r the ratio of this change to that before, ½ r (response − r response before); none where the two changes
        are not along one line, or this one is many times as long.
        """
        square = float(before.change @ before.change)
        ratio = float(self.change @ before.change) / square if square > 0.0 else 0.0
        aside = np.linalg.norm(self.change - ratio * before.change)
        if aside > STRAIGHT * np.linalg.norm(self.change) or abs(ratio) > LONGEST:
            return np.zeros_like(self.response)
        return 0.5 * ratio * (self.response - ratio * before.response)


class Walk:
    """A walk along targets, one load step at a time.

    Another walk of the same stepper and targets goes on from here when its record takes over the notes and the content
    of the arrays of this one's.

    Parameters
    ----------
    stepper, targets, start, state : as of `LoadStepper.follow`
    watch : called with the walk after every Newton iteration; `residuals` are those of the increment at hand
    """

    def __init__(
        self,
        stepper: LoadStepper,
        targets: Array,
        start: Array | None = None,
        state: State = None,
        watch: Callable[[Walk], None] | None = None,
    ) -> None:
        self.stepper, self.targets = stepper, np.asarray(targets, dtype=float)
        self._watch = (lambda: watch(self)) if watch is not None else (lambda: None)
        self.residuals: list[float] = []
        self.record = self._begun(start, state)

    def _begun(self, start: Array | None, state: State) -> Record:
        assembly = self.stepper.assembly
        steps, nodes, elements = (
            len(of) for of in (self.targets, assembly.mesh.node_position, assembly.mesh.element_nodes)
        )
        displacement, force = np.full((2, steps, nodes, 3), np.nan)
        gradient, stress = np.full((2, steps, elements, 8, 3, 3), np.nan)
        iterations, cuts = np.zeros((2, steps), dtype=np.int64)
        with _numerics():
            origin = np.zeros((nodes, 3)) if start is None else np.asarray(start, dtype=float)
            here = assembly.evaluate(origin, assembly.split(state))
        still = Move(np.zeros(len(assembly.prescribed)), np.zeros(len(assembly.free)))
        return Record(here, still, 1.0, 0, displacement, force, gradient, stress, iterations, cuts, Counter(), [])

    @property
    def is_over(self) -> bool:
        """Whether all targets were reached."""
        return self.record.step == len(self.targets)

    @property
    def solution(self) -> Solution:
        """The equilibria so far."""
        record = self.record
        return Solution(
            record.displacement,
            record.force,
            record.gradient,
            record.stress,
            record.iterations,
            record.cuts,
            np.arange(len(self.targets)) < record.step,
            dict(record.used),
            join(record.here.states),
            tuple(record.attempts),
        )

    def advance(self) -> None:
        """Go on to the next target; raises LoadStepError, with the part before it, where it is not reached."""
        record, assembly = self.record, self.stepper.assembly
        with _numerics():
            self._reach(record.step)
            here = record.here
            record.displacement[record.step], record.force[record.step] = here.displacement, here.internal_force
            record.gradient[record.step] = assembly.deformation_gradient(here.displacement)
            record.stress[record.step] = here.stress
            record.step += 1

    def _reach(self, step: int) -> None:
        record = self.record
        before = record.here.displacement.reshape(-1)[self.stepper.assembly.prescribed]
        reached = 0.0
        while reached < 1.0:
            end = min(1.0, reached + record.increment)
            values = self.targets[step] if end == 1.0 else before + end * (self.targets[step] - before)
            self.residuals = []
            failure = ""
            try:
                record.here, record.before = self.stepper.attempt(
                    record.here, values, record.before, record.used, self.residuals, self._watch
                )
            except ConvergenceError as error:
                failure = str(error)
            record.attempts.append(Attempt(step, reached, end, tuple(self.residuals), failure))
            record.iterations[step] += len(self.residuals)
            if not failure:
                reached = end
                if len(self.residuals) <= QUICK:
                    record.increment = min(1.0, 2.0 * record.increment)
                continue
            record.cuts[step] += 1
            record.increment = 0.5 * (end - reached)
            if record.increment < self.stepper.smallest_increment:
                raise LoadStepError(
                    step,
                    f"no equilibrium found beyond {100.0 * reached:.3g} % of its way, with increments "
                    f"down to {100.0 * (end - reached):.2g} %: {failure}; prescribe less, or in more steps",
                    self.solution,
                )


@dataclass
class Record:
    """All that a walk has found, and all that it needs to go on; arrays over all steps, as of `Solution`.

    here : the last equilibrium; before : the move that led there, none at all at the start
    increment : part of a step to try next; step : the next target
    """

    here: Point
    before: Move
    increment: float
    step: int
    displacement: Array
    force: Array
    gradient: Array
    stress: Array
    iterations: NDArray[np.int64]
    cuts: NDArray[np.int64]
    used: Counter[str]
    attempts: list[Attempt]

    @property
    def arrays(self) -> list[NDArray[Any]]:
        """The very arrays that a walk needs to go on, in a fixed order; the pattern of the stiffness never changes."""
        found, here = [self.displacement, self.force, self.gradient, self.stress, self.iterations, self.cuts], self.here
        found += [here.displacement, here.internal_force, here.stiffness.data, here.coupling.data, here.stress]
        return [*found, self.before.change, self.before.response, *arrays_of(here.states)]

    @property
    def notes(self) -> dict[str, Any]:
        """All else that it needs, as JSON can hold it."""
        names = ("increment", "step", "used")
        attempts = [list(vars(attempt).values()) for attempt in self.attempts]
        return {name: getattr(self, name) for name in names} | {
            "force_scale": self.here.force_scale,
            "attempts": attempts,
        }

    def take(self, notes: Any) -> None:
        """Take over notes that JSON gave back; a class of error that is about values says that they are none."""
        step, increment, force_scale = int(notes["step"]), float(notes["increment"]), float(notes["force_scale"])
        used = Counter({str(name): int(count) for name, count in notes["used"].items()})
        attempts = [
            Attempt(int(number), float(start), float(end), tuple(map(float, residuals)), str(failure))
            for number, start, end, residuals, failure in notes["attempts"]
        ]
        if not (0 <= step <= len(self.iterations) and 0.0 < increment <= 1.0 and force_scale > 0.0):
            raise ValueError(f"step {step}, increment {increment}, force scale {force_scale}")
        self.step, self.increment, self.used, self.attempts = step, increment, used, attempts
        self.here = replace(self.here, force_scale=force_scale)


@contextmanager
def _numerics() -> Iterator[None]:
    """One BLAS thread, whose sums do not depend on the machine's load; trials may leave the range of numbers.

    A trial that turns elements inside out is refused for forces that are not finite.
    """
    with threadpool_limits(limits=1, user_api="blas"), np.errstate(all="ignore"):
        yield
