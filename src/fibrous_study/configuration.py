"""The study's config, checked before any job starts: the schema first, then what several keys say together.

Every problem that the schema finds is said in one line with the key's path; so is every cross-check's.
"""

from __future__ import annotations

import difflib
import json
import math
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import yaml

from fibrous.errors import ConfigError
from fibrous.networks import GENERATORS
from fibrous_study.contradictions import contradictions

Config = dict[str, Any]

PROJECT = Path(__file__).parents[2]
SCHEMA = PROJECT / "workflow" / "schemas" / "config.schema.yaml"
DEFAULT = PROJECT / "config" / "config.yaml"
CLAIMS = PROJECT / "config" / "claims.yaml"
CAPTIONS = PROJECT / "workflow" / "report"
TEMPLATES = Path(__file__).parent / "report"


def validated(config: Mapping[str, Any]) -> Config:
    """The merged config, checked, with every number of the schema's type `number` a float.

    Raises ConfigError with one line that names every problem by its key's path.
    """
    schema = schema_of_config()
    plain = _plain(config)
    found = (problem for error in _validator(schema).iter_errors(plain) for problem in _said(error))
    problems = list(dict.fromkeys(found))  # every missing key comes once for each of its companions
    if not problems:
        plain = _with_floats(plain, schema, schema)
        problems = list(contradictions(plain))
    if problems:
        raise ConfigError("config: " + "; ".join(problems))
    return plain


@cache
def schema_of_config() -> dict[str, Any]:
    """The JSON schema of the config. Raises ConfigError where the package does not lie in its checkout."""
    try:
        schema = yaml.safe_load(SCHEMA.read_text(encoding="utf-8"))
        schema["properties"]["network"]["enum"] = [*GENERATORS, "file"]
        return schema
    except OSError:
        raise ConfigError(
            f"{SCHEMA}: no such file; install the package from its checkout with pip install -e"
        ) from None


def loaded(override: Path | None = None) -> Config:
    """The default config with the user's file merged over it as Snakemake's --configfile does, and validated.

    Dictionaries are merged, everything else is replaced. Raises ConfigError where a file cannot be read.
    """
    config = _read(DEFAULT)
    if override is not None:
        _merge(config, _read(override))
    return validated(config)


@cache
def statements() -> list[dict[str, Any]]:
    """What the paper says, as config/claims.yaml has it. Raises ConfigError where that cannot be read."""
    found = parsed(CLAIMS)
    if not isinstance(found, list):
        raise ConfigError(f"{CLAIMS}: must hold a list of statements")
    return found


@cache
def caption(name: str) -> str:
    """What the report says below a figure, from the file that Snakemake's own report shows. Raises ConfigError."""
    path = CAPTIONS / f"{name}.rst"
    try:
        return " ".join(path.read_text(encoding="utf-8").split())
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}; write the caption of {name}") from None


def _read(path: Path) -> Config:
    content = parsed(path)
    if not isinstance(content, dict):
        raise ConfigError(f"{path}: must hold keys and values at its top level")
    return content


def parsed(path: Path) -> Any:
    """What a YAML file holds. Raises ConfigError where it cannot be read."""
    try:
        return yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: not YAML ({' '.join(str(error).split())})") from None


def _merge(config: Config, override: Mapping[str, Any]) -> None:
    for key, value in override.items():
        if isinstance(value, Mapping):
            if not isinstance(config.get(key), dict):
                config[key] = {}
            _merge(config[key], value)
        else:
            config[key] = value


def _plain(value: Any) -> Any:
    """Ordinary dictionaries and lists, whatever the reader of the YAML made."""
    if isinstance(value, Mapping):
        return {key: _plain(item) for key, item in value.items()}
    return [_plain(item) for item in value] if isinstance(value, list) else value


def _validator(schema: Mapping[str, Any]) -> Any:
    base = jsonschema.Draft202012Validator
    types = base.TYPE_CHECKER.redefine("number", lambda _, value: _is_number(value))
    types = types.redefine("integer", lambda _, value: isinstance(value, int) and not isinstance(value, bool))
    return jsonschema.validators.extend(base, type_checker=types)(schema)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value)


TYPES = {
    "integer": "a whole number",
    "number": "a number",
    "boolean": "true or false",
    "string": "a text",
    "array": "a list",
    "object": "keys with values",
    "null": "null",
}
COMPARISONS = {
    "minimum": "at least",
    "exclusiveMinimum": "greater than",
    "maximum": "at most",
    "exclusiveMaximum": "less than",
}


def _said(error: jsonschema.ValidationError) -> Iterator[str]:
    """A problem, or one for every unknown or missing key, in words with the key's path."""
    path = _path(error.absolute_path)
    value: Any = error.instance
    wanted: Any = error.validator_value
    schema: Any = error.schema
    unit = schema.get("unit", "1")
    unit = "" if unit == "1" else f" {unit}"
    keyword = str(error.validator)
    match keyword:
        case "additionalProperties":
            known = schema["properties"]
            for key in value:
                if key not in known:
                    near = difflib.get_close_matches(str(key), known, n=1)
                    hint = f"did you mean {near[0]}?" if near else f"known are {', '.join(known)}"
                    yield f"{_path([*error.absolute_path, key])} is unknown, {hint}"
        case "required":
            for key in wanted:
                if key not in value:
                    yield f"{_path([*error.absolute_path, key])} is missing"
        case "type":
            names = [wanted] if isinstance(wanted, str) else wanted
            hint = _number_hint(value) if "number" in names else ""
            yield f"{path} is {_shown(value)}, must be {' or '.join(TYPES[name] for name in names)}{hint}"
        case "enum":
            yield f"{path} is {_shown(value)}, must be one of {', '.join(wanted)}"
        case "pattern" | "minLength":
            yield f"{path} is {_shown(value)}, must be {schema['description']}"
        case "minItems" | "maxItems":
            least = "at least" if keyword == "minItems" else "at most"
            yield f"{path} has {len(value)} entries, must have {least} {wanted}"
        case _:
            yield f"{path} is {_shown(value)}, must be {COMPARISONS[keyword]} {wanted:.15g}{unit}"


def _number_hint(value: Any) -> str:
    """What to write instead of a text that reads like a number: YAML takes 1e-9 for a text, and 1.0e-9 for a number."""
    try:
        number = float(value) if isinstance(value, str) else math.nan
    except ValueError:
        return ""
    written = repr(number) if "." in repr(number) else repr(number).replace("e", ".0e")
    return f"; write {written}" if math.isfinite(number) else ""


def _shown(value: Any) -> str:
    if isinstance(value, str):
        return f"the text '{' '.join(value.split())[:60]}'"
    if isinstance(value, dict):
        return "a mapping"
    if isinstance(value, list):
        return "a list"
    return json.dumps(value) if isinstance(value, bool | None) else str(value)


def _path(parts: Any) -> str:
    return "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in parts).lstrip(".") or "the config"


def _with_floats(value: Any, schema: Mapping[str, Any], root: Mapping[str, Any]) -> Any:
    """20 and 20.0 are the same length: written alike, they have the same hash and rerun nothing."""
    if "$ref" in schema:
        schema = root["$defs"][schema["$ref"].rpartition("/")[2]]
    if isinstance(value, dict):
        return {key: _with_floats(item, schema["properties"][key], root) for key, item in value.items()}
    if isinstance(value, list):
        return [_with_floats(item, schema["items"], root) for item in value]
    return float(value) if value is not None and "number" in schema["type"] else value
