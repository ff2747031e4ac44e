"""Rule `deform_networks_as_in_tissue`: a batch of networks along the deformations that a run found (2.5)."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fibrous import datasets
from fibrous.deformation import LoadPath
from fibrous.errors import DatasetError
from fibrous.study.curves import write_curves
from fibrous.study.fit_tables import LOAD
from fibrous.study.loading import loaded_networks


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Drive the networks of `networks` by their elements' average F in `tissue`, and write `curves`.

    The average is that over an element's Gauss points, at every load step. `specimen` tells whose network is whose.
    Raises DatasetError where a network belongs to no element.
    """
    specimen = datasets.read(inputs["specimen"][0], "specimen")
    tissue = datasets.read(inputs["tissue"][0], "tissue")
    element_of = {int(number): element for element, number in enumerate(specimen["element_network"].values)}
    gradients = tissue["deformation_gradient"].mean("gauss_point").values
    parts = np.linspace(0.0, 1.0, len(gradients) + 1)

    def paths(number: int, _: np.ndarray) -> list[LoadPath]:
        if number not in element_of:
            raise DatasetError(
                f"{inputs['specimen'][0]}: has no element of that number; delete the networks, run again"
            )
        path = np.concatenate([np.eye(3)[None], gradients[:, element_of[number]]])
        return [LoadPath(LOAD, parts, path, amplitude_limited=False)]

    networks = loaded_networks(inputs["networks"][0], params["config"]["equilibrium"], paths)
    write_curves(networks, outputs["curves"], params)
