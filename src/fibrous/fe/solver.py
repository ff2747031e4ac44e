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
from fibrous.deformation import cauchy_stress
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


@dataclass(frozen=True, repr=False)
class Equilibria:
    """What was found at the targets; the leading axis is the step.

    displacement : shape (steps, nodes, 3), mm
    internal_force : shape (steps, nodes, 3), N; at prescribed components the reaction, elsewhere zero to tolerance
    deformation_gradient, piola : F and the first Piola–Kirchhoff stress at the Gauss points, MPa, shape
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
    piola: Array
    newton_iterations: NDArray[np.int64]
    cuts: NDArray[np.int64]
    converged: NDArray[np.bool_]
    linear_solvers: Mapping[str, int]
    state: State
    attempts: tuple[Attempt, ...]

    @property
    def cauchy(self) -> Array:
        """Cauchy stress at the Gauss points, shape (steps, elements, 8, 3, 3), MPa."""
        with np.errstate(invalid="ignore"):  # steps that did not converge are NaN
            return cauchy_stress(self.piola, self.deformation_gradient)

    def __repr__(self) -> str:
        steps, elements = self.piola.shape[:2]
        effort = f"{self.newton_iterations.sum()} Newton iterations, {self.cuts.sum()} cutbacks"
        return f"<{type(self).__name__}: {elements} elements, {self.converged.sum()} of {steps} steps, {effort}>"


class LoadStepError(ConvergenceError):
    """A target was not reached; `solution` is the part that converged, and holds the attempts.

    step : number of the target, from 0; the text counts steps from 1, as files do
    reason : why it was given up, and what to do
    """

    def __init__(self, step: int, reason: str, solution: Equilibria) -> None:
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

    def follow(self, targets: Array, start: Array | None = None, state: State = None) -> Equilibria:
        """Equilibria at prescribed values, shape (steps, prescribed), mm, in the order of the assembly.

        `start` is the displacement to begin from, shape (nodes, 3), mm, by default none, and `state` the material's
        there. Raises LoadStepError where a target is not reached, with the part before it.
        """
        walk = Walk(self, targets, start, state)
        while not walk.is_over:
            walk.advance()
        return walk.solution


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

    Another walk of the same stepper and targets goes on from here when it takes over the `notes` and the content of the
    `arrays` of this one.

    Parameters
    ----------
    stepper, targets, start, state : as of `LoadStepper.follow`
    watch : called with the walk after every Newton iteration

    Attributes
    ----------
    step : the next target; increment : part of a step to try next
    here : the last equilibrium; before : the move that led there, none at all at the start
    residuals : of the increment at hand
    """

    def __init__(
        self,
        stepper: LoadStepper,
        targets: Array,
        start: Array | None = None,
        state: State = None,
        watch: Callable[[Walk], None] | None = None,
    ) -> None:
        self.stepper, self.targets, self._watch = stepper, np.asarray(targets, dtype=float), watch
        self.step, self.increment = 0, 1.0
        self.residuals: list[float] = []
        self.attempts: list[Attempt] = []
        self.linear_solvers: Counter[str] = Counter()
        assembly = stepper.assembly
        nodes, at_points = assembly.mesh.node_position.shape, (len(assembly.mesh.element_nodes), 8, 3, 3)
        # By the names that they have in Equilibria, over all steps.
        self._at_targets: dict[str, NDArray[Any]] = {
            "displacement": np.full((len(targets), *nodes), np.nan),
            "internal_force": np.full((len(targets), *nodes), np.nan),
            "deformation_gradient": np.full((len(targets), *at_points), np.nan),
            "piola": np.full((len(targets), *at_points), np.nan),
            "newton_iterations": np.zeros(len(targets), dtype=np.int64),
            "cuts": np.zeros(len(targets), dtype=np.int64),
        }
        with _numerics():
            origin = np.zeros(nodes) if start is None else np.asarray(start, dtype=float)
            self.here = assembly.evaluate(origin, assembly.split(state))
        self.before = Move(np.zeros(len(assembly.prescribed)), np.zeros(len(assembly.free)))

    @property
    def is_over(self) -> bool:
        """Whether all targets were reached."""
        return self.step == len(self.targets)

    @property
    def solution(self) -> Equilibria:
        """The equilibria so far."""
        return Equilibria(
            **self._at_targets,
            converged=np.arange(len(self.targets)) < self.step,
            linear_solvers=dict(self.linear_solvers),
            state=join(self.here.states),
            attempts=tuple(self.attempts),
        )

    def advance(self) -> None:
        """Go on to the next target; raises LoadStepError, with the part before it, where it is not reached."""
        with _numerics():
            self._reach(self.step)
            self._at_targets["displacement"][self.step] = self.here.displacement
            self._at_targets["internal_force"][self.step] = self.here.internal_force
            gradient = self.stepper.assembly.deformation_gradient(self.here.displacement)
            self._at_targets["deformation_gradient"][self.step] = gradient
            self._at_targets["piola"][self.step] = self.here.piola
            self.step += 1

    def _reach(self, step: int) -> None:
        before = self.here.displacement.reshape(-1)[self.stepper.assembly.prescribed]
        reached = 0.0
        while reached < 1.0:
            end = min(1.0, reached + self.increment)
            values = self.targets[step] if end == 1.0 else before + end * (self.targets[step] - before)
            self.residuals, failure = [], ""
            try:
                self.here, self.before = self._equilibrium(values)
            except ConvergenceError as error:
                failure = str(error)
            self.attempts.append(Attempt(step, reached, end, tuple(self.residuals), failure))
            self._at_targets["newton_iterations"][step] += len(self.residuals)
            if not failure:
                reached = end
                if len(self.residuals) <= QUICK:
                    self.increment = min(1.0, 2.0 * self.increment)
                continue
            self._at_targets["cuts"][step] += 1
            self.increment = 0.5 * (end - reached)
            if self.increment < self.stepper.smallest_increment:
                raise LoadStepError(
                    step,
                    f"no equilibrium found beyond {100.0 * reached:.3g} % of its way, with increments "
                    f"down to {100.0 * (end - reached):.2g} %: {failure}; prescribe less, or in more steps",
                    self.solution,
                )

    def _equilibrium(self, target: Array) -> tuple[Point, Move]:
        """The equilibrium at prescribed values, shape (prescribed,), and the move of the tangent here towards it.

        Appends to `residuals`. Raises ConvergenceError where none is found.
        """
        stepper, here = self.stepper, self.here
        assembly, free = stepper.assembly, stepper.assembly.free
        displacement = here.displacement.copy()
        components = displacement.reshape(-1)
        change = target - components[assembly.prescribed]
        components[assembly.prescribed] = target
        right = -here.internal_force.reshape(-1)[free] - here.coupling @ change
        move = Move(change, self._linear(here, right))
        components[free] += move.response + move.bend(self.before)
        near = None
        for _ in range(stepper.largest_number_of_iterations):
            point = assembly.evaluate(displacement.copy(), here.states, near)
            near = point.states
            right = -point.internal_force.reshape(-1)[free]
            size = float(np.linalg.norm(right))
            # Without a free component nothing is out of balance, however small the forces.
            residual = 0.0 if size == 0.0 and np.isfinite(point.force_scale) else size / point.force_scale
            self.residuals.append(residual)
            if self._watch is not None:
                self._watch(self)
            if residual <= stepper.tolerance:
                return point, move
            if not np.isfinite(residual):
                raise ConvergenceError(assembly.what_is_not_finite(displacement))
            if len(self.residuals) < stepper.largest_number_of_iterations:
                components[free] += self._linear(point, right)
        raise ConvergenceError(f"the residual is {residual:.1e} after {len(self.residuals)} iterations")

    def _linear(self, point: Point, right: Array) -> Array:
        size = float(np.linalg.norm(right))
        if size == 0.0:
            return np.zeros_like(right)
        # Newton's method squares a small residual; a linear solution better than that would be wasted.
        relative = size / point.force_scale
        tolerance = max(min(LOOSE, 0.1 * relative), 0.01 * self.stepper.tolerance / relative)
        with self.stepper.clock.of("macroscopic solve"):
            linear = self.stepper.solve(point.stiffness, right, tolerance)
        self.linear_solvers[linear.solver] += 1
        return linear.values

    @property
    def arrays(self) -> list[NDArray[Any]]:
        """The very arrays that a walk needs to go on, in a fixed order; the pattern of the stiffness never changes."""
        here = self.here
        of_point = [here.displacement, here.internal_force, here.stiffness.data, here.coupling.data, here.piola]
        return [
            *self._at_targets.values(), *of_point, self.before.change, self.before.response, *arrays_of(here.states)
        ]  # fmt: skip

    @property
    def notes(self) -> dict[str, Any]:
        """All else that it needs, as JSON can hold it."""
        return {
            "step": self.step,
            "increment": self.increment,
            "force_scale": self.here.force_scale,
            "linear_solvers": self.linear_solvers,
            "attempts": [list(vars(attempt).values()) for attempt in self.attempts],
        }

    def take(self, notes: Any) -> None:
        """Take over notes that JSON gave back; an error about values leaves all as it was."""
        step, increment, force_scale = int(notes["step"]), float(notes["increment"]), float(notes["force_scale"])
        solvers = Counter({str(name): int(count) for name, count in notes["linear_solvers"].items()})
        attempts = [
            Attempt(int(number), float(start), float(end), tuple(map(float, residuals)), str(failure))
            for number, start, end, residuals, failure in notes["attempts"]
        ]
        if not (0 <= step <= len(self.targets) and 0.0 < increment <= 1.0 and force_scale > 0.0):
            raise ValueError(f"step {step}, increment {increment}, force scale {force_scale}")
        self.step, self.increment, self.linear_solvers, self.attempts = step, increment, solvers, attempts
        self.here = replace(self.here, force_scale=force_scale)


@contextmanager
def _numerics() -> Iterator[None]:
    """One BLAS thread, whose sums do not depend on the machine's load; trials may leave the range of numbers.

    A trial that turns elements inside out is refused for forces that are not finite.
    """
    with threadpool_limits(limits=1, user_api="blas"), np.errstate(all="ignore"):
        yield
