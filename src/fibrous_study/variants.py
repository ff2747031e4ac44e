"""What the sensitivities vary: one number of the study at a time, everything else as the config has it."""

from __future__ import annotations

import copy
from typing import Any

from fibrous_study import plan
from fibrous_study.batches import replicate_numbers, replicated
from fibrous_study.plan import Config

# Keys under `sensitivity` that list values, with their unit.
FACTORS = {"edge_length_um": "µm", "volume_fraction": "1", "nonlinearity": "1", "amplitude": "1", "steps": "1"}
BASE = "base"


def factors(config: Config) -> dict[str, str]:
    """The factors that are varied, with their unit: no amplitude where the first load has a gradient of its own."""
    first = plan.protocol(config, config["roles"]["large"])["loads"][0]
    return {factor: unit for factor, unit in FACTORS.items() if factor != "amplitude" or "magnitude" in first}


def variants(config: Config) -> dict[str, tuple[str, float | None]]:
    """Factor and value of each variant, by the name of its files: `base`, then every value that is not the study's own.

    There is none of a user's networks.
    """
    if plan.own_networks(config):
        return {}
    others = {
        f"{factor}_{value:.6g}": (factor, value)
        for factor in factors(config)
        for value in config["sensitivity"][factor]
        if value != own_value(config, factor)
    }
    return {BASE: (BASE, None), **others}


def trial(config: Config, name: str) -> dict[str, Any]:
    """What the trial of the variant of that name depends on: the study's numbers with its own in their place."""
    factor, value = variants(config)[name]
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


def _networks(config: Config) -> list[dict[str, Any]]:
    """Alignments with the numbers of their networks, which are those of the ensemble of replicates."""
    names = [entry["name"] for entry in config["named"]]
    numbers = replicate_numbers(len(names), config["sensitivity"]["seeds"])
    return [
        {**config["named"][i], "numbers": [number for number in numbers if replicated(number) == i]}
        for i in (names.index(name) for name in config["sensitivity"]["networks"])
    ]


def own_values(config: Config) -> list[dict[str, Any]]:
    """Every factor with its unit and the study's own value; a list, since sorted JSON would lose the order."""
    return [
        {"name": name, "unit": unit, "own_value": own_value(config, name)} for name, unit in factors(config).items()
    ]


def own_value(config: Config, factor: str) -> float:
    """The study's own value of a factor."""
    section, key = _place(config, factor)
    return section[key]


def varied(config: Config, factor: str, value: float | None) -> Config:
    """The config with the value in the factor's place; as it is for the base, which has no value."""
    changed = copy.deepcopy(config)
    if value is not None:
        section, key = _place(changed, factor)
        section[key] = value
    return changed


def _place(config: Config, factor: str) -> tuple[Any, str]:
    """The mapping of the config that holds a factor, and its key there."""
    protocol = plan.protocol(config, config["roles"]["large"])
    places = {
        "edge_length_um": (config["cube"], factor),
        "volume_fraction": (config["cube"], factor),
        "nonlinearity": (config["fiber"], factor),
        "amplitude": (protocol["loads"][0], "magnitude"),
        "steps": (protocol, factor),
    }
    return places[factor]
