"""Rule `febio`: the problems of runs as input files of FEBio 4, to compare its logs node by node."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fibrous.io.febio import feb
from fibrous_study import datasets
from fibrous_study.solutions import Constants, fibers_of, matrix_of, read_specimen


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Read `specimen` and the runs' constants from `tissue`; write a problem to the output of each run's name.

    The config holds `matrix` and the names of the `runs` in the order of `tissue`.
    """
    specimen, _ = read_specimen(inputs["specimen"][0])
    matrix = matrix_of(params["config"])
    for run, path in zip(params["config"]["runs"], inputs["tissue"], strict=True):
        tissue = datasets.read(path, "tissue")
        last = tissue.isel(step=-1)
        constants = Constants(last["C2"].values, last["C3"].values, tissue["structure_tensor"].values)
        content = feb(specimen, matrix + fibers_of("families", constants, tension_only=True))
        datasets.write_bytes(content, outputs[run], params)
