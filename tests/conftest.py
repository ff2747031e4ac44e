"""What several tests share: small networks, made as the study makes them, a small study, and a run of the quick one."""

from functools import partial
from pathlib import Path

import numpy as np
import pytest
from fibers import exponential
from small_study import Study
from workflow_runs import snakemake

from fibrous.networks.engine import Engine
from fibrous.networks.generation import delaunay, network_seed
from fibrous.networks.guard import EquilibriumSolver, Limits
from fibrous.networks.network import Network


def small_network(
    seed: int = 0, H: tuple[float, float, float] = (0.6, 0.25, 0.15), edge_length_um: float = 10.0
) -> Network:
    """A Delaunay network of the study's constants in a smaller cube."""
    return delaunay(H, exponential(2.5), 0.04, edge_length_um, network_seed(7, "test", seed), tolerance=0.01)


@pytest.fixture(scope="session")
def network() -> Network:
    return small_network()


@pytest.fixture(scope="session")
def solver(network) -> EquilibriumSolver:
    return EquilibriumSolver.of(network, exponential(2.5))


@pytest.fixture(scope="session")
def engine(network) -> Engine:
    return Engine.of(network, exponential(2.5))


@pytest.fixture(scope="session")
def tight_engine(network) -> Engine:
    """Converged to rounding, for comparisons with differences of the stress."""
    return Engine.of(network, exponential(2.5), Limits(residual_tolerance=1e-14))


@pytest.fixture(scope="session")
def tight_solver(network) -> EquilibriumSolver:
    """Converged to rounding, for comparisons with differences of the stress."""
    return EquilibriumSolver.of(network, exponential(2.5), Limits(residual_tolerance=1e-14))


@pytest.fixture(scope="session")
def study(tmp_path_factory) -> Study:
    """Specimen, networks, fits, surface and a few runs; tests may add runs, and change nothing."""
    return Study(tmp_path_factory.mktemp("study")).prepare()


@pytest.fixture
def other(study, tmp_path):
    """Makes a study with a copy of some files of `study`, which a test may change."""
    return partial(study.with_files, tmp_path)


@pytest.fixture
def rng() -> np.random.Generator:
    return np.random.default_rng(11)


@pytest.fixture(scope="session")
def quick(tmp_path_factory) -> tuple[Path, str]:
    """The quick study run from an empty folder, with what it said."""
    folder = tmp_path_factory.mktemp("quick")
    done = snakemake(folder, "-j2")
    assert done.returncode == 0, done.stderr
    return folder, done.stdout + done.stderr


@pytest.fixture(scope="session")
def quick_sensitivity(tmp_path_factory) -> Path:
    """The sensitivities of the quick study, made from an empty folder of their own."""
    folder = tmp_path_factory.mktemp("quick_sensitivity")
    done = snakemake(folder, "-j2", "sensitivity")
    assert done.returncode == 0, done.stderr
    return folder
