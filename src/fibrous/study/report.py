"""Rule `report`: the whole study as one HTML page that a person reads, prints or sends."""

from __future__ import annotations

import json
import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd
import yaml

from fibrous import datasets
from fibrous.errors import DatasetError
from fibrous.report.headline import counted, headline
from fibrous.report.page import Claim, Report, Table, report_page
from fibrous.report.tables import VIEWS, shown
from fibrous.study.configuration import PROJECT, loaded

TITLE = "Fibre networks and the laws fitted to them"


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Write `page` from the `figures`, SVG in the order of the config's, and the `tables`, in that of its names.

    Raises DatasetError where one of them cannot be read.
    """
    config = params["config"]
    drawn = [figure["stage"] for figure in config["figures"]]
    figures = dict(zip(drawn, (_svg(path) for path in inputs["figures"]), strict=True))
    paths = dict(zip(config["tables"], inputs["tables"], strict=True))
    tables = {name: datasets.read_table(path, VIEWS[name].needed) for name, path in paths.items()}
    claims = tables.get("claims", pd.DataFrame(columns=["verdict"])).fillna("")
    page = report_page(
        Report(
            title=TITLE,
            headline=headline(tables),
            notes=_notes(config["study"]),
            figures=figures,
            captions={figure["stage"]: figure["caption"] for figure in config["figures"]},
            tables={name: Table(*shown(table, VIEWS[name]), VIEWS[name].path) for name, table in tables.items()},
            claims=[Claim(**{str(name): cell for name, cell in row.items()}) for row in claims.to_dict("records")],
            verdicts=counted(claims),
            provenance=_provenance(tables["stages"], config["study"]),
            config=_as_yaml(in_order_of(loaded(), config["study"])),
        )
    )
    datasets.write_bytes(page.encode(), outputs["page"], params)


def _svg(path: Path) -> bytes:
    try:
        return path.read_bytes()
    except OSError as error:
        raise DatasetError(f"{path}: {error.strerror}; run the rule that draws it") from None


def _notes(study: Mapping[str, Any]) -> list[str]:
    """What a reader must know first: captions speak of the default study."""
    default = loaded()
    other = [key for key in default if key in study and study[key] != default[key]]
    if not other:
        return []
    return [
        f"This run's config differs from the default one in {', '.join(other)}. Numbers, verdicts and pictures are "
        "this run's; what captions say there is to see is what the default study shows."
    ]


def in_order_of(default: Any, value: Any) -> Any:
    """A config with its keys in the order of the default one's; those that it lacks come last.

    >>> in_order_of({"b": 1, "a": {"d": 1, "c": 1}}, {"a": {"c": 2, "d": 3}, "b": 4, "e": 5})
    {'b': 4, 'a': {'d': 3, 'c': 2}, 'e': 5}
    """
    if isinstance(value, dict) and isinstance(default, dict):
        keys = [key for key in default if key in value] + [key for key in value if key not in default]
        return {key: in_order_of(default.get(key), value[key]) for key in keys}
    if isinstance(value, list) and isinstance(default, list) and default:
        return [in_order_of(default[0], one) for one in value]
    return value


def _provenance(stages: pd.DataFrame, study: Mapping[str, Any]) -> dict[str, str]:
    versions = [
        ", ".join(f"{name} {one}" for name, one in json.loads(said).items()) for said in _each(stages["versions"])
    ]
    return {
        "commit": commit(),
        "seed": str(study["seed"]),
        "CPU-hours": f"{stages['cpu_seconds'].sum() / 3600.0:.3g} in {stages['jobs'].sum()} jobs",
        "largest memory of a job": f"{stages['largest_peak_memory_MB'].max():,.0f} MB",
        "machine": "; ".join(_each(stages["machine"])),
        "versions": "; ".join(versions),
    }


def _each(said: pd.Series) -> list[str]:
    """What the rows say, each thing once."""
    return list(dict.fromkeys(one for row in said for one in row.split("; ")))


def _as_yaml(config: Mapping[str, Any]) -> str:
    return yaml.safe_dump(config, sort_keys=False, allow_unicode=True, width=110)


def commit() -> str:
    """The commit of the package's checkout, and whether its files have changed since; or that there is none."""
    try:
        return _git("rev-parse", "HEAD") + (" with changes since" if _git("status", "--porcelain", "-uno") else "")
    except (OSError, subprocess.CalledProcessError):
        return "not a git checkout"


def _git(*words: str) -> str:
    done = subprocess.run(["git", "-C", str(PROJECT), *words], capture_output=True, text=True, check=True)
    return done.stdout.strip()
