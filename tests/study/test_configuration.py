"""The config: everything wrong is said in one line with the key's path, before any job starts."""

import copy
import math
import re

import pytest
import yaml

from fibrous.errors import ConfigError
from fibrous_study import plan
from fibrous_study.configuration import DEFAULT, _merge, loaded, schema_of_config, validated
from fibrous_study.variants import variants

SCHEMA_TREE = schema_of_config()


def default() -> dict:
    """The default config with one user network, so that every key of the schema occurs."""
    config = yaml.safe_load(DEFAULT.read_text(encoding="utf-8"))
    config["network_files"] = [
        {"name": "a", "nodes": "nodes.csv", "fibers": "fibers.csv"},
        {"name": "b", "file": "b.nc"},
    ]
    config["specimen_files"] = {"mesh": "a.vtu", "motion": "motion.csv", "fibers": "fibers.csv"}
    return config


def keys(schema: dict, path: tuple = (), config=None):
    """(path, schema) of every key of the schema, with lists entered at the first entry that has the key."""
    if "$ref" in schema:
        schema = SCHEMA_TREE["$defs"][schema["$ref"].rpartition("/")[2]]
    if path:
        yield path, schema
    if schema.get("type") == "object":
        for key, inner in schema["properties"].items():
            if key in config:
                yield from keys(inner, (*path, key), config[key])
    if schema.get("type") == "array" and config:
        for i, entry in enumerate(config):
            yield from keys(schema["items"], (*path, i), entry)


def said(path: tuple) -> str:
    return re.sub(r"^\.", "", "".join(f"[{part}]" if isinstance(part, int) else f".{part}" for part in path))


def wrong_types(schema: dict):
    types = schema["type"] if isinstance(schema["type"], list) else [schema["type"]]
    samples = {"string": "a text", "number": 1.5, "boolean": True, "array": [], "object": {}, "null": None}
    for kind, sample in samples.items():
        if kind not in types:
            if kind == "number" and "integer" in types:
                sample = 2.5
            yield sample
    if "number" in types:
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
    if "minLength" in schema:
        yield ""
    if "minItems" in schema:
        yield []


KEYS = list(keys(SCHEMA_TREE, config=default()))
# One entry of a list speaks for the others.
UNIQUE = list({re.sub(r"\[\d+\]", "[]", said(path)): (path, schema) for path, schema in KEYS}.values())
WRONG_TYPE = [pytest.param(path, value, id=f"{said(path)}={value!r}") for path, s in UNIQUE for value in wrong_types(s)]
OUT_OF_RANGE = [
    pytest.param(path, value, id=f"{said(path)}={value!r}") for path, s in UNIQUE for value in out_of_range(s)
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
    assert line.startswith(f"{said(path)} is ")
    assert "must be" in line


@pytest.mark.parametrize(("path", "value"), OUT_OF_RANGE)
def test_a_value_out_of_range_is_named_by_its_key(path, value):
    line = complaint(with_value(path, value))
    assert line.startswith(f"{said(path)} ")
    assert "must" in line


def test_every_key_of_the_schema_is_described_and_bounded():
    for path, schema in KEYS:
        assert schema["description"], said(path)
        numeric = {"number", "integer"} & set(schema["type"] if isinstance(schema["type"], list) else [schema["type"]])
        if numeric:
            unit = {"um": "µm", "MPa": "MPa", "mm": "mm", "degrees": "degrees"}.get(
                next(part for part in reversed(path) if isinstance(part, str)).rpartition("_")[2], "1"
            )
            assert schema["unit"] == unit, said(path)
            assert {"minimum", "exclusiveMinimum"} & set(schema), said(path)
            assert {"maximum", "exclusiveMaximum"} & set(schema), said(path)
        if schema["type"] == "object":
            assert schema["additionalProperties"] is False, said(path)
        if schema["type"] == "string" or schema["type"] == "object":
            assert list(out_of_range(schema)) or schema["type"] == "object", said(path)


def test_every_key_of_the_default_config_is_in_the_schema_and_the_other_way_round():
    described = {re.sub(r"\[\d+\]", "[]", said(path)) for path, _ in KEYS}
    declared = set()

    def walk(schema: dict, path: str) -> None:
        if "$ref" in schema:
            schema = SCHEMA_TREE["$defs"][schema["$ref"].rpartition("/")[2]]
        if path:
            declared.add(path.removeprefix("."))
        for key, inner in schema.get("properties", {}).items():
            walk(inner, f"{path}.{key}")
        if "items" in schema:
            walk(schema["items"], f"{path}[]")

    walk(SCHEMA_TREE, "")
    assert described == declared


OPTIONAL = {"nodes", "fibers", "file", "magnitude", "deformation_gradient", "mesh", "motion"}
OPTIONAL |= {"constants", "energy", "objective", "refit", "load_steps"}
REQUIRED = [path for path, _ in UNIQUE if isinstance(path[-1], str) and path[-1] not in OPTIONAL]


@pytest.mark.parametrize("path", REQUIRED, ids=said)
def test_a_missing_key_is_named(path):
    config = default()
    place = config
    for part in path[:-1]:
        place = place[part]
    del place[path[-1]]
    assert complaint(config).startswith(f"{said(path)} is missing")


@pytest.mark.parametrize(
    ("change", "line"),
    [
        ({"sede": 1}, "sede is unknown, did you mean seed?"),
        ({"fiber": {"raduis_um": 1}}, "fiber.raduis_um is unknown, did you mean radius_um?"),
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
    _merge(config, change)
    assert complaint(config) == line


def test_several_problems_share_the_line():
    line = complaint(merged({"seed": -1, "cube": {"volume_fraction": 2}}))
    assert line.split("; ") == ["seed is -1, must be at least 0", "cube.volume_fraction is 2, must be at most 0.5"]


def merged(change: dict) -> dict:
    config = loaded()
    _merge(config, change)
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
CONTRADICTIONS = [
    (named({"name": "far", "H11": 0.7, "H22": 0.4}), "named[6] has H11 + H22 = 1.1, must be less than 1"),
    (named({"name": "case", "H11": 0.4, "H22": 0.4}), "named[6].name is case, which named[0] is called already"),
    (
        edited("protocols", 0, loads=[{"load": "x_pull", "magnitude": 1.8}]),
        "protocols[0].loads[0].load is x_pull, must be",
    ),
    (edited("protocols", 0, name="refit_a"), "protocols[0].name is refit_a, must not begin with refit_"),
    (edited("protocols", 0, ensembles=["named"]), "roles.large is large, whose ensembles lack delaunay"),
    (
        edited("protocols", 2, ensembles=["tissue"]),
        "roles.case_study is section_2_6, whose ensembles lack named",
    ),
    (edited("protocols", 2, ensembles=["named"]), "tissue.protocol is section_2_6, whose ensembles lack tissue"),
    (edited("protocols", 3, name="eq10"), "roles.path is eq9, must be one of large, small, section_2_6, eq10"),
    (
        edited("protocols", 3, loads=[*loaded()["protocols"][3]["loads"], {"load": "x_uniaxial", "magnitude": 1.1}]),
        "roles.path is eq9, which has 2 loads, must have one",
    ),
    (
        edited("protocols", 1, loads=[{"load": "xy_shear", "deformation_gradient": PULL}]),
        "protocols[1].loads[0].load is xy_shear, whose deformation gradient is known: give yours another name",
    ),
    (
        edited("protocols", 0, loads=[{"load": "pull", "deformation_gradient": PULL}]),
        "roles.large is large, which lacks x_uniaxial, which the claims need",
    ),
    (eq9(magnitude=1.0), "protocols[3].loads[0] has a magnitude and a deformation_gradient, must have one of them"),
    (
        eq9(deformation_gradient=[[-1, 0, 0], [0, 1, 0], [0, 0, 1]]),
        "protocols[3].loads[0].deformation_gradient has the",
    ),
    (
        eq9(deformation_gradient=[[9, 0, 0], [0, 1, 0], [0, 0, 1]]),
        "protocols[3].loads[0].deformation_gradient is given, a",
    ),
    (
        eq9(deformation_gradient=[[1, 0, 0], [0, 1, 0], [0, 0, 1]]),
        "protocols[3].loads[0].deformation_gradient is given, w",
    ),
    ({"specimen": "file"}, "specimen_files.mesh is missing, must name a file"),
    (
        {"specimen": "file", "specimen_files": {"mesh": "no.vtu"}},
        "specimen_files.mesh is no.vtu, no such file seen from",
    ),
    ({"specimen_files": {"mesh": "no.vtu"}}, "specimen_files names files, but specimen is synthetic"),
    ({"synthetic_specimen": {"H11": [0.6, 0.6]}}, "synthetic_specimen.H11 is [0.6, 0.6], must rise"),
    ({"synthetic_specimen": {"radius_mm": 3.0}}, "synthetic_specimen.length_mm is 10, which bent to radius_mm = 3"),
    ({"synthetic_specimen": {"thickness_mm": 30.0}}, "synthetic_specimen.thickness_mm is 30, must be less than twice"),
    ({"synthetic_specimen": {"gap_mm": -10.0}}, "synthetic_specimen.gap_mm is -10, which pushes one bone through"),
    (
        {"synthetic_specimen": {"H11": [0.5, 0.85]}},
        "synthetic_specimen reaches H11 = 0.5 and 0.85 with an H33",
    ),
    ({"network": "file", "specimen": "file"}, "specimen is file, which says nothing with network: file"),
    (models({"name": "specimen", "law": "matrix"}), "tissue.models[0].name is specimen, which names a file of another"),
    ({"tissue": {"load_set": "none"}}, "tissue.load_set is none, must be one of section_3_1, section_2_3"),
    ({"tissue": {"load_set": "section_2_3"}}, "tissue.protocol is section_2_6, which lacks yz_shear"),
    ({"tissue": {"protocol": "none"}}, "tissue.protocol is none, must be one of large, small, section_2_6, eq9"),
    ({"tissue": {"surface_protocol": "eq9"}}, "tissue.surface_protocol is eq9, of which there is no surface"),
    (models({"name": "a", "law": "families"}), "tissue.models[0].constants is missing, must be given for a"),
    (models({"name": "a", "law": "families", "constants": "fit"}), "tissue.models[0].energy is missing, must be given"),
    (
        models({"name": "a", "law": "matrix", "refit": True}),
        "tissue.models[0].refit says nothing about a: leave it out",
    ),
    (models({"name": "a", "law": "affine", "energy": "families"}), "tissue.models[0].energy says nothing about a"),
    (models(*[{"name": "a", "law": "matrix"}] * 2), "tissue.models[1].name is a, which tissue.models[0] is called"),
    (models(FITTED, {"name": "hgo_refit", "law": "matrix"}), "tissue.models: hgo_refit is the name of a model and of"),
    ({"sensitivity": {"networks": ["fig6_6"]}}, "sensitivity.networks[0] is fig6_6, must be one of case, fig6_1"),
    ({"sensitivity": {"networks": ["case", "case"]}}, "sensitivity.networks[1] is case, which the list has already"),
    ({"sensitivity": {"steps": [5, 5]}}, "sensitivity.steps[1] is 5, which the list has already"),
    (
        {"sensitivity": {"edge_length_um": [5.0]}},
        "sensitivity.edge_length_um[0] is 5, with which cube.volume_fraction is 0.04, which with this radius",
    ),
    (
        {"sensitivity": {"nonlinearity": [2.5, 50.0]}, "principal_stretch_limit": 5},
        "sensitivity.nonlinearity[1] is 50, with which fiber.nonlinearity is 50, which makes a fiber's force overflow",
    ),
    (
        {"sensitivity": {"amplitude": [0.9]}},
        "sensitivity.amplitude[0] is 0.9, with which protocols[0].loads[0].magnitude is 0.9, which gives a network",
    ),
    (named(without="fig6_2"), "roles.survey[1] is fig6_2, which named lacks"),
    ({"delaunay": {"H11": [0.5, 0.4]}}, "delaunay.H11 is [0.5, 0.4], must rise"),
    ({"delaunay": {"H11": [0.5, 0.92]}}, "delaunay.H11 reaches 0.92, which leaves no room"),
    ({"delaunay": {"batches": 800}}, "delaunay.batches is 800, must be at most delaunay.networks = 750"),
    ({"replicates": {"seeds": 1, "batches": 7}}, "replicates.batches is 7, must be at most the 6 replicates"),
    ({"delaunay": {"networks": 10, "batches": 1}}, "delaunay.networks is 10, too few for the 9 coefficients"),
    ({"surface": {"cross_validation_folds": 800}}, "surface.cross_validation_folds is 800, must be at most"),
    ({"fiber": {"radius_um": 10.0}}, "fiber.radius_um is 10, must be less than half of cube.edge_length_um"),
    ({"cube": {"edge_length_um": 3.0}}, "cube.volume_fraction is 0.04, which with this radius and edge leaves 11.5"),
    ({"cube": {"edge_length_um": 300.0}}, "cube.edge_length_um is 300, which with this radius and volume fraction"),
    ({"fiber": {"nonlinearity": 50}, "principal_stretch_limit": 5}, "fiber.nonlinearity is 50, which makes a fiber"),
    ({"principal_stretch_limit": 1.5}, "protocols[0].loads[0].magnitude is 1.8, a principal stretch of 1.8, must stay"),
    (protocols(xy_shear=4.0), "protocols[1].loads[3].magnitude is 4, a principal stretch of 4.236, must stay"),
    (protocols(x_uniaxial=0.9), "protocols[1].loads[0].magnitude is 0.9, which gives a network of H = (0.8, 0.05"),
    (
        edited(
            "protocols", 1, loads=[{"load": "squeeze", "deformation_gradient": [[0.9, 0, 0], [0, 1, 0], [0, 0, 1]]}]
        ),
        "protocols[1].loads[0].deformation_gradient is given, which gives a network of H = ",
    ),
    # Where H11 < 1/3, a stretch along x makes the fibers shorter on average.
    (
        protocols(x_uniaxial=1.005) | {"delaunay": {"H11": [0.2, 0.8]}},
        "protocols[1].loads[0].magnitude is 1.005, which gives a network of H = (0.2, 0.05, 0.75) the averaged",
    ),
    (protocols(xy_biaxial=1.0), "protocols[1].loads[1].magnitude is 1, which deforms nothing"),
    (protocols(xz_shear=None), "load_sets[0].loads[4] is xz_shear, which protocol small lacks"),
    ({"load_sets": [{"name": "s", "loads": ["zx_shear"]}]}, "load_sets[0].loads[0] is zx_shear, which no protocol has"),
    (
        {"load_sets": [{"name": "s", "loads": ["xy_shear", "xy_shear"]}]},
        "load_sets[0].loads[1] is xy_shear, which the set has already",
    ),
    ({"load_sets": [{"name": "s", "loads": ["xy_shear"]}] * 2}, "load_sets[1].name is s, which load_sets[0] is called"),
    ({"network": "file"}, "network_files is empty, must name your networks for network: file"),
    ({"network_files": [{"name": "a", "file": "a.nc"}]}, "network_files names files, but network is delaunay"),
    (
        {"network": "file", "network_files": [{"name": "a", "file": "nowhere.nc"}]},
        "network_files[0].file is nowhere.nc, no such file seen from",
    ),
    (
        {"network": "file", "network_files": [{"name": "a", "nodes": "a.csv"}]},
        "network_files[0] must have nodes and fibers, or file alone",
    ),
]


@pytest.mark.parametrize(("change", "start"), CONTRADICTIONS, ids=[start for _, start in CONTRADICTIONS])
def test_keys_that_contradict_each_other(change, start):
    assert any(part.startswith(start) for part in complaint(merged(change)).split("; "))


def test_protocols_that_the_figures_draw_must_exist():
    config = loaded()
    config["protocols"][1]["name"] = "tiny"
    assert complaint(config).startswith("roles.small is small, must be one of large, tiny")


def test_a_load_occurs_once_and_the_first_has_a_magnitude():
    config = loaded()
    loads = config["protocols"][0]["loads"]
    del loads[0]["magnitude"]
    assert complaint(config).startswith("protocols[0].loads[0].magnitude is missing")
    loads[0]["magnitude"] = 1.8
    loads[2]["load"] = "xy_biaxial"
    assert "protocols[0].loads[2].load is xy_biaxial, which the protocol has already" in complaint(config)


@pytest.mark.parametrize("place", [0, 3, 6])
@pytest.mark.parametrize("protocol", [0, 1])
def test_a_load_with_its_own_gradient_has_any_place_in_the_protocols_of_the_figures(protocol, place):
    config = loaded()
    config["protocols"][protocol]["loads"].insert(place, {"load": "pull", "deformation_gradient": PULL})
    assert validated(config)["protocols"][protocol]["loads"][place]["load"] == "pull"
    factors = {variant.factor for variant in variants(config)}
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


def test_files_are_merged_as_snakemake_merges_them():
    from snakemake.utils import update_config

    override = {"fiber": {"radius_um": 0.2}, "named": [], "seed": {"a": {"b": 1}}, "new": {"c": 2}, "cube": 3}
    ours, theirs = loaded(), copy.deepcopy(loaded())
    _merge(ours, override)
    update_config(theirs, override)
    assert ours == theirs


@pytest.mark.parametrize("text", ["a: [", "- 1", "\ta: 1"])
def test_a_file_that_is_no_config_is_one_line(tmp_path, text):
    path = tmp_path / "own.yaml"
    path.write_text(text)
    with pytest.raises(ConfigError, match=r"^[^\n]*own\.yaml[^\n]*$"):
        loaded(path)
