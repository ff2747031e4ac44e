"""What a change of the config or of a source makes anew: exactly what depends on it."""

import shutil

import pytest
import xarray as xr
import yaml
from workflow_runs import QUICK, files_of, jobs_of, quick_config, snakemake, would_run, written

from fibrous_study import provenance
from fibrous_study.config import DEFAULT, validated


def downstream(config: dict, first: set[str]) -> set[str]:
    """The files, and all that are made from them."""
    found, before = set(first), -1
    while len(found) != before:
        before = len(found)
        for job in jobs_of(config):
            if job.inputs & found:
                found |= job.outputs
    return found


def first_hit(*rules: str, **wanted: str):
    """The files of these rules with these wildcards, and all that are made from them."""
    return lambda: downstream(quick_config(), files_of(quick_config(), *rules, **wanted))


def of_runs(*names: str):
    return lambda: downstream(
        quick_config(), {path for name in names for path in files_of(quick_config(), "tissue_run", run=name)}
    )


def together(*parts):
    return lambda: set().union(*(part() for part in parts))


def _with(key: str, index: int, **change) -> list[dict]:
    entries = quick_config()[key]
    entries[index] |= change
    return entries


the_networks = together(first_hit("network_ensemble"), first_hit("specimen"))
the_curves = together(first_hit("network_curves"), first_hit("network_states"), first_hit("refit_curves"))
SYNTHETIC = {
    "elements": [3, 4, 2], "length_mm": 11.0, "height_mm": 15.0, "thickness_mm": 1.9, "radius_mm": 16.0,
    "lowest_row_degrees": 19.0, "deviation_degrees": 3.0, "tilt_degrees": 1.0, "H11": [0.55, 0.69],
    "in_plane_share": [0.51, 0.7], "correlation_length_mm": 5.0, "gap_mm": 0.9, "slide_mm": 2.0,
    "rotation_degrees": 5.0, "load_steps": 5,
}  # fmt: skip
HGO_LAWS = ("hgo", "structure_tensor", "families", "stress", "hgo_surface")
as_printed = together(
    *(
        first_hit("hgo_fits", ensemble=ensemble, protocol=protocol)
        for ensemble, protocol in (("tissue", "section_2_6"), ("named", "section_2_6"), ("named", "eq9"))
    ),
    of_runs(*HGO_LAWS),
)
# What tells the whole study is made again with any part of it.
TELLING = {"stage_costs", "figure_4", "table_pages", "report"}
# Every key of the config, a change of it, and what depends on it.
CHANGES = {
    "seed": (5, the_networks),
    **{
        f"fiber.{key}": (value, first_hit("network_ensemble"))
        for key, value in {
            "modulus_MPa": 11.0,
            "nonlinearity": 2.0,
            "radius_um": 0.09,
            "linear_beyond_stretch": 3.0,
        }.items()
    },
    **{
        f"cube.{key}": (value, first_hit("network_ensemble"))
        for key, value in {
            "edge_length_um": 11.0,
            "volume_fraction": 0.05,
            "alignment_tolerance": 0.009,
        }.items()
    },
    "delaunay.H11": ([0.34, 0.8], first_hit("network_ensemble", ensemble="delaunay")),
    "delaunay.smallest_H": (0.06, first_hit("network_ensemble", ensemble="delaunay")),
    "named": (
        lambda: _with("named", 5, H22=0.15),
        together(first_hit("network_ensemble", ensemble="named"), first_hit("network_ensemble", ensemble="replicates")),
    ),
    "roles.survey": (["fig6_2", "fig6_1", "fig6_3", "fig6_4", "fig6_5"], first_hit("figure_6", "claims")),
    "replicates.seeds": (3, first_hit("network_ensemble", ensemble="replicates")),
    "protocols": (
        lambda: _with("protocols", 1, steps=10),
        together(first_hit("network_curves", protocol="small"), first_hit("network_states")),
    ),
    "principal_stretch_limit": (3.4, first_hit("network_curves", "network_states")),
    "equilibrium.residual_tolerance": (1e-8, together(the_curves, first_hit("tissue_coupled"))),
    "equilibrium.largest_number_of_iterations": (50, together(the_curves, first_hit("tissue_coupled"))),
    "equilibrium.largest_number_of_cuts": (5, together(the_curves, first_hit("tissue_coupled"))),
    # Figures 5 and 6 draw load sets; the tissue takes its constants from one that did not change.
    "load_sets": (
        lambda: _with("load_sets", 1, loads=["x_uniaxial", "yz_shear"]),
        together(first_hit("hgo_fits", protocol="large"), first_hit("hgo_fits", protocol="small")),
    ),
    "fit.largest_C3": (40.0, first_hit("hgo_fits")),
    "fit.slope_fit_below_r_squared": (0.4, first_hit("hgo_fits")),
    "surface.cross_validation_folds": (5, first_hit("table_1")),
    **{f"synthetic_specimen.{key}": (value, first_hit("specimen")) for key, value in SYNTHETIC.items()},
    "matrix.C1_MPa": (0.03, first_hit("tissue_run", "tissue_coupled")),
    "matrix.lame_lambda_MPa": (0.4, first_hit("tissue_run", "tissue_coupled")),
    "tissue.surface_protocol": ("small", of_runs("hgo_surface")),
    # With the law as printed there is no problem that FEBio could be given.
    "tissue.tension_only": (False, lambda: as_printed() - files_of(quick_config(), "febio")),
    **{
        f"claims.{key}": (0.9 * value if value > 1.2 else 0.5 + 0.5 * value, first_hit("claims"))
        for key, value in quick_config()["claims"].items()
    },
    # Sensitivities are made on demand, and nothing is made from them.
    **{
        f"sensitivity.{key}": (value, set)
        for key, value in {
            "networks": ["fig6_4"],
            "seeds": 3,
            "edge_length_um": [12.0],
            "volume_fraction": [0.07],
            "nonlinearity": [3.0],
            "amplitude": [1.3],
            "steps": [7],
        }.items()
    },
    "tissue.linear_solver": ("direct", first_hit("tissue_run", "tissue_coupled")),
}
# Which networks, protocols and models there are, and whose, is the subject of tests of their own.
OF_THEIR_OWN = {
    "network", "network_files", "delaunay.networks", "delaunay.batches", "specimen", "specimen_files", "tissue.batches",
    "tissue.protocol", "tissue.load_set", "tissue.update", "tissue.refit_rounds", "tissue.models",
    "microstructure.runs", "microstructure.elements", "replicates.batches", "roles.case", "roles.large", "roles.small",
    "roles.case_study", "roles.path",
}  # fmt: skip


@pytest.mark.parametrize("key", CHANGES)
def test_a_change_of_one_parameter_reruns_exactly_what_depends_on_it(quick, key):
    value, dependent = CHANGES[key]
    value = value() if callable(value) else value
    for part in reversed(key.split(".")):
        value = {part: value}
    assert would_run(quick[0], value) == dependent()


def test_more_networks_leave_the_named_ones_alone(quick):
    """Batch 00 gets one network more, so that it and the new shares of the others are made again."""
    found = would_run(quick[0], {"delaunay": {"networks": 31, "batches": 3}})
    assert not any("named" in path or "figure_3" in path or "figure_5" in path for path in found)
    assert {f"results/networks/delaunay/0{batch}.nc" for batch in range(3)} <= found


def test_the_changes_speak_of_every_key():
    keys = set()
    for key, value in yaml.safe_load(DEFAULT.read_text(encoding="utf-8")).items():
        keys |= {f"{key}.{inner}" for inner in value} if isinstance(value, dict) else {key}
    assert keys - OF_THEIR_OWN == set(CHANGES)


def outdated(before: dict, after: dict) -> set[str]:
    """Files of the study of `after` that one of `before` lacks or made of other things, and all made from these."""
    made = {path: (job.params, job.inputs) for job in jobs_of(before) for path in job.outputs}
    other = {path for job in jobs_of(after) for path in job.outputs if made.get(path) != (job.params, job.inputs)}
    return downstream(after, other)


def changed(config: dict, **tissue) -> dict:
    return validated({**config, "tissue": {**config["tissue"], **tissue}})


def initial_fits(config: dict) -> set[str]:
    fitted = {model["name"] for model in config["tissue"]["models"] if model.get("constants") == "fit"}
    return {path for name in fitted for path in files_of(config, "tissue_run", run=name)}


def test_constants_from_another_load_set_or_protocol_rerun_the_initial_runs_and_what_follows():
    before = quick_config()
    before["load_sets"].append({"name": "tension", "loads": ["x_uniaxial", "xy_biaxial"]})
    before["protocols"].append({**before["protocols"][2], "name": "again", "ensembles": ["tissue"]})
    initial = initial_fits(before)
    assert len(initial) == 8
    found = outdated(before, changed(before, load_set="tension"))
    of_surface = files_of(before, "tissue_run", run="hgo_surface")
    assert found == downstream(before, initial | of_surface | files_of(before, "case_study"))
    assert outdated(before, changed(before, protocol="again")) == downstream(before, initial)


def test_another_model_leaves_all_but_refits_alone():
    """Networks are driven as the elements of all refitted models go in one job, whose files are made anew together."""
    before = quick_config()
    models = [dict(model) for model in before["tissue"]["models"]]
    models[3] |= {"name": "own"}
    found = outdated(before, changed(before, models=models))
    # All problems for FEBio are written by one job, too.
    runs = {path for path in found if path.startswith("results/tissue/") and not path.endswith(".feb")}
    refitted = {f"{model['name']}_refit" for model in models if model.get("refit")}
    assert {path.split("/")[-1].partition(".")[0] for path in runs} == {"own", *refitted}
    assert "own_refit" in refitted
    assert len(refitted) > 1
    assert not any("networks" in path or "fits/tissue/section_2_6" in path for path in found)


FIT = {"constants": "fit", "energy": "families", "objective": "stress"}


@pytest.mark.parametrize(
    ("tissue", "there", "absent"),
    [
        ({"models": [{"name": "matrix", "law": "matrix"}]}, "figures/specimen.png", "figures/figure_8.png"),
        ({"models": [{"name": "nets", "law": "network"}]}, "tissue/nets.nc", "tables/comparison.csv"),
        (
            {"models": [{"name": "a", "law": "families", **FIT}, {"name": "nets", "law": "network", "load_steps": 4}]},
            "tables/comparison.csv",
            "tables/table_2.csv",
        ),
        ({"models": [{"name": "a", "law": "families", **FIT}], "update": "lagged"}, "tissue/a.nc", "tissue/a_refit.nc"),
    ],
)
def test_any_list_of_models_makes_a_study(quick, tissue, there, absent):
    names = [model["name"] for model in tissue["models"]]
    found = would_run(quick[0], {"tissue": tissue, "microstructure": {"runs": names}})
    assert f"results/{there}" in found
    assert f"results/{absent}" not in found


def test_more_rounds_add_runs_and_change_none():
    before = quick_config()
    found = outdated(before, changed(before, refit_rounds=2))
    assert {path for path in found if path.endswith(".nc") and "/tissue/" in path and "curves" not in path} == {
        f"results/tissue/{name}_refit_2.nc" for name in ("hgo", "structure_tensor", "families", "stress")
    }
    assert "results/fits/tissue/refit_hgo_refit.csv" in found
    assert "results/fits/tissue/refit_hgo.csv" not in found


def test_more_batches_of_element_networks_give_the_same_bits(quick, tmp_path):
    change = {"tissue": {"batches": 3}}
    wanted = [f"results/networks/tissue/0{batch}.nc" for batch in range(3)]
    done = snakemake(tmp_path, "-j2", *wanted, configs=(QUICK, written(tmp_path, change)))
    assert done.returncode == 0, done.stderr
    whole = xr.concat(
        [
            xr.load_dataset(quick[0] / f"results/networks/tissue/0{batch}.nc", engine="netcdf4")["structure_tensor"]
            for batch in range(2)
        ],
        "network",
    )
    parts = xr.concat(
        [xr.load_dataset(tmp_path / path, engine="netcdf4")["structure_tensor"] for path in wanted], "network"
    )
    assert parts.values.tobytes() == whole.values.tobytes()


def test_lagged_constants_need_no_curves_of_refits(quick):
    found = would_run(quick[0], {"tissue": {"update": "lagged"}})
    assert not any("refit_" in path and path.startswith("results/curves") for path in found)
    assert {f"results/tissue/{name}_refit.nc" for name in ("hgo", "structure_tensor", "families", "stress")} <= found
    assert "results/tissue/hgo.nc" not in found


@pytest.mark.parametrize(
    ("source", "first", "spared"),
    [
        ("fibrous/networks/generation.py", {"network_ensemble", "network_curves"}, {"specimen", "figure_7"}),
        ("fibrous/fitting/hgo.py", {"hgo_fits"}, {"network_ensemble", "network_curves", "specimen", "figure_7"}),
        ("fibrous/fe/assembly.py", {"specimen", "tissue_run"}, {"network_states", "table_1", "case_study"}),
        ("fibrous/specimen.py", {"specimen"}, {"table_1", "case_study", "figure_7"}),
        ("fibrous/hybrid.py", set(), None),
        ("fibrous_study/steps/convergence.py", {"convergence"}, None),
        ("fibrous_study/report/report.css", {"report", "table_pages"}, None),
        ("fibrous_study/datasets.py", {"network_ensemble", "specimen", "figure_7", "report"}, set()),
    ],
)
def test_a_change_of_a_source_reruns_what_uses_its_room(quick, tmp_path, monkeypatch, source, first, spared):
    """Spared are all others where no rule is named."""
    sources = shutil.copytree(provenance.SOURCES, tmp_path / "src")
    with open(sources / source, "a") as stream:
        stream.write("/* changed */\n" if source.endswith(".css") else "# changed\n")
    provenance.code_hash.cache_clear()
    monkeypatch.setattr(provenance, "SOURCES", sources)
    found = would_run(quick[0], {})
    provenance.code_hash.cache_clear()
    others = {job.rule for job in jobs_of(quick_config())} - TELLING - first
    assert files_of(quick_config(), *first) <= found
    assert not files_of(quick_config(), *(others if spared is None else spared)) & found
