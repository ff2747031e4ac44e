"""Files: written whole, read back the same, and refused in one line when they are not what they should be."""

import os
import resource
import signal

import numpy as np
import pandas as pd
import pytest
import xarray as xr

from fibrous.errors import DatasetError
from fibrous_study import datasets
from fibrous_study.schema import KINDS, TABLES

PARAMS = {"stage": "fibrous_study.steps.network_states", "config": {"seed": 5, "network": "case"}, "code_hash": "abc"}


def states() -> xr.Dataset:
    rng = np.random.default_rng(0)
    arrays = {
        "node_position": rng.normal(size=(2, 3, 7, 3)),
        "fiber_stretch": rng.normal(size=(2, 3, 5)),
        "fiber_nodes": rng.integers(0, 7, size=(5, 2)),
        "averaged_stretch": rng.normal(size=(2, 3)),
        "deformation_gradient": rng.normal(size=(2, 3, 3, 3)),
    }
    return datasets.packed(arrays, "states", {"deformation": ["x_uniaxial", "xy_shear"], "step": [0, 1, 2]})


def test_round_trip_keeps_numbers_units_and_provenance(tmp_path):
    path = tmp_path / "deep" / "states.nc"
    datasets.write(states(), path, "states", PARAMS)
    found = datasets.read(path, "states")
    for name, declared in KINDS["states"].variables.items():
        np.testing.assert_array_equal(found[name].values, states()[name].values)
        assert found[name].attrs["units"] == declared.unit
        assert found[name].attrs["long_name"] == declared.meaning
    assert found.attrs["seed"] == 5
    assert found.attrs["code_hash"] == "abc"
    assert found.attrs["cpu_seconds"] > 0.0
    assert found.attrs["peak_memory_MB"] > 1.0
    for name in ("deformation", "step"):
        assert found[name].attrs["units"] == "1"
        assert found[name].attrs["long_name"]
    assert list(found["deformation"].values) == ["x_uniaxial", "xy_shear"]
    assert os.listdir(path.parent) == ["states.nc"]


@pytest.mark.parametrize("kind", KINDS)
def test_every_variable_is_declared_with_unit_and_meaning(kind):
    for name, variable in KINDS[kind].variables.items():
        assert variable.meaning, name
        assert variable.unit, name


def test_a_dataset_that_is_not_what_it_should_be_is_not_written(tmp_path):
    path = tmp_path / "x.nc"
    with pytest.raises(DatasetError, match="lacks the variable 'fiber_stretch'"):
        datasets.write(states().drop_vars("fiber_stretch"), path, "states", PARAMS)
    with pytest.raises(DatasetError, match="has dimensions"):
        datasets.write(states().transpose("step", ...), path, "states", PARAMS)
    assert not path.exists()


def test_truncated_foreign_and_missing_files_are_refused_in_one_line(tmp_path):
    path = tmp_path / "states.nc"
    datasets.write(states(), path, "states", PARAMS)
    whole = path.read_bytes()
    for content in (b"", b"not a dataset", whole[: len(whole) // 2], whole[:100] + b"\0" * 400):
        path.write_bytes(content)
        with pytest.raises(DatasetError, match="not a readable NetCDF file") as refused:
            datasets.read(path, "states")
        assert "\n" not in str(refused.value)
        assert "states.nc" in str(refused.value)
    path.write_bytes(whole)
    with pytest.raises(DatasetError, match="holds 'states' where a file of networks"):
        datasets.read(path, "networks")
    with pytest.raises(DatasetError, match="no such file"):
        datasets.read(tmp_path / "absent.nc", "states")
    xr.Dataset({"a": 1}).to_netcdf(path, engine="netcdf4")
    with pytest.raises(DatasetError, match="something else"):
        datasets.read(path, "states")


def test_a_full_disk_leaves_nothing_half_written_and_loses_nothing(tmp_path):
    path = tmp_path / "states.nc"
    datasets.write(states(), path, "states", PARAMS)
    before = path.read_bytes()
    limit, handler = resource.getrlimit(resource.RLIMIT_FSIZE), signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    try:
        resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limit[1]))
        with pytest.raises(DatasetError, match="cannot be written"):
            datasets.write(states(), path, "states", PARAMS)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limit)
        signal.signal(signal.SIGXFSZ, handler)
    assert path.read_bytes() == before
    assert os.listdir(tmp_path) == ["states.nc"]


def test_a_dataset_that_the_library_cannot_store_leaves_nothing(tmp_path):
    with pytest.raises(TypeError):
        datasets.write(states().assign_attrs(origin={"a": "mapping"}), tmp_path / "states.nc", "states", PARAMS)
    assert os.listdir(tmp_path) == []


def test_a_path_that_cannot_be_written_is_said(tmp_path):
    (tmp_path / "file").write_text("in the way")
    with pytest.raises(DatasetError, match="cannot be written"):
        datasets.write(states(), tmp_path / "file" / "states.nc", "states", PARAMS)


def convergence(**changes) -> pd.DataFrame:
    state = {
        "ensemble": "file", "protocol": "large", "network": 3, "name": "007", "load": "xy_shear", "step": 7,
        "amplitude_limited": False, "newton_iterations": 12,
    }  # fmt: skip
    return pd.DataFrame([state | changes])


def test_tables_carry_their_provenance_beside_them_and_come_back_as_they_were(tmp_path):
    """Texts stay texts, also those that look like numbers or like nothing."""
    path = tmp_path / "table.csv"
    for name in ("007", "", "NA"):
        table = convergence(name=name)
        datasets.write_table(table[list(table)[::-1]], path, PARAMS, "convergence")
        pd.testing.assert_frame_equal(datasets.read_table(path, "convergence"), table, check_dtype=False)
    assert '"config_hash"' in (tmp_path / "table.csv.json").read_text()


def test_a_table_that_is_not_as_declared_is_not_written(tmp_path):
    path = tmp_path / "table.csv"
    for wrong, what in (
        (convergence().drop(columns="step"), "lacks the column 'step'"),
        (convergence(cause="unknown"), "has no column 'cause'"),
        (convergence(step="seven"), "'step' holds no whole numbers"),
        (convergence(name=7), "'name' holds no text"),
    ):
        with pytest.raises(DatasetError, match=what):
            datasets.write_table(wrong, path, PARAMS, "convergence")
    assert not path.exists()


def test_a_table_without_rows_has_its_columns(tmp_path):
    datasets.write_table(pd.DataFrame(), tmp_path / "table.csv", PARAMS, "convergence")
    assert list(datasets.read_table(tmp_path / "table.csv", "convergence")) == list(TABLES["convergence"].columns)


def test_a_table_that_was_damaged_is_refused_in_one_line(tmp_path):
    path = tmp_path / "table.csv"
    whole = convergence().to_csv(index=False)
    for content, what in (
        (whole.replace("step", "stop"), "lacks the column 'step'"),
        (whole.replace(",7,", ",seven,"), "'step' holds no whole numbers"),
        ("\xff\xfe\x00broken", "table.csv"),
        ("", "not a readable table"),
    ):
        path.write_text(content, encoding="latin-1")
        with pytest.raises(DatasetError, match=what) as refused:
            datasets.read_table(path, "convergence")
        assert "\n" not in str(refused.value)
