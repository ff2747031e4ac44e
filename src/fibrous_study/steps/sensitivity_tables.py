"""Rule `tables_of_sensitivity`: trials of every variant summed up, in a table and in a sentence for each factor."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pandas as pd

from fibrous_study import datasets
from fibrous_study.sensitivity.sentences import sentences
from fibrous_study.sensitivity.summary import TRIAL_COLUMNS, completed, summary
from fibrous_study.words import spoken


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Read inputs["trials"], the base's among them; write outputs["table"] and outputs["sentences"].

    The config holds the `factors`, each with its `name`, its `unit` and the study's `own_value`, and the `load_sets`.
    Raises DatasetError where a table is not one of trials.
    """
    config = params["config"]
    tables = [datasets.read_table(path, TRIAL_COLUMNS) for path in inputs["trials"]]
    trials = completed(tables, {factor["name"]: factor["own_value"] for factor in config["factors"]})
    units = {factor["name"]: factor["unit"] for factor in config["factors"]}
    table = summary(trials)
    table.insert(1, "unit", table["factor"].map(units))
    datasets.write_table(table, outputs["table"], params)
    words = {entry["name"]: spoken(entry["name"]) for entry in config["load_sets"]}
    said = sentences(trials, words, units)
    datasets.write_table(pd.DataFrame({"factor": said.keys(), "sentence": said.values()}), outputs["sentences"], params)
