"""Rule `show_table`: a table of the study as a page that a browser shows, for Snakemake's own report."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fibrous.datasets import read_table, write_bytes
from fibrous.report.page import table_page
from fibrous.report.tables import VIEWS, shown


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Write `table`, as the report shows the one that the config calls `table`, to `page`."""
    name = params["config"]["table"]
    view = VIEWS[name]
    headings, rows = shown(read_table(inputs["table"][0], view.needed), view)
    write_bytes(table_page(name.replace("_", " "), headings, rows).encode(), outputs["page"], params)
