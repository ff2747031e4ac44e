"""A user's own network: both formats give the same network, and every fault is named with its row."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from conftest import small_network
from fibers import buckling, exponential

from fibrous.errors import ConfigError, NetworkError
from fibrous.io.networks import read_network
from fibrous.networks.network import packed, unpacked

SIZE = {"fiber": exponential(2.5), "edge_um": 7.0}


@pytest.fixture
def files(tmp_path):
    network = small_network(2, edge_length_um=7.0)
    nodes = pd.DataFrame(network.node_position, columns=["x", "y", "z"])
    fibers = pd.DataFrame(network.fiber_nodes, columns=["tail", "head"])
    return network, nodes, fibers, {"nodes": str(tmp_path / "n.csv"), "fibers": str(tmp_path / "f.csv")}


def read(nodes, fibers, entry):
    nodes.to_csv(entry["nodes"], index=False)
    fibers.to_csv(entry["fibers"], index=False)
    return read_network(entry["nodes"], entry["fibers"], **SIZE)


@pytest.mark.parametrize("format_", ["NETCDF3_CLASSIC", "NETCDF3_64BIT", "NETCDF4_CLASSIC", "NETCDF4"])
def test_csv_and_netcdf_give_the_network_that_was_saved(files, tmp_path, format_):
    network, nodes, fibers, entry = files
    tables = read(nodes, fibers, entry)
    arrays = {
        "node_position": (("node", "axis"), network.node_position),
        "node_is_boundary": ("node", network.node_is_boundary),
        "fiber_nodes": (("fiber", "end"), network.fiber_nodes),
    }
    for names in (["node_position", "fiber_nodes"], list(arrays)):
        dataset = xr.Dataset({name: arrays[name] for name in names})
        dataset.to_netcdf(tmp_path / "own.nc", engine="netcdf4", format=format_)
        binary = read_network(tmp_path / "own.nc", **SIZE)
        for found in (tables, binary):
            np.testing.assert_allclose(found.node_position, network.node_position, atol=1e-15)
            np.testing.assert_array_equal(found.node_is_boundary, network.node_is_boundary)
            np.testing.assert_array_equal(found.fiber_nodes, network.fiber_nodes)
        np.testing.assert_array_equal(binary.node_position, network.node_position)


def test_boundary_flags_are_obeyed(files):
    network, nodes, fibers, entry = files
    inner = int(np.flatnonzero(~network.node_is_boundary)[0])
    flags = network.node_is_boundary.astype(int)
    flags[inner] = 1
    assert read(nodes.assign(boundary=flags), fibers, entry).node_is_boundary[inner]


def test_every_fault_is_named(files):
    _, nodes, fibers, entry = files
    last = len(nodes) - 1

    def refused(text, nodes=nodes, fibers=fibers):
        with pytest.raises(NetworkError, match=text) as error:
            read(nodes, fibers, entry)
        assert "\n" not in str(error.value)

    def changed(table, row, column, value):
        table = table.astype(object)
        table.loc[row, column] = value
        return table

    refused(
        f"fiber 4 joins nodes .* {last + 1}, but nodes are numbered from 0 to {last}",
        fibers=changed(fibers, 4, "head", last + 1),
    )
    refused("fiber 4 joins", fibers=changed(fibers, 4, "tail", -1))
    refused("row 4 has no finite number in the column 'head'", fibers=changed(fibers, 4, "head", "many"))
    refused("fiber 4 has a node number that is not a whole number", fibers=changed(fibers, 4, "head", 1.5))
    refused("row 3 has no finite number in the column 'y'", nodes=changed(nodes, 3, "y", np.nan))
    refused("row 3 has no finite number in the column 'y'", nodes=changed(nodes, 3, "y", np.inf))
    refused("node 3 lies outside the unit cube", nodes=changed(nodes, 3, "z", 7.0))
    refused("fiber 4 has zero length", fibers=changed(fibers, 4, "head", fibers.loc[4, "tail"]))
    refused("repeats another", fibers=pd.concat([fibers, fibers.iloc[[2]]]))
    refused("lacks the column 'z'", nodes=nodes.drop(columns="z"))
    refused("lacks the column 'head'", fibers=fibers.drop(columns="head"))
    with open(entry["nodes"], "w") as stream:  # a column that the header does not name would shift all others
        stream.write("x,y,z\n" + nodes.assign(boundary=1).to_csv(index=False, header=False))
    with pytest.raises(NetworkError, match="more values in a row than names"):
        read_network(entry["nodes"], entry["fibers"], **SIZE)
    refused("fiber 4 has a node number that is not a whole number", fibers=changed(fibers, 4, "head", 1e30))
    refused("boundary flag 2", nodes=nodes.assign(boundary=2))
    refused("no node lies on a face", nodes=nodes.assign(boundary=0))
    refused("has no fibers", fibers=fibers.iloc[:0])
    floating = pd.concat([nodes, pd.DataFrame([[0.0, 0.0, 0.0], [0.1, 0.0, 0.0]], columns=["x", "y", "z"])])
    refused(
        f"node {last + 1} hangs on no fiber",
        nodes=floating,
        fibers=pd.concat([fibers, pd.DataFrame({"tail": [last + 1], "head": [last + 2]})]),
    )


def test_missing_and_foreign_files_are_refused(files, tmp_path):
    entry = files[-1]
    with pytest.raises(NetworkError, match="not a readable CSV file"):
        read_network(entry["nodes"], entry["fibers"], **SIZE)
    (tmp_path / "own.nc").write_text("no")
    with pytest.raises(NetworkError, match="not a readable NetCDF file"):
        read_network(tmp_path / "own.nc", **SIZE)
    xr.Dataset({"node_position": (("node", "axis"), np.zeros((4, 2)))}).to_netcdf(tmp_path / "own.nc", engine="netcdf4")
    with pytest.raises(NetworkError, match=r"'node_position' needs numbers of shape \(…, 3\), not float64 of \(4, 2\)"):
        read_network(tmp_path / "own.nc", **SIZE)


@pytest.mark.parametrize("per_fiber", [False, True])
def test_a_saved_network_is_the_same_network(tmp_path, per_fiber, rng):
    network = small_network(2, edge_length_um=7.0)
    if per_fiber:
        section = rng.uniform(0.5, 2.0, len(network.fiber_nodes))
        network = replace(network, fiber=buckling(0.2, section=section, modulus_MPa=3.0))
    network.save(tmp_path / "mine.nc")
    same = read_network(tmp_path / "mine.nc")
    F = np.diag([1.2, 0.9, 0.95])
    np.testing.assert_array_equal(same.stress(F), network.stress(F))
    assert same.volume_fraction == network.volume_fraction
    assert type(same.fiber) is type(network.fiber)


def test_a_file_without_fibers_needs_them(files, tmp_path):
    _, nodes, fibers, entry = files
    read(nodes, fibers, entry)
    with pytest.raises(NetworkError, match="give fiber and edge_um"):
        read_network(entry["nodes"], entry["fibers"])


def test_a_file_of_several_networks_is_refused(tmp_path):
    networks = [small_network(seed, edge_length_um=7.0) for seed in (2, 2)]
    packed(networks).to_netcdf(tmp_path / "two.nc", engine="netcdf4")
    with pytest.raises(NetworkError, match="holds 2 networks"):
        read_network(tmp_path / "two.nc")
    assert [len(one.fiber_nodes) for one in unpacked(packed(networks))] == [len(networks[0].fiber_nodes)] * 2
    with pytest.raises(ConfigError, match="several edges"):
        packed([networks[0], replace(networks[0], edge_um=8.0)])
