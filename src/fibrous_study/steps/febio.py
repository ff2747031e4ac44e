"""Rule `write_febio_model`: the problem of one run as an input file of FEBio 4, to compare its log node by node."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fibrous.io.febio import feb
from fibrous_study import datasets
from fibrous_study.solutions import Constants, fibers_of, matrix_of, read_specimen


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Read `specimen` and the run's constants from `tissue`; write `feb`. The config holds `matrix`."""
    specimen, _ = read_specimen(inputs["specimen"][0])
    tissue = datasets.read(inputs["tissue"][0], "tissue")
    last = tissue.isel(step=-1)
    constants = Constants(last["C2"].values, last["C3"].values, tissue["structure_tensor"].values)
    content = feb(specimen, matrix_of(params["config"]) + fibers_of("families", constants, tension_only=True))
    datasets.write_bytes(content, outputs["feb"], params)
