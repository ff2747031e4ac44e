"""What figures and pages call a law and where its constants come from."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from fibrous.materials.registry import LAWS

# What was fitted: section 2.5 may fit a slope in place of an energy.
FITTED = {"energy": "fitted", "slope": "fitted", "stress": "fitted to stress"}


def law_label(model: Mapping[Any, Any]) -> str:
    """What a law is and where its constants come from, by `law`, `constants`, `energy` and `objective` of its table.

    >>> law_label({"law": "families", "constants": "fit", "energy": "structure_tensor", "objective": "energy"})
    'Eq. 2 fitted, Eq. 10C run'
    """
    law = LAWS[model["law"]]
    if not law.has_constants:
        return law.label
    if model["constants"] == "surface":
        return f"surface of Eq. 11, {law.label} run"
    fitted = f"{LAWS[model['energy']].label} {FITTED[model['objective']]}"
    if model["law"] != model["energy"]:
        return f"{fitted}, {law.label} run"
    return fitted if model["objective"] == "stress" else f"{fitted} and run"


def spoken(load_set: str) -> str:
    """The name of a load set as sentences say it.

    >>> spoken("section_3_1"), spoken("my_loads")
    ("section 3.1's loads", 'my loads')
    """
    words = load_set.split("_")
    return f"section {'.'.join(words[1:])}'s loads" if words[0] == "section" else " ".join(words)


SMALLEST = 1e-6  # a number below it is rounding, or as good as nothing


def number(value: float, digits: int = 3) -> str:
    """A number with so many digits, thousands apart, and no power of ten.

    >>> number(0.12345), number(2.0), number(-1013.2), number(1772.09), number(0.0), number(1e-16), number(math.nan)
    ('0.123', '2', '-1,010', '1,770', '0', 'less than 0.000001', 'unknown')
    """
    if not math.isfinite(value):
        return "unknown"
    if 0.0 < abs(value) < SMALLEST:
        return f"less than {SMALLEST:f}"
    if value == 0.0:
        return "0"
    decimals = digits - 1 - math.floor(math.log10(abs(value)))
    text = f"{round(value, decimals):,.{max(decimals, 0)}f}"
    return text.rstrip("0").rstrip(".") if "." in text else text


def percent(fraction: float) -> str:
    """A fraction in percent, with two digits.

    >>> percent(0.12345), percent(0.0123), percent(11.2)
    ('12 %', '1.2 %', '1,120 %')
    """
    return f"{number(100.0 * fraction, 2)} %" if abs(fraction) < 0.0995 else f"{100.0 * fraction:,.0f} %"
