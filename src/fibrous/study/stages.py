"""The stages of the study: what each reads, what it writes, and which part of the config it depends on.

The rules of the workflow and ``python -m fibrous check`` both ask here, so they cannot disagree. Everything follows
from the validated config and the files that it names; paths are relative to the folder in which the study runs.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import chain
from typing import Any

from fibrous.provenance import code_hash, config_hash
from fibrous.study import plan
from fibrous.study.multiscale_stages import MULTISCALE_STAGES
from fibrous.study.network_stages import NETWORK_STAGES
from fibrous.study.plan import Config, Stage, Wildcards
from fibrous.study.report_stages import report_stages, target_stages
from fibrous.study.sensitivity_stages import SENSITIVITY_STAGES
from fibrous.study.tissue_stages import TISSUE_STAGES

# What a part of the config says of the tissue that the files come from: a synthetic one is called so everywhere.
SPECIMEN = "specimen"

STAGES: dict[str, Stage] = {
    **NETWORK_STAGES,
    **TISSUE_STAGES,
    **MULTISCALE_STAGES,
    **SENSITIVITY_STAGES,
    # Every state of every curve, those along the deformations of the tissue included.
    "convergence": Stage(
        module="fibrous.study.convergence",
        outputs={"convergence": "results/tables/convergence.csv"},
        inputs=lambda config, _: {"curves": all_curves(config)},
        config=lambda _, __: {},
        instances=lambda _: [{}],
    ),
}
STAGES |= report_stages(dict(STAGES))


def stage_params(stage: str, config: Config, wildcards: Wildcards) -> dict[str, Any]:
    """What a rule hands to the module of `stage`: its name, its part of the config, the hash of its sources.

    The part of the config holds under `upstream` a hash of the params of the stages whose files are read: a result
    whose inputs were made anew with other values is then seen to be old, whatever the files' times say.
    """
    producers = {path: (name, instance) for path, name, instance in possible_files(config)}
    return _params(stage, config, wildcards, producers, {})


def _params(
    stage: str,
    config: Config,
    wildcards: Wildcards,
    producers: Mapping[str, tuple[str, Wildcards]],
    known: dict[str, tuple[str, str]],
) -> dict[str, Any]:
    upstream, specimen = set(), plan.origin(config) if stage == "specimen" else ""
    for path in chain.from_iterable(STAGES[stage].inputs(config, wildcards).values()):
        if path not in producers:
            continue  # a user's own file
        if path not in known:
            name, instance = producers[path]
            made_with = _params(name, config, instance, producers, known)
            known[path] = config_hash(made_with), made_with["config"].get(SPECIMEN, "")
        upstream.add(known[path][0])
        specimen = specimen or known[path][1]
    module = STAGES[stage].module
    own = STAGES[stage].config(config, wildcards)
    if specimen:
        own[SPECIMEN] = specimen
    if upstream:
        own["upstream"] = config_hash({"inputs": sorted(upstream)})
        if not plan.own_networks(config):
            own["seed"] = config["seed"]  # of the networks that the files come from
    return {"stage": module, "config": own, "code_hash": code_hash(module)}


def expected_files(config: Config) -> Iterator[tuple[str, str, dict[str, str]]]:
    """Every file of the whole study with the stage that writes it and that stage's wildcards."""
    return (one for one in possible_files(config) if not STAGES[one[1]].on_demand)


def possible_files(config: Config) -> Iterator[tuple[str, str, dict[str, str]]]:
    """The same with the files that are made on demand."""
    for name, stage in STAGES.items():
        for wildcards in stage.instances(config):
            for pattern in stage.outputs.values():
                yield pattern.format_map(wildcards), name, wildcards


def files(stage: str, output: str, config: Config, **wanted: str) -> list[str]:
    """Paths of one named output of `stage`, over all of its wildcards that agree with `wanted`."""
    pattern = STAGES[stage].outputs[output]
    return [
        pattern.format_map(wildcards)
        for wildcards in STAGES[stage].instances(config)
        if all(wildcards[name] == value for name, value in wanted.items())
    ]


def files_of_target(target: str, config: Config) -> list[str]:
    """Every file that the target of a rule makes."""
    wanted = target_stages(target)
    return [path for path, stage, _ in possible_files(config) if stage in wanted]


def all_curves(config: Config) -> list[str]:
    """Files of all curves of the study."""
    return files("curves", "curves", config) + files("refit_curves", "curves", config)
