"""The junction law beside networks that it never saw, and in the tissue of a study that was run.

    python benchmarks/junction.py                       16 networks under loads of five kinds
    python benchmarks/junction.py path/to/results       and the specimen, by its coupled run

Prints RMS over RMS, median and 95th percentile of the Cauchy stress's relative error in percent, and the CPU seconds of
the tissue. The tables of docs/junction.md are its output.
"""

import sys
import time
from pathlib import Path

import numpy as np
import xarray as xr
from scipy.spatial.transform import Rotation

import fibrous as fb
from fibrous.networks.path import follow
from fibrous_study.loading import networks_of
from fibrous_study.solutions import read_specimen

FIBER = fb.Fiber(modulus_MPa=10.0, nonlinearity=2.5, radius_um=0.1)
ALIGNMENTS = [
    (0.35, 0.33), (0.4, 0.35), (0.4, 0.2), (0.5, 0.3), (0.5, 0.4), (0.5, 0.12), (0.6, 0.2), (0.6, 0.3),
    (0.6, 0.08), (0.69, 0.21), (0.69, 0.1), (0.75, 0.15), (0.75, 0.07), (0.8, 0.1), (0.8, 0.15), (0.45, 0.45),
]  # fmt: skip
EQ_9 = np.array([[1.239, 0.0, 0.0035], [0.0, 1.048, -0.0014], [-0.0080, 0.102, 0.770]])
STEPS = 5


def loads(rng: np.random.Generator) -> dict[str, np.ndarray]:
    """Deformation gradients at the ends of the loads of each kind, shape (loads, 3, 3)."""
    stretches = rng.uniform(0.8, 1.25, (12, 3))
    stretches *= ((rng.uniform(0.95, 1.12, 12) / stretches.prod(axis=1)) ** (1 / 3))[:, None]
    frames = Rotation.random(19, random_state=int(rng.integers(2**31))).as_matrix()
    turned = [Q.T @ F @ Q for Q, F in zip(frames[:12], map(np.diag, stretches), strict=True)]
    shear = np.eye(3) + 0.4 * np.eye(3, k=1) * [[1.0], [0.0], [0.0]]
    uniaxial = np.diag([1.8, 1.8**-0.5, 1.8**-0.5])
    return {
        "Eq. 9": EQ_9[None],
        "random stretches": np.array(turned),
        "shears": np.array([Q.T @ shear @ Q for Q in frames[12:16]]),
        "uniaxial to 1.8": np.array([*[Q.T @ uniaxial @ Q for Q in frames[16:]], uniaxial]),
        "volume changes": np.array([1.1 * np.eye(3), 0.93 * np.eye(3), np.diag([1.2, 1.05, 1.0])]),
    }


def held_out() -> None:
    """Print errors on networks with seeds of their own."""
    rng, errors = np.random.default_rng(42), {}
    for seed, (H11, H22) in enumerate(ALIGNMENTS):
        H = (H11, H22, 1.0 - H11 - H22)
        network = fb.delaunay(H, FIBER, volume_fraction=0.04, edge_um=20.0, seed=10_000 + seed, tolerance=0.002)
        laws = {"affine": fb.AffineFibers.of_networks([network]), "junction": fb.Junction.of_networks([network])}
        for kind, ends in loads(rng).items():
            F = np.eye(3) + np.linspace(0.0, 1.0, STEPS + 1)[:, None, None] * (ends[:, None] - np.eye(3))
            wanted = follow(network.engine(), F, network.stress_unit_MPa).cauchy_stress[:, 1:].reshape(-1, 3, 3)
            for name, law in laws.items():
                off = law.stress(F[:, 1:].reshape(1, -1, 3, 3))[0] - wanted
                pair = np.linalg.norm(off, axis=(-1, -2)), np.linalg.norm(wanted, axis=(-1, -2))
                errors.setdefault((kind, name), []).append(pair)
    for (kind, name), pairs in errors.items():
        error, size = np.concatenate(pairs, axis=1)
        known = np.isfinite(size)
        error, size = error[known], size[known]
        relative = 100.0 * error / size
        rms = 100.0 * np.sqrt((error**2).sum() / (size**2).sum())
        print(
            f"{kind:17} {name:9} {len(size):4} states: {rms:5.2f} {np.median(relative):6.2f} "
            f"{np.percentile(relative, 95):6.2f} %"
        )


def in_tissue(results: Path) -> None:
    """Print errors and costs in the specimen of a study."""
    specimen, numbers = read_specimen(results / "tissue/specimen.nc")
    networks = networks_of(sorted((results / "networks/tissue").glob("*.nc")), numbers.tolist())
    begun = time.process_time()
    junction = fb.Junction.of_networks(networks)
    print(f"directions and κ: {time.process_time() - begun:.1f} CPU-s, κ {junction.release.mean():.4f} in the mean")
    with xr.open_dataset(results / "tissue/multiscale.nc") as run:
        last = run.isel(step=-1).load()
    matrix = fb.NeoHookean(last.attrs["C1_MPa"], last.attrs["lame_lambda_MPa"])
    begun = time.process_time()
    solution = fb.solve(specimen, matrix + junction)
    print(f"{solution}: {time.process_time() - begun:.1f} CPU-s")
    pairs = {
        "Cauchy tensor": (solution.cauchy[-1], last["cauchy_stress"].values),
        "maximum shear stress": [
            np.ptp(np.linalg.eigvalsh(stress), axis=-1).mean(axis=1)
            for stress in (solution.cauchy[-1], last["cauchy_stress"].values)
        ],
        "maximum shear strain": [
            np.ptp(np.linalg.eigvalsh(np.swapaxes(F, -1, -2) @ F), axis=-1).mean(axis=1)
            for F in (solution.deformation_gradient[-1], last["deformation_gradient"].values)
        ],
        "force on the bone": (solution.reaction[-1, 1], last["reaction_force"].values[1]),
    }
    for name, (ours, theirs) in pairs.items():
        print(f"{name}: {100.0 * np.sqrt(((ours - theirs) ** 2).mean() / (theirs**2).mean()):.3f} %")


if __name__ == "__main__":
    held_out()
    if len(sys.argv) > 1:
        in_tissue(Path(sys.argv[1]))
