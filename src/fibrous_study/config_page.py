"""The page docs/config.md: every key of the config, from the models and the default config."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import Any

from fibrous_study.config import DEFAULT, parsed, schema_at, unit_of

HEAD = """# Every key of the config

The default study is `config/config.yaml`; a file of your own, laid over it with `--configfile`, names only what it
changes: keys of a mapping are laid over those of the default, a list replaces the list there. What is wrong is named in
one line before any job starts. Made by `python -m fibrous_study describe-config`.
"""
TABLE = "\n| key | type and range | unit | default | meaning |\n|---|---|---|---|---|\n"
TYPES = {"integer": "whole number", "number": "number", "boolean": "true or false"}
COMPARISONS = {"minimum": "≥", "exclusiveMinimum": ">", "maximum": "≤", "exclusiveMaximum": "<"}
Path = tuple[str | int, ...]


def described() -> str:
    """The page, as Markdown: keys without a section first, then a table for each section."""
    default, alone, sections = parsed(DEFAULT), "", ""
    for name in schema_at()["properties"]:
        schema = schema_at((name,))
        if "properties" in schema or "$ref" in schema.get("items", {}):
            sections += f"\n## {name}\n\n{schema['description'][0].upper()}{schema['description'][1:].rstrip('.')}.\n"
            sections += TABLE + "".join(_rows((name,), default[name]))
        else:
            alone += _row((name,), schema, default[name])
    return HEAD + TABLE + alone + sections


def _rows(path: Path, default: Any) -> Iterator[str]:
    """Rows of the keys of a section, or of the entries of a list of sections."""
    schema = schema_at(path)
    if schema["type"] == "array":
        path, default, schema = (*path, 0), {}, schema_at((*path, 0))
    for name in schema["properties"]:
        inner = schema_at((*path, name))
        yield _row((*path, name), inner, default.get(name))
        if "$ref" in inner.get("items", {}):
            yield from _rows((*path, name), {})


def _row(path: Path, schema: dict[str, Any], default: Any) -> str:
    key = "".join("[]" if isinstance(part, int) else f".{part}" for part in path).lstrip(".")
    # A list of sections stands in the default file, with its comments.
    left_out = default is None and not schema.get("nullable")
    shown = "" if left_out or "$ref" in schema.get("items", {}) else _text(default)
    return f"| `{key}` | {_kind(schema)} | {unit_of(path)} | {shown} | {schema.get('description', '')} |\n"


def _text(value: Any) -> str:
    return f"`{json.dumps(value, ensure_ascii=False)}`".replace('"', "")


def _kind(schema: dict[str, Any]) -> str:
    """Type and range in words.

    >>> _kind({"type": "array", "minItems": 2, "maxItems": 2, "items": {"type": "number", "exclusiveMinimum": 0}})
    'list of 2: number > 0'
    """
    if "enum" in schema or "const" in schema:
        return ", ".join(f"`{name}`" for name in schema.get("enum", [schema.get("const")]))
    if schema["type"] == "array":
        least, most = schema.get("minItems", 0), schema.get("maxItems")
        count = f" of {most}" if most else f" of at least {least}" if least else ""
        return f"list{count}" + ("" if "$ref" in schema["items"] else f": {_kind(schema['items'])}")
    if schema["type"] == "string":
        return "name" if "pattern" in schema else "file"
    limits = [f"{sign} {schema[name]:.15g}" for name, sign in COMPARISONS.items() if name in schema]
    return " ".join([TYPES[schema["type"]], ", ".join(limits)]).strip() + (" or null" if "nullable" in schema else "")
