"""Everything the paper prints, and what is said of its statements: config/paper.yaml."""

from __future__ import annotations

from functools import cache
from typing import Any

from fibrous.errors import ConfigError
from fibrous_study.config import PROJECT, parsed

PAPER = PROJECT / "config" / "paper.yaml"


@cache
def paper() -> dict[str, Any]:
    """All sections of config/paper.yaml. Raises ConfigError where it cannot be read."""
    sections = parsed(PAPER)
    if not isinstance(sections, dict):
        raise ConfigError(f"{PAPER}: must hold sections, each a key with its values")
    return sections


def section(name: str) -> Any:
    """A section by its name. Raises ConfigError where there is none."""
    if name not in paper():
        raise ConfigError(f"{PAPER}: lacks the section {name}; known are {', '.join(paper())}")
    return paper()[name]
