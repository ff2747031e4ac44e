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
import numpy as np
import yaml

import fibrous
from fibrous.deformation import Load, averaged_stretch, largest_principal_stretch
from fibrous.errors import ConfigError
from fibrous.study.stages import FIGURE_NETWORK, FIGURE_PROTOCOLS, SURVEY_NETWORKS

Config = dict[str, Any]

PROJECT = Path(fibrous.__file__).parents[2]
SCHEMA = PROJECT / "workflow" / "schemas" / "config.schema.yaml"
DEFAULT = PROJECT / "config" / "config.yaml"

SURFACE_TERMS = 9
LARGEST_BATCH = 5000  # its numbers travel on the command line of a job
LARGEST_EXPONENT = 350.0  # exp of it, and the square of that, are finite in double precision
# A Delaunay network needs some ten nodes in the cube before its alignment means anything.
LEAST_FIBER_LENGTH = 40.0
LARGEST_FIBER_LENGTH = 20000.0  # some 90,000 nodes: beyond it the banded factor alone fills the memory of a machine


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
        problems = list(_contradictions(plain))
    if problems:
        raise ConfigError("config: " + "; ".join(problems))
    return plain


@cache
def schema_of_config() -> dict[str, Any]:
    """The JSON schema of the config. Raises ConfigError where the package does not lie in its checkout."""
    try:
        return yaml.safe_load(SCHEMA.read_text(encoding="utf-8"))
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


def _read(path: Path) -> Config:
    try:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
    except OSError as error:
        raise ConfigError(f"{path}: {error.strerror}") from None
    except (yaml.YAMLError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: not YAML ({' '.join(str(error).split())})") from None
    if not isinstance(content, dict):
        raise ConfigError(f"{path}: must hold keys and values at its top level")
    return content


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


def _contradictions(config: Config) -> Iterator[str]:
    """What is wrong between keys that are each right."""
    yield from _repeated(config)
    yield from _files(config)
    yield from _cube(config)
    if config["network"] == "delaunay":
        yield from _alignments(config)
        yield from _ensemble(config)
    yield from _loads(config)
    yield from _load_sets(config)


def _repeated(config: Config) -> Iterator[str]:
    for key in ("named", "network_files", "protocols", "load_sets"):
        names = [entry["name"] for entry in config[key]]
        for i, name in enumerate(names):
            if name in names[:i]:
                yield f"{key}[{i}].name is {name}, which {key}[{names.index(name)}] is called already"


def _files(config: Config) -> Iterator[str]:
    entries = config["network_files"]
    if config["network"] == "file" and not entries:
        yield "network_files is empty, must name your networks for network: file"
    if config["network"] != "file" and entries:
        yield "network_files names files, but network is delaunay; write network: file or leave the list empty"
    for i, entry in enumerate(entries):
        given = set(entry) - {"name"}
        if given not in ({"nodes", "fibers"}, {"file"}):
            yield f"network_files[{i}] must have nodes and fibers, or file alone"
        for key in sorted(given):
            if not Path(entry[key]).is_file():
                yield f"network_files[{i}].{key} is {entry[key]}, no such file seen from {Path.cwd()}"


def _cube(config: Config) -> Iterator[str]:
    fiber, cube = config["fiber"], config["cube"]
    if fiber["radius_um"] >= cube["edge_length_um"] / 2:
        yield f"fiber.radius_um is {fiber['radius_um']:g}, must be less than half of cube.edge_length_um"
        return
    length = cube["volume_fraction"] * cube["edge_length_um"] ** 2 / (math.pi * fiber["radius_um"] ** 2)
    if config["network"] == "delaunay" and length < LEAST_FIBER_LENGTH:
        yield (
            f"cube.volume_fraction is {cube['volume_fraction']:g}, which with this radius and edge leaves {length:.3g} "
            f"edge lengths of fiber in the cube, must be at least {LEAST_FIBER_LENGTH:g}: enlarge cube.edge_length_um"
        )
    if config["network"] == "delaunay" and length > LARGEST_FIBER_LENGTH:
        yield (
            f"cube.edge_length_um is {cube['edge_length_um']:g}, which with this radius and volume fraction puts "
            f"{length:.3g} edge lengths of fiber into the cube, must be at most {LARGEST_FIBER_LENGTH:g}"
        )
    largest = min(config["principal_stretch_limit"], fiber["linear_beyond_stretch"] or math.inf)
    if fiber["nonlinearity"] * (largest**2 - 1) / 2 > LARGEST_EXPONENT:
        yield (
            f"fiber.nonlinearity is {fiber['nonlinearity']:g}, which makes a fiber's force overflow at the stretch "
            f"{largest:g}: lower it, principal_stretch_limit or fiber.linear_beyond_stretch"
        )


def _alignments(config: Config) -> Iterator[str]:
    least, largest = config["delaunay"]["H11"]
    smallest = config["delaunay"]["smallest_H"]
    if least >= largest:
        yield f"delaunay.H11 is [{least:g}, {largest:g}], must rise"
    if 1 - largest < 2 * smallest:
        yield (
            f"delaunay.H11 reaches {largest:g}, which leaves no room for H22 and H33 of at least delaunay.smallest_H "
            f"= {smallest:g}: the components add up to 1"
        )
    for i, entry in enumerate(config["named"]):
        if entry["H11"] + entry["H22"] >= 1:
            yield f"named[{i}] has H11 + H22 = {entry['H11'] + entry['H22']:g}, must be less than 1, the trace of H"
    names = {entry["name"] for entry in config["named"]}
    for name in (FIGURE_NETWORK, *SURVEY_NETWORKS):
        if name not in names:
            yield f"named lacks {name}, which a figure draws"


def _ensemble(config: Config) -> Iterator[str]:
    networks, batches = config["delaunay"]["networks"], config["delaunay"]["batches"]
    folds = config["surface"]["cross_validation_folds"]
    if networks > LARGEST_BATCH * batches:
        yield (
            f"delaunay.batches is {batches}, which puts {networks / batches:.0f} networks into one, "
            f"must leave at most {LARGEST_BATCH}"
        )
    if batches > networks:
        yield f"delaunay.batches is {batches}, must be at most delaunay.networks = {networks}"
    if folds > networks:
        yield f"surface.cross_validation_folds is {folds}, must be at most delaunay.networks = {networks}"
    elif networks - math.ceil(networks / folds) <= SURFACE_TERMS:
        yield (
            f"delaunay.networks is {networks}, too few for the {SURFACE_TERMS} coefficients of Eq. 11 "
            f"with surface.cross_validation_folds = {folds}"
        )


def _loads(config: Config) -> Iterator[str]:
    names = [protocol["name"] for protocol in config["protocols"]]
    for name in FIGURE_PROTOCOLS:
        if config["network"] == "delaunay" and name not in names:
            yield f"protocols lacks {name}, which the figures draw"
    limit = config["principal_stretch_limit"]
    for i, protocol in enumerate(config["protocols"]):
        loads = [entry["load"] for entry in protocol["loads"]]
        for j, entry in enumerate(protocol["loads"]):
            path, load = f"protocols[{i}].loads[{j}]", Load.parse(entry["load"])
            if entry["load"] in loads[:j]:
                yield f"{path}.load is {entry['load']}, which the protocol has already"
            magnitude = entry.get("magnitude")
            if magnitude is None:
                if j == 0:
                    yield f"{path}.magnitude is missing: the first load gives the averaged stretch of the others"
                continue
            gradient = load.deformation_gradient(magnitude)
            stretch = float(largest_principal_stretch(gradient))
            if magnitude == load.rest:
                yield f"{path}.magnitude is {magnitude:g}, which deforms nothing"
            elif stretch > limit:
                yield (
                    f"{path}.magnitude is {magnitude:g}, a principal stretch of {stretch:.4g}, must stay within "
                    f"principal_stretch_limit = {limit:g}"
                )
            elif j == 0:
                yield from _unstretched(config, gradient, f"{path}.magnitude is {magnitude:g}")


def _unstretched(config: Config, gradient: Any, said: str) -> Iterator[str]:
    """λ_f² = H:C is linear in H, so the corners of the region of alignments speak for all of it."""
    if config["network"] == "file":
        return
    smallest = config["delaunay"]["smallest_H"]
    corners = [(H11, H22) for H11 in config["delaunay"]["H11"] for H22 in (smallest, 1 - H11 - smallest)]
    corners += [(entry["H11"], entry["H22"]) for entry in config["named"]]
    for H11, H22 in corners:
        stretch = float(averaged_stretch(gradient, np.diag([H11, H22, 1 - H11 - H22])))
        if stretch <= 1:
            yield (
                f"{said}, which gives a network of H = ({H11:.3g}, {H22:.3g}, {1 - H11 - H22:.3g}) the averaged "
                f"stretch {stretch:.4g}; must exceed 1 for every network, or no other load can reach it"
            )
            return


def _load_sets(config: Config) -> Iterator[str]:
    available = {protocol["name"]: {entry["load"] for entry in protocol["loads"]} for protocol in config["protocols"]}
    for i, load_set in enumerate(config["load_sets"]):
        for j, load in enumerate(load_set["loads"]):
            path = f"load_sets[{i}].loads[{j}]"
            if load in load_set["loads"][:j]:
                yield f"{path} is {load}, which the set has already"
            if not any(load in loads for loads in available.values()):
                yield f"{path} is {load}, which no protocol has"
                continue
            for name in FIGURE_PROTOCOLS:
                if config["network"] == "delaunay" and load not in available.get(name, {load}):
                    yield f"{path} is {load}, which protocol {name} lacks, so that Table 1 cannot be made"
