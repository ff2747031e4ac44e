"""Made-up inputs of the tissue's figures declared as in fibrous_study.datasets: smooth, but not physics."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from synthetic import params

from fibrous.specimen import Slab
from fibrous_study.datasets import packed, write, write_table

STEPS = 2
RUNS = {"hgo": 1.0, "hgo_refit": 0.8}  # how far the run moves the nodes
SHIFT = np.array([[0.08, 0.03, 0.0], [0.0, 0.01, 0.05], [0.02, -0.04, -0.03]])
FIT = {"hgo": ("families", "structure_tensor", "energy"), "stress": ("families", "families", "stress")}


def write_stresses(path: Path) -> None:
    """The network, two laws that were fitted, one of them again, and affine fibres; xz is the largest shear."""
    part = np.linspace(0.0, 1.0, 6)
    tables = []

    def states(model: str, factor: float, constants: str = "", form: tuple[str, ...] = ("", "", "")) -> None:
        law, energy, objective = form
        about: dict[str, Any] = {"model": model, "constants": constants, "law": law, "energy": energy}
        about |= {"objective": objective, "C2_MPa": 0.1, "C3": 0.3}
        sizes = {"xx": 0.1, "yy": 0.01, "zz": 0.001, "xy": 0.0002, "xz": -0.002, "yz": 0.0015}
        stress = {f"sigma_{name}_MPa": factor * size * (part + part**2) for name, size in sizes.items()}
        values = {"step": np.arange(6), "magnitude": part, "averaged_stretch": 1.0 + 0.16 * part}
        tables.append(pd.DataFrame({**about, **values, "strain_energy_density_MPa": 0.01 * part**2, **stress}))

    states("network", 1.0)
    states("hgo", 1.9, "initial", FIT["hgo"])
    states("hgo", 1.7, "refit", FIT["hgo"])
    states("stress", 0.9, "initial", FIT["stress"])
    states("affine", 1.1, form=("affine", "", ""))
    write_table(pd.concat(tables, ignore_index=True), path, params(0), "section_2_6_stresses")


def write_specimen(path: Path) -> None:
    specimen = Slab(elements=(4, 5, 2)).specimen(STEPS)
    arrays = {
        "node_position": specimen.mesh.node_position,
        "element_nodes": specimen.mesh.element_nodes,
        "element_network": np.arange(len(specimen.mesh.element_nodes)),
        "structure_tensor": specimen.structure_tensor,
        "fiber_direction": specimen.fiber_direction,
        "enthesis": specimen.enthesis,
        "prescribed_displacement": specimen.prescribed_displacement,
    }
    dataset = packed(arrays, "specimen", {"step": np.arange(1, STEPS + 1)}).assign_attrs(origin=specimen.origin)
    write(dataset, path, "specimen", params(0))


def write_tissue(path: Path, amount: float) -> None:
    """A homogeneous displacement with deformation gradients and stresses that vary at random about it."""
    specimen = Slab(elements=(4, 5, 2)).specimen(STEPS)
    position, count = specimen.mesh.node_position, len(specimen.mesh.element_nodes)
    generator = np.random.default_rng(int(10 * amount))
    parts = amount * np.arange(1, STEPS + 1)[:, None, None] / STEPS
    noise = 0.02 * generator.standard_normal((STEPS, count, 8, 3, 3))
    stress = 0.1 * generator.standard_normal((STEPS, count, 8, 3, 3))
    constants = generator.uniform(0.1, 0.2, (2, STEPS, count))
    arrays = {
        "displacement": parts * (position @ SHIFT.T),
        "deformation_gradient": np.eye(3) + (parts * SHIFT)[:, None, None] + noise,
        "cauchy_stress": stress + stress.swapaxes(-1, -2),
        "reaction_force": parts**2 * np.array([[-1.0, 0.1, 0.02], [1.0, -0.1, -0.02]]),
        "newton_iterations": np.full(STEPS, 3),
        "cuts": np.zeros(STEPS, dtype=int),
        "converged": np.ones(STEPS, dtype=bool),
        **dict.fromkeys(("network_iterations", "network_cuts", "indefinite_hessians"), np.zeros(STEPS, dtype=int)),
        "structure_tensor": specimen.structure_tensor,
        "C2": constants[0],
        "C3": constants[1],
    }
    coords = {"step": np.arange(1, STEPS + 1), "enthesis": [1, 2]}
    dataset = packed(arrays, "tissue", coords).assign_attrs(origin=specimen.origin)
    write(dataset, path, "tissue", params(0))


def write_study(folder: Path) -> dict[str, Path]:
    """Everything the tissue's figures read, in `folder`; returns the paths by a short name."""
    paths = {"stresses": folder / "stresses.csv"} | {name: folder / f"{name}.nc" for name in ("specimen", *RUNS)}
    write_stresses(paths["stresses"])
    write_specimen(paths["specimen"])
    for name, amount in RUNS.items():
        write_tissue(paths[name], amount)
    return paths
