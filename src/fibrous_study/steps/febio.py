"""Rule `write_febio_model`: the problem of one run as an input file of FEBio 4, to compare its log node by node."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from fibrous.io.febio import feb
from fibrous_study import datasets
from fibrous_study.solutions import read_specimen


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Read `specimen` and the run's constants from `tissue`; write `feb`. The config holds `matrix`."""
    specimen, _ = read_specimen(inputs["specimen"][0])
    tissue = datasets.read(inputs["tissue"][0], "tissue")
    last, matrix = tissue.isel(step=-1), params["config"]["matrix"]
    problem = replace(specimen, structure_tensor=tissue["structure_tensor"].values)
    content = feb(problem, matrix["C1_MPa"], matrix["lame_lambda_MPa"], last["C2"].values, last["C3"].values)
    datasets.write_bytes(content, outputs["feb"], params)
