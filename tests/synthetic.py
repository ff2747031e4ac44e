"""Made-up inputs of the figures that are declared in fibrous_study.datasets: affine networks, not physics."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import xarray as xr
from scipy.spatial import Delaunay

from fibrous.curves import Curves
from fibrous.deformation import Load, averaged_stretch, load_path, matching_magnitude
from fibrous.fitting.hgo import strain_energy
from fibrous.fitting.surface import LABELS, evaluate
from fibrous.networks import network
from fibrous.networks.fiber_law import Fiber
from fibrous.networks.network import Network
from fibrous_study import curve_datasets
from fibrous_study.datasets import packed, read, write, write_table
from fibrous_study.schema import KINDS, TABLES

LOADS = ("x_uniaxial", "xy_biaxial", "xz_biaxial", "xy_shear", "xz_shear", "yz_shear")
LOAD_SETS = [
    {"name": "section_3_1", "loads": ["x_uniaxial", "xy_biaxial", "xz_biaxial", "xy_shear", "xz_shear"]},
    {"name": "section_2_3", "loads": ["x_uniaxial", "xy_biaxial", "xz_biaxial", "xy_shear", "yz_shear"]},
]
PROTOCOLS = {"large": 1.8, "small": 1.2**0.5}
NAMED = {
    "case": (0.69, 0.21),
    "fig6_1": (0.35, 0.32),
    "fig6_2": (0.50, 0.32),
    "fig6_3": (0.36, 0.12),
    "fig6_4": (0.66, 0.18),
    "fig6_5": (0.74, 0.14),
}
C2_COEFFICIENT = np.array([0.8, -0.3, -0.9, 0.1, 0.2, 0.1, 0.0, 0.0, 0.3])
C3_COEFFICIENT = np.array([-0.2, 0.1, 0.6, 0.2, 0.1, 0.3, 0.0, 0.1, 0.0])
# The case-study network's yz-shear ends at the limit, and its xz-shear loses its last state.
PRINCIPAL_STRETCH_LIMIT = 2.6
LOST_LOAD = "xz_shear"


# Of made-up arrays, by the kinds of the schema.
TYPES = {"f": float, "i": int, "b": bool, "U": object}


def params(figure: int | str, **config: Any) -> dict[str, Any]:
    return {"stage": f"fibrous_study.figures.figure_{figure}", "config": config, "code_hash": "0" * 16}


def structure_tensors() -> np.ndarray:
    return np.array([np.diag([a, b, 1.0 - a - b]) for a, b in NAMED.values()])


def constants(H11: np.ndarray, H22: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    return evaluate(C2_COEFFICIENT, H11, H22), np.maximum(evaluate(C3_COEFFICIENT, H11, H22), 0.0)


def write_networks(path: Path, points: int) -> None:
    networks = []
    for number, tensor in enumerate(structure_tensors()):
        cloud = np.random.default_rng(number).uniform(-0.5, 0.5, (points, 3))
        shape = np.sqrt(np.diag(tensor) * 3.0)
        simplices = Delaunay(cloud / shape).simplices
        pairs = np.sort(np.vstack([simplices[:, [a, b]] for a in range(4) for b in range(a)]), axis=1)
        near_a_face = np.abs(cloud).max(axis=1) > 0.42
        fiber = Fiber(modulus_MPa=10.0, nonlinearity=2.5, radius_um=0.1)
        networks.append(Network(cloud, near_a_face, np.unique(pairs, axis=0), fiber=fiber, edge_um=20.0))
    count = len(NAMED)
    arrays = {
        "structure_tensor": structure_tensors(),
        "target_structure_tensor": structure_tensors(),
        "volume_fraction": np.full(count, 0.04),
        "shortest_fiber": np.full(count, 0.01),
        "seed": np.arange(count),
        "name": np.array(list(NAMED)),
    }
    dataset = network.packed(networks).assign(packed(arrays, "networks", {"network": np.arange(count)}))
    write(dataset, path, "networks", params(0))


def _paths(tensor: np.ndarray, stretch: float, steps: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    first = Load.parse(LOADS[0])
    target = float(averaged_stretch(first.deformation_gradient(stretch), tensor))
    magnitudes, gradients, limited = [], [], []
    for number, name in enumerate(LOADS):
        load = Load.parse(name)
        end, cut = (stretch, False)
        if number:
            end, cut = matching_magnitude(load, tensor, target, PRINCIPAL_STRETCH_LIMIT)
        magnitude, gradient = load_path(load, end, steps)
        magnitudes.append(magnitude)
        gradients.append(gradient)
        limited.append(cut)
    return np.array(magnitudes), np.array(gradients), np.array(limited)


def write_curves(path: Path, protocol: str, steps: int) -> None:
    tensors = structure_tensors()
    paths = [_paths(tensor, PROTOCOLS[protocol], steps) for tensor in tensors]
    gradient = np.array([p[1] for p in paths])
    stretch = np.array([averaged_stretch(g, tensor) for g, tensor in zip(gradient, tensors, strict=True)])
    C2, C3 = constants(tensors[:, 0, 0], tensors[:, 1, 1])
    stiffness = 1.0 + 0.15 * np.arange(len(LOADS))
    energy = stiffness[None, :, None] * np.array(
        [strain_energy(a, b, s) for a, b, s in zip(C2, C3, stretch, strict=True)]
    )
    turned = gradient @ tensors[:, None, None] @ np.swapaxes(gradient, -1, -2)
    eigenvalue = np.linalg.eigvalsh(turned)[..., -1] / np.trace(turned, axis1=-2, axis2=-1)
    converged = np.ones(stretch.shape, dtype=bool)
    converged[0, LOADS.index(LOST_LOAD), -1] = False
    energy[~converged], eigenvalue[~converged] = np.nan, np.nan
    answers = Curves(
        numbers=np.arange(len(NAMED)),
        names=np.array(list(NAMED)),
        loads=LOADS,
        structure_tensor=tensors,
        deformation_gradient=gradient,
        magnitude=np.array([p[0] for p in paths]),
        strain_energy_density=energy,
        cauchy_stress=np.zeros(gradient.shape),
        first_piola_kirchhoff_stress=np.zeros(gradient.shape),
        largest_orientation_eigenvalue=eigenvalue,
        newton_iterations=np.full(stretch.shape, 3),
        cuts=np.zeros(stretch.shape, dtype=int),
        amplitude_limited=np.array([p[2] for p in paths]),
    )
    curve_datasets.write_curves(answers, path, params(0))


def write_states(path: Path, networks: xr.Dataset, protocol: str, steps: int) -> None:
    tensor = structure_tensors()[0]
    _, gradient, _ = _paths(tensor, PROTOCOLS[protocol], steps)
    nodes = networks["node_position"].values[: int(networks["node_count"].values[0])]
    fibers = networks["fiber_nodes"].values[: int(networks["fiber_count"].values[0])]
    inside = 0.5 - np.abs(nodes).max(axis=1)
    noise = np.random.default_rng(0).normal(0.0, 0.3, nodes.shape) * inside[:, None]
    position = np.einsum("dsij,nj->dsni", gradient, nodes)
    position += noise * np.linalg.norm(gradient - np.eye(3), axis=(-2, -1))[..., None, None]
    lengths = np.linalg.norm(np.diff(position[:, :, fibers], axis=3)[:, :, :, 0], axis=-1)
    stretch = lengths / lengths[:, :1]
    stretch[LOADS.index(LOST_LOAD), -1] = np.nan
    position[LOADS.index(LOST_LOAD), -1] = np.nan
    arrays = {
        "node_position": position,
        "fiber_stretch": stretch,
        "fiber_nodes": fibers,
        "averaged_stretch": averaged_stretch(gradient, tensor),
        "deformation_gradient": gradient,
    }
    coords = {"deformation": list(LOADS), "step": np.arange(steps + 1)}
    write(packed(arrays, "states", coords), path, "states", params(0))


def whole(table: pd.DataFrame, name: str) -> pd.DataFrame:
    """The table with all columns that the schema declares under that name; those it lacked hold nothing."""
    nothing = {"f": np.nan, "i": 0, "b": False, "U": ""}
    lacking = {c: nothing[one.dtype] for c, one in TABLES[name].columns.items() if c not in table}
    return table.assign(**lacking)[list(TABLES[name].columns)]


def write_fits(path: Path, tensors: np.ndarray, names: list[str], seed: int) -> None:
    """Noisy constants of both load sets; C3 below 0.1 stands for a fit at its bound."""
    generator = np.random.default_rng(seed)
    C2, C3 = constants(tensors[:, 0, 0], tensors[:, 1, 1])
    rows: list[dict[str, Any]] = []
    for number, tensor in enumerate(tensors):
        for load_set in LOAD_SETS:
            factor = (1.0 + 0.1 * (load_set["name"] == "section_2_3")) * (1.0 + 0.1 * generator.standard_normal(2))
            a, b = factor[0] * C2[number], factor[1] * C3[number]
            bound = b < 0.1
            components = dict(zip(("H11", "H22", "H33"), np.diag(tensor), strict=True))
            fit = {
                "energy": "structure_tensor",
                "objective": "energy",
                "lambda_f_max": 1.5,
                "C2_MPa": a,
                "C3": 0.0 if bound else b,
                "C2_half_width_MPa": 0.1 * a,
                "C3_half_width": np.nan if bound else 0.1 * b,
                "r_squared": 0.95,
                "rule": "energy",
            }
            row = {"network": number, "load_set": load_set["name"], "deformation": "all", "name": names[number]}
            other = {"C2_MPa": 1e3 * a, "C3": 40.0}  # no panel draws the fits that follow
            rows += [row | components | fit, row | components | fit | {"load_set": "single", "deformation": LOADS[0]}]
            rows += [row | components | fit | other | {"energy": "families"}]
            rows += [row | components | fit | other | {"objective": "stress", "rule": "stress"}]
    write_table(whole(pd.DataFrame(rows), "fits"), path, params(0), "fits")


def triangle(count: int) -> np.ndarray:
    generator = np.random.default_rng(5)
    H11 = generator.uniform(0.33, 0.80, 4 * count)
    H22 = generator.uniform(0.05, 0.62, 4 * count)
    kept = H11 + H22 <= 0.95
    return np.array([np.diag([a, b, 1.0 - a - b]) for a, b in zip(H11[kept], H22[kept], strict=True)][:count])


def write_surface(path: Path) -> None:
    """Coefficients and ranges as given; what the figures do not read is zero."""
    coords = {
        "protocol": list(PROTOCOLS),
        "load_set": [load_set["name"] for load_set in LOAD_SETS],
        "constant": ["C2", "C3", "C3_eight"],
        "term": list(LABELS),
        "term_b": list(LABELS),
        "bound": ["least", "largest"],
    }
    sizes = {name: len(values) for name, values in coords.items()}
    arrays = {
        name: np.zeros(
            [sizes[dim] for dim in variable.dims], dtype={"f": float, "i": int, "b": bool, "U": object}[variable.dtype]
        )
        for name, variable in KINDS["surface"].variables.items()
    }
    arrays["coefficient"][:] = [C2_COEFFICIENT, C3_COEFFICIENT, C3_COEFFICIENT]
    arrays["r_squared"][:] = [0.6, 0.7, 0.65]
    arrays["cross_validated_r_squared"][:] = [0.5, 0.6, 0.55]
    arrays["H11_range"][:] = [0.33, 0.80]
    arrays["H22_range"][:] = arrays["H33_range"][:] = [0.05, 0.62]
    write(packed(arrays, "surface", coords), path, "surface", params(0))


def write_study(folder: Path, points: int = 60, steps: int = 5, networks: int = 120) -> dict[str, Path]:
    """Everything the figures read, in `folder`; returns the paths by a short name."""
    paths = {"networks": folder / "networks.nc", "surface": folder / "surface.nc"}
    write_networks(paths["networks"], points)
    named = read(paths["networks"], "networks")
    for protocol in PROTOCOLS:
        paths[f"states_{protocol}"] = folder / f"states_{protocol}.nc"
        write_states(paths[f"states_{protocol}"], named, protocol, steps)
        paths[f"curves_{protocol}"] = folder / f"curves_{protocol}.nc"
        write_curves(paths[f"curves_{protocol}"], protocol, steps)
        paths[f"fits_{protocol}"] = folder / f"fits_{protocol}.csv"
        write_fits(paths[f"fits_{protocol}"], structure_tensors(), list(NAMED), seed=1)
    paths["fits_delaunay"] = folder / "fits_delaunay.csv"
    write_fits(paths["fits_delaunay"], triangle(networks), [""] * networks, seed=2)
    write_surface(paths["surface"])
    return paths
