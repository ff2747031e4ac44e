"""What the sensitivities vary: one number of the study at a time, everything else as the config has it."""

from __future__ import annotations

import copy
from dataclasses import dataclass
from typing import Any

from fibrous.errors import ConfigError
from fibrous_study import plan
from fibrous_study.plan import Config

# Keys under `sensitivity` that list values, with their unit.
FACTORS = {"edge_length_um": "µm", "volume_fraction": "1", "nonlinearity": "1", "amplitude": "1", "steps": "1"}
BASE = "base"


@dataclass(frozen=True)
class Variant:
    """The study with one number replaced; the base has the study's own numbers, and no value."""

    factor: str = BASE
    value: float | None = None

    @property
    def name(self) -> str:
        """Of its files.

        >>> Variant("volume_fraction", 0.02).name, Variant().name
        ('volume_fraction_0.02', 'base')
        """
        return BASE if self.value is None else f"{self.factor}_{self.value:.6g}"


def factors(config: Config) -> dict[str, str]:
    """The factors that are varied, with their unit: no amplitude where the first load has a gradient of its own."""
    first = plan.protocol(config, config["roles"]["large"])["loads"][0]
    return {factor: unit for factor, unit in FACTORS.items() if factor != "amplitude" or "magnitude" in first}


def variants(config: Config) -> list[Variant]:
    """The base, then every value of every factor that is not the study's own; none of a user's networks."""
    if plan.own_networks(config):
        return []
    others = [
        Variant(factor, value)
        for factor in factors(config)
        for value in config["sensitivity"][factor]
        if value != own_value(config, factor)
    ]
    return [Variant(), *others]


def variant_called(config: Config, name: str) -> Variant:
    """The variant of that name."""
    return next(variant for variant in variants(config) if variant.name == name)


def own_value(config: Config, factor: str) -> float:
    """The study's own value of a factor."""
    section, key = _place(config, factor)
    return section[key]


def varied(config: Config, variant: Variant) -> Config:
    """The config with the variant's value in its place."""
    changed = copy.deepcopy(config)
    if variant.value is not None:
        section, key = _place(changed, variant.factor)
        section[key] = variant.value
    return changed


def _place(config: Config, factor: str) -> tuple[Any, str]:
    """The mapping of the config that holds a factor, and its key there."""
    match factor:
        case "edge_length_um" | "volume_fraction":
            return config["cube"], factor
        case "nonlinearity":
            return config["fiber"], factor
        case "amplitude":
            return plan.protocol(config, config["roles"]["large"])["loads"][0], "magnitude"
        case "steps":
            return plan.protocol(config, config["roles"]["large"]), factor
    raise ConfigError(f"sensitivity: nothing varies '{factor}', must be one of {', '.join(FACTORS)}")
