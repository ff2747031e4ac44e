"""Pages that need nothing outside of them: the template report.html with its styles, figures embedded."""

from __future__ import annotations

import base64
import re
from collections.abc import Mapping
from importlib import resources
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

_WIDTH = re.compile(rb'<svg[^>]*?\swidth="([0-9.]+)pt"')


def page(title: str, **content: Any) -> str:
    """The template filled with `content`: a `table`, its headings and rows of texts, or all that the report holds."""
    environment = Environment(
        loader=PackageLoader("fibrous_study.report", ""),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    style = Markup((resources.files("fibrous_study.report") / "report.css").read_text(encoding="utf-8"))
    return environment.get_template("report.html").render(title=title, style=style, **content)


def images(figures: Mapping[str, bytes]) -> dict[str, tuple[str, float]]:
    """SVG figures as links that hold them, with widths in percent of the widest, so that letters are of one size."""
    widths = {name: float(match.group(1)) if (match := _WIDTH.search(svg)) else 0.0 for name, svg in figures.items()}
    widest = max(widths.values(), default=0.0)
    return {
        name: (
            f"data:image/svg+xml;base64,{base64.b64encode(svg).decode()}",
            100.0 * widths[name] / widest if widths[name] else 100.0,
        )
        for name, svg in figures.items()
    }
