"""Rule `report`: the whole study as one HTML page that a person reads, prints or sends."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import pandas as pd

from fibrous.errors import DatasetError
from fibrous_study import datasets
from fibrous_study.audit.wording import worded
from fibrous_study.report.headline import counted, headline
from fibrous_study.report.outline import OUTLINE, SECTIONS, name_of
from fibrous_study.report.page import images, page
from fibrous_study.report.tables import VIEWS, shown


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Write `page` from the `figures`, SVG in the order of the config's, and the `tables`, in that of its names.

    The config also holds the run's own as the YAML that a reader sees (`study`), the keys in which it differs from the
    default one, and the `commit` of the sources.
    Raises DatasetError where one of them cannot be read.
    """
    config = params["config"]
    figures = {name: _svg(path) for name, path in zip(config["figures"], inputs["figures"], strict=True)}
    paths = dict(zip(config["tables"], inputs["tables"], strict=True))
    tables = {name: datasets.read_table(path, name) for name, path in paths.items()}
    claims = worded(tables["claims"], config["paper"]["statements"]) if "claims" in tables else []
    there = {*figures, *tables, *(claim.under for claim in claims)}
    text = page(
        OUTLINE["title"],
        outline=OUTLINE,
        sections=[section for section in SECTIONS if there & {*map(name_of, section["exhibits"])}],
        claims={claim.id: claim for claim in claims},
        contradictions=config["paper"]["contradictions"],
        counts=counted(tables["claims"]) if claims else {},
        headline=headline(tables),
        notes=_notes(config["other_than_default"]),
        images=images(figures),
        tables={name: (*shown(table, VIEWS[name]), VIEWS[name].path) for name, table in tables.items()},
        provenance=_provenance(tables["stages"], config["commit"], config["seed"]),
        config=config["study"],
    )
    datasets.write_bytes(text.encode(), outputs["page"], params)


def _svg(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise DatasetError(f"{path}: {error.strerror}; run the rule that draws it") from None


def _notes(other: Sequence[str]) -> list[str]:
    """What a reader must know first of a config with `other` values than the default: captions speak of the latter."""
    if not other:
        return []
    return [
        f"This run's config differs from the default one in {', '.join(other)}. Numbers, verdicts and pictures are "
        "this run's; what captions say there is to see is what the default study shows."
    ]


def _provenance(stages: pd.DataFrame, commit: str, seed: int) -> dict[str, str]:
    versions = [", ".join(map(" ".join, json.loads(text).items())) for text in _distinct(stages["versions"])]
    return {
        "commit": commit,
        "seed": str(seed),
        "CPU-hours": f"{stages['cpu_seconds'].sum() / 3600.0:.3g} in {stages['jobs'].sum()} jobs",
        "largest memory of a job": f"{stages['largest_peak_memory_MB'].max():,.0f} MB",
        "machine": "; ".join(_distinct(stages["machine"])),
        "versions": "; ".join(versions),
    }


def _distinct(cells: pd.Series) -> list[str]:
    """The entries of all cells, each once."""
    return list(dict.fromkeys(entry for cell in cells for entry in cell.split("; ")))
