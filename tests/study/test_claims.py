"""The table of statements that the quick study makes: how it reads, and what happens to networks without an answer."""

import importlib
import re
import shutil
from pathlib import Path

import pandas as pd
import pytest
import xarray as xr
from made_up_evidence import TALLIED, assert_plain
from workflow_runs import job_of, quick_config

from fibrous_study.audit.finding import Verdict


def claims(folder: Path) -> pd.DataFrame:
    return pd.read_csv(folder / "results/claims.csv", keep_default_na=False).set_index("id")


def test_every_row_says_in_plain_words_why(quick):
    table = claims(quick[0])
    assert table.index.tolist() == [entry["id"] for entry in TALLIED]
    assert set(table["verdict"]) <= {verdict.value for verdict in Verdict}
    for why in table["why"]:
        assert_plain(why)
    for column in ("here", "spread"):
        assert not table[column].str.contains(r"\d[eE][+-]?\d|\bnan\b|\binf\b").any()
    assert table["here"].str.len().min() > 0
    assert not table["spread"].str.count("replicates").gt(1).any()


def test_every_place_with_constants_says_how_far_they_were_fitted(quick):
    table = claims(quick[0])
    constants = table.index[table["here"].str.contains(r"\bC2 [\d.]+, |\bC2 [\d.]+ MPa|RMS difference from ours")]
    assert len(constants) >= 6
    assert table["here"][constants].str.contains("up to λ_f = ").all()


@pytest.fixture
def spoilt(quick, tmp_path) -> Path:
    """The quick study with one network of the ensemble, and one replicate, that lost the equilibrium of a state."""
    for folder in ("curves", "fits", "networks", "tables", "tissue"):
        shutil.copytree(quick[0] / "results" / folder, tmp_path / "results" / folder)
    for ensemble in ("delaunay", "replicates"):
        path = tmp_path / f"results/curves/{ensemble}/large/00.nc"
        dataset = xr.load_dataset(path, engine="netcdf4")
        dataset["converged"][1, 2, 5] = False
        dataset.to_netcdf(path, engine="netcdf4")
    return tmp_path


def test_networks_without_an_equilibrium_count_for_nothing_and_are_said(spoilt, monkeypatch):
    monkeypatch.chdir(spoilt)
    config = quick_config()
    job = job_of(config, "claims")
    inputs = {name: [Path(path) for path in paths] for name, paths in job.content["inputs"].items()}
    outputs = {"claims": Path("results/claims.csv")}
    importlib.import_module(job.params["stage"]).run(inputs, outputs, job.params)
    table = claims(spoilt)
    count = config["delaunay"]["networks"]
    assert re.search(rf"of {count - 1} networks whose H11", table["why"]["dissimilar-with-alignment"])
    for name, lost in (
        ("dissimilar-with-alignment", "1 network is"),
        ("curves-converge", "1 network is"),
        ("c2-trend", "2 networks are"),
    ):
        assert table["here"][name].endswith(f"; {lost} left out, for want of an equilibrium or of a fit")
    assert not table["here"]["rms-initial"].endswith("of a fit")
    for why in table["why"]:
        assert_plain(why)
