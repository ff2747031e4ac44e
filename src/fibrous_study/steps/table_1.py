"""Rule `table_1`: Eq. 11 over the fitted networks, beside Table 1, and what both surfaces do over the triangle."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr

from fibrous.errors import ConfigError, DatasetError
from fibrous.fitting.surface import (
    EIGHT,
    LABELS,
    NINE,
    TRIANGLE,
    Region,
    Surface,
    evaluate,
    fit_surface,
    indices_swapped,
    summary,
)
from fibrous_study import datasets
from fibrous_study.fit_tables import ALL

# constant of the surface: column of the fits, column of its half-width, terms
CONSTANTS = {
    "C2": ("C2_MPa", "C2_half_width_MPa", NINE),
    "C3": ("C3", "C3_half_width", NINE),
    "C3_eight": ("C3", "C3_half_width", EIGHT),
}
RANGES = ("H11", "H22", "H33", "lambda_f_max")


@dataclass(frozen=True)
class _Result:
    """The surfaces of one protocol and load set, and the networks behind them."""

    protocol: str
    load_set: str
    surfaces: dict[str, Surface]
    at_bound: dict[str, int]
    ranges: dict[str, tuple[float, float]]
    network_count: int


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Read `fits`, one table a protocol, named after it; write `table_1`, `surface` and `surface_over_triangle`.

    The config holds `surface`, `delaunay`, whose H11 and smallest_H bound the fitted region, and Table 1 and Fig. 6's
    alignments as printed (`paper`). Raises ConfigError
    without a table, DatasetError where one is no table of fits, FitError where its networks are too few.
    """
    config = params["config"]
    if not inputs["fits"]:
        raise ConfigError("protocols: none runs every load of every load set, so there is no Table 1: add the loads")
    folds = config["surface"]["cross_validation_folds"]
    results = [result for path in inputs["fits"] for result in _results(Path(path), folds)]
    datasets.write(_dataset(results), outputs["surface"], "surface", params)
    datasets.write_table(_table_1(results, config["paper"]["table_1"]), outputs["table_1"], params, "table_1")
    over_triangle = _triangle(results, config["delaunay"], config["paper"])
    datasets.write_table(over_triangle, outputs["surface_over_triangle"], params, "surface_over_triangle")


def _results(path: Path, folds: int) -> list[_Result]:
    """A surface for each load set of one table of fits: fits of Eq. 2 to the energy of all its loads."""
    table = datasets.read_table(path, "fits")
    eq_2 = (table["energy"] == "structure_tensor") & (table["rule"] == "energy")
    table = table[eq_2 & (table["deformation"] == ALL)]
    if table.empty:
        raise DatasetError(f"{path}: holds no fit to all loads of a load set; delete it and run again")
    return [_result(path.stem, str(load_set), fits, folds) for load_set, fits in table.groupby("load_set", sort=False)]


def _result(protocol: str, load_set: str, fits: pd.DataFrame, folds: int) -> _Result:
    H11, H22 = fits["H11"].to_numpy(float), fits["H22"].to_numpy(float)
    return _Result(
        protocol,
        load_set,
        {
            constant: fit_surface(H11, H22, fits[column].to_numpy(float), terms, folds)
            for constant, (column, _, terms) in CONSTANTS.items()
        },
        # A constant at a bound is one whose fit gives it no half-width.
        {constant: int(fits[width].isna().sum()) for constant, (_, width, _) in CONSTANTS.items()},
        {column: (float(fits[column].min()), float(fits[column].max())) for column in RANGES},
        len(fits),
    )


def _dataset(results: list[_Result]) -> xr.Dataset:
    protocols = list(dict.fromkeys(result.protocol for result in results))
    load_sets = list(dict.fromkeys(result.load_set for result in results))
    by_key = {(result.protocol, result.load_set): result for result in results}
    missing = [(p, s) for p in protocols for s in load_sets if (p, s) not in by_key]
    if missing:
        raise DatasetError(f"the fits of protocol '{missing[0][0]}' lack load set '{missing[0][1]}': run them again")

    def gather(value: Callable[[_Result], Any]) -> np.ndarray:
        return np.array([[value(by_key[protocol, load_set]) for load_set in load_sets] for protocol in protocols])

    def of_constants(attribute: str) -> np.ndarray:
        return gather(lambda result: [getattr(result.surfaces[constant], attribute) for constant in CONSTANTS])

    per_constant = (
        "coefficient", "half_width", "covariance", "residual_variance", "degrees_of_freedom", "r_squared",
        "cross_validated_r_squared",
    )  # fmt: skip
    arrays = {attribute: of_constants(attribute) for attribute in per_constant}
    arrays["networks_at_bound"] = gather(lambda result: [result.at_bound[constant] for constant in CONSTANTS])
    arrays["network_count"] = gather(lambda result: result.network_count)
    for index, column in enumerate(RANGES):
        arrays[f"{column}_range"] = gather(lambda result: list(result.ranges.values()))[:, :, index]
    coords = {
        "protocol": protocols,
        "load_set": load_sets,
        "constant": list(CONSTANTS),
        "term": list(LABELS),
        "term_b": list(LABELS),
        "bound": ["least", "largest"],
    }
    return datasets.packed(arrays, "surface", coords)


def _table_1(results: list[_Result], printed: Mapping[str, Any]) -> pd.DataFrame:
    """One row a protocol, load set and term ij: ours, the paper's, and the goodness of fit of the whole surface."""
    rows = []
    for result in results:
        C2, C3, eight = (result.surfaces[constant] for constant in CONSTANTS)
        for term, label in enumerate(LABELS):
            rows.append(
                {
                    **_origin(result),
                    "networks": result.network_count,
                    "networks_with_C2_at_bound": result.at_bound["C2"],
                    "networks_with_C3_at_bound": result.at_bound["C3"],
                    "ij": label,
                    "alpha_MPa": C2.coefficient[term],
                    "alpha_half_width_MPa": C2.half_width[term],
                    "alpha_paper_MPa": printed["C2"][term],
                    "alpha_paper_half_width_MPa": printed["C2_half_width"][term],
                    "beta_nine_terms": C3.coefficient[term],
                    "beta_nine_terms_half_width": C3.half_width[term],
                    "beta_eight_terms": eight.coefficient[term],
                    "beta_eight_terms_half_width": eight.half_width[term],
                    "beta_paper": printed["C3"][term],
                    "beta_paper_half_width": printed["C3_half_width"][term],
                    "C2_r_squared": C2.r_squared,
                    "C2_cross_validated_r_squared": C2.cross_validated_r_squared,
                    "C2_r_squared_paper": printed["C2_r_squared"],
                    "C3_nine_terms_r_squared": C3.r_squared,
                    "C3_nine_terms_cross_validated_r_squared": C3.cross_validated_r_squared,
                    "C3_eight_terms_r_squared": eight.r_squared,
                    "C3_eight_terms_cross_validated_r_squared": eight.cross_validated_r_squared,
                    "C3_r_squared_paper": printed["C3_r_squared"],
                }
            )
    return pd.DataFrame(rows)


def _triangle(results: list[_Result], delaunay: Mapping[str, Any], paper: Mapping[str, Any]) -> pd.DataFrame:
    """Sign and extremes of C2 and C3 over the fitted region and the whole triangle, and their values at networks."""
    least_H11, largest_H11 = delaunay["H11"]
    fitted = Region(least_H11, largest_H11, delaunay["smallest_H"])
    printed = paper["table_1"]
    regions = {"fitted_region": fitted, "whole_triangle": TRIANGLE}
    unfitted = {"protocol": "", "load_set": "", "lambda_f_max_least": np.nan, "lambda_f_max_largest": np.nan}

    sources: list[tuple[dict[str, Any], Any, Any]] = []
    for result in results:
        for name, terms in (("C3", "nine_terms"), ("C3_eight", "eight_terms")):
            heading = {"surface": f"this_study_C3_{terms}", **_origin(result)}
            sources.append((heading, result.surfaces["C2"].coefficient, result.surfaces[name].coefficient))
    sources.append(({"surface": "table_1_as_printed", **unfitted}, printed["C2"], printed["C3"]))
    swapped = indices_swapped(printed["C2"]), indices_swapped(printed["C3"])
    sources.append(({"surface": "table_1_indices_swapped", **unfitted}, *swapped))

    rows = []
    for heading, C2, C3 in sources:
        for over, (H11, H22) in paper["alignments"].items():
            at = {"C2_MPa": float(evaluate(C2, H11, H22)), "C3": float(evaluate(C3, H11, H22))}
            rows.append({**heading, "over": over, "H11": H11, "H22": H22, **at})
        for over, region in regions.items():
            of_C2, of_C3 = summary(C2, region), summary(C3, region)
            rows.append(
                {
                    **heading,
                    "over": over,
                    "C2_negative_fraction": of_C2.negative_fraction,
                    "C2_least_MPa": of_C2.least,
                    "C2_largest_MPa": of_C2.largest,
                    "C3_negative_fraction": of_C3.negative_fraction,
                    "C3_least": of_C3.least,
                    "C3_largest": of_C3.largest,
                }
            )
    return pd.DataFrame(rows)


def _origin(result: _Result) -> dict[str, Any]:
    """What every row with C2 and C3 says: loads and amplitude of the fits behind it."""
    least, largest = result.ranges["lambda_f_max"]
    return {
        "protocol": result.protocol,
        "load_set": result.load_set,
        "lambda_f_max_least": least,
        "lambda_f_max_largest": largest,
    }
