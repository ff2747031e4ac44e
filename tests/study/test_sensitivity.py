"""Sensitivities: a trial is the study's own fit, networks scale as they must, and moves follow from the numbers."""

import re
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
from small_study import NO_PARAMS, small_config
from workflow_runs import job_of

from fibrous.curves import Curves
from fibrous.deformation import Load, averaged_stretch, load_path, straight_path
from fibrous.errors import NetworkError
from fibrous.materials.hgo import HGOStructureTensor
from fibrous_study.datasets import write_table
from fibrous_study.schema import TABLES
from fibrous_study.sensitivity.summary import completed, moves, summary
from fibrous_study.sensitivity.trial import stress_error, trial
from fibrous_study.steps import sensitivity_tables
from fibrous_study.steps import sensitivity_trial as stage
from fibrous_study.variants import own_value, variants, varied

H = np.diag([0.6, 0.25, 0.15])
FIT = {"largest_C3": 50.0, "slope_fit_below_r_squared": 0.5}
END = np.array([[1.24, 0.0, 0.0], [0.0, 1.05, 0.0], [0.0, 0.1, 0.77]])
QUANTITIES = ["C2_MPa", "C3", "r_squared", "stress_error"]


def answers_of_eq_2(gradients, C2=0.2, C3=0.7) -> Curves:
    law = HGOStructureTensor(C2, C3, H)
    stress = law(gradients)[0] @ np.swapaxes(gradients, -1, -2) / np.linalg.det(gradients)[..., None, None]
    return Curves.of_network(gradients, H, law.energy(gradients), stress)


def loaded() -> Curves:
    loads = (("x_uniaxial", 1.5), ("xy_biaxial", 1.2), ("xy_shear", 0.6))
    return answers_of_eq_2(np.array([load_path(Load.parse(name), end, 8)[1] for name, end in loads]))


def judged() -> Curves:
    return answers_of_eq_2(straight_path(END, 6)[1][None])


# One network ---------------------------------------------------------------------------------------------------------


def test_a_network_that_answers_as_eq_2_does_is_met_on_every_path():
    row = trial(loaded(), judged(), **FIT)
    np.testing.assert_allclose((row["C2_MPa"], row["C3"]), (0.2, 0.7), rtol=1e-6)
    assert row["r_squared"] == pytest.approx(1.0)
    assert row["stress_error"] < 1e-6
    assert row["lambda_f_max"] == pytest.approx(averaged_stretch(loaded().deformation_gradient, H).max())
    assert (row["points_used"], row["states_failed"], row["judged_states_failed"]) == (24, 0, 0)


def test_the_error_of_stress_is_that_of_eq_2_written_out():
    """σ = 2 C2 x exp(C3 x²) F H Fᵀ/J with x = λ_f² − 1, against any stress, by the Frobenius norm over the steps."""
    path = judged()
    rng = np.random.default_rng(2)
    network = replace(path, cauchy_stress=rng.normal(size=(1, 1, 7, 3, 3)))
    difference, own = 0.0, 0.0
    for F, sigma in zip(network.deformation_gradient[0, 0, 1:], network.cauchy_stress[0, 0, 1:], strict=True):
        x = np.trace(H @ F.T @ F) - 1.0
        law = 2.0 * 0.3 * x * np.exp(0.5 * x**2) * F @ H @ F.T / np.linalg.det(F)
        difference += ((law - sigma) ** 2).sum()
        own += (sigma**2).sum()
    assert stress_error(0.3, 0.5, network) == pytest.approx(np.sqrt(difference / own))


def test_states_without_equilibrium_are_left_out_and_counted():
    curves, path = loaded(), judged()
    # What a solver may leave behind must reach neither fit nor error.
    curves.cauchy_stress[0, 1, 5], path.cauchy_stress[0, 0, 3] = 1e9, 1e9
    curves.strain_energy_density[0, 1, 5], path.strain_energy_density[0, 0, 3] = np.nan, np.nan
    row = trial(curves, path, **FIT)
    assert (row["points_used"], row["states_failed"], row["judged_states_failed"]) == (23, 1, 1)
    np.testing.assert_allclose((row["C2_MPa"], row["C3"]), (0.2, 0.7), rtol=1e-6)
    assert row["stress_error"] < 1e-6


def test_a_path_or_a_fit_without_states_has_no_error():
    path = judged()
    path.strain_energy_density[0, 0, 1:] = np.nan
    assert np.isnan(trial(loaded(), path, **FIT)["stress_error"])
    curves = loaded()
    curves.strain_energy_density[..., 1:] = np.nan
    row = trial(curves, judged(), **FIT)
    assert np.isnan([row["C2_MPa"], row["C3"], row["stress_error"]]).all()
    assert row["states_failed"] == 24


# The stage -----------------------------------------------------------------------------------------------------------


def short(**changes) -> dict:
    """Two networks of one alignment in few steps."""
    part = {
        "seeds": 2,
        "networks": ["case"],
        "steps": [3],
        "edge_length_um": [16.0],
        "volume_fraction": [0.05],
    }
    config = small_config(sensitivity=part, **changes)
    config["protocols"][0]["steps"], config["protocols"][3]["steps"] = 4, 4
    return config


def trials(config, folder, variant="base", **changes) -> pd.DataFrame:
    params = job_of(config, "sensitivity_trial", variant=variant).params
    params["config"] = params["config"] | changes
    stage.run({}, {"trials": folder / f"{variant}.csv"}, params)
    return pd.read_csv(folder / f"{variant}.csv")


def test_stress_of_the_fibres_depends_on_the_volume_fraction_over_the_square_of_the_edge(tmp_path):
    """Networks of one φχ² are the same in edges; their forces act on faces of area χ², and so C2 goes as 1/χ²."""
    near = trials(short(cube={"volume_fraction": 0.04, "edge_length_um": 8.0}), tmp_path / "near")
    wide = trials(short(cube={"volume_fraction": 0.01, "edge_length_um": 16.0}), tmp_path / "wide")
    assert near["fibers"].equals(wide["fibers"])
    np.testing.assert_allclose(wide["C2_MPa"], near["C2_MPa"] / 4.0, rtol=1e-6)
    for quantity in ("C3", "r_squared", "stress_error"):
        np.testing.assert_allclose(wide[quantity], near[quantity], rtol=1e-5, atol=1e-9)


def test_a_stiffer_fibre_scales_C2_alone(tmp_path):
    soft, stiff = (trials(short(fiber={"modulus_MPa": k}), tmp_path / str(k)) for k in (10.0, 25.0))
    np.testing.assert_allclose(stiff["C2_MPa"], 2.5 * soft["C2_MPa"], rtol=1e-9)
    np.testing.assert_allclose(stiff[QUANTITIES[1:]], soft[QUANTITIES[1:]], rtol=1e-9)


def test_variants_share_their_networks_and_change_one_number(tmp_path):
    config = short()
    config["sensitivity"]["networks"] = ["fig6_4", "case"]
    base = trials(config, tmp_path)
    assert base["network"].tolist() == ["fig6_4"] * 4 + ["case"] * 4
    assert base["replicate"].tolist() == [4000, 4000, 4001, 4001, 0, 0, 1, 1]
    assert base["load_set"].tolist() == ["section_3_1", "section_2_3"] * 4
    assert set(base["factor"]) == {"base"}
    assert base["value"].isna().all()
    fewer = trials(config, tmp_path, "steps_3")
    assert fewer["points_used"].tolist() == (base["points_used"] * 3 / 4).tolist()
    np.testing.assert_allclose(fewer["lambda_f_max"], base["lambda_f_max"], rtol=1e-12)  # the same networks and ends
    small = trials(config, tmp_path, "amplitude_1.25")
    assert (small["lambda_f_max"] < base["lambda_f_max"] - 0.05).all()
    assert small["fibers"].equals(base["fibers"])
    assert small["seed"].equals(base["seed"])


def test_an_impossible_network_is_named(tmp_path):
    with pytest.raises(NetworkError, match=r"^case, replicate 0: a total fiber length"):
        trials(short(), tmp_path, cube=short()["cube"] | {"edge_length_um": 4.0})


def test_a_state_that_found_no_equilibrium_is_named(tmp_path, capsys):
    hasty = {"residual_tolerance": 1e-13, "largest_number_of_iterations": 1, "largest_number_of_cuts": 0}
    found = trials(short(equilibrium=hasty), tmp_path)
    assert found["states_failed"].sum() > 0
    said = capsys.readouterr().err.splitlines()
    assert "case, replicate 0, x_uniaxial, step 1: no equilibrium was found" in said
    assert sum(", eq9, " in line for line in said) == found.groupby("replicate")["judged_states_failed"].first().sum()


# Variants ------------------------------------------------------------------------------------------------------------


def test_a_variant_is_the_study_with_one_number_replaced():
    config = small_config()
    for factor, value in list(variants(config).values())[1:]:
        changed = varied(config, factor, value)
        assert own_value(changed, factor) == value != own_value(config, factor)
        assert varied(changed, factor, own_value(config, factor)) == config


def test_the_base_is_no_variant_of_itself():
    names = list(variants(small_config(cube={"edge_length_um": 15.0})))
    assert names[0] == "base"
    assert "edge_length_um_15" not in names
    assert "edge_length_um_20" in names


# Sums and moves ------------------------------------------------------------------------------------------------------


def made_up(shifts: dict[str, float], seeds: float = 0.1, failed: int = 0) -> list[pd.DataFrame]:
    """Three networks of one alignment whose quantities are seeds apart by `seeds`; `shifts` are added at χ = 30 µm."""
    tables = []
    for factor, value in (("base", np.nan), ("edge_length_um", 30.0)):
        rows = []
        for number in range(3):
            row = {"factor": factor, "value": value, "network": "case", "load_set": "a", "replicate": number}
            row |= {name: 1.0 + seeds * number + shifts.get(name, 0.0) * (factor != "base") for name in QUANTITIES}
            rows.append(row | {"states_failed": failed, "judged_states_failed": 0, "loads_limited": number})
        tables.append(pd.DataFrame(rows))
    return tables


def test_the_table_has_medians_ranges_and_ratios_to_the_base():
    table = summary(completed(made_up({"C2_MPa": 1.1}), {"edge_length_um": 20.0})).set_index("value")
    assert table.index.tolist() == [20.0, 30.0]
    assert table["is_base"].tolist() == [True, False]
    own, other = table.loc[20.0], table.loc[30.0]
    assert (own["C2_median_MPa"], own["C2_least_MPa"], own["C2_largest_MPa"]) == pytest.approx((1.1, 1.0, 1.2))
    assert (other["C2_median_MPa"], other["C2_over_base"], other["C3_over_base"]) == pytest.approx((2.2, 2.0, 1.0))
    assert (other["replicates"], other["loads_limited"]) == (3, 3)


def test_the_ratio_to_a_base_of_zero_is_unknown():
    zero = [table.assign(C3=0.0) for table in made_up({})]
    assert summary(completed(zero, {"edge_length_um": 20.0}))["C3_over_base"].isna().all()


def test_values_are_in_order_whatever_the_base_is():
    own = {"steps": 20, "edge_length_um": 40.0}
    found = completed(made_up({}), own)
    assert list(dict.fromkeys(found["factor"])) == list(own)
    for _, values in found.groupby("factor")["value"]:
        assert all(one <= other for one, other in pairwise(values))


def moved(tables) -> pd.DataFrame:
    """The moves by factor and quantity."""
    return moves(summary(completed(tables, {"edge_length_um": 20.0}))).set_index(["factor", "quantity"])


def test_a_move_beyond_the_spread_over_seeds_is_told_from_one_within_it():
    found = moved(made_up({"C2_MPa": 0.21, "C3": 0.19, "stress_error": -0.5})).loc["edge_length_um"]
    assert found["beyond_seeds"].to_dict() == {"C2_MPa": 1, "C3": 0, "r_squared": 0, "stress_error": 1}
    assert (found["cases"] == 1).all()
    assert (found[["network", "load_set"]] == ["case", "a"]).all(axis=None)
    ends = ["least", "least_at", "largest", "largest_at"]
    np.testing.assert_allclose(found.loc["C2_MPa", ends].astype(float), [1.1, 20.0, 1.31, 30.0])
    np.testing.assert_allclose(found.loc["stress_error", ends].astype(float), [0.6, 30.0, 1.1, 20.0])
    np.testing.assert_allclose(found[["seeds_least", "seeds_largest"]], [[1.0, 1.2]] * 4)


def test_states_that_were_left_out_are_counted():
    assert (moved(made_up({}, failed=2)).loc["edge_length_um", "states_failed"] == 12).all()
    assert (moved(made_up({}))["states_failed"] == 0).all()


def test_load_sets_are_compared_with_the_seeds_of_the_one_that_scatters_more():
    tables = [pd.concat([one, one.assign(load_set="b", C3=2.0 * one["C3"])]) for one in made_up({})]
    found = moved(tables).loc["shear_directions"]
    assert found["beyond_seeds"].to_dict() == {"C2_MPa": 0, "C3": 1, "r_squared": 0, "stress_error": 0}
    row = found.loc["C3"]
    assert (row["network"], row["load_set"], row["least_at"], row["largest_at"]) == ("case", "", "a", "b")
    assert (row["least"], row["largest"]) == pytest.approx((1.1, 2.2))
    assert (row["seeds_least"], row["seeds_largest"]) == pytest.approx((2.0, 2.4))


def two_alignments(quiet, loud) -> pd.DataFrame:
    """The seeds of one alignment are alike, those of the other 2 apart."""
    tables = zip(made_up(quiet, seeds=0.01), made_up(loud, seeds=1.0), strict=True)
    return moved([pd.concat([one, other.assign(network="fig6_1")]) for one, other in tables])


def test_a_case_that_moves_beyond_its_seeds_is_named_before_one_that_moves_more_but_within_them():
    row = two_alignments({"C2_MPa": 0.3}, {"C2_MPa": 1.0}).loc["edge_length_um", "C2_MPa"]
    assert (row["beyond_seeds"], row["cases"], row["network"]) == (1, 2, "case")


def test_where_nothing_moves_the_case_is_the_one_whose_seeds_are_farthest_apart():
    found = two_alignments({}, {})
    for factor in ("edge_length_um", "shear_directions", "seeds"):
        assert (found.loc[factor, "network"] == "fig6_1").all()
        np.testing.assert_allclose(found.loc[factor, ["seeds_least", "seeds_largest"]], [[1.0, 3.0]] * 4)


def test_every_move_is_written_with_its_numbers_in_words(tmp_path):
    paths = [tmp_path / f"{number}.csv" for number in range(2)]
    for path, table in zip(paths, made_up({"C2_MPa": 0.21}), strict=True):
        whole = table.reindex(columns=list(TABLES["sensitivity_trials"].columns))
        write_table(whole.assign(unit="µm", fibers=1), path, NO_PARAMS)
    outputs = {name: tmp_path / f"{name}.csv" for name in ("table", "sentences")}
    factors = [{"name": "edge_length_um", "unit": "µm", "own_value": 20.0}]
    sensitivity_tables.run({"trials": paths}, outputs, NO_PARAMS | {"config": {"factors": factors}})
    found = pd.read_csv(outputs["sentences"])
    assert list(found) == list(TABLES["sensitivity_sentences"].columns)
    assert {"1.1", "1.31", "1", "1.2", "20", "30"} <= set(re.findall(r"\d+(?:\.\d+)?", found["sentence"][0]))
    assert found["sentence"].str.contains("case").all()
