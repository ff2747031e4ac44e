"""Rule `table_pages`: every table of the study as a page that a browser shows, for Snakemake's own report."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fibrous_study.datasets import read_table, write_bytes
from fibrous_study.report.page import page
from fibrous_study.report.tables import VIEWS, shown


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Write each of `tables`, in the order of the names that the config gives them, to the output of its name."""
    for name, path in zip(params["config"]["tables"], inputs["tables"], strict=True):
        view = VIEWS[name]
        text = page(name.replace("_", " "), table=shown(read_table(path, name), view))
        write_bytes(text.encode(), outputs[name], params)
