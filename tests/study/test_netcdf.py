"""NetCDF files: content comes back as it was, and a barred file is not called broken, nor a broken one read."""

import errno
import subprocess
import sys
from functools import partial

import numpy as np
import pytest
import xarray as xr
from fibers import exponential
from test_datasets import PARAMS, states

from fibrous.errors import FibrousError
from fibrous.io import netcdf
from fibrous.io.meshes import read_mesh
from fibrous.io.networks import read_network
from fibrous_study import datasets

FORMATS = ("NETCDF3_CLASSIC", "NETCDF3_64BIT", "NETCDF4_CLASSIC", "NETCDF4")


def every_type() -> xr.Dataset:
    rng = np.random.default_rng(0)
    arrays = {
        "number": (("row", "column"), rng.normal(size=(50, 3))),
        "gap": ("row", np.where(np.arange(50) % 7 == 0, np.nan, 1.5)),
        "single": ("row", rng.normal(size=50).astype(np.float32)),
        "count": ("row", rng.integers(-(2**62), 2**62, size=50)),
        "seed": ("row", rng.integers(0, 2**64, size=50, dtype=np.uint64)),
        "flag": ("row", np.arange(50) % 3 == 0),
        "name": ("row", np.array(["", "Knorpel-Übergang"] * 25)),
        "unnamed": ("row", np.array([""] * 50)),
        "none": (("empty", "column"), np.zeros((0, 3))),
    }
    coords = {"row": np.arange(50), "load": ("row", np.array(["x_uniaxial"] * 50))}
    attributes = {"seed": 5, "modulus": 0.1, "nothing": "", "unit": "MPa", "origin": "λ of 2°", "long": "x" * 100_000}
    dataset = xr.Dataset(arrays, coords, attributes | {"never": np.nan})
    dataset["number"].attrs.update(units="µm", long_name="position")
    return dataset


@pytest.fixture
def path(tmp_path):
    return tmp_path / "a.nc"


def loaded_from(path):
    with netcdf.opened(path, "make it", "delete it") as dataset:
        return dataset.load()


def test_every_type_comes_back_as_it_was(path):
    dataset = every_type()
    packed = {name: {"zlib": True, "complevel": 1} for name in ("number", "gap", "count", "flag")}
    netcdf.save(dataset, path, packed)
    found = loaded_from(path)
    xr.testing.assert_identical(found, dataset)
    assert list(found.variables) == list(dataset.variables)
    for name in dataset.variables:
        assert found[name].dtype.kind == dataset[name].dtype.kind, name
        if dataset[name].dtype.kind != "U":
            assert found[name].dtype == dataset[name].dtype, name
        np.testing.assert_array_equal(found[name].values, dataset[name].values)
    assert isinstance(found.attrs["seed"], np.integer)
    assert found["number"].encoding["zlib"]


def written(format_: str, path) -> tuple[xr.Dataset, bytes]:
    dataset = every_type()[["number", "gap", "single", "flag"]]
    dataset.to_netcdf(path, engine="netcdf4", format=format_)
    return dataset, path.read_bytes()


@pytest.mark.parametrize("format_", FORMATS)
def test_a_file_that_lacks_its_end_is_never_read_as_something_else(format_, path):
    dataset, whole = written(format_, path)
    xr.testing.assert_equal(loaded_from(path), dataset)
    for size in (*range(0, len(whole), 397), *range(len(whole) - 9, len(whole))):
        path.write_bytes(whole[:size])
        try:
            found = loaded_from(path)
        except FibrousError:
            continue
        assert format_.startswith("NETCDF3")  # which may end with bytes that mean nothing
        xr.testing.assert_equal(found, dataset)


def test_a_file_of_the_study_that_lacks_a_byte_is_refused(path):
    datasets.write(states(), path, "states", PARAMS)
    path.write_bytes(path.read_bytes()[:-1])
    with pytest.raises(FibrousError, match="delete it"):
        datasets.read(path, "states")


def problem(read, path) -> str:
    with pytest.raises(FibrousError) as refused:
        read(path)
    line = str(refused.value)
    assert line.startswith(f"{path}: ")
    assert "\n" not in line
    return line


READERS = {
    "dataset": partial(datasets.read, kind="states"),
    "provenance": datasets.provenance_of,
    "network": lambda path: read_network(path, fiber=exponential(), edge_um=20.0),
    "mesh": read_mesh,
}


@pytest.fixture(params=READERS)
def reader(request):
    return READERS[request.param]


@pytest.fixture
def whole(reader, tmp_path):
    path = tmp_path / ("a.e" if reader is read_mesh else "a.nc")
    datasets.write(states(), path, "states", PARAMS)
    return path


def test_a_locked_file_is_neither_broken_nor_forbidden(reader, whole):
    """Locked by the library itself, in another process that has the file open for writing."""
    code = f"import netCDF4; d = netCDF4.Dataset({str(whole)!r}, 'a'); print('open', flush=True); input()"
    with subprocess.Popen(
        [sys.executable, "-c", code], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as other:
        assert other.stdout.readline() == "open\n"
        line = problem(reader, whole)
        other.kill()
    assert "locked" in line
    assert "delete" not in line
    assert "permission" not in line


def test_a_forbidden_file_is_neither_broken_nor_locked(reader, whole, monkeypatch):
    def denied(*_):
        raise PermissionError(errno.EACCES, "Permission denied", str(whole))

    monkeypatch.setattr(netcdf, "open", denied, raising=False)  # the tests may run as root, whom no permission stops
    line = problem(reader, whole)
    assert "permission" in line
    assert "delete" not in line
    assert "locked" not in line


def test_a_broken_file_is_neither_locked_nor_forbidden(reader, whole):
    content = whole.read_bytes()
    for broken in (b"", b"x,y\n1,2\n", content[: len(content) // 2], content[:100] + b"\0" * 400):
        whole.write_bytes(broken)
        line = problem(reader, whole)
        assert "locked" not in line
        assert "permi" not in line
        assert ("delete" in line) == (reader in (READERS["dataset"], READERS["provenance"]))


def test_a_missing_file_and_a_folder_are_said(reader, whole):
    whole.unlink()
    assert "no such file" in problem(reader, whole)
    whole.mkdir()
    assert "delete" not in problem(reader, whole)


def test_a_file_system_without_locks_is_read_from(path, monkeypatch):
    datasets.write(states(), path, "states", PARAMS)
    for number in (errno.ENOLCK, errno.ENOSYS, errno.EOPNOTSUPP):

        def without(*_, number=number):
            raise OSError(number, "no locks here")

        monkeypatch.setattr(netcdf.fcntl, "flock", without)
        assert datasets.read(path, "states").sizes["node"] == 7


def test_a_table_that_may_not_be_read_is_not_to_be_deleted(tmp_path, monkeypatch):
    path = tmp_path / "table.csv"

    def denied(*_):
        raise PermissionError(errno.EACCES, "Permission denied", str(path))

    monkeypatch.setattr(netcdf, "open", denied, raising=False)
    line = problem(partial(datasets.read_table, name="fits"), path)
    assert "permission" in line
    assert "delete" not in line
