"""Rule `follow_network`: the network of one element along the deformation that a run of the tissue found (2.5)."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from fibrous.errors import DatasetError, naming
from fibrous.materials.neo_hookean import NeoHookean
from fibrous.microstructure import stress_difference
from fibrous.networks.engine import Engine
from fibrous.networks.network import Network
from fibrous.networks.path import follow
from fibrous_study import datasets
from fibrous_study.loading import fiber_law, scale_of, unpacked

#: Name of the path along the mean F of an element, beside the numbers of its Gauss points.
MEAN = "mean"
ANSWERS = ("node_position", "fiber_stretch", "orientation_tensor", "cauchy_stress", "converged")
COPIED = ("edge_length_um", "fiber_radius_um")


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
    batch, network = _network(inputs["networks"], number)
    with naming(f"network {number}"):
        engine = Engine.of(network, fiber_law(batch), **config["equilibrium"])
        states = _driven(engine, batch, own["deformation_gradient"].values)
    states.attrs.update(run=config["run"], element=element, network=number, law=law, origin=tissue.attrs["origin"])
    converged = states["converged"].values
    print(f"network {number}: {converged.sum()} of {converged.size} states converged", file=sys.stderr)
    if law == "network":
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


def _network(paths: list[Path], number: int) -> tuple[xr.Dataset, Network]:
    """The batch that holds the network of that number, and the network."""
    for path in paths:
        batch = datasets.read(path, "networks")
        places = np.flatnonzero(batch["network"].values == number)
        if places.size:
            with naming(str(path)):
                return batch, unpacked(batch)[places[0]]
    raise DatasetError(f"{paths[0].parent}: lacks network {number}; delete the folder and run again")


def _driven(engine: Engine, batch: xr.Dataset, points: np.ndarray) -> xr.Dataset:
    """The network from rest along F of the Gauss points, shape (points, steps, 3, 3), and along their mean."""
    after_rest = np.concatenate([points, points.mean(axis=0)[None]])
    gradients = np.concatenate([np.tile(np.eye(3), (len(after_rest), 1, 1, 1)), after_rest], axis=1)
    response = follow(engine, gradients, scale_of(batch), geometry=True)
    arrays = {name: getattr(response, name) for name in ANSWERS}
    # Force over the undeformed section (Eq. 6).
    arrays["fiber_stress"] = float(batch.attrs["fiber_modulus_MPa"]) * engine.law.response(arrays["fiber_stretch"])[0]
    arrays |= {"fiber_nodes": engine.network.fiber_nodes, "deformation_gradient": gradients}
    paths = np.array([*map(str, range(len(points))), MEAN], dtype=object)
    coords = {"path": paths, "step": np.arange(gradients.shape[1])}
    states = datasets.packed(arrays, "microstructure", coords)
    return states.assign_attrs({name: batch.attrs[name] for name in COPIED})
