"""Rules `deform_networks_as_in_tissue_…`: a batch of networks along the deformations that runs found (2.5)."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from fibrous.curves import Curves
from fibrous.deformation import loads
from fibrous.errors import DatasetError
from fibrous.networks.guard import Limits
from fibrous_study import datasets
from fibrous_study.curve_datasets import write_curves
from fibrous_study.fit_tables import LOAD
from fibrous_study.loading import members_of


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
    rest, limits, parts = np.eye(3)[None], Limits(**params["config"]["equilibrium"]), []
    for member in members_of(inputs["networks"]):
        if member.number not in element_of:
            raise DatasetError(
                f"{inputs['specimen'][0]}: has no element with network {member.number}; delete the networks, run again"
            )
        of_element = gradients[:, :, element_of[member.number]]
        cases = loads({run: np.concatenate([rest, F]) for run, F in zip(runs, of_element, strict=True)})
        parts.append(member.answers(cases, gradients.shape[1], np.inf, limits))
        converged = parts[-1].converged
        print(f"{member}: {converged.sum()} of {converged.size} states converged", file=sys.stderr)
    curves = Curves.joined(parts)
    for run in runs:
        write_curves(replace(curves.under([run]), loads=(LOAD,)), outputs[run], params)
