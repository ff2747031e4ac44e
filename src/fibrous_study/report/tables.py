"""Tables of the study as a reader meets them: which columns and rows, and numbers with three digits."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import pandas as pd

from fibrous_study.words import law_label

# Load sets are named after sections of the paper.
_SECTION = re.compile(r"\bsection_(\d+)_(\d+)\b")


@dataclass(frozen=True)
class View:
    """A table as the report shows it.

    path : of its CSV
    columns : of the CSV, with the heading of each; all others are left out
    where : values that rows may have, `None` for a missing one
    law : heading of a first column that says in words what the law of a row is, or nothing
    """

    path: str
    columns: Mapping[str, str]
    where: Mapping[str, tuple[Any, ...]] = field(default_factory=dict)
    law: str = ""

    @property
    def needed(self) -> tuple[str, ...]:
        """Columns that the CSV must have."""
        return (*self.columns, *self.where, *(("law", "constants", "energy", "objective") if self.law else ()))


VIEWS = {
    "table_1": View(
        "results/tables/table_1.csv",
        {
            "load_set": "load set",
            "lambda_f_max_least": "fitted up to λ_f, least",
            "lambda_f_max_largest": "largest",
            "ij": "ij",
            "alpha_MPa": "α, ours (MPa)",
            "alpha_half_width_MPa": "±",
            "alpha_paper_MPa": "α, paper (MPa)",
            "alpha_paper_half_width_MPa": "±",
            "beta_eight_terms": "β, ours (1)",
            "beta_eight_terms_half_width": "±",
            "beta_paper": "β, paper (1)",
            "beta_paper_half_width": "±",
        },
        {"protocol": ("large",)},
    ),
    "surface_over_triangle": View(
        "results/tables/surface_over_triangle.csv",
        {
            "surface": "surface",
            "load_set": "load set",
            "lambda_f_max_least": "fitted up to λ_f, least",
            "lambda_f_max_largest": "largest",
            "over": "where",
            "H11": "H11",
            "H22": "H22",
            "C2_MPa": "C2 (MPa)",
            "C3": "C3 (1)",
            "C2_negative_fraction": "share with C2 < 0",
            "C3_negative_fraction": "share with C3 < 0",
        },
        {
            "protocol": ("large", None),
            "surface": ("this_study_C3_eight_terms", "table_1_as_printed", "table_1_indices_swapped"),
        },
    ),
    "section_2_6_errors": View(
        "results/tables/section_2_6_errors.csv",
        {
            "constants": "constants",
            "component": "component",
            "relative_rms_error": "RMS error over the network's own (1)",
            "end_error_MPa": "difference at the end (MPa)",
            "r_squared": "R² of the fit",
        },
        {"component": ("xx", "yy", "all")},
        law="law",
    ),
    "tissue": View(
        "results/tables/tissue.csv",
        {
            "run": "run",
            "newton_iterations": "Newton iterations",
            "cuts": "cuts",
            "C2_mean_MPa": "mean C2 (MPa)",
            "C3_mean": "mean C3 (1)",
            "stretch_percentile_99": "99th percentile of stretch",
            "J_least": "least J",
            "J_largest": "largest J",
            "maximum_shear_stress_rms_MPa": "RMS maximum shear stress (MPa)",
        },
        law="law",
    ),
    "comparison": View(
        "results/tables/comparison.csv",
        {
            "run": "run",
            "specimen": "specimen",
            "shear_stress_rms_error_MPa": "RMS error of maximum shear stress (MPa)",
            "shear_stress_relative_rms_error": "relative error: maximum shear stress (1)",
            "shear_strain_relative_rms_error": "maximum shear strain (1)",
            "cauchy_stress_relative_rms_error": "Cauchy tensor (1)",
            "reaction_relative_error": "force on the bone (1)",
            "shear_stress_peak_overlap": "peaks of stress found (1)",
            "cpu_seconds": "CPU time of the finite elements (s)",
        },
        law="law",
    ),
    "table_2": View(
        "results/tables/table_2.csv",
        {
            "method": "method",
            "runs": "runs",
            "task": "task",
            "specimen": "specimen",
            "paper_cpu_hours": "paper (CPU-hours)",
            "cpu_hours": "here (CPU-hours)",
            "paper_over_ours": "paper over ours",
            "times_hybrid": "coupled over hybrid, here",
            "times_hybrid_paper": "coupled over hybrid, paper",
        },
    ),
    "table_2_parts": View(
        "results/tables/table_2_parts.csv",
        {"run": "run", "part": "part", "cpu_seconds": "CPU time (s)", "share": "share of the run"},
    ),
    "claims": View(
        "results/claims.csv",
        {
            "claim": "statement",
            "quantity": "quantity",
            "load_set": "load set",
            "value": "value",
            "unit": "unit",
            "low": "least over replicates",
            "high": "largest over replicates",
            "printed": "printed",
            "verdict": "verdict",
        },
    ),
    "stages": View(
        "results/tables/stages.csv",
        {
            "stage": "stage",
            "reads": "reads",
            "jobs": "jobs",
            "cpu_seconds": "CPU time (s)",
            "largest_peak_memory_MB": "largest memory of a job (MB)",
        },
    ),
    "targets": View(
        "results/tables/targets.csv",
        {"target": "target", "jobs": "jobs from an empty folder", "cpu_seconds": "CPU time (s)"},
    ),
}


def shown(table: pd.DataFrame, view: View) -> tuple[list[str], list[list[str]]]:
    """Headings and rows of `table` as `view` shows them, every cell a text; empty where the table holds nothing."""
    for column, values in view.where.items():
        table = table[table[column].isin([one for one in values if one]) | (table[column].isna() & (None in values))]
    if "ij" in table:
        table = table.assign(
            ij=table["ij"].map("{:02d}".format)
        )  # powers of H11 and H22, which a CSV takes for a number
    rows = [[cell(value) for value in row] for row in table[list(view.columns)].itertuples(index=False)]
    headings = list(view.columns.values())
    if not view.law:
        return headings, rows
    laws = [law_label(law) for law in table.to_dict("records")]
    return [view.law, *headings], [[law, *row] for law, row in zip(laws, rows, strict=True)]


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
