"""What a state of the `curves` stage costs, in banded factor-and-solves of the network's rest Hessian.

    python benchmarks/curves.py [networks]

Runs the stage as the workflow does, on evenly chosen networks of the default study, and prints CPU seconds per state
(all of the process: imports, reading, loading, writing) over the time of one banded Cholesky factorisation and solve
in SciPy's reverse Cuthill-McKee order, both measured in this run, and the Newton iterations per state. The mean over
the protocols weighs each by the states that the study has of it. A refit is measured as four paths of F per network.
"""

import json
import os
import platform
import resource
import subprocess
import sys
import tempfile
import time
from importlib.metadata import version
from pathlib import Path

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1"))

import numpy as np
import yaml
from scipy.linalg import lapack
from scipy.sparse import coo_array, csr_array
from scipy.sparse.csgraph import reverse_cuthill_mckee

from fibrous.networks.banded import Assembly
from fibrous.networks.guard import Limits
from fibrous.networks.network import unpacked
from fibrous.networks.path import follow
from fibrous_study import datasets
from fibrous_study.provenance import code_hash

ROOT = Path(__file__).resolve().parent.parent


def run_stage(stage: str, config: dict, inputs: list[Path], output: Path) -> float:
    """Run a stage as a rule does; CPU seconds of its process."""
    module = {"networks": "fibrous_study.steps.network_ensemble", "curves": "fibrous_study.steps.network_curves"}[stage]
    params = {"stage": module, "config": config, "code_hash": code_hash(module)}
    files = {"inputs": {"networks": [str(path) for path in inputs]}, "outputs": {stage: str(output)}}
    job, whole = output.with_suffix(".job.json"), output.with_suffix(".config.json")
    job.write_text(json.dumps({**params, **files}), encoding="utf-8")
    whole.write_text("{}", encoding="utf-8")
    command = [sys.executable, "-m", "fibrous_study.job", str(job), "--config", str(whole)]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(command, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def factor_and_solve(network, repeats: int = 9) -> float:
    """Median CPU seconds of one banded factor-and-solve of the rest Hessian in SciPy's reverse Cuthill-McKee order."""
    assembly = Assembly(network, network.fiber)
    band = assembly.hessian(assembly.evaluate(np.eye(3), np.zeros((assembly.size + 1, 3))))
    size = band.shape[1]
    rows = np.arange(len(band))[:, None] + np.arange(size)
    entries = (rows < size) & (band != 0.0)
    row, column, value = rows[entries], np.broadcast_to(np.arange(size), band.shape)[entries], band[entries]
    # Order the nodes, not their coordinates: the three unknowns of a node stay together.
    graph = csr_array(coo_array((np.ones(len(row)), (row // 3, column // 3)), shape=(size // 3, size // 3)))
    order = reverse_cuthill_mckee(csr_array(graph + graph.T), symmetric_mode=True)
    place = np.argsort((3 * order[:, None] + np.arange(3)).ravel())
    low, high = np.minimum(place[row], place[column]), np.maximum(place[row], place[column])
    ordered = np.zeros(((high - low).max() + 1, size), order="F")
    ordered[high - low, low] = value
    times = []
    for _ in range(repeats):
        work = ordered.copy(order="F")
        start = time.process_time()
        factor, info = lapack.dpbtrf(work, lower=1, overwrite_ab=1)
        lapack.dpbtrs(factor, np.ones(size), lower=1)
        times.append(time.process_time() - start)
        assert info == 0
    return float(np.median(times))


def refits(path: Path, config: dict) -> float:
    """CPU seconds per state of four paths per network that end near Eq. 9, as elements of four runs go."""
    dataset = datasets.read(path, "networks")
    rng = np.random.default_rng(1)
    end = np.array([[1.239, 0.0, 0.0035], [0.0, 1.048, -0.0014], [-0.0080, 0.102, 0.770]])
    ends = end + 0.02 * rng.normal(size=(len(dataset["network"]), 4, 3, 3))
    parts = np.linspace(0.0, 1.0, 21)[:, None, None]
    paths = np.eye(3) + parts * (ends[:, :, None] - np.eye(3))
    start = time.process_time()
    for network, path_ in zip(unpacked(dataset), paths, strict=True):
        follow(network.engine(Limits(**config["equilibrium"])), path_, network.stress_unit_MPa)
    return (time.process_time() - start) / paths[:, :, 1:, 0, 0].size


def main() -> None:
    """Run, compare, print."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 60
    config = yaml.safe_load((ROOT / "config/config.yaml").read_text(encoding="utf-8"))
    numbers = np.linspace(0, config["delaunay"]["networks"] - 1, count).astype(int).tolist()
    shared = {key: config[key] for key in ("seed", "network", "fiber", "cube")}
    alignment = {key: config["delaunay"][key] for key in ("H11", "smallest_H")}
    limits = {key: config[key] for key in ("principal_stretch_limit", "equilibrium")}
    with tempfile.TemporaryDirectory() as folder:
        networks = Path(folder) / "networks.nc"
        run_stage(
            "networks",
            {**shared, "ensemble": "delaunay", "numbers": numbers, "delaunay": alignment},
            [],
            networks,
        )
        baseline = np.mean([factor_and_solve(one) for one in unpacked(datasets.read(networks, "networks"))])
        total = {"delaunay": config["delaunay"]["networks"], "named": len(config["named"])}
        total |= {"replicates": config["replicates"]["seeds"] * len(config["named"])}
        total |= {"tissue": int(np.prod(config["synthetic_specimen"]["elements"]))}
        costs, iterations, weights = [], [], []
        for protocol in config["protocols"]:
            curves = Path(folder) / f"{protocol['name']}.nc"
            spent = run_stage("curves", {"protocol": protocol, **limits}, [networks], curves)
            found = datasets.read(curves, "curves")
            here, newton = found["converged"].values[..., 1:].size, int(found["newton_iterations"].sum())
            print(f"{protocol['name']}: {1e3 * spent / here:.2f} ms, {newton / here:.2f} iterations per state")
            costs.append(spent / here)
            iterations.append(newton / here)
            weights.append(here / count * sum(total[ensemble] for ensemble in protocol["ensembles"]))
        refit = refits(networks, config)
    cost = np.average(costs, weights=weights)
    print(f"one banded factor-and-solve, mean over {count} networks: {1e3 * baseline:.2f} ms")
    print(f"curves: {cost / baseline:.2f} factor-and-solves per state (to reach: at most 1.3)")
    print(f"Newton iterations per state: {np.average(iterations, weights=weights):.2f} (to reach: at most 3.5)")
    print(f"refits: {1e3 * refit:.2f} ms, {refit / baseline:.2f} factor-and-solves per state (to reach: at most 1.8)")
    print(
        f"{platform.processor() or platform.machine()}, Python {platform.python_version()}, "
        + ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy", "numba"))
    )


if __name__ == "__main__":
    main()
