"""Rules `deform_networks_as_in_tissue_…`: a batch of networks along the deformations that runs found (2.5)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fibrous.deformation import LoadPath
from fibrous.errors import DatasetError
from fibrous_study import datasets
from fibrous_study.curve_datasets import write_curves
from fibrous_study.fit_tables import LOAD
from fibrous_study.loading import loaded_networks
from fibrous_study.steps.network_curves import curves_of


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Drive the networks of `networks` by their elements' average F in each file of `tissue`, side by side.

    The average is that over an element's Gauss points, at every load step. `specimen` tells whose network is whose. The
    config names the `runs` of the files, and so do the outputs, which hold curves. Raises DatasetError where a network
    belongs to no element.
    """
    runs = params["config"]["runs"]
    specimen = datasets.read(inputs["specimen"][0], "specimen")
    element_of = {int(number): element for element, number in enumerate(specimen["element_network"].values)}
    found = [datasets.read(path, "tissue")["deformation_gradient"] for path in inputs["tissue"]]
    gradients = np.stack([F.mean("gauss_point").values for F in found])
    parts = np.linspace(0.0, 1.0, gradients.shape[1] + 1)

    def paths(number: int, _: np.ndarray) -> list[LoadPath]:
        if number not in element_of:
            raise DatasetError(
                f"{inputs['specimen'][0]}: has no element of that number; delete the networks, run again"
            )
        return [
            LoadPath(run, parts, np.concatenate([np.eye(3)[None], F[:, element_of[number]]]), amplitude_limited=False)
            for run, F in zip(runs, gradients, strict=True)
        ]

    curves = curves_of(loaded_networks(inputs["networks"][0], params["config"]["equilibrium"], paths))
    for run in runs:
        write_curves(replace(curves.under([run]), loads=(LOAD,)), outputs[run], params)
