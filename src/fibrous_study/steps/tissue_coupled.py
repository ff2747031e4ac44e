"""Rule `deform_tissue_with_networks`: a discrete network in equilibrium at every Gauss point (2.7, 3.4)."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from fibrous.clock import Clock
from fibrous.errors import ConfigError
from fibrous.fe.solver import LoadStepError, LoadStepper, Walk
from fibrous.materials.network import FiberNetworks, NetworkState
from fibrous.networks.guard import Limits
from fibrous.specimen import Specimen
from fibrous.tissue import Solution
from fibrous_study.checkpoint import Checkpoint
from fibrous_study.loading import networks_of
from fibrous_study.progress import Progress
from fibrous_study.provenance import cpu_seconds
from fibrous_study.solutions import matrix_of, read_specimen, say, tissue_dataset, write_tissue

COUNTS = {"network_iterations": "iterations", "network_cuts": "cuts", "indefinite_hessians": "indefinite"}


# Time from one checkpoint to the next, over that of writing one. A run that is killed loses at most that, and the load
# step at hand: about a minute and a half of the study's run, whose checkpoints take a second or two.
LEAST_WORK = 60.0


@dataclass
class _Kept:
    """What a killed run goes on with: its walk, sums over all networks at each step, shape (steps, 3), CPU time."""

    walk: Walk
    counts: np.ndarray
    seconds: dict[str, float]
    cpu_seconds: float

    @property
    def arrays(self) -> list[np.ndarray]:
        return [*self.walk.arrays, self.counts]

    @property
    def notes(self) -> dict[str, Any]:
        return {"walk": self.walk.notes, "seconds": self.seconds, "cpu_seconds": self.cpu_seconds}

    def take(self, notes: Any) -> None:
        seconds = {str(part): float(spent) for part, spent in notes["seconds"].items()}
        spent = float(notes["cpu_seconds"])
        self.walk.take(notes["walk"])
        self.seconds, self.cpu_seconds = seconds, spent


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Read `specimen` and `networks`; write `tissue` and `vtu`. ``params["threads"]`` elements are worked on at a time.

    After a load step a checkpoint is kept beside `tissue` if keeping the last one cost little of the time since. It
    is removed in the end. Raises ConvergenceError as the rule `deform_tissue` does, DatasetError where an element has
    no network.
    """
    config = params["config"]
    specimen, numbers = read_specimen(inputs["specimen"][0])
    targets = _targets(specimen, config)
    clock = Clock()
    stepper, tensor = _stepper(inputs["networks"], specimen, numbers, config, params.get("threads", 1), clock)
    checkpoint, progress = Checkpoint(outputs["tissue"], params), Progress(config["run"], params.get("terminal"))
    walk = Walk(stepper, targets, watch=progress)
    kept = _Kept(walk, np.zeros((len(targets), len(COUNTS)), dtype=np.int64), {}, 0.0)
    if checkpoint.read(kept.arrays, kept.take):
        progress.goes_on(walk)
        for part, seconds in kept.seconds.items():
            clock.seconds[part] += seconds
    spent, failure = kept.cpu_seconds, None
    written, cost = -np.inf, 0.0
    progress.network_iterations = _sums(walk)[0]
    try:
        while not walk.is_over:
            before, step = _sums(walk), walk.step
            walk.advance()
            kept.counts[step] = _sums(walk) - before
            progress.network_iterations = _sums(walk)[0]
            kept.seconds, kept.cpu_seconds = dict(clock.seconds), spent + cpu_seconds()
            if not walk.is_over and time.monotonic() - written >= LEAST_WORK * cost:
                start = time.monotonic()
                checkpoint.write(kept.arrays, kept.notes)
                written = time.monotonic()
                cost = written - start
    except LoadStepError as error:
        failure = error
    say(tuple(walk.attempts))
    params = {**params, "cpu_seconds_before": spent}
    solution = Solution.of(specimen, walk.solution)
    nothing = np.full((len(targets), len(tensor)), np.nan)
    counts = dict(zip(COUNTS, kept.counts.T, strict=True))
    dataset = tissue_dataset(solution, nothing, nothing, tensor, config["matrix"], clock, counts)
    write_tissue(solution, dataset, failure, outputs, params)
    checkpoint.remove()


def _stepper(
    paths: list[Path],
    specimen: Specimen,
    numbers: np.ndarray,
    config: Mapping[str, Any],
    threads: int,
    clock: Clock,
) -> tuple[LoadStepper, np.ndarray]:
    """The finite elements with networks, and H of the elements' networks, shape (elements, 3, 3)."""
    networks = networks_of(paths, numbers.tolist())
    material = matrix_of(config) + FiberNetworks.of(networks, threads, Limits(**config["equilibrium"]), clock)
    stepper = LoadStepper.of(specimen.mesh, material, specimen.prescribed, config["linear_solver"], clock=clock)
    return stepper, np.array([network.structure_tensor for network in networks])


def _targets(specimen: Specimen, config: Mapping[str, Any]) -> np.ndarray:
    """Prescribed values at the end of each load step of the run, shape (steps, prescribed), mm."""
    values = specimen.prescribed.values
    wanted = config["model"].get("load_steps", len(values))
    if len(values) % wanted:
        raise ConfigError(
            f"tissue.models: {config['run']} has load_steps {wanted}, must divide the specimen's {len(values)}"
        )
    return values[len(values) // wanted - 1 :: len(values) // wanted]


def _sums(walk: Walk) -> np.ndarray:
    """Newton iterations, cuts and indefinite Hessians of all networks since rest, shape (3,)."""
    networks: list[NetworkState] = [fibers for _, fibers in walk.here.states]
    return np.array([sum(getattr(state, name).sum() for state in networks) for name in COUNTS.values()])
