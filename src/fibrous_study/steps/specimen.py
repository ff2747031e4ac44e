"""Rule `specimen`: the synthetic specimen, or the user's own mesh, fibres and motion."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fibrous.io.meshes import read_specimen
from fibrous.specimen import FiberField, RigidMotion, Slab, Specimen
from fibrous_study import datasets


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Write `specimen`; the config holds `synthetic_specimen` and `seed`, or the `specimen_files`.

    Raises MeshError where the user's files do not make a specimen.
    """
    config = params["config"]
    specimen = (
        read_specimen(**config["specimen_files"])
        if "specimen_files" in config
        else _synthetic(config["synthetic_specimen"], config["seed"])
    )
    arrays = {
        "node_position": specimen.mesh.node_position,
        "element_nodes": specimen.mesh.element_nodes,
        "element_network": np.arange(len(specimen.mesh.element_nodes)),
        "structure_tensor": specimen.structure_tensor,
        "fiber_direction": specimen.fiber_direction,
        "enthesis": specimen.enthesis,
        "prescribed_displacement": specimen.prescribed_displacement,
    }
    steps = np.arange(1, len(specimen.prescribed_displacement) + 1)
    dataset = datasets.packed(arrays, "specimen", {"step": steps})
    dataset.attrs["origin"] = specimen.origin
    datasets.write(dataset, outputs["specimen"], "specimen", params)


def _synthetic(numbers: Mapping[str, Any], seed: int) -> Specimen:
    """The specimen whose numbers are called in the config as the fields of the three parts are."""
    x, y, z = numbers["elements"]
    slab = Slab((x, y, z), **_of(numbers, "length_mm", "height_mm", "thickness_mm", "radius_mm"))
    (least, largest), (thin, wide) = numbers["H11"], numbers["in_plane_share"]
    angles = _of(numbers, "lowest_row_degrees", "deviation_degrees", "tilt_degrees", "correlation_length_mm")
    fibers = FiberField(seed, **angles, H11=(least, largest), in_plane_share=(thin, wide))
    motion = RigidMotion(**_of(numbers, "gap_mm", "slide_mm", "rotation_degrees"))
    return slab.specimen(numbers["load_steps"], fibers, motion)


def _of(numbers: Mapping[str, Any], *names: str) -> dict[str, Any]:
    return {name: numbers[name] for name in names}
