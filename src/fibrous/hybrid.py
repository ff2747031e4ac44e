"""The hybrid method with lagged constants (section 2.5, Fig. 4b): networks follow their elements step by step.

Constants fitted to what the networks did up to a load step serve the next one; only the last step is repeated until
its constants belong to its own deformation.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from fibrous.curves import Curves
from fibrous.deformation import cauchy_stress
from fibrous.fe.solver import Equilibria, LoadStepError, LoadStepper
from fibrous.fitting.hgo import HGOFit
from fibrous.networks.engine import PathState
from fibrous.networks.guard import LIMITS, Limits
from fibrous.networks.lanes import LANES
from fibrous.networks.network import Network

Array = NDArray[np.float64]


@dataclass(frozen=True)
class LaggedSolution:
    """Equilibria of the tissue, with C2 (MPa) and C3 of each load step, shape (steps, elements).

    solution : Newton iterations, cuts, linear solvers and attempts are those of all solutions of a step together
    last_changes : largest changes of C2 (MPa) and C3 at each repetition of the last step, shape (repetitions, 2)
    lost_states : (network, step) of the states that found no equilibrium; the fits leave them out
    """

    solution: Equilibria
    C2: Array
    C3: Array
    last_changes: Array
    lost_states: tuple[tuple[int, int], ...]


class LaggedStepError(LoadStepError):
    """A load step was not reached; `found` is what is known of the steps before it, NaN from there on."""

    def __init__(self, step: int, reason: str, found: LaggedSolution) -> None:
        super().__init__(step, reason, found.solution)
        self.found = found


class LaggedRefit:
    """Elements and networks, one for one, with the fit between them.

    Parameters
    ----------
    stepper_of : the finite elements with constants C2 (MPa) and C3, shape (elements,)
    networks : of the elements, in their order
    fit : constants from the one curve of a network
    limits : of the search for the networks' equilibria
    """

    def __init__(
        self,
        stepper_of: Callable[[Array, Array], LoadStepper],
        networks: Sequence[Network],
        fit: Callable[[Curves], HGOFit],
        limits: Limits = LIMITS,
    ) -> None:
        self.stepper_of, self.networks, self.fit = stepper_of, networks, fit
        self.engines = [network.engine(limits) for network in networks]

    def follow(self, targets: Array, C2: Array, C3: Array, repetitions: int) -> LaggedSolution:
        """Equilibria at prescribed values, shape (steps, prescribed), mm, from initial constants, shape (elements,).

        The last step is solved once more after each of `repetitions` fits to its own deformation. An element whose
        network found no equilibrium up to a step keeps the constants it has. Raises LaggedStepError with the part
        before a step that was not reached.
        """
        steps, elements = len(targets), len(self.networks)
        states: list[PathState | None] = [None] * elements
        record = _Record(steps, elements)
        solved: list[list[Equilibria]] = []
        constants = np.full((2, steps, elements), np.nan)
        changes: list[Array] = []

        def found() -> LaggedSolution:
            lost = tuple((int(k), int(step)) for step, k in np.argwhere(np.isnan(record.energy)))
            return LaggedSolution(
                _joined(solved, steps), constants[0], constants[1], np.array(changes).reshape(-1, 2), lost
            )

        start = None
        for step in range(steps):
            before = states
            solved.append([])
            for repetition in range(1 + (repetitions if step == steps - 1 else 0)):
                if step or repetition:
                    C2, C3 = self._fitted(record, step if repetition else step - 1, C2, C3)
                if repetition:
                    changes.append(np.abs(np.array([C2, C3]) - constants[:, step]).max(axis=1))
                constants[:, step] = C2, C3
                # Again from the step before: the path decides, not the guess that came first.
                try:
                    solved[-1].append(self.stepper_of(C2, C3).follow(targets[step : step + 1], start))
                except LoadStepError as error:
                    solved[-1].append(error.solution)
                    raise LaggedStepError(step, error.reason, found()) from None
                states = self._driven(solved[-1][-1], step, before, record)
            start = solved[-1][-1].displacement[0]
        return found()

    def _driven(
        self, part: Equilibria, step: int, before: list[PathState | None], record: _Record
    ) -> list[PathState | None]:
        """States of the networks under their elements' average F; one that is lost waits at the state before."""
        gradients = part.deformation_gradient[0].mean(axis=1)
        states = list(before)
        for k, (engine, gradient) in enumerate(zip(self.engines, gradients, strict=True)):
            scale = self.networks[k].stress_unit_MPa
            start = before[k] or engine.rest()
            state = engine.advance(start, np.repeat(gradient[..., None], LANES, axis=-1))
            record.gradient[step + 1, k] = gradient
            if not state.converged.all():
                record.energy[step + 1, k] = record.stress[step + 1, k] = np.nan
                states[k] = start
                continue
            states[k] = state
            W, P, _ = engine.measures()
            record.energy[step + 1, k] = scale * W[0]
            record.stress[step + 1, k] = cauchy_stress(scale * P[..., 0], gradient)
        return states

    def _fitted(self, record: _Record, step: int, C2: Array, C3: Array) -> tuple[Array, Array]:
        fits = [self.fit(record.curve(k, step, network)) for k, network in enumerate(self.networks)]
        new_C2, new_C3 = (np.array([getattr(fit, name) for fit in fits]) for name in ("C2", "C3"))
        unknown = np.isnan(new_C2)
        return np.where(unknown, C2, new_C2), np.where(unknown, C3, new_C3)


class _Record:
    """What all networks did, the step first and rest at 0."""

    def __init__(self, steps: int, networks: int) -> None:
        self.gradient = np.tile(np.eye(3), (steps + 1, networks, 1, 1))
        self.energy, self.stress = np.zeros((steps + 1, networks)), np.zeros((steps + 1, networks, 3, 3))

    def curve(self, k: int, step: int, network: Network) -> Curves:
        """The curve of network `k` up to a load step, itself included."""
        upto = slice(0, step + 2)
        F, energy, stress = (array[None, upto, k] for array in (self.gradient, self.energy, self.stress))
        return Curves.of_network(F, network.structure_tensor, energy, stress)


def _joined(solved: Sequence[Sequence[Equilibria]], steps: int) -> Equilibria:
    """One solution from those of single steps, the last of each step counting; steps that are missing did not converge.

    What was spent on a step, and the attempts, are those of all its solutions.
    """
    last = [solutions[-1] for solutions in solved]
    fields = {
        name: np.concatenate([getattr(part, name) for part in last])
        for name in ("displacement", "internal_force", "deformation_gradient", "piola", "converged")
    }
    for name in ("newton_iterations", "cuts"):
        fields[name] = np.concatenate([sum(getattr(one, name) for one in solutions) for solutions in solved])
    filling = {"newton_iterations": 0, "cuts": 0, "converged": False}
    arrays = {}
    for name, known in fields.items():
        arrays[name] = np.full((steps, *known.shape[1:]), filling.get(name, np.nan), dtype=known.dtype)
        arrays[name][: len(known)] = known
    solvers = sum((Counter(one.linear_solvers) for solutions in solved for one in solutions), Counter())
    attempts = tuple(
        replace(attempt, step=step)
        for step, solutions in enumerate(solved)
        for one in solutions
        for attempt in one.attempts
    )
    return Equilibria(**arrays, linear_solvers=dict(solvers), state=last[-1].state, attempts=attempts)
