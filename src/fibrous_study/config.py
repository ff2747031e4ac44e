"""The study's config, read, merged and checked before any job starts; every problem is named in a line by its key."""

from __future__ import annotations

import difflib
import json
import math
from collections.abc import Iterator, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import yaml
from pydantic import ValidationError
from snakemake.utils import update_config

from fibrous.errors import ConfigError
from fibrous_study import plan
from fibrous_study.config_model import UNITS, Contradiction, Study
from fibrous_study.variants import factors, varied

Config = dict[str, Any]

PROJECT = Path(__file__).parents[2]
DEFAULT = PROJECT / "config" / "config.yaml"


def validated(config: Mapping[str, Any]) -> Config:
    """The merged config, checked, as dictionaries and lists, with a float wherever a number need not be whole.

    Raises ConfigError with one line that names every problem by its key's path.
    """
    try:
        plain = Study.model_validate(config).plain()
        problems = list(_of_sensitivity(plain))
    except ValidationError as error:
        problems = list(_problems(error))
    if problems:
        raise ConfigError("config: " + "; ".join(problems))
    return plain


def loaded(override: Path | None = None) -> Config:
    """The default config with the user's file merged over it as Snakemake's --configfile does, and validated.

    Dictionaries are merged, everything else is replaced. Raises ConfigError where a file cannot be read.
    """
    config = _read(DEFAULT)
    if override is not None:
        update_config(config, _read(override))
    return validated(config)


def parsed(path: Path) -> Any:
    """What a YAML file holds. Raises ConfigError where it cannot be read."""
    try:
        return yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: not YAML ({' '.join(str(error).split())})") from None


def _read(path: Path) -> Config:
    content = parsed(path)
    if not isinstance(content, dict):
        raise ConfigError(f"{path}: must hold keys and values at its top level")
    return content


def _of_sensitivity(config: Config) -> Iterator[str]:
    """Problems of the config that a value to be tried would bring."""
    for factor in () if plan.own_networks(config) else factors(config):
        for i, value in enumerate(config["sensitivity"][factor]):
            try:
                Study.model_validate(varied(config, factor, value))
            except ValidationError as error:
                for problem in _problems(error):
                    yield f"sensitivity.{factor}[{i}] is {value:g}, with which {problem}"


def schema_at(path: Sequence[str | int] = ()) -> dict[str, Any]:
    """The JSON schema of the config, or of the key or entry at that path. Raises KeyError for none such."""
    root = _schema()
    schema = root
    for part in path:
        schema = _resolved(schema["properties"][part] if isinstance(part, str) else schema["items"], root)
    return schema


@cache
def _schema() -> dict[str, Any]:
    return Study.model_json_schema()


def _resolved(schema: dict[str, Any], root: dict[str, Any]) -> dict[str, Any]:
    """A key's own schema, with what that of its type adds."""
    if "$ref" in schema:
        return root["$defs"][schema["$ref"].rpartition("/")[2]] | schema
    if "anyOf" in schema:  # a number or null
        return schema["anyOf"][0] | {"nullable": True, "description": schema["description"]}
    return schema


WANTED = {
    "int_type": "a whole number",
    "float_type": "a number",
    "finite_number": "a number",
    "bool_type": "true or false",
    "string_type": "a text",
    "list_type": "a list",
    "model_type": "keys with values",
    "string_pattern_mismatch": "a name of letters, digits and _, since it becomes part of a file name",
    "string_too_short": "a file, seen from the folder in which the study runs",
}
LIMITS = {
    "greater_than": ("gt", "greater than"),
    "greater_than_equal": ("ge", "at least"),
    "less_than": ("lt", "less than"),
    "less_than_equal": ("le", "at most"),
    "too_short": ("min_length", "at least"),
    "too_long": ("max_length", "at most"),
}


def _problems(error: ValidationError) -> Iterator[str]:
    """What is wrong, in words, each line with the key's path."""
    for detail in error.errors(include_url=False):
        kind, location, value, context = detail["type"], detail["loc"], detail["input"], detail.get("ctx", {})
        path, cause = key_path(location), context.get("error")
        if isinstance(cause, Contradiction):
            for line in cause.lines:
                yield path + line if line[0] in " [" else f"{path}.{line}".lstrip(".")
        elif kind == "missing":
            yield f"{path} is missing"
        elif kind in ("extra_forbidden", "invalid_key"):
            key, known = str(location[-1]), schema_at(location[:-1])["properties"]
            near = difflib.get_close_matches(key, known, n=1)
            yield f"{key_path((*location[:-1], key))} is unknown, " + (
                f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}"
            )
        elif kind == "literal_error":
            yield f"{path} is {_shown(value)}, must be {context['expected']}"
        elif kind in ("too_short", "too_long"):
            limit, comparison = LIMITS[kind]
            yield f"{path} has {context['actual_length']} entries, must have {comparison} {context[limit]}"
        elif kind in LIMITS:
            limit, comparison = LIMITS[kind]
            unit = unit_of(location)
            yield f"{path} is {_shown(value)}, must be {comparison} {context[limit]:.15g}{f' {unit}' if unit else ''}"
        else:
            wanted = WANTED[kind] + (" or null" if schema_at(location).get("nullable") else "")
            yield f"{path or 'the config'} is {_shown(value)}, must be {wanted}{_number_hint(value, kind)}"


def key_path(location: Sequence[str | int]) -> str:
    """A key as messages call it.

    >>> key_path(("protocols", 0, "loads", 1, "load"))
    'protocols[0].loads[1].load'
    """
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in location).lstrip(".")


def unit_of(location: Sequence[str | int]) -> str:
    """Unit of a number, from the ending of its key; empty where it has none.

    >>> unit_of(("sensitivity", "edge_length_um", 0)), unit_of(("seed",))
    ('µm', '')
    """
    name = next((part for part in reversed(location) if isinstance(part, str)), "")
    return UNITS.get(name.rpartition("_")[2], "")


def _number_hint(value: Any, kind: str) -> str:
    """What to write instead of a text that reads like a number: YAML takes 1e-9 for a text, and 1.0e-9 for a number."""
    try:
        number = float(value) if kind == "float_type" and isinstance(value, str) else math.nan
    except ValueError:
        return ""
    written = repr(number) if "." in repr(number) else repr(number).replace("e", ".0e")
    return f"; write {written}" if math.isfinite(number) else ""


def _shown(value: Any) -> str:
    if isinstance(value, str):
        return f"the text '{' '.join(value.split())[:60]}'"
    if isinstance(value, dict | list):
        return "a mapping" if isinstance(value, dict) else "a list"
    return json.dumps(value) if isinstance(value, bool | None) else str(value)[:60]
