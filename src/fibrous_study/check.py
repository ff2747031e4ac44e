"""Whether the results on disk are those that the present config and code would make.

Every result carries the hashes of what made it, so this needs no record of past runs and works on a copied folder too.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from PIL import Image

from fibrous.errors import DatasetError
from fibrous_study.datasets import provenance_of
from fibrous_study.provenance import config_hash
from fibrous_study.stages import Config, Params, expected_files, possible_files

# Files with no place for provenance have it beside them.
WITH_COMPANION = (".csv", ".vtu", ".feb", ".html")
LEFT = {
    ".failed.nc": "the converged part of a run that failed",
    ".checkpoint": "of a run that was stopped, which the next one goes on from",
}
FOREIGN = "foreign, no stage of this study writes it"
DESCRIPTION = "{http://purl.org/dc/elements/1.1/}description"


def check(config: Config, folder: Path) -> tuple[list[str], int]:
    """One line for every file under `folder`/results that is stale, unreadable, missing or of no stage.

    Also returns the number of files that the study has. `config` is validated.
    """
    wanted = {path for path, _, _ in expected_files(config)}
    expected = {
        Path(path): (stage, wildcards)
        for path, stage, wildcards in possible_files(config)
        if path in wanted or (folder / path).is_file()
    }
    params, lines = Params(config), []
    for path, (stage, wildcards) in expected.items():
        fault = _fault(folder / path, params.of(stage, wildcards))
        if fault:
            lines.append(f"{path}: {fault}")
    sidecars = {Path(f"{path}.json") for path in expected if path.suffix in WITH_COMPANION}
    for found in sorted((folder / "results").rglob("*")):
        path = found.relative_to(folder)
        if found.is_file() and path not in expected and path not in sidecars:
            what = next((said for ending, said in LEFT.items() if path.name.endswith(ending)), FOREIGN)
            lines.append(f"{path}: {what}")
    return lines, len(expected)


def _fault(path: Path, params: Mapping[str, Any]) -> str:
    """What is wrong with the file, in words; nothing where it is as `params` would make it."""
    if not path.is_file():
        return "missing"
    try:
        found = _attributes(path)
        made_with = json.loads(found["config"])
    except (DatasetError, KeyError, TypeError, ValueError) as error:
        text = " ".join(str(error).removeprefix(f"{path}: ").split())
        return f"unreadable ({text[:120]})"
    if found.get("stage") != params["stage"]:
        return f"foreign, written by {found.get('stage')}"
    reasons = []
    if found.get("config_hash") != config_hash(params["config"]):
        reasons.append(_difference(made_with, params["config"], ""))
    if found.get("code_hash") != params["code_hash"]:
        reasons.append(f"the sources of {params['stage']} have changed")
    return f"stale, {' and '.join(reasons)}" if reasons else ""


def _attributes(path: Path) -> dict[str, Any]:
    """The attributes that a NetCDF, a PNG, an SVG or the companion of another file holds.

    Raises DatasetError where there are none, or the content is not whole.
    """
    try:
        if path.suffix in (".nc", *WITH_COMPANION):
            return provenance_of(path)
        if path.suffix == ".svg":
            return json.loads(ElementTree.parse(path).findtext(f".//{DESCRIPTION}") or "")
        with Image.open(path) as image:
            image.load()
            return json.loads(image.info["fibrous"])
    except (OSError, ValueError, KeyError, SyntaxError, ElementTree.ParseError) as error:
        raise DatasetError(str(error) or type(error).__name__) from None


def _difference(before: Any, now: Any, path: str) -> str:
    """The first place where two configs differ, in words."""
    if isinstance(before, dict) and isinstance(now, dict):
        for key in [*now, *before]:
            if before.get(key) != now.get(key) or (key in before) != (key in now):
                return _difference(before.get(key), now.get(key), f"{path}.{key}".lstrip("."))
    if isinstance(before, list) and isinstance(now, list) and len(before) == len(now):
        for i, (old, new) in enumerate(zip(before, now, strict=True)):
            if old != new:
                return _difference(old, new, f"{path}[{i}]")
    if path == "upstream":
        return "made from inputs that the present config or code would make differently"
    return f"made with {path} = {_short(before)} where the config now says {_short(now)}"


def _short(value: Any) -> str:
    text = json.dumps(value)
    return text if len(text) <= 60 else f"{text[:57]}..."
