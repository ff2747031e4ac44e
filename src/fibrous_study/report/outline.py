"""What the report tells, in order, as outline.yaml has it: sections, exhibits with captions, words, targets."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import Any

import yaml

OUTLINE: dict[str, Any] = yaml.safe_load(Path(__file__).with_suffix(".yaml").read_text(encoding="utf-8"))
SECTIONS: list[dict[str, Any]] = OUTLINE["sections"]
TARGETS: dict[str, list[str]] = OUTLINE["targets"]  # section of the paper, and what the target makes


def exhibits() -> Iterator[dict[str, Any]]:
    """All figures and tables in their order, each with the name of its section."""
    return ({**exhibit, "section": section["title"]} for section in SECTIONS for exhibit in section["exhibits"])


def figures() -> dict[str, dict[str, Any]]:
    """The exhibits that are figures, by the rule that draws each."""
    return {exhibit["figure"]: exhibit for exhibit in exhibits() if "figure" in exhibit}


def name_of(exhibit: dict[str, Any]) -> str:
    """What statements of config/paper.yaml say that they stand under."""
    return exhibit.get("figure") or exhibit["table"]


def in_snakemake(folder: Path) -> dict[str, dict[str, Any]]:
    """What Snakemake's own report shows beside each figure, by its rule, and beside tables: arguments of `report()`.

    It takes captions from files: they are written into `folder`.
    """
    shown = {
        name: (figure["caption"], {"category": figure["section"], "labels": {"figure": figure["title"]}})
        for name, figure in figures().items()
    }
    shown["table"] = (OUTLINE["table_caption"], {"category": "Tables"})
    folder.mkdir(parents=True, exist_ok=True)
    for name, (caption, _) in shown.items():
        (folder / f"{name}.rst").write_text(caption, encoding="utf-8")
    return {name: {"caption": str((folder / f"{name}.rst").resolve()), **rest} for name, (_, rest) in shown.items()}
