"""The surface that comes with the package is that of the present default study."""

import json
from importlib import resources

import numpy as np
import pytest

from fibrous_study import datasets
from fibrous_study.config import loaded
from fibrous_study.prediction import predict

BEHIND_THE_SURFACE = (
    "seed",
    "fiber",
    "cube",
    "principal_stretch_limit",
    "equilibrium",
    "load_sets",
    "fit",
    "surface",
)


@pytest.fixture(scope="module")
def shipped():
    with resources.as_file(resources.files("fibrous_study") / "data" / "surface.nc") as path:
        return datasets.read(path, "surface")


def test_it_was_made_with_the_default_config_at_the_paper_size(shipped):
    made_with, default = json.loads(shipped.attrs["study_config"]), loaded()
    assert {key: made_with[key] for key in BEHIND_THE_SURFACE} == {key: default[key] for key in BEHIND_THE_SURFACE}
    assert _loads(made_with, shipped) == _loads(default, shipped)
    assert made_with["delaunay"] | {"batches": 0} == default["delaunay"] | {"batches": 0}
    large = shipped.sel(protocol="large", load_set="section_3_1")
    assert int(large["network_count"]) == default["delaunay"]["networks"]


def _loads(config, surface) -> list:
    """Steps and loads of the protocols whose surfaces these are; what else is loaded is nothing to them."""
    behind = [entry for entry in config["protocols"] if entry["name"] in surface["protocol"].values]
    return [(entry["name"], entry["steps"], entry["loads"]) for entry in behind]


def test_it_follows_section_3_2_over_the_whole_range(shipped):
    """C2 is largest and C3 smallest near isotropy, and every alignment of the study is answered."""
    isotropic, aligned = predict(np.diag([0.34, 0.33, 0.33])), predict(np.diag([0.80, 0.10, 0.10]))
    assert isotropic.C2_MPa > 2.0 * aligned.C2_MPa > 0.0
    assert isotropic.C3 < aligned.C3
    least, largest = aligned.C2_interval_MPa
    assert least < aligned.C2_MPa < largest
