"""Stages of the sensitivities, made on demand: a trial of each variant of the study, their tables, and their figure."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from fibrous_study import plan
from fibrous_study.batches import replicate_numbers, replicated
from fibrous_study.network_stages import figure, once
from fibrous_study.plan import Config, Stage, Wildcards
from fibrous_study.variants import FACTORS, factors, own_value, variants, varied

TRIALS = "results/sensitivity/{variant}.csv"


def _networks(config: Config) -> list[dict[str, Any]]:
    """Alignments with the numbers of their networks, which are those of the ensemble of replicates."""
    wanted, names = config["sensitivity"]["networks"], [entry["name"] for entry in config["named"]]
    numbers = replicate_numbers(len(names), config["sensitivity"]["seeds"])
    return [
        {
            **config["named"][names.index(name)],
            "numbers": [number for number in numbers if names[replicated(number)] == name],
        }
        for name in wanted
    ]


def _trial_config(config: Config, wildcards: Wildcards) -> dict[str, Any]:
    factor, value = variants(config)[wildcards["variant"]]
    own = varied(config, factor, value)
    kept = ("seed", "fiber", "cube", "principal_stretch_limit", "equilibrium", "load_sets", "fit")
    return {
        "factor": factor,
        "value": value,
        "unit": FACTORS.get(factor, ""),
        "networks": _networks(config),
        "protocol": plan.protocol(own, config["roles"]["large"]),
        "path": plan.protocol(own, config["roles"]["path"]),
        **{key: own[key] for key in kept},
    }


def _summary_config(config: Config) -> dict[str, Any]:
    # A list, since JSON with sorted keys would lose the order of a mapping.
    varied_ones = [
        {"name": name, "unit": unit, "own_value": own_value(config, name)} for name, unit in factors(config).items()
    ]
    return {"factors": varied_ones, "load_sets": config["load_sets"]}


def _trials(config: Config) -> dict[str, list[str]]:
    return {"trials": [TRIALS.format(variant=name) for name in variants(config)]}


SENSITIVITY_STAGES: dict[str, Stage] = {
    "sensitivity": Stage(
        module="fibrous_study.steps.sensitivity_trial",
        outputs={"trials": TRIALS},
        inputs=lambda _, __: {},
        config=_trial_config,
        instances=lambda config: [{"variant": name} for name in variants(config)],
        on_demand=True,
    ),
    "sensitivity_tables": Stage(
        module="fibrous_study.steps.sensitivity_tables",
        outputs={
            "table": "results/tables/sensitivity.csv",
            "sentences": "results/tables/sensitivity_sentences.csv",
        },
        inputs=lambda config, _: _trials(config),
        config=lambda config, _: _summary_config(config),
        instances=once,
        on_demand=True,
    ),
    "figure_sensitivity": replace(
        figure("sensitivity", {"data": ".csv"}, inputs=_trials, config=_summary_config), on_demand=True
    ),
}
