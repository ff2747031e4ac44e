"""The sensitivities through the workflow: what they need, what they hold, and that they are the study's own numbers."""

import copy

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from workflow_runs import QUICK, jobs_of, quick_config, would_run, written

from fibrous_study.check import check
from fibrous_study.config import validated

FIT = ["C2_MPa", "C3", "r_squared", "lambda_f_max", "points_used"]


def of_sensitivity(config: dict) -> dict[str, dict]:
    """Params of every file of the sensitivities."""
    return {path: job.params for job in jobs_of(config, "sensitivity") for path in job.outputs}


def test_the_target_makes_its_own_files_and_needs_no_others(quick_sensitivity, tmp_path):
    wanted = set(of_sensitivity(quick_config()))
    assert len(wanted) == 6 + 5
    assert would_run(tmp_path, {}, "sensitivity") == wanted
    found = {str(path.relative_to(quick_sensitivity)) for path in (quick_sensitivity / "results").rglob("*.*")}
    assert {path for path in found if not path.endswith(".json")} == wanted
    assert would_run(quick_sensitivity, {}, "sensitivity") == set()


def test_check_judges_them_where_they_are(quick_sensitivity, tmp_path):
    assert [line for line in check(QUICK, quick_sensitivity)[0] if "sensitivity" in line] == []
    other = quick_config()
    other["sensitivity"]["seeds"] = 3
    lines = check(written(tmp_path, other), quick_sensitivity)[0]
    stale = {line.split(": ")[0] for line in lines if "sensitivity" in line and ": stale, made with " in line}
    assert stale == {path for path in of_sensitivity(quick_config()) if path.startswith("results/sensitivity/")}


@pytest.mark.parametrize(
    ("key", "value", "made"),
    [
        ("steps", [5, 40], {"results/sensitivity/steps_40.csv"}),
        ("volume_fraction", [0.06], set()),
        ("seeds", 3, None),
        ("networks", ["case"], None),
    ],
)
def test_another_value_makes_its_own_trial(key, value, made):
    before = quick_config()
    after = copy.deepcopy(before)
    after["sensitivity"][key] = value
    old, new = of_sensitivity(before), of_sensitivity(validated(after))
    trials = {path for path in new if path.startswith("results/sensitivity/")}
    assert {path for path in trials if old.get(path) != new[path]} == (trials if made is None else made)


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
    moves = pd.read_csv(quick_sensitivity / "results/tables/sensitivity_sentences.csv")
    assert list(dict.fromkeys(moves["factor"])) == [*dict.fromkeys(table["factor"]), "shear_directions", "seeds"]
