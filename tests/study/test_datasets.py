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
    return datasets.packed(arrays, datasets.STATES, {"deformation": ["x_uniaxial", "xy_shear"], "step": [0, 1, 2]})


def test_round_trip_keeps_numbers_units_and_provenance(tmp_path):
    path = tmp_path / "deep" / "states.nc"
    datasets.write(states(), path, "states", PARAMS)
    found = datasets.read(path, "states")
    for name, declared in datasets.STATES.items():
        np.testing.assert_array_equal(found[name].values, states()[name].values)
        assert found[name].attrs["units"] == declared.units
        assert found[name].attrs["long_name"] == declared.long_name
    assert found.attrs["seed"] == 5
    assert found.attrs["code_hash"] == "abc"
    assert found.attrs["cpu_seconds"] > 0.0
    assert found.attrs["peak_memory_MB"] > 1.0
    for name in ("deformation", "step"):
        assert found[name].attrs["units"] == "1"
        assert found[name].attrs["long_name"]
    assert list(found["deformation"].values) == ["x_uniaxial", "xy_shear"]
    assert os.listdir(path.parent) == ["states.nc"]


@pytest.mark.parametrize("kind", datasets.KINDS)
def test_every_variable_is_declared_with_unit_and_meaning(kind):
    for name, variable in datasets.KINDS[kind].items():
        assert variable.long_name, name
        assert variable.units, name


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


def test_tables_carry_their_provenance_beside_them(tmp_path):
    path = tmp_path / "table.csv"
    table = pd.DataFrame({"C2_MPa": [0.1, 0.25], "name": ["case", "fig6_1"]})
    datasets.write_table(table, path, PARAMS)
    pd.testing.assert_frame_equal(datasets.read_table(path, ("C2_MPa", "name")), table)
    assert '"config_hash"' in (tmp_path / "table.csv.json").read_text()
    with pytest.raises(DatasetError, match="lacks the column 'C3'"):
        datasets.read_table(path, ("C3",))
    path.write_bytes(b"\xff\xfe\x00broken")
    with pytest.raises(DatasetError):
        datasets.read_table(path, ("C3",))
