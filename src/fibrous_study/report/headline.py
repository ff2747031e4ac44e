"""What came out, in a few sentences: the first screen of the report and of the README.

Tables are those of results/claims.csv, results/tables/table_2.csv and results/tables/comparison.csv; the sentences are
templates in outline.yaml.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import pandas as pd

from fibrous_study.audit.verdict import Verdict
from fibrous_study.report.outline import OUTLINE
from fibrous_study.words import percent

SENTENCES: dict[str, Any] = OUTLINE["headline"]


def counted(claims: pd.DataFrame) -> dict[str, int]:
    """How many statements got each verdict."""
    verdicts = claims.groupby("claim")["verdict"].first()
    return {verdict.value: int((verdicts == verdict.value).sum()) for verdict in Verdict}


def headline(tables: Mapping[str, pd.DataFrame]) -> list[str]:
    """Sentences from the `tables` that there are, by the names of fibrous_study.report.tables."""
    sentences = {"claims": _of_claims, "table_2": _of_costs, "comparison": _of_errors}
    return [sentence for name, of_table in sentences.items() if name in tables and (sentence := of_table(tables[name]))]


def _of_claims(claims: pd.DataFrame) -> str:
    counts = counted(claims)
    verdicts = ", ".join(f"{count} {verdict}" for verdict, count in counts.items() if count)
    return SENTENCES["claims"].format(count=sum(counts.values()), verdicts=verdicts)


def _of_costs(table: pd.DataFrame) -> str:
    hybrid = table[table["method"] == "hybrid"].set_index("task")["cpu_hours"]
    finite_elements = hybrid[hybrid.index.str.startswith("finite elements, ")].iloc[0]
    coupled = table[(table["method"] == "multiscale") & table["paper_cpu_hours"].notna()].iloc[0]
    return SENTENCES["costs"].format(
        multiscale_minutes=60.0 * coupled["cpu_hours"],
        hybrid_minutes=60.0 * hybrid["total"],
        outside=percent(1.0 - finite_elements / hybrid["total"]),
        **{name: coupled[name] for name in ("paper_cpu_hours", "times_hybrid", "times_hybrid_paper", "specimen")},
    )


def _of_errors(table: pd.DataFrame) -> str:
    """Errors of each law, initial and after its last refit; nothing where none was run."""
    laws = []
    for law in SENTENCES["laws"]:
        of_law = table
        for column in law.keys() - {"words"}:
            of_law = of_law[of_law[column] == law[column]]
        errors = of_law.sort_values("refits")["shear_stress_relative_rms_error"].tolist()
        if errors:
            ends = dict.fromkeys((0, len(errors) - 1))
            laws.append(f"{law['words']} {' → '.join(percent(errors[end]) for end in ends)}")
    return SENTENCES["errors"].format(laws="; ".join(laws), specimen=table["specimen"].iloc[0]) if laws else ""
