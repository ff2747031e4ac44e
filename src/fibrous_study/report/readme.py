"""Numbers of the README, as Markdown between marks, from the tables of a run: none of them is written by hand."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import pandas as pd

from fibrous.errors import DatasetError
from fibrous_study.audit.wording import Said, worded
from fibrous_study.report.headline import headline
from fibrous_study.report.outline import OUTLINE, TARGETS


def blocks(tables: Mapping[str, pd.DataFrame], statements: Sequence[Mapping[str, Any]]) -> dict[str, str]:
    """Markdown by the name of its mark, from tables by the names of fibrous_study.report.tables.

    `statements` is that section of config/paper.yaml.
    """
    return {
        "headline": "\n".join(f"- {sentence}" for sentence in headline(tables)),
        "size": _size(tables["stages"]),
        "statements": _statements(worded(tables["claims"], statements)),
        "targets": _targets(tables["targets"]),
    }


def filled(page: str, texts: Mapping[str, str]) -> str:
    """The page with every block between its marks, ``<!-- name -->`` and ``<!-- end of name -->``, put anew.

    Raises DatasetError where the page lacks the marks of a block.
    """
    for name, text in texts.items():
        start, end = f"<!-- {name} -->", f"<!-- end of {name} -->"
        if page.count(start) != 1 or page.count(end) != 1:
            raise DatasetError(f"the page must hold '{start}' and '{end}' once each")
        before, after = page[: page.index(start)], page[page.index(end) :]
        page = f"{before}{start}\n{text}\n{after}"
    return page


def _size(stages: pd.DataFrame) -> str:
    return (
        f"The whole study takes {duration(stages['cpu_seconds'].sum())} of CPU time in {stages['jobs'].sum()} jobs, "
        f"and its largest job {stages['largest_peak_memory_MB'].max() / 1000.0:.2g} GB of memory."
    )


def _statements(claims: Sequence[Said]) -> str:
    by_id = {claim.id: claim for claim in claims}
    shown = [by_id[id] for id in OUTLINE["readme"] if id in by_id]
    rows = ((claim.section, claim.says, claim.here, claim.verdict) for claim in shown)
    return _markdown(("section", "the paper says", "here", "verdict"), rows)


def _targets(targets: pd.DataFrame) -> str:
    spent = targets.set_index("target")["cpu_seconds"]
    rows = ((f"`{name}`", *about, duration(float(spent[name]))) for name, about in TARGETS.items() if name in spent)
    return _markdown(("target", "section of the paper", "result", "CPU time"), rows)


def _markdown(headings: Sequence[str], rows: Iterable[Sequence[str]]) -> str:
    lines = [f"| {' | '.join(headings)} |", "|" + "---|" * len(headings)]
    return "\n".join(lines + [f"| {' | '.join(row)} |" for row in rows])


def duration(seconds: float) -> str:
    """A time in seconds below two minutes, in minutes above.

    >>> duration(3.2), duration(75.0), duration(500.0)
    ('3 s', '75 s', '8 min')
    """
    return f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} min"
