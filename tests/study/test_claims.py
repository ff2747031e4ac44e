"""The table of claims that the quick study makes, its sentences, and what happens to networks without an answer."""

import importlib
import shutil
from pathlib import Path

import pandas as pd
import pytest
import xarray as xr
from workflow_runs import quick_config

from fibrous.errors import ConfigError
from fibrous_study.audit.verdict import Verdict
from fibrous_study.audit.wording import worded
from fibrous_study.paper import section
from fibrous_study.stages import STAGES, stage_params


def claims(folder: Path) -> pd.DataFrame:
    return pd.read_csv(folder / "results/claims.csv")


def values(table: pd.DataFrame, quantity: str) -> pd.Series:
    """The values of a quantity without a load set, by claim."""
    rows = table[(table["quantity"] == quantity) & table["load_set"].isna()]
    return rows.set_index("claim")["value"]


def test_every_statement_has_its_verdict_on_every_row_and_every_quantity_once(quick):
    table = claims(quick[0])
    assert table["claim"].unique().tolist() == [entry["id"] for entry in section("statements")]
    assert table.groupby("claim")["verdict"].nunique().eq(1).all()
    assert set(table["verdict"]) <= {verdict.value for verdict in Verdict}
    assert not table.duplicated(["claim", "quantity", "load_set"]).any()
    assert set(table["load_set"].dropna()) == {entry["name"] for entry in quick_config()["load_sets"]}


def test_ranges_are_those_over_the_replicates(quick):
    table = claims(quick[0])
    ranged = table["low"].notna()
    assert (table["low"][ranged] <= table["high"][ranged]).all()
    assert set(table["claim"][ranged]) == set(values(table, "replicates").index)
    assert (values(table, "replicates") == quick_config()["replicates"]["seeds"]).all()


def test_every_sentence_can_be_written_for_every_verdict(quick):
    """A template that names what is not there stops the rule, whatever the verdict that writes it."""
    table, statements = claims(quick[0]), section("statements")
    for verdict in Verdict:
        said = worded(table.assign(verdict=verdict.value), statements)
        assert [one.id for one in said] == [entry["id"] for entry in statements]
        assert all(one.here and one.why and one.says for one in said)


@pytest.mark.parametrize("template", ["{missing}", "{C2.nothing}", "{C2", "{C2:wrong}"])
def test_a_sentence_that_cannot_be_written_is_an_error_of_one_line(template):
    row = {"claim": "mine", "quantity": "C2", "load_set": "", "value": 1.0, "low": 0.5, "high": 2.0, "printed": 3.0}
    table = pd.DataFrame([{**row, "verdict": "partly"}, {**row, "quantity": "left_out", "verdict": "partly"}])
    statement = {"id": "mine", "under": "figure_3", "where": "1", "says": "it", "here": "{C2}", "why": "So."}
    assert worded(table, [statement])[0].why == "So."
    with pytest.raises(ConfigError, match=r"config/paper.yaml: why of mine cannot be written .* C2, left_out") as error:
        worded(table, [statement | {"why": template}])
    assert "\n" not in str(error.value)


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


def test_networks_without_an_equilibrium_count_for_nothing_and_are_counted(spoilt, monkeypatch):
    monkeypatch.chdir(spoilt)
    config, stage = quick_config(), STAGES["claims"]
    inputs = {name: [Path(path) for path in paths] for name, paths in stage.inputs(config, {}).items()}
    outputs = {"claims": Path("results/claims.csv")}
    importlib.import_module(stage.module).run(inputs, outputs, stage_params("claims", config, {}))
    table = claims(spoilt)
    assert values(table, "networks")["dissimilar-with-alignment"] == config["delaunay"]["networks"] - 1
    lost = values(table, "left_out")
    for name, count in (("dissimilar-with-alignment", 1), ("curves-converge", 1), ("c2-trend", 2), ("rms-initial", 0)):
        assert lost[name] == count
