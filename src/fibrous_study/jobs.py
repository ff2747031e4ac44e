"""The jobs of a study: those that it is asked for, and those that they wait for."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from fibrous_study.plan import Config, Stage, Wildcards

# What is told of the paper's own networks. With a tissue of one's own it is made where something else reads it.
OF_THE_PAPER = {
    "networks",
    "curves",
    "states",
    "fits",
    "surface",
    "case_study",
    "claims",
    *(f"figure_{number}" for number in (2, 3, 5, 6, 7, 8)),
}


@dataclass(frozen=True)
class Job:
    """One job of the study: its stage and wildcards, the files that it writes and reads."""

    stage: str
    wildcards: Wildcards
    outputs: tuple[str, ...]
    inputs: tuple[str, ...]

    @property
    def accounted(self) -> str:
        """The file that says what the job cost; pictures do not say it: equal inputs give equal bytes."""
        return next(path for path in self.outputs if not path.endswith((".png", ".svg")))


def possible_jobs(stages: Mapping[str, Stage], config: Config) -> Iterator[Job]:
    """Every job of these stages, with those on demand."""
    for name, stage in stages.items():
        for wildcards in stage.instances(config):
            inputs = (path for paths in stage.inputs(config, wildcards).values() for path in paths)
            yield Job(name, wildcards, tuple(stage.files(config, wildcards).values()), tuple(inputs))


def jobs(stages: Mapping[str, Stage], config: Config) -> list[Job]:
    """The jobs of the whole study among these stages, and what they wait for, in the order of the stages."""
    every = list(possible_jobs(stages, config))
    producer = {path: number for number, job in enumerate(every) for path in job.outputs}
    needed: set[int] = set()
    waiting = [number for number, job in enumerate(every) if _asked_for(job.stage, stages[job.stage], config)]
    while waiting:
        number = waiting.pop()
        if number not in needed:
            needed.add(number)
            waiting += [producer[path] for path in every[number].inputs if path in producer]
    return [every[number] for number in sorted(needed)]


def _asked_for(name: str, stage: Stage, config: Config) -> bool:
    """Whether the whole study makes the files of a stage for their own sake."""
    return not (stage.on_demand or (config["specimen"] == "file" and name in OF_THE_PAPER))
