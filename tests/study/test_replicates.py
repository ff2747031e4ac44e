"""Replicates of the named networks: other networks of the same alignment, whatever their number."""

import numpy as np
from small_study import Study

from fibrous.networks.network import unpacked
from fibrous_study import datasets


def replicates(folder, seeds: int, batch: str = "02"):
    path = Study(folder, replicates={"seeds": seeds, "batches": 6}).run("networks", ensemble="replicates", batch=batch)[
        "networks"
    ]
    return datasets.read(path, "networks")


def test_replicates_share_the_alignment_of_their_network_and_nothing_else(tmp_path):
    found = replicates(tmp_path, 3)
    assert found["name"].values.tolist() == ["fig6_2"] * 3
    np.testing.assert_allclose(found["structure_tensor"], np.tile(np.diag([0.5, 0.32, 0.18]), (3, 1, 1)), atol=0.01)
    assert len(set(found["seed"].values.tolist())) == 3
    first, second, _ = (network.node_position for network in unpacked(found))
    assert first.shape != second.shape or np.abs(first - second).max() > 0.1


def test_more_replicates_leave_those_that_are_there(tmp_path):
    few, more = replicates(tmp_path / "few", 2), replicates(tmp_path / "more", 3)
    np.testing.assert_array_equal(more["network"][:2], few["network"])
    for one, same in zip(unpacked(few), unpacked(more), strict=False):
        np.testing.assert_array_equal(one.node_position, same.node_position)


def test_no_replicate_of_one_network_is_one_of_another(tmp_path):
    other = replicates(tmp_path / "other", 3, "03")
    assert not set(other["seed"].values.tolist()) & set(replicates(tmp_path, 3)["seed"].values.tolist())
