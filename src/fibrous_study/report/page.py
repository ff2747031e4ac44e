"""The report as one HTML file without anything outside of it: figures are embedded, styles are inside."""

from __future__ import annotations

import base64
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, Template
from markupsafe import Markup

from fibrous_study.audit.wording import Said
from fibrous_study.report.outline import MEANINGS, SECTIONS, WORDS, Section

Rows = Sequence[Sequence[str]]
_WIDTH = re.compile(rb'<svg[^>]*?\swidth="([0-9.]+)pt"')


@dataclass(frozen=True)
class Table:
    """Headings and rows, every cell a text, and where the CSV is."""

    headings: Sequence[str]
    rows: Rows
    path: str


@dataclass(frozen=True)
class Report:
    """What the page holds beside the words of its outline.

    title, headline : what it is of, and the sentences of the first screen
    figures : SVG by the stage that drew it; captions by the same
    tables : by the names of fibrous_study.report.tables
    claims : in the order of the paper; contradictions : that they settle, as in config/paper.yaml
    verdicts : every verdict there is with the number of statements that got it
    notes : sentences that a reader should know first, such as how the config differs from the default
    provenance : commit, seed, versions, machine and the like; config : as YAML
    """

    title: str
    headline: Sequence[str]
    notes: Sequence[str]
    figures: Mapping[str, bytes]
    captions: Mapping[str, str]
    tables: Mapping[str, Table]
    claims: Sequence[Said]
    contradictions: Sequence[Mapping[str, Any]]
    verdicts: Mapping[str, int]
    provenance: Mapping[str, str]
    config: str


def report_page(report: Report) -> str:
    """The whole page."""
    return _template("report.html").render(
        report=report,
        sections=[section for section in SECTIONS if _tells(section, report)],
        meanings=MEANINGS,
        words=WORDS,
        style=_style(),
        claims={claim.id: claim for claim in report.claims},
        embedded=_embedded,
        share_of_width=_shares_of_width(report.figures),
        verdict_class=_verdict_class,
    )


def _tells(section: Section, report: Report) -> bool:
    """Whether the run has made anything that a section shows."""
    judged = {claim.under for claim in report.claims}
    return any(
        one.stage in report.figures or one.table in report.tables or one.name in judged for one in section.exhibits
    )


def table_page(title: str, headings: Sequence[str], rows: Rows) -> str:
    """A page of one table."""
    return _template("table.html").render(title=title, headings=headings, rows=rows, style=_style())


def _template(name: str) -> Template:
    environment = Environment(
        loader=PackageLoader("fibrous_study.report", ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    return environment.get_template(name)


def _style() -> Markup:
    return Markup((resources.files("fibrous_study.report") / "report.css").read_text(encoding="utf-8"))


def _embedded(svg: bytes) -> str:
    """An image of the page as a link that holds it."""
    return f"data:image/svg+xml;base64,{base64.b64encode(svg).decode()}"


def _shares_of_width(figures: Mapping[str, bytes]) -> dict[str, float]:
    """Width of every figure as a share of the widest one's, in percent, so that their letters are of one size."""
    widths = {name: float(found.group(1)) for name, svg in figures.items() if (found := _WIDTH.search(svg))}
    return {name: 100.0 * width / max(widths.values()) for name, width in widths.items()}


def _verdict_class(verdict: str) -> str:
    """The verdict's name in the style sheet: its first word.

    >>> _verdict_class("cannot be checked: data not public")
    'cannot'
    """
    return verdict.split()[0]
