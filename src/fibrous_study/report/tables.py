"""Tables of the study as a reader meets them: columns and rows that the schema shows, and numbers of three digits."""

from __future__ import annotations

import re
from typing import Any

import pandas as pd

from fibrous_study.schema import TABLES, Table
from fibrous_study.words import law_label

# Load sets are named after sections of the paper.
_SECTION = re.compile(r"\bsection_(\d+)_(\d+)\b")

# Tables that the report shows, in its order.
VIEWS = {name: table for name, table in TABLES.items() if table.headings}


def shown(table: pd.DataFrame, declared: Table) -> tuple[list[str], list[list[str]]]:
    """Headings and rows of `table` in the report, every cell a text; empty where the table holds nothing."""
    for column, values in declared.rows.items():
        table = table[table[column].isin(values)]
    headings = declared.headings
    rows = [[cell(value) for value in row] for row in table[list(headings)].itertuples(index=False)]
    if not declared.law:
        return list(headings.values()), rows
    laws = [law_label(law) for law in table.to_dict("records")]
    return [declared.law, *headings.values()], [[law, *row] for law, row in zip(laws, rows, strict=True)]


def cell(value: Any) -> str:
    """A number with three digits, and all digits of a whole one; nothing for a missing value.

    >>> [cell(one) for one in (0.012345, 1234.5, 20.0, 7, float("nan"), -0.5, 1.2e-6)]
    ['0.0123', '1,234', '20', '7', '', '−0.5', '1.2e−06']
    >>> cell("multiscale_one_step"), cell("section_3_1")
    ('multiscale one step', 'section 3.1')
    """
    if isinstance(value, str):
        return _SECTION.sub(r"section \1.\2", value).replace("_", " ")
    if pd.isna(value):
        return ""
    number = float(value)
    text = f"{number:,.0f}" if abs(number) >= 1000 or number.is_integer() else f"{number:.3g}"
    return text.replace("-", "−")
