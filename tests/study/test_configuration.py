"""The config: everything wrong is named in one line with the key's path, before any job starts."""

import copy
import math
import re

import pytest
import yaml

from fibrous.errors import ConfigError
from fibrous_study import plan
from fibrous_study.config import DEFAULT, PROJECT, key_path, loaded, schema_at, update_config, validated
from fibrous_study.config_page import described
from fibrous_study.variants import variants

WRITTEN = yaml.safe_load(DEFAULT.read_text(encoding="utf-8"))


def default() -> dict:
    """The default config with two user networks and a user's specimen, so that every key occurs."""
    config = copy.deepcopy(WRITTEN)
    config["network_files"] = [
        {"name": "a", "nodes": "nodes.csv", "fibers": "fibers.csv"},
        {"name": "b", "file": "b.nc"},
    ]
    config["specimen_files"] = {"mesh": "a.vtu", "motion": "motion.csv", "fibers": "fibers.csv"}
    return config


def keys(path: tuple = (), config=None):
    """Path and JSON schema of every key and entry of a config."""
    if path:
        yield path, schema_at(path)
    inner = config.items() if isinstance(config, dict) else enumerate(config) if isinstance(config, list) else ()
    for key, value in inner:
        yield from keys((*path, key), value)


def wrong_types(schema: dict):
    samples = {"string": "a text", "number": 1.5, "boolean": True, "array": [], "object": {}, "null": None}
    for kind, sample in samples.items():
        if kind != schema["type"] and not (kind == "null" and schema.get("nullable")):
            yield sample
    if schema["type"] == "number":
        yield from (math.nan, math.inf)


def out_of_range(schema: dict):
    step = 1 if schema["type"] == "integer" else 1e-9
    if "minimum" in schema:
        yield schema["minimum"] - step
    if "maximum" in schema:
        yield schema["maximum"] + step
    if "exclusiveMinimum" in schema:
        yield schema["exclusiveMinimum"]
    if "exclusiveMaximum" in schema:
        yield schema["exclusiveMaximum"]
    if "enum" in schema or "pattern" in schema:
        yield "no such/thing"
    if "pattern" in schema:
        yield "a\n"
    if "minLength" in schema:
        yield ""
    if "minItems" in schema:
        yield []


KEYS = list(keys(config=default()))
# One entry of a list speaks for the others.
UNIQUE = list({re.sub(r"\[\d+\]", "[]", key_path(path)): (path, schema) for path, schema in KEYS}.values())
WRONG_TYPE = [
    pytest.param(path, value, id=f"{key_path(path)}={value!r}") for path, s in UNIQUE for value in wrong_types(s)
]
OUT_OF_RANGE = [
    pytest.param(path, value, id=f"{key_path(path)}={value!r}") for path, s in UNIQUE for value in out_of_range(s)
]


def with_value(path: tuple, value) -> dict:
    config = default()
    place = config
    for part in path[:-1]:
        place = place[part]
    place[path[-1]] = value
    return config


def complaint(config: dict) -> str:
    with pytest.raises(ConfigError) as raised:
        validated(config)
    line = str(raised.value)
    assert line.startswith("config: ")
    assert "\n" not in line
    return line.removeprefix("config: ")


@pytest.mark.parametrize(("path", "value"), WRONG_TYPE)
def test_a_wrong_type_is_named_by_its_key(path, value):
    line = complaint(with_value(path, value))
    assert line.startswith(f"{key_path(path)} is ")
    assert "must be" in line


@pytest.mark.parametrize(("path", "value"), OUT_OF_RANGE)
def test_a_value_out_of_range_is_named_by_its_key(path, value):
    line = complaint(with_value(path, value))
    assert line.startswith(f"{key_path(path)} ")
    assert "must" in line


def test_every_key_has_a_meaning_and_a_range():
    for path, schema in KEYS:
        if isinstance(path[-1], str):
            assert schema["description"], key_path(path)
        if schema["type"] in ("integer", "number"):
            assert {"minimum", "exclusiveMinimum"} & set(schema), key_path(path)
            assert {"maximum", "exclusiveMaximum"} & set(schema), key_path(path)
        if schema["type"] == "object":
            assert schema["additionalProperties"] is False, key_path(path)
        if schema["type"] == "string":
            assert list(out_of_range(schema)), key_path(path)


def declared(path: tuple = ()):
    schema = schema_at(path)
    for key in schema.get("properties", {}):
        yield key_path((*path, key)).replace("[0]", "[]")
        yield from declared((*path, key))
    if "items" in schema:
        yield from declared((*path, 0))


def test_every_declared_key_is_in_the_default_config_and_on_the_page():
    in_the_config = {re.sub(r"\[\d+\]", "[]", key_path(path)) for path, _ in KEYS if isinstance(path[-1], str)}
    assert set(declared()) == in_the_config
    page = (PROJECT / "docs" / "config.md").read_text(encoding="utf-8")
    assert page == described()
    sections = set(re.findall(r"^## (\w+)$", page, re.MULTILINE))
    assert sections | set(re.findall(r"^\| `([^`]+)` \|", page, re.MULTILINE)) == in_the_config


OPTIONAL = {"nodes", "fibers", "file", "magnitude", "deformation_gradient", "mesh", "motion"}
OPTIONAL |= {"constants", "energy", "objective", "refit", "load_steps"}
REQUIRED = [path for path, _ in UNIQUE if isinstance(path[-1], str) and path[-1] not in OPTIONAL]


@pytest.mark.parametrize("path", REQUIRED, ids=key_path)
def test_a_missing_key_is_named(path):
    config = default()
    place = config
    for part in path[:-1]:
        place = place[part]
    del place[path[-1]]
    assert complaint(config).startswith(f"{key_path(path)} is missing")


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"sede": 1}, "sede is unknown, did you mean seed?"),
        ({"fiber": {"raduis_um": 1}}, "fiber.raduis_um is unknown, did you mean radius_um?"),
        ({"fit": {3: 1}}, "fit.3 is unknown, known are largest_C3, slope_fit_below_r_squared"),
        ({"surface": {"zzz": 1}}, "surface.zzz is unknown, known are cross_validation_folds"),
        ({"fiber": {"radius_um": -1}}, "fiber.radius_um is -1, must be greater than 0 µm"),
        ({"fiber": {"radius_um": "1e-1"}}, "fiber.radius_um is the text '1e-1', must be a number; write 0.1"),
        (
            {"equilibrium": {"residual_tolerance": "1e-9"}},
            "equilibrium.residual_tolerance is the text '1e-9', must be a number; write 1.0e-09",
        ),
    ],
)
def test_the_line_says_what_to_write(change, line):
    config = loaded()
    update_config(config, change)
    assert complaint(config) == line


def test_several_problems_share_the_line():
    line = complaint(merged({"seed": -1, "cube": {"volume_fraction": 2}}))
    assert line.split("; ") == ["seed is -1, must be at least 0", "cube.volume_fraction is 2, must be at most 0.5"]


def merged(change: dict) -> dict:
    config = copy.deepcopy(WRITTEN)
    update_config(config, change)
    return config


def protocols(**small) -> dict:
    """The default protocols with the loads of `small` replaced by name: a magnitude, or None for a load taken out."""
    config = loaded()
    loads = config["protocols"][1]["loads"]
    for name, magnitude in small.items():
        if magnitude is None:
            loads[:] = [entry for entry in loads if entry["load"] != name]
        else:
            next(entry for entry in loads if entry["load"] == name)["magnitude"] = magnitude
    return {"protocols": config["protocols"]}


def named(*extra: dict, without: str = "") -> dict:
    return {"named": [entry for entry in loaded()["named"] if entry["name"] != without] + list(extra)}


def edited(key: str, index: int, **change) -> dict:
    """The list under `key` with one entry changed."""
    entries = loaded()[key]
    entries[index] |= change
    return {key: entries}


def eq9(**change) -> dict:
    protocols = loaded()["protocols"]
    protocols[3]["loads"][0] |= change
    return {"protocols": protocols}


FITTED = {
    "name": "hgo", "law": "families", "constants": "fit", "energy": "families", "objective": "energy", "refit": True,
}  # fmt: skip


def models(*entries: dict) -> dict:
    return {"tissue": {"models": list(entries)}}


PULL = [[1.8, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
SQUEEZE = {"load": "squeeze", "deformation_gradient": [[0.9, 0, 0], [0, 1, 0], [0, 0, 1]]}
EQ_9 = loaded()["protocols"][3]["loads"]
XY_SHEAR = {"name": "s", "loads": ["xy_shear"]}
# A change, the key that the line must name, and what else it must say: both numbers, or the names to choose from.
CONTRADICTIONS = [
    (named({"name": "far", "H11": 0.7, "H22": 0.4}), "named[6]", "1.1"),
    (named({"name": "case", "H11": 0.4, "H22": 0.4}), "named[6].name", "case"),
    (named(without="fig6_2"), "roles.survey", "fig6_2"),
    ({"roles": {"case": "caes"}}, "roles.case", "caes", "case"),
    ({"roles": {"survey": ["case"] * 5}}, "roles.survey[1]", "case"),
    ({"roles": {"survey": ["case"]}}, "roles.survey", "1", "5"),
    ({"roles": {"small": "tiny"}}, "roles.small", "tiny", "small"),
    ({"roles": {"large": "eq9"}}, "roles.large", "eq9", "delaunay"),
    ({"roles": {"path": "section_2_6"}}, "roles.path", "section_2_6", "5"),
    (edited("protocols", 0, loads=[{"load": "x_pull", "magnitude": 1.8}]), "protocols[0].loads[0].load", "x_pull"),
    (edited("protocols", 0, loads=[{"load": "x_uniaxial"}]), "protocols[0].loads[0].magnitude"),
    (edited("protocols", 0, loads=[{"load": "x_uniaxial", "magnitude": 1.8}] * 2), "protocols[0].loads[1].load"),
    (edited("protocols", 0, ensembles=["named", "named"]), "protocols[0].ensembles[1]", "named"),
    (edited("protocols", 0, name="refit_a"), "protocols[0].name", "refit_a"),
    (edited("protocols", 0, ensembles=["named"]), "roles.large", "large", "delaunay"),
    (edited("protocols", 1, name="tiny"), "roles.small", "small", "tiny"),
    (edited("protocols", 2, ensembles=["tissue"]), "roles.case_study", "section_2_6", "named"),
    (edited("protocols", 2, ensembles=["named"]), "tissue.protocol", "section_2_6", "tissue"),
    (edited("protocols", 3, loads=[*EQ_9, {"load": "x_uniaxial", "magnitude": 1.1}]), "roles.path", "eq9", "2"),
    (
        edited("protocols", 1, loads=[{"load": "xy_shear", "deformation_gradient": PULL}]),
        "protocols[1].loads[0].load",
        "xy_shear",
    ),
    (edited("protocols", 0, loads=[{"load": "pull", "deformation_gradient": PULL}]), "roles.large", "x_uniaxial"),
    (eq9(magnitude=1.0), "protocols[3].loads[0]"),
    (eq9(deformation_gradient=[[-1, 0, 0], [0, 1, 0], [0, 0, 1]]), "protocols[3].loads[0].deformation_gradient", "-1"),
    (eq9(deformation_gradient=[[9, 0, 0], [0, 1, 0], [0, 0, 1]]), "protocols[3].loads[0].deformation_gradient", "9"),
    (eq9(deformation_gradient=[[1, 0, 0], [0, 1, 0], [0, 0, 1]]), "protocols[3].loads[0].deformation_gradient"),
    ({"specimen": "file"}, "specimen_files.mesh"),
    ({"specimen": "file", "specimen_files": {"mesh": "no.vtu"}}, "specimen_files.mesh", "no.vtu"),
    ({"specimen_files": {"mesh": "no.vtu"}}, "specimen_files", "synthetic"),
    ({"network": "file", "specimen": "file"}, "specimen", "file"),
    ({"synthetic_specimen": {"H11": [0.6, 0.6]}}, "synthetic_specimen.H11", "0.6"),
    ({"synthetic_specimen": {"radius_mm": 3.0}}, "synthetic_specimen.length_mm", "10", "3"),
    ({"synthetic_specimen": {"thickness_mm": 30.0}}, "synthetic_specimen.thickness_mm", "30", "15"),
    ({"synthetic_specimen": {"gap_mm": -10.0}}, "synthetic_specimen.gap_mm", "-10"),
    ({"synthetic_specimen": {"H11": [0.5, 0.85]}}, "synthetic_specimen.H11", "0.5", "0.045", "hgo_surface"),
    ({"synthetic_specimen": {"H11": [0.3, 0.7]}}, "synthetic_specimen.H11", "0.3"),
    (models({"name": "specimen", "law": "matrix"}), "tissue.models[0].name", "specimen"),
    (models({"name": "a", "law": "families"}), "tissue.models[0].constants", "a"),
    (models({"name": "a", "law": "families", "constants": "fit"}), "tissue.models[0].energy", "a"),
    (models({"name": "a", "law": "matrix", "refit": True}), "tissue.models[0].refit", "a"),
    (models({"name": "a", "law": "affine", "energy": "families"}), "tissue.models[0].energy", "a"),
    (models({"name": "a", "law": "network", "load_steps": 3}), "tissue.models[0].load_steps", "3", "20"),
    (models(*[{"name": "a", "law": "matrix"}] * 2), "tissue.models[1].name", "a"),
    (models(FITTED, {"name": "hgo_refit", "law": "matrix"}), "tissue.models", "hgo_refit"),
    ({"tissue": {"load_set": "none"}}, "tissue.load_set", "none", "section_3_1", "section_2_3"),
    ({"tissue": {"load_set": "section_2_3"}}, "tissue.protocol", "section_2_6", "yz_shear"),
    ({"tissue": {"load_set": "section_2_3"}}, "roles.case_study", "section_2_6", "yz_shear"),
    ({"tissue": {"protocol": "none"}}, "tissue.protocol", "none", "large", "section_2_6"),
    ({"tissue": {"surface_protocol": "eq9"}}, "tissue.surface_protocol", "eq9", "large, small"),
    ({"microstructure": {"runs": ["hgo_refitt"]}}, "microstructure.runs", "hgo_refitt", "hgo_refit"),
    ({"microstructure": {"elements": [900]}}, "microstructure.elements[0]", "900"),
    ({"sensitivity": {"networks": ["fig6_6"]}}, "sensitivity.networks", "fig6_6", "fig6_1"),
    ({"sensitivity": {"networks": ["case", "case"]}}, "sensitivity.networks[1]", "case"),
    ({"sensitivity": {"steps": [5, 5]}}, "sensitivity.steps[1]", "5"),
    ({"sensitivity": {"amplitude": [1.5, 1.5000001]}}, "sensitivity.amplitude[1]", "1.5"),
    ({"sensitivity": {"edge_length_um": [5.0]}}, "sensitivity.edge_length_um[0]", "5", "cube.edge_length_um", "31.8"),
    (
        {"sensitivity": {"nonlinearity": [2.5, 50.0]}, "principal_stretch_limit": 5},
        "sensitivity.nonlinearity[1]",
        "fiber.nonlinearity",
    ),
    ({"sensitivity": {"amplitude": [0.9]}}, "sensitivity.amplitude[0]", "0.9", "protocols[0].loads[0].magnitude"),
    ({"delaunay": {"H11": [0.5, 0.4]}}, "delaunay.H11", "[0.5, 0.4]"),
    ({"delaunay": {"H11": [0.5, 0.92]}}, "delaunay.H11", "0.92", "0.05"),
    ({"delaunay": {"batches": 800}}, "delaunay.batches", "800", "750"),
    ({"replicates": {"seeds": 1, "batches": 7}}, "replicates.batches", "7", "6"),
    ({"delaunay": {"networks": 10, "batches": 1}}, "delaunay.networks", "10", "9"),
    ({"surface": {"cross_validation_folds": 800}}, "delaunay.networks", "750", "800"),
    ({"fiber": {"radius_um": 10.0}}, "fiber.radius_um", "10", "20"),
    ({"cube": {"edge_length_um": 3.0}}, "cube.edge_length_um", "3", "0.04", "11.5", "40"),
    ({"cube": {"edge_length_um": 300.0}}, "cube.edge_length_um", "300", "20000"),
    ({"fiber": {"nonlinearity": 50}, "principal_stretch_limit": 5}, "fiber.nonlinearity", "50", "5"),
    ({"principal_stretch_limit": 1.5}, "protocols[0].loads[0].magnitude", "1.8", "1.5"),
    (protocols(xy_shear=4.0), "protocols[1].loads[3].magnitude", "4", "4.236", "3.5"),
    (protocols(x_uniaxial=0.9), "protocols[1].loads[0].magnitude", "0.9", "0.8, 0.05"),
    (edited("protocols", 1, loads=[SQUEEZE]), "protocols[1].loads[0].deformation_gradient", "0.33, 0.05"),
    # Where H11 < 1/3, a stretch along x makes the fibers shorter on average.
    (protocols(x_uniaxial=1.005) | {"delaunay": {"H11": [0.2, 0.8]}}, "protocols[1].loads[0].magnitude", "0.2, 0.05"),
    (protocols(xy_biaxial=1.0), "protocols[1].loads[1].magnitude", "1"),
    (protocols(xz_shear=None), "roles.small", "small", "xz_shear"),
    ({"load_sets": [{"name": "s", "loads": ["zx_shear"]}]}, "load_sets[0].loads", "zx_shear"),
    ({"load_sets": [{"name": "s", "loads": ["xy_shear", "xy_shear"]}]}, "load_sets[0].loads[1]", "xy_shear"),
    ({"load_sets": [XY_SHEAR] * 2}, "load_sets[1].name", "s"),
    ({"network": "file"}, "network_files", "file"),
    ({"network_files": [{"name": "a", "file": "a.nc"}]}, "network_files", "delaunay"),
    ({"network": "file", "network_files": [{"name": "a", "file": "no.nc"}]}, "network_files[0].file", "no.nc"),
    ({"network": "file", "network_files": [{"name": "a", "nodes": "a.csv"}]}, "network_files[0]"),
]


@pytest.mark.parametrize(
    ("change", "path", "rest"),
    [pytest.param(change, path, rest, id=" ".join((path, *rest))) for change, path, *rest in CONTRADICTIONS],
)
def test_keys_that_contradict_each_other(change, path, rest):
    lines = complaint(merged(change)).split("; ")
    words = r"(?<![\w.]){}(?![\w.]*\w)"
    assert any(
        re.match(rf"{re.escape(path)}[ :]", line)
        and all(re.search(words.format(re.escape(part)), line) for part in rest)
        for line in lines
    ), lines


def test_a_user_specimen_beyond_the_surface_is_refused(tmp_path):
    files = {name: str(tmp_path / f"{name}.csv") for name in ("mesh", "motion", "fibers")}
    for path in files.values():
        with open(path, "w") as stream:
            stream.write("element,H11,H22,H33\n0,0.6,0.3,0.1\n1,0.06,0.04,0.9\n")
    line = complaint(merged({"specimen": "file", "specimen_files": files}))
    assert line.startswith("specimen_files.fibers reaches 0.9, ")
    assert "0.04" in line


@pytest.mark.parametrize("place", [0, 3, 6])
@pytest.mark.parametrize("protocol", [0, 1])
def test_a_load_with_its_own_gradient_has_any_place_in_the_protocols_of_the_figures(protocol, place):
    config = loaded()
    config["protocols"][protocol]["loads"].insert(place, {"load": "pull", "deformation_gradient": PULL})
    assert validated(config)["protocols"][protocol]["loads"][place]["load"] == "pull"
    factors = {factor for factor, _ in variants(config).values()}
    assert ("amplitude" in factors) == ((protocol, place) != (0, 0))  # without a magnitude there is none to vary


@pytest.mark.parametrize(
    ("key", "question"),
    [
        ("network", plan.own_networks),
        ("specimen", plan.own_specimen),
        ("update", plan.has_lagged_constants),
    ],
)
def test_a_third_way_is_not_taken_for_one_of_the_two(key, question):
    config = loaded()
    assert question(config) is False
    (config["tissue"] if key == "update" else config)[key] = "voronoi"
    with pytest.raises(ConfigError, match=f"{key} is 'voronoi', must be "):
        question(config)


def test_the_default_and_the_quick_config_are_accepted():
    assert loaded()["cube"]["edge_length_um"] == 20.0
    assert loaded(DEFAULT.with_name("quick.yaml"))["delaunay"]["networks"] < 50


def test_a_length_is_the_same_with_and_without_its_point():
    config = loaded()
    config["cube"]["edge_length_um"] = 20
    assert repr(validated(config)) == repr(loaded())


@pytest.mark.parametrize("text", ["a: [", "- 1", "\ta: 1"])
def test_a_file_that_is_no_config_is_one_line(tmp_path, text):
    path = tmp_path / "own.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=r"^[^\n]*own\.yaml[^\n]*$"):
        loaded(path)
