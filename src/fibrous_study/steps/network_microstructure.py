"""Rule `network_microstructure`: the network of an element along the deformation in a run of the tissue (2.5)."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from fibrous.deformation import loads
from fibrous.errors import DatasetError, naming
from fibrous.materials.neo_hookean import NeoHookean
from fibrous.materials.registry import LAWS
from fibrous.microstructure import stress_difference
from fibrous.networks.guard import Limits
from fibrous.networks.network import Network
from fibrous_study import datasets
from fibrous_study.loading import networks_of

#: Name of the path along the mean F of an element, beside the numbers of its Gauss points.
MEAN = "mean"


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Drive the network of ``config["element"]`` as that element goes in `tissue`, the file of a run; write `states`.

    `networks` are all batches of the tissue's, `specimen` tells whose network is whose. Of a run with the law
    `network` the file says as `stress_difference_MPa` how far the stress found here is from the run's own.
    Raises DatasetError where there is no such element or its network is missing.
    """
    config = params["config"]
    element, law = config["element"], config["model"]["law"]
    specimen = datasets.read(inputs["specimen"][0], "specimen")
    tissue = datasets.read(inputs["tissue"][0], "tissue")
    count = min(tissue.sizes["element"], specimen.sizes["element"])
    if not 0 <= element < count:
        raise DatasetError(f"{inputs['tissue'][0]}: has no element {element}; name one from 0 to {count - 1}")
    own = tissue.isel(element=element).transpose("gauss_point", "step", ...)
    number = int(specimen["element_network"].values[element])
    (network,) = networks_of(inputs["networks"], [number])
    with naming(f"network {number}"):
        states = _driven(network, Limits(**config["equilibrium"]), own["deformation_gradient"].values)
    states.attrs.update(run=config["run"], element=element, network=number, law=law, origin=tissue.attrs["origin"])
    converged = states["converged"].values
    print(f"network {number}: {converged.sum()} of {converged.size} states converged", file=sys.stderr)
    if LAWS[law].is_solved:
        matrix = NeoHookean(tissue.attrs["C1_MPa"], tissue.attrs["lame_lambda_MPa"])
        difference = stress_difference(
            states["cauchy_stress"].values[:-1, 1:],
            matrix,
            own["deformation_gradient"].values,
            own["cauchy_stress"].values,
        )
        states.attrs["stress_difference_MPa"] = difference
        print(f"its stress differs from the run's by up to {difference:.1e} MPa", file=sys.stderr)
    datasets.write(states, outputs["states"], "microstructure", params)


def _driven(network: Network, limits: Limits, points: np.ndarray) -> xr.Dataset:
    """The network from rest along F of the Gauss points, shape (points, steps, 3, 3), and along their mean."""
    after_rest = np.concatenate([points, points.mean(axis=0)[None]])
    gradients = np.concatenate([np.tile(np.eye(3), (len(after_rest), 1, 1, 1)), after_rest], axis=1)
    names = [*map(str, range(len(points))), MEAN]
    cases = loads(dict(zip(names, gradients, strict=True)))
    answers = network.load(cases, points.shape[1], limits=limits, geometry=True).rename(deformation="path")
    # Force over the undeformed section (Eq. 6).
    stress = network.fiber.modulus_MPa * network.fiber.response(answers["fiber_stretch"].values)[0]
    states = answers.assign(fiber_stress=(answers["fiber_stretch"].dims, stress))
    return states.assign_attrs(edge_length_um=network.edge_um, fiber_radius_um=network.fiber.radius_um)
