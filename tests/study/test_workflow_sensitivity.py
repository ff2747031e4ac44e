"""The sensitivities through the workflow: what they need, what they hold, and that they are the study's own numbers."""

import copy

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from workflow_runs import quick_config, would_run

from fibrous_study.check import check
from fibrous_study.config import validated
from fibrous_study.stages import possible_files, stage_params

STAGES = ("sensitivity", "sensitivity_tables", "figure_sensitivity")
FIT = ["C2_MPa", "C3", "r_squared", "lambda_f_max", "points_used"]


def of_sensitivity(config: dict) -> dict[str, dict]:
    """Params of every file of the sensitivities."""
    files = [one for one in possible_files(config) if one[1] in STAGES]
    return {path: stage_params(stage, config, wildcards) for path, stage, wildcards in files}


def test_the_target_makes_its_own_files_and_needs_no_others(quick_sensitivity, tmp_path):
    wanted = set(of_sensitivity(quick_config()))
    assert len(wanted) == 6 + 5
    assert would_run(tmp_path, {}, "sensitivity") == wanted
    found = {str(path.relative_to(quick_sensitivity)) for path in (quick_sensitivity / "results").rglob("*.*")}
    assert {path for path in found if not path.endswith(".json")} == wanted
    assert would_run(quick_sensitivity, {}, "sensitivity") == set()


def test_check_judges_them_where_they_are(quick, quick_sensitivity):
    about_them = [line for line in check(quick_config(), quick_sensitivity)[0] if "sensitivity" in line]
    assert about_them == []
    assert not [line for line in check(quick_config(), quick[0])[0] if "sensitivity" in line]
    other = quick_config()
    other["sensitivity"]["seeds"] = 3
    stale = [line for line in check(other, quick_sensitivity)[0] if "sensitivity" in line]
    assert len(stale) == 6 + 5
    assert all(": stale, made " in line for line in stale)


@pytest.mark.parametrize(
    ("key", "value", "made"),
    [
        ("steps", [5, 40], {"results/sensitivity/steps_40.csv"}),
        ("volume_fraction", [0.06], set()),
        ("seeds", 3, None),
        ("networks", ["case"], None),
    ],
)
def test_another_value_makes_its_own_trial_and_the_sums(key, value, made):
    before = quick_config()
    after = copy.deepcopy(before)
    after["sensitivity"][key] = value
    old, new = of_sensitivity(before), of_sensitivity(validated(after))
    changed = {path for path, params in new.items() if old.get(path) != params}
    trials = {path for path in changed if path.startswith("results/sensitivity/")}
    assert trials == ({path for path in new if path.startswith("results/sensitivity/")} if made is None else made)
    sums = {path for path in new if not path.startswith("results/sensitivity/")}
    assert changed - trials == (set() if made == set() else sums)


def test_the_base_is_what_the_studys_own_rules_give(quick, quick_sensitivity):
    """The same replicates, generated, loaded and fitted by the rules networks, curves and fits."""
    base = pd.read_csv(quick_sensitivity / "results/sensitivity/base.csv")
    fits = pd.read_csv(quick[0] / "results/fits/replicates/large.csv")
    pooled = fits[fits["deformation"] == "all"].set_index(["network", "load_set"])
    same = pooled.loc[pd.MultiIndex.from_frame(base[["replicate", "load_set"]])]
    assert same["name"].tolist() == base["network"].tolist()
    np.testing.assert_array_equal(base[FIT].to_numpy(), same[FIT].to_numpy())
    networks = xr.load_dataset(quick[0] / "results/networks/replicates/00.nc", engine="netcdf4")
    assert base["seed"].tolist() == networks["seed"].sel(network=base["replicate"].to_numpy()).values.tolist()


def test_the_error_of_the_base_is_that_along_the_studys_path(quick, quick_sensitivity):
    base = pd.read_csv(quick_sensitivity / "results/sensitivity/base.csv")
    path = xr.load_dataset(quick[0] / "results/curves/replicates/eq9/00.nc", engine="netcdf4").isel(deformation=0)
    for row in base.to_dict("records"):
        network = path.sel(network=row["replicate"]).isel(step=slice(1, None))
        F, H = network["deformation_gradient"].values, network["structure_tensor"].values
        x = np.einsum("sij,ik,jk->s", np.swapaxes(F, 1, 2) @ F, np.eye(3), H) - 1.0
        factor = 2.0 * row["C2_MPa"] * x * np.exp(row["C3"] * x**2) / np.linalg.det(F)
        difference = factor[:, None, None] * (F @ H @ np.swapaxes(F, 1, 2)) - network["cauchy_stress"].values
        own = np.linalg.norm(network["cauchy_stress"].values)
        assert row["stress_error"] == pytest.approx(np.linalg.norm(difference) / own, rel=1e-9)


def test_the_figure_draws_every_network_at_every_value(quick_sensitivity):
    data = pd.read_csv(quick_sensitivity / "results/figures/sensitivity.csv")
    table = pd.read_csv(quick_sensitivity / "results/tables/sensitivity.csv")
    assert len(data) == table["replicates"].sum() == 5 * 2 * 2 * 2 * 2
    medians = data.groupby(["factor", "value", "network", "load_set"], sort=False)["C2_MPa"].median()
    np.testing.assert_allclose(medians, table["C2_median_MPa"])
    said = pd.read_csv(quick_sensitivity / "results/tables/sensitivity_sentences.csv")
    assert said["factor"].tolist() == [*dict.fromkeys(table["factor"]), "shear_directions", "seeds"]
