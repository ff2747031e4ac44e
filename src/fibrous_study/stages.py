"""The stages of the study: what each reads, what it writes, and which part of the config it depends on.

The rules of the workflow and ``python -m fibrous_study check`` both ask here, so they cannot disagree. Everything
follows from the validated config and the files that it names; paths are relative to the folder in which the study runs.
"""

from __future__ import annotations

from collections.abc import Iterator
from itertools import chain
from typing import Any

from fibrous_study import plan
from fibrous_study.jobs import jobs, possible_jobs
from fibrous_study.multiscale_stages import MULTISCALE_STAGES
from fibrous_study.network_stages import NETWORK_STAGES
from fibrous_study.plan import Config, Stage, Wildcards
from fibrous_study.provenance import code_hash, config_hash
from fibrous_study.report_stages import report_stages, target_stages
from fibrous_study.sensitivity_stages import SENSITIVITY_STAGES
from fibrous_study.tissue_stages import TISSUE_STAGES

# What a part of the config says of the tissue that the files come from: a synthetic one is called so everywhere.
SPECIMEN = "specimen"

CURVES = ("curves", "refit_curves")
COMPUTING: dict[str, Stage] = {**NETWORK_STAGES, **TISSUE_STAGES, **MULTISCALE_STAGES, **SENSITIVITY_STAGES}
STAGES: dict[str, Stage] = {
    **COMPUTING,
    # Every state of every curve, those along the deformations of the tissue included.
    "convergence": Stage(
        module="fibrous_study.steps.convergence",
        outputs={"convergence": "results/tables/convergence.csv"},
        inputs=lambda config, _: {"curves": all_curves(config)},
        config=lambda _, __: {},
        instances=lambda _: [{}],
    ),
}
STAGES |= report_stages(dict(STAGES))


class Params:
    """What the rules of one config hand to the modules of their stages, each worked out once.

    Made for one state of the config and of the files that it names: a config that changes afterwards needs another.
    """

    def __init__(self, config: Config) -> None:
        self.config = config
        self._producers = {path: (name, instance) for path, name, instance in possible_files(config)}
        self._known: dict[tuple[Any, ...], tuple[dict[str, Any], str]] = {}

    def of(self, stage: str, wildcards: Wildcards) -> dict[str, Any]:
        """The name of the stage's module, its part of the config, and the hash of its sources.

        The part of the config holds under `upstream` a hash of the params of the stages whose files are read: a result
        whose inputs were made anew with other values is then seen to be old, whatever the files' times say.
        """
        return self._with_hash(stage, wildcards)[0]

    def with_files(self, stage: str, wildcards: Wildcards) -> dict[str, Any]:
        """The same with the job's files by name: lists of paths under `inputs`, paths under `outputs`."""
        inputs, outputs = (told(self.config, wildcards) for told in (STAGES[stage].inputs, STAGES[stage].files))
        return {**self.of(stage, wildcards), "inputs": inputs, "outputs": outputs}

    def _with_hash(self, stage: str, wildcards: Wildcards) -> tuple[dict[str, Any], str]:
        key = (stage, *sorted(wildcards.items()))
        if key not in self._known:
            params = self._worked_out(stage, wildcards)
            self._known[key] = params, config_hash(params)
        return self._known[key]

    def _worked_out(self, stage: str, wildcards: Wildcards) -> dict[str, Any]:
        upstream, specimen = set(), plan.origin(self.config) if stage == "specimen" else ""
        for path in chain.from_iterable(STAGES[stage].inputs(self.config, wildcards).values()):
            if path not in self._producers:
                continue  # a user's own file
            made_with, hashed = self._with_hash(*self._producers[path])
            upstream.add(hashed)
            specimen = specimen or made_with["config"].get(SPECIMEN, "")
        module = STAGES[stage].module
        own = STAGES[stage].config(self.config, wildcards)
        if specimen:
            own[SPECIMEN] = specimen
        if upstream:
            own["upstream"] = config_hash({"inputs": sorted(upstream)})
            if not plan.own_networks(self.config):
                own["seed"] = self.config["seed"]  # of the networks that the files come from
        return {"stage": module, "config": own, "code_hash": code_hash(module)}


def stage_params(stage: str, config: Config, wildcards: Wildcards) -> dict[str, Any]:
    """The params of one job alone."""
    return Params(config).of(stage, wildcards)


def expected_files(config: Config) -> Iterator[tuple[str, str, Wildcards]]:
    """Every file of the whole study with the stage that writes it and that stage's wildcards."""
    return ((path, job.stage, job.wildcards) for job in jobs(STAGES, config) for path in job.outputs)


def possible_files(config: Config) -> Iterator[tuple[str, str, Wildcards]]:
    """The same with the files that are made on demand."""
    return ((path, job.stage, job.wildcards) for job in possible_jobs(STAGES, config) for path in job.outputs)


def files(stage: str, output: str, config: Config, **wanted: str) -> list[str]:
    """Paths of one named output of `stage`, over all of its wildcards that agree with `wanted`."""
    pattern = STAGES[stage].outputs[output]
    return [
        pattern.format_map(wildcards)
        for wildcards in STAGES[stage].instances(config)
        if all(wildcards[name] == value for name, value in wanted.items())
    ]


def files_of_target(target: str, config: Config) -> list[str]:
    """Every file of the whole study that the target of a rule makes."""
    wanted = target_stages(target)
    return [path for path, stage, _ in expected_files(config) if stage in wanted]


def all_curves(config: Config) -> list[str]:
    """Files of all curves of the study."""
    return [path for job in jobs(COMPUTING, config) if job.stage in CURVES for path in job.outputs]
