"""The surface of Eq. 11: least squares against textbook formulas, Table 1 as printed, and predictions from a file."""

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import t as student
from synthetic import whole

from fibrous.errors import ConfigError, DatasetError, FitError
from fibrous.fitting.surface import (
    EIGHT,
    LABELS,
    NINE,
    TERMS,
    TRIANGLE,
    Region,
    alignment,
    evaluate,
    fit_surface,
    indices_swapped,
    monomials,
    prediction,
    summary,
)
from fibrous_study import datasets
from fibrous_study.paper import section
from fibrous_study.prediction import predict
from fibrous_study.steps import table_1 as stage

FITTED = Region(0.33, 0.80, 0.05)
TRUTH = np.array([0.4, -0.3, 0.2, 0.5, 0.1, -0.6, 0.3, 0.8, -0.2])
FOLDS = 10
TABLE_1 = section("table_1")


def alignments(count, seed=0):
    """H11 and H22 drawn evenly from the fitted region."""
    generator = np.random.default_rng(seed)
    H11, H22, width = FITTED.points(*generator.uniform(size=(2, 4 * count)))
    kept = generator.uniform(size=4 * count) < width / width.max()
    return H11[kept][:count], H22[kept][:count]


def scattered(count=60, seed=0, deviation=0.05):
    H11, H22 = alignments(count)
    return H11, H22, evaluate(TRUTH, H11, H22) + deviation * np.random.default_rng(seed).normal(size=count)


# Least squares


@given(st.floats(0.0, 1.0), st.floats(0.0, 1.0))
def test_the_surface_is_the_double_sum_of_eq_11(H11, H22):
    total = sum(c * H11**i * H22**j for c, (i, j) in zip(TRUTH, TERMS, strict=True))
    assert float(evaluate(TRUTH, H11, H22)) == pytest.approx(total, abs=1e-14)


@pytest.mark.parametrize("terms", [EIGHT, NINE])
def test_coefficients_and_their_covariance_are_those_of_the_normal_equations(terms):
    H11, H22, value = scattered()
    matrix = np.stack([H11**i * H22**j for i, j in TERMS[:terms]], axis=1)
    expected, squares, _, _ = np.linalg.lstsq(matrix, value, rcond=None)
    fit = fit_surface(H11, H22, value, terms, FOLDS)
    np.testing.assert_allclose(fit.coefficient[:terms], expected, rtol=1e-7)
    assert fit.degrees_of_freedom == 60 - terms
    assert fit.residual_variance == pytest.approx(squares[0] / (60 - terms), rel=1e-9)
    covariance = fit.residual_variance * np.linalg.inv(matrix.T @ matrix)
    np.testing.assert_allclose(fit.covariance[:terms, :terms], covariance, rtol=1e-5)
    half_width = student.ppf(0.975, 60 - terms) * np.sqrt(np.diag(covariance))
    np.testing.assert_allclose(fit.half_width[:terms], half_width, rtol=1e-5)
    assert fit.r_squared == pytest.approx(1.0 - squares[0] / np.sum((value - value.mean()) ** 2), rel=1e-9)
    if terms == EIGHT:
        assert fit.coefficient[8] == 0.0
        assert not fit.covariance[8].any()
        assert np.isnan(fit.half_width[8])


def test_coefficients_without_scatter_are_exact():
    fit = fit_surface(*scattered(deviation=0.0), NINE, FOLDS)
    np.testing.assert_allclose(fit.coefficient, TRUTH, atol=1e-10)
    assert fit.cross_validated_r_squared == pytest.approx(1.0, abs=1e-12)


def test_half_widths_cover_the_truth_19_times_in_20():
    """400 repetitions of nine coefficients; one coefficient's standard error is 1.1 %."""
    covered = np.zeros(9)
    for seed in range(400):
        fit = fit_surface(*scattered(seed=seed), NINE, 2)
        covered += np.abs(fit.coefficient - TRUTH) < fit.half_width
    assert np.all(np.abs(covered / 400 - 0.95) < 0.04)


def test_leaving_one_out_is_the_press_statistic():
    """With as many folds as networks, the residual without a network is e/(1 − leverage): no refit is needed."""
    H11, H22, value = scattered()
    fit = fit_surface(H11, H22, value, NINE, len(value))
    matrix = monomials(H11, H22)
    hat = matrix @ np.linalg.pinv(matrix)
    press = np.sum(((value - hat @ value) / (1.0 - np.diag(hat))) ** 2)
    expected = 1.0 - press / np.sum((value - value.mean()) ** 2)
    assert fit.cross_validated_r_squared == pytest.approx(expected, rel=1e-8)
    assert fit.cross_validated_r_squared < fit.r_squared


def test_cross_validation_sees_that_pure_noise_is_not_explained():
    H11, H22 = alignments(60)
    fit = fit_surface(H11, H22, np.random.default_rng(1).normal(size=60), NINE, FOLDS)
    assert fit.r_squared > 0.0 > fit.cross_validated_r_squared
    again = fit_surface(H11, H22, np.random.default_rng(1).normal(size=60), NINE, FOLDS)
    assert again.cross_validated_r_squared == fit.cross_validated_r_squared


def test_units_of_the_constant_scale_everything_with_it():
    H11, H22, value = scattered()
    one, other = (fit_surface(H11, H22, factor * value, NINE, FOLDS) for factor in (1.0, 1e6))
    np.testing.assert_allclose(other.half_width, 1e6 * one.half_width, rtol=1e-9)
    assert other.residual_variance == pytest.approx(1e12 * one.residual_variance)
    assert other.cross_validated_r_squared == pytest.approx(one.cross_validated_r_squared)


def test_too_few_networks_or_too_narrow_a_range_are_refused():
    H11, H22, value = scattered()
    with pytest.raises(FitError, match=r"9 terms and 9 fitted networks.*more networks"):
        fit_surface(H11[:9], H22[:9], value[:9], NINE, FOLDS)
    with pytest.raises(FitError, match="wider range"):
        fit_surface(np.full(60, 0.5), H22, value, NINE, FOLDS)


def test_prediction_intervals_hold_19_new_networks_in_20():
    covered, at = 0, (0.74, 0.14)
    for seed in range(600):
        value, half_width = prediction(fit_surface(*scattered(30, seed), NINE, 2), *at)
        new = evaluate(TRUTH, *at) + 0.05 * np.random.default_rng([seed, 1]).normal()
        covered += abs(value - new) < half_width
    assert abs(covered / 600 - 0.95) < 0.03


def test_the_prediction_interval_is_the_textbook_one():
    H11, H22, value = scattered()
    fit = fit_surface(H11, H22, value, NINE, FOLDS)
    matrix, row = monomials(H11, H22), monomials(0.5, 0.3)
    leverage = row @ np.linalg.inv(matrix.T @ matrix) @ row
    expected = student.ppf(0.975, 51) * np.sqrt(fit.residual_variance * (1.0 + leverage))
    assert prediction(fit, 0.5, 0.3)[1] == pytest.approx(expected, rel=1e-6)


# Regions


def test_areas_and_extremes_of_a_plane_over_the_whole_triangle():
    plane = np.zeros(9)
    plane[[TERMS.index((0, 0)), TERMS.index((1, 0))]] = -0.5, 1.0  # negative where H11 < 1/2: 3/4 of the triangle
    over = summary(plane, TRIANGLE)
    assert over.negative_fraction == pytest.approx(0.75, abs=1e-3)
    assert (over.least, over.largest) == pytest.approx((-0.5, 0.5))


def test_the_fitted_region_is_the_trapezium_of_section_3_2():
    plane = np.zeros(9)
    plane[[TERMS.index((0, 0)), TERMS.index((0, 1))]] = -0.15, 1.0  # negative where H22 < 0.15
    over = summary(plane, FITTED)
    # H22 from 0.05 to 0.95 − H11: the strip below 0.15 is 0.1 · 0.47 of an area 0.47 · (0.57 + 0.10)/2.
    assert over.negative_fraction == pytest.approx(0.1 / 0.335, abs=2e-3)
    assert (over.least, over.largest) == pytest.approx((-0.10, 0.47))


# Table 1 as printed


def test_printed_c2_is_negative_nearly_everywhere():
    assert float(evaluate(TABLE_1["C2"], 1 / 3, 1 / 3)) == pytest.approx(-0.33, abs=0.005)
    assert float(evaluate(TABLE_1["C2"], 0.74, 0.14)) == pytest.approx(-23.8, abs=0.05)
    assert summary(TABLE_1["C2"], FITTED).negative_fraction == pytest.approx(0.91, abs=0.005)
    assert summary(TABLE_1["C2"], TRIANGLE).negative_fraction == pytest.approx(0.44, abs=0.005)
    H11, H22, _ = FITTED.points(*np.meshgrid(np.linspace(0, 1, 201), np.linspace(0, 1, 201)))
    assert evaluate(TABLE_1["C2"], H11, H22)[H11 >= H22].max() < 0.0


def test_printed_c2_with_indices_swapped_grows_with_alignment():
    swapped = indices_swapped(TABLE_1["C2"])
    networks = [section("alignments")[f"network_{k}"] for k in range(1, 6)]
    values = [float(evaluate(swapped, *at)) for at in networks]
    assert values == pytest.approx([0.3, 3.6, 3.6, 11.3, 14.7], abs=0.06)
    assert float(evaluate(swapped, 0.6, 0.3)) == pytest.approx(float(evaluate(TABLE_1["C2"], 0.3, 0.6)), rel=1e-13)


def test_printed_c3_is_as_the_text_wants_and_its_swap_is_not():
    assert float(evaluate(TABLE_1["C3"], 1 / 3, 1 / 3)) == pytest.approx(-0.60, abs=0.005)
    assert float(evaluate(TABLE_1["C3"], 0.74, 0.14)) == pytest.approx(2.5, abs=0.05)
    swapped = indices_swapped(TABLE_1["C3"])
    negative = [float(evaluate(swapped, *section("alignments")[f"network_{k}"])) < 0.0 for k in range(1, 6)]
    assert negative == [True, False, False, True, True]


# What is no alignment


@pytest.mark.parametrize(
    ("tensor", "words"),
    [
        (np.eye(2) / 2, "shape"),
        ([[0.5, 0, 0], [0, 0.3, 0]], "shape"),
        ([[0.5, 0, 0], [0, 0.3], [0, 0, 0.2]], "not a number"),
        (np.diag([0.5, np.nan, 0.2]), "structure_tensor is .*nan"),
        ([[0.5, 0.1, 0], [0, 0.3, 0], [0, 0, 0.2]], "symmetric"),
        (np.diag([0.5, 0.3, 0.3]), "structure_tensor is .*trace 1"),
        (np.diag([0.8, 0.3, -0.1]), "structure_tensor is .*negative"),
        ([[0.5, 0.05, 0], [0.05, 0.3, 0], [0, 0, 0.2]], "rotate"),
        (np.diag([0.85, 0.10, 0.05]), "H11 = 0.850 is outside"),
        (np.diag([0.3, 0.4, 0.3]), "H11 = 0.300 is outside"),
        (np.diag([0.6, 0.37, 0.03]), "H33 = 0.030 is outside"),
        (np.diag([0.6, 0.02, 0.38]), "H22 = 0.020 is outside"),
    ],
)
def test_what_the_surface_does_not_know_is_refused_in_one_line(tensor, words):
    ranges = [(0.33, 0.80), (0.05, 0.62), (0.05, 0.62)]
    with pytest.raises(FitError, match=words) as refusal:
        alignment(tensor, ranges)
    assert "\n" not in str(refusal.value)
    assert alignment(np.diag([0.69, 0.21, 0.10]), ranges) == (0.69, 0.21)


def test_an_alignment_at_the_edge_is_answered_to_the_two_decimals_printed():
    ranges = [(0.333, 0.797), (0.052, 0.62), (0.052, 0.62)]
    assert alignment(np.diag([0.80, 0.15, 0.05]), ranges) == (0.80, 0.15)
    assert alignment(np.diag([0.33, 0.05, 0.62]), ranges) == (0.33, 0.05)


# The stage and predict


def fits_table(path, count=40, seed=0):
    H11, H22 = alignments(count, seed=5)
    generator = np.random.default_rng(seed)
    rows = []
    for k in range(count):
        for n, load_set in enumerate(("section_3_1", "section_2_3")):
            common = {
                "network": k, "load_set": load_set, "deformation": "all", "energy": "structure_tensor",
                "rule": "energy", "H11": H11[k], "H22": H22[k], "H33": 1 - H11[k] - H22[k],
                "lambda_f_max": 1.2 + 0.01 * k, "C2_half_width_MPa": 0.1, "C3_half_width": np.nan if k < 3 else 0.1,
            }  # fmt: skip
            C2 = float(evaluate(TRUTH, H11[k], H22[k])) + n
            rows.append({**common, "C2_MPa": C2 + 0.01 * generator.normal(), "C3": 2 * H11[k] + generator.normal()})
            rows.append({**common, "deformation": "x_uniaxial", "load_set": "single", "C2_MPa": 1e6, "C3": 1e6})
            rows.append({**common, "energy": "families", "C2_MPa": 1e6, "C3": 1e6})
            rows.append({**common, "rule": "stress", "C2_MPa": 1e6, "C3": 1e6})
    rows.append({**rows[0], "network": count, "C2_MPa": 0.0, "rule": "zero"})
    whole(pd.DataFrame(rows), "fits").to_csv(path, index=False)
    return path


def run_stage(folder, tables):
    config = {
        "surface": {"cross_validation_folds": FOLDS},
        "paper": {"table_1": TABLE_1, "alignments": section("alignments")},
        "delaunay": {"H11": [0.33, 0.80], "smallest_H": 0.05},
        "load_sets": [],
        "protocols": ["large", "small"],
    }
    outputs = {
        "surface": folder / "surface.nc",
        "table_1": folder / "table_1.csv",
        "surface_over_triangle": folder / "surface_over_triangle.csv",
    }
    stage.run({"fits": tables}, outputs, {"stage": "fibrous_study.steps.table_1", "config": config, "code_hash": ""})
    return outputs


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("tables")
    return run_stage(folder, [fits_table(folder / "large.csv"), fits_table(folder / "small.csv", seed=1)])


def test_table_1_holds_ours_and_the_papers_with_amplitude_and_goodness_of_fit(study):
    table = pd.read_csv(study["table_1"], dtype={"ij": str})
    assert list(table["ij"]) == 4 * list(LABELS) == 4 * [f"{i}{j}" for i, j in TERMS]
    assert list(dict.fromkeys(zip(table["protocol"], table["load_set"], strict=True))) == [
        (protocol, load_set) for protocol in ("large", "small") for load_set in ("section_3_1", "section_2_3")
    ]
    assert table["lambda_f_max_least"].eq(1.2).all()
    assert table["lambda_f_max_largest"].eq(1.2 + 0.01 * 39).all()
    assert table["networks"].eq(40).all()
    assert table["networks_with_C3_at_bound"].eq(3).all()
    assert table["networks_with_C2_at_bound"].eq(0).all()
    assert table["C2_r_squared_paper"].eq(0.47).all()
    assert table["C3_r_squared_paper"].eq(0.73).all()
    np.testing.assert_array_equal(table["alpha_paper_MPa"][:9], TABLE_1["C2"])
    np.testing.assert_array_equal(table["beta_paper_half_width"][:9], np.array(TABLE_1["C3_half_width"], dtype=float))

    fits = pd.read_csv(study["table_1"].parent / "large.csv")
    fits = fits[(fits["deformation"] == "all") & (fits["load_set"] == "section_2_3")]
    fits = fits[(fits["energy"] == "structure_tensor") & (fits["rule"] == "energy")]
    matrix = np.stack([fits["H11"] ** i * fits["H22"] ** j for i, j in TERMS], axis=1)
    ours = table[(table["protocol"] == "large") & (table["load_set"] == "section_2_3")]
    np.testing.assert_allclose(ours["alpha_MPa"], np.linalg.lstsq(matrix, fits["C2_MPa"])[0], rtol=1e-6)
    np.testing.assert_allclose(ours["beta_nine_terms"], np.linalg.lstsq(matrix, fits["C3"])[0], rtol=1e-6)
    eight = np.linalg.lstsq(matrix[:, :8], fits["C3"])[0]
    np.testing.assert_allclose(ours["beta_eight_terms"], [*eight, 0.0], rtol=1e-6)


def test_the_triangle_table_says_where_each_surface_is_negative(study):
    table = pd.read_csv(study["surface_over_triangle"], keep_default_na=True)

    def row(surface, over):
        return table[(table["surface"] == surface) & (table["over"] == over)].iloc[0]

    paper = row("table_1_as_printed", "fitted_region")
    assert paper["C2_negative_fraction"] == pytest.approx(0.91, abs=0.005)
    assert paper["C2_least_MPa"] < -23.8 < 0.0 < paper["C2_largest_MPa"]
    assert row("table_1_indices_swapped", "network_5")["C2_MPa"] == pytest.approx(14.7, abs=0.05)
    ours = table[(table["surface"] == "this_study_C3_nine_terms") & (table["over"] == "isotropy")]
    np.testing.assert_allclose(ours["C2_MPa"] - [0, 1, 0, 1], evaluate(TRUTH, 1 / 3, 1 / 3), atol=0.03)
    assert set(table["over"]) == {"fitted_region", "whole_triangle", *section("alignments")}


def test_predict_reads_the_studys_surface(study):
    tensor = np.diag([0.55, 0.25, 0.20])
    got = predict(tensor, study["surface"])
    assert got.C2_MPa == pytest.approx(float(evaluate(TRUTH, 0.55, 0.25)), abs=0.02)
    low, high = got.C2_interval_MPa
    assert (low + high) / 2 == pytest.approx(got.C2_MPa)
    assert 0.03 < high - low < 0.08  # four times a scatter of 0.01 and some for the coefficients
    assert got.C3_interval[0] < got.C3 < got.C3_interval[1]
    assert (got.protocol, got.load_set) == ("large", "section_3_1")
    assert got.largest_stretch == pytest.approx((1.2, 1.59))
    other = predict(tensor.tolist(), str(study["surface"]), load_set="section_2_3", protocol="small")
    assert other.C2_MPa - got.C2_MPa == pytest.approx(1.0, abs=0.05)


def test_predict_refuses_what_the_surface_does_not_hold(study, tmp_path):
    tensor = np.diag([0.55, 0.25, 0.20])
    with pytest.raises(FitError, match=r"load_set 'section_9'.*section_3_1, section_2_3"):
        predict(tensor, study["surface"], load_set="section_9")
    with pytest.raises(FitError, match="outside the fitted range"):
        predict(np.diag([0.9, 0.05, 0.05]), study["surface"])
    with pytest.raises(DatasetError, match="no such file"):
        predict(tensor, tmp_path / "surface.nc")


def test_the_shipped_surface_answers_within_its_range():
    got = predict(np.diag([0.69, 0.21, 0.10]))
    assert got.C2_interval_MPa[0] < got.C2_MPa < got.C2_interval_MPa[1]
    with pytest.raises(FitError, match="outside the fitted range"):
        predict(np.diag([0.95, 0.03, 0.02]))


def test_the_stage_refuses_tables_that_make_no_surface(tmp_path):
    with pytest.raises(ConfigError, match="Table 1"):
        run_stage(tmp_path, [])
    table = pd.read_csv(fits_table(tmp_path / "large.csv"))
    table[table["load_set"] == "single"].to_csv(tmp_path / "small.csv", index=False)
    with pytest.raises(DatasetError, match="no fit to all loads"):
        run_stage(tmp_path, [tmp_path / "small.csv"])
    table[table["load_set"] != "section_2_3"].to_csv(tmp_path / "small.csv", index=False)
    with pytest.raises(DatasetError, match="lack load set 'section_2_3'"):
        run_stage(tmp_path, [tmp_path / "large.csv", tmp_path / "small.csv"])
    assert not (tmp_path / "surface.nc").exists()


def test_the_surface_file_keeps_coefficients_and_ranges(study):
    dataset = datasets.read(study["surface"], "surface").sel(protocol="large", load_set="section_2_3")
    table = pd.read_csv(study["table_1"], dtype={"ij": str})
    ours = table[(table["protocol"] == "large") & (table["load_set"] == "section_2_3")]
    np.testing.assert_array_equal(dataset["coefficient"].sel(constant="C2"), ours["alpha_MPa"])
    np.testing.assert_array_equal(dataset["half_width"].sel(constant="C3_eight"), ours["beta_eight_terms_half_width"])
    assert list(dataset["term"].values) == list(ours["ij"])
    assert int(dataset["networks_at_bound"].sel(constant="C3")) == 3
    assert float(dataset["H33_range"].sel(bound="least")) >= 0.05
