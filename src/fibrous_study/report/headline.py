"""What came out, in a few sentences: the first screen of the report and of the README.

Tables are those of results/claims.csv, results/tables/table_2.csv and results/tables/comparison.csv.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any

import pandas as pd

from fibrous_study.audit.verdict import Verdict
from fibrous_study.words import percent

MIXTURE = {"law": "families", "energy": "structure_tensor", "objective": "energy"}
ONE_LAW = {
    "Eq. 2": {"law": "structure_tensor", "energy": "structure_tensor", "objective": "energy"},
    "Eq. 10C": {"law": "families", "energy": "families", "objective": "energy"},
}


def counted(claims: pd.DataFrame) -> dict[str, int]:
    """How many statements got each verdict."""
    verdicts = claims.groupby("claim")["verdict"].first()
    return {verdict.value: int((verdicts == verdict.value).sum()) for verdict in Verdict}


def headline(tables: Mapping[str, pd.DataFrame]) -> list[str]:
    """Sentences from the `tables` that there are, by the names of fibrous_study.report.tables."""
    return [sentence for name, speak in SPEAKERS.items() if name in tables for sentence in speak(tables[name])]


def _of_claims(claims: pd.DataFrame) -> Iterator[str]:
    counts = counted(claims)
    of_each = ", ".join(f"{count} {verdict}" for verdict, count in counts.items() if count)
    yield f"Of {sum(counts.values())} checkable statements of the paper: {of_each}."


def _of_costs(table: pd.DataFrame) -> Iterator[str]:
    rows: list[dict[Any, Any]] = table.to_dict("records")
    hybrid = next(row["cpu_hours"] for row in rows if (row["method"], row["task"]) == ("hybrid", "total"))
    one = next(row for row in rows if row["method"] == "multiscale" and not pd.isna(row["paper_cpu_hours"]))
    finite_elements = next(row["cpu_hours"] for row in rows if str(row["task"]).startswith("finite elements, "))
    yield (
        f"The coupled (multiscale) simulation, with a network in equilibrium at every Gauss point, costs "
        f"{60.0 * one['cpu_hours']:.2g} CPU-minutes here, and {one['paper_cpu_hours']:,.0f} CPU-hours in the paper. "
        f"The hybrid method costs {60.0 * hybrid:.2g} CPU-minutes, {percent(1.0 - finite_elements / hybrid)} of it "
        f"outside its finite elements, for networks and their fits: the coupled simulation takes "
        f"{one['times_hybrid']:.2g} times as long, where the paper has {one['times_hybrid_paper']:,.0f} times "
        f"({one['specimen']}). Compared are the loads of one load set, one law fitted and refitted, and two runs of "
        "finite elements with one run that has the networks in it; one engine solves the networks of both, and making "
        "them is in neither."
    )


def _of_errors(table: pd.DataFrame) -> Iterator[str]:
    parts = [
        f"{name} {said}"
        for name, law in {
            "as the paper runs it, Eq. 2 fitted and Eq. 10C run,": MIXTURE,
            "Eq. 2 fitted and run": ONE_LAW["Eq. 2"],
            "Eq. 10C fitted and run": ONE_LAW["Eq. 10C"],
            "the networks' own fibres stretched affinely, with nothing fitted,": {"law": "affine"},
            "the matrix without any fibres": {"law": "matrix"},
        }.items()
        if (said := _errors(table, law))
    ]
    if parts:
        yield (
            "Error of the maximum shear stress, as RMS over the coupled simulation's own, initial → after the refit: "
            f"{'; '.join(parts)} ({table['specimen'].iloc[0]}). With the same constants Eq. 10C is a stiffer law than "
            "Eq. 2."
        )


SPEAKERS = {"claims": _of_claims, "table_2": _of_costs, "comparison": _of_errors}


def _errors(table: pd.DataFrame, law: dict[str, str]) -> str:
    """Errors of a law in words, initial and after its last refit; nothing where it was not run."""
    for column, value in law.items():
        table = table[table[column] == value]
    errors = table.sort_values("refits")["shear_stress_relative_rms_error"].tolist()
    said = percent(errors[0]) if errors else ""
    return said if len(errors) < 2 else f"{said} → {percent(errors[-1])}"
