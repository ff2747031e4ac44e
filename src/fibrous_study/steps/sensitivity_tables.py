"""Rule `sensitivity_tables`: trials of every variant summed up, and how far each factor moves each quantity."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fibrous_study import datasets
from fibrous_study.report.tables import cell
from fibrous_study.sensitivity.summary import SEEDS, SHEAR, completed, moves, summary

FACTORS = {
    "edge_length_um": "Edge length χ (µm)",
    "volume_fraction": "Volume fraction φ",
    "nonlinearity": "Nonlinearity B",
    "amplitude": "Amplitude",
    "steps": "Number of steps",
    SHEAR: "Shear directions",
    SEEDS: "Seeds",
}
QUANTITIES = {"C2_MPa": "C2 (MPa)", "C3": "C3", "r_squared": "R²", "stress_error": "error of stress"}
MOVE = (
    "{factor}: {quantity} moves by more than seeds do in {beyond_seeds} of {cases} cases, most for {network} "
    "{load_set} ({least} at {least_at}, {largest} at {largest_at}; seeds {seeds_least} to {seeds_largest})."
)
SENTENCES = {
    SEEDS: "{factor}: {quantity} is farthest apart for {network} {load_set}, {seeds_least} to {seeds_largest}."
}


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Read inputs["trials"], the base's among them; write outputs["table"] and outputs["sentences"].

    The config holds the `factors`, each with its `name`, its `unit` and the study's `own_value`.
    Raises DatasetError where a table is not one of trials.
    """
    factors = params["config"]["factors"]
    tables = [datasets.read_table(path, "sensitivity_trials") for path in inputs["trials"]]
    table = summary(completed(tables, {factor["name"]: factor["own_value"] for factor in factors}))
    moved = moves(table)
    moved["sentence"] = [sentence(row) for row in moved.to_dict("records")]
    datasets.write_table(moved, outputs["sentences"], params, "sensitivity_sentences")
    table.insert(1, "unit", table["factor"].map({factor["name"]: factor["unit"] for factor in factors}))
    datasets.write_table(table, outputs["table"], params, "sensitivity")


def sentence(row: Mapping[Any, Any]) -> str:
    """A row of `moves` in words."""
    words = {name: cell(value) for name, value in row.items()}
    words |= {"factor": FACTORS[row["factor"]], "quantity": QUANTITIES[row["quantity"]], "network": row["network"]}
    return " ".join(SENTENCES.get(row["factor"], MOVE).format(**words).split())
