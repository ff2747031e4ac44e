"""The run with a network at every Gauss point: networks alone, one load step, any threads, killed and gone on with."""

import json
import pickle
import signal
import subprocess
import time

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from reference import respond
from small_study import NETWORK_FILES, SPECIMEN_FILE, small_specimen
from workflow_runs import job_line

from fibrous import datasets, provenance
from fibrous.errors import ConfigError, ConvergenceError
from fibrous.fe.solver import LoadStepper, Walk
from fibrous.materials.mixture import Mixture
from fibrous.materials.neo_hookean import NeoHookean
from fibrous.materials.network import FiberNetworks
from fibrous.networks.fiber_law import ExponentialFiber
from fibrous.networks.guard import EquilibriumSolver
from fibrous.study import table_2
from fibrous.study.checkpoint import Checkpoint
from fibrous.study.stages import Params, stage_params

SCALE = 10.0 * np.pi * 0.1**2 / 8.0**2  # k π R²/χ²


def same_bits(one: xr.Dataset, other: xr.Dataset) -> bool:
    return all(one[name].values.tobytes() == other[name].values.tobytes() for name in datasets.TISSUE)


@pytest.fixture(scope="module")
def coupled(study, tmp_path_factory):
    """The study with its unbroken run."""
    whole = study.with_files(tmp_path_factory.mktemp("coupled"), SPECIMEN_FILE, *NETWORK_FILES)
    whole.run("multiscale", run="multiscale")
    return whole


def test_every_gauss_point_holds_its_network_in_equilibrium(coupled):
    """The networks alone, led along the F of the run, and the matrix by its formula make up the stress."""
    tissue = coupled.tissue("multiscale")
    assert tissue["converged"].all()
    for element, point in ((0, 0), (5, 3), (11, 7)):
        gradients = tissue["deformation_gradient"].values[:, element, point]
        path = np.concatenate([np.eye(3)[None], gradients])
        alone = respond(EquilibriumSolver.of(coupled.networks()[element], ExponentialFiber(2.5)), path, SCALE)
        J = np.linalg.det(gradients)[:, None, None]
        matrix = 2.0 * 0.025 / J * (gradients @ gradients.swapaxes(1, 2) - np.eye(3)) + 0.417 * np.log(J) / J * np.eye(
            3
        )
        np.testing.assert_allclose(
            tissue["cauchy_stress"][:, element, point], alone.cauchy_stress[1:] + matrix, rtol=0.0, atol=1e-10
        )


def test_counts_are_those_of_the_library_called_by_hand(coupled):
    specimen, tissue = small_specimen(), coupled.tissue("multiscale")
    material = Mixture((NeoHookean(0.025, 0.417), FiberNetworks.of(coupled.networks(), ExponentialFiber(2.5), SCALE)))
    found = LoadStepper.of(specimen.mesh, material, specimen.prescribed).follow(specimen.prescribed.values)
    assert found.displacement.tobytes() == tissue["displacement"].values.tobytes()
    assert found.newton_iterations.tolist() == tissue["newton_iterations"].values.tolist()
    state = found.state[1]
    for name, counted in (("network_iterations", "iterations"), ("indefinite_hessians", "indefinite")):
        assert tissue[name].values.sum() == getattr(state, counted).sum()
    assert (tissue["network_iterations"].values >= 8 * tissue.sizes["element"]).all()


def test_the_forces_of_the_bones_balance_and_the_free_nodes_carry_none(coupled):
    reaction = coupled.tissue("multiscale")["reaction_force"].values
    np.testing.assert_allclose(reaction.sum(axis=1), 0.0, atol=1e-6 * np.abs(reaction).max())


def test_one_load_step_ends_where_all_of_them_do(coupled):
    """Networks and matrix are conservative."""
    coupled.run("multiscale", run="multiscale_one_step")
    one, all_ = coupled.tissue("multiscale_one_step"), coupled.tissue("multiscale")
    assert one.sizes["step"] == 1
    for name, tolerance in (("displacement", 1e-7), ("cauchy_stress", 1e-8)):
        np.testing.assert_allclose(one[name][-1], all_[name][-1], rtol=0.0, atol=tolerance)


def test_load_steps_that_do_not_divide_the_specimens_are_refused(coupled):
    coupled.config["tissue"]["models"].append({"name": "odd", "law": "network", "load_steps": 2})
    with pytest.raises(ConfigError, match="odd has load_steps 2, must divide the specimen's 3"):
        coupled.run("multiscale", run="odd")
    coupled.config["tissue"]["models"].pop()


def job(study, *options: str) -> list[str]:
    """The command of the rule."""
    content = Params(study.config).with_files("multiscale", {"run": "multiscale"})
    return job_line(study.folder, content, *options)


def test_a_killed_run_goes_on_to_the_same_bits_with_other_threads(coupled, other):
    begun = other(SPECIMEN_FILE, *NETWORK_FILES)
    kept = begun.folder / "results/tissue/multiscale.checkpoint"
    run = subprocess.Popen(job(begun), cwd=begun.folder, stderr=subprocess.PIPE, text=True)
    end = time.monotonic() + 60.0
    while not kept.exists() and run.poll() is None and time.monotonic() < end:
        time.sleep(0.002)
    run.send_signal(signal.SIGKILL)
    said = run.communicate()[1]
    assert kept.exists(), said
    assert not (begun.folder / "results/tissue/multiscale.nc").exists()
    # Half of a checkpoint that was being written when the run was killed.
    (kept.parent / f".{kept.name}.{run.pid}").write_bytes(b"half")
    done = subprocess.run(
        job(begun, "--threads", "2", "--terminal", "1"), cwd=begun.folder, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    assert "multiscale: going on after load step" in done.stdout
    assert "load step 1 of 3, iteration" not in done.stdout
    assert "load step 3 of 3, iteration 1, residual" in done.stdout
    assert same_bits(begun.tissue("multiscale"), coupled.tissue("multiscale"))
    assert sorted(path.name for path in kept.parent.iterdir()) == sorted(
        ["specimen.nc", "multiscale.nc", "multiscale.vtu", "multiscale.vtu.json"]
    )


@pytest.mark.parametrize("change", ["config", "code", "library", "content"])
def test_a_checkpoint_of_another_origin_or_a_broken_one_is_ignored(coupled, other, capsys, monkeypatch, change):
    begun = other(SPECIMEN_FILE, *NETWORK_FILES)
    params = stage_params("multiscale", begun.config, {"run": "multiscale"})
    if change == "config":
        params["config"] = {**params["config"], "linear_solver": "direct"}
    if change == "code":
        params["code_hash"] = "another"
    if change == "library":
        monkeypatch.setattr(provenance, "RECORDED", ("numpy",))
    checkpoint = Checkpoint(begun.folder / "results/tissue/multiscale.nc", params)
    checkpoint.write("nothing of use")
    if change == "content":
        checkpoint.path.write_bytes(checkpoint.path.read_bytes()[:-5])
    monkeypatch.undo()
    begun.run("multiscale", run="multiscale")
    said = capsys.readouterr().err
    assert ("kept by another config" in said) == (change != "content")
    assert ("not readable" in said) == (change == "content")
    assert same_bits(begun.tissue("multiscale"), coupled.tissue("multiscale"))


def test_a_run_that_fails_keeps_what_converged(other, monkeypatch):
    begun = other(SPECIMEN_FILE, *NETWORK_FILES)
    real = Walk.advance

    def fails(walk):
        if walk.record.step == 1:
            monkeypatch.setattr(walk.stepper.assembly, "evaluate", never)
        return real(walk)

    def never(*_):
        raise ConvergenceError("element 3, Gauss point 1: its network finds no stable equilibrium")

    monkeypatch.setattr(Walk, "advance", fails)
    with pytest.raises(ConvergenceError, match=r"model multiscale: step 2: .*element 3, Gauss point 1.*failed\.nc"):
        begun.run("multiscale", run="multiscale")
    failed = datasets.read(begun.folder / "results/tissue/multiscale.failed.nc", "tissue")
    assert failed["converged"].values.tolist() == [True, False, False]
    assert np.isfinite(failed["cauchy_stress"][0]).all()


def test_a_walk_goes_on_from_a_record():
    """Any law: all that a walk needs is in its record."""
    specimen = small_specimen_steps(6)
    material = Mixture((NeoHookean(0.025, 0.417),))
    first, second = (LoadStepper.of(specimen.mesh, material, specimen.prescribed) for _ in range(2))
    whole = first.follow(specimen.prescribed.values)
    begun = Walk(first, specimen.prescribed.values)
    for _ in range(4):
        begun.advance()
    on = Walk(second, specimen.prescribed.values, record=pickle.loads(pickle.dumps(begun.record)))
    while not on.is_over:
        on.advance()
    assert on.solution.displacement.tobytes() == whole.displacement.tobytes()
    assert on.solution.stress.tobytes() == whole.stress.tobytes()
    assert on.solution.attempts == whole.attempts


def small_specimen_steps(steps: int):
    specimen = small_specimen()
    whole = specimen.prescribed_displacement[-1]
    parts = np.arange(1, steps + 1)[:, None, None] / steps
    return type(specimen)(
        specimen.mesh, specimen.fiber_direction, specimen.structure_tensor, specimen.enthesis, parts * whole, "parts"
    )


def test_table_2_sums_up_what_the_processes_counted(tmp_path):
    params = {"stage": "fibrous.study.table_2", "config": {"reference": "multiscale"}, "code_hash": ""}

    def written(name: str, seconds: float, **attributes) -> str:
        dataset = xr.Dataset(
            attrs={
                "cpu_seconds": seconds,
                "peak_memory_MB": 100.0 * seconds,
                "machine": "m",
                "origin": "o",
                **attributes,
            }
        )
        dataset.attrs["versions"] = '{"python": "3"}'
        dataset.to_netcdf(tmp_path / name, engine="netcdf4")
        return tmp_path / name

    parts = json.dumps({"assembly": 1000.0, "factorisation": 500.0})
    inputs = {
        "networks": [written("n.nc", 7.2)],
        "initial": [written("a.nc", 36.0), written("b.nc", 36.0)],
        "refit": [written("c.nc", 18.0)],
        "hybrid": [written("d.nc", 9.0), written("e.nc", 9.0)],
        "multiscale": [written("multiscale.nc", 3600.0, cpu_seconds_of_parts=parts)],
    }
    outputs = {"table_2": tmp_path / "t.csv", "parts": tmp_path / "p.csv"}
    table_2.run(inputs, outputs, params)
    table = pd.read_csv(outputs["table_2"]).set_index(["method", "task"])["cpu_hours"]
    assert table["hybrid", "total"] == pytest.approx(108.0 / 3600.0)
    (initial,) = [hours for (method, task), hours in table.items() if task.startswith("initial simulation")]
    assert initial == pytest.approx(0.02)
    row = pd.read_csv(outputs["table_2"]).iloc[-1]
    assert row["times_hybrid"] == pytest.approx(1.0 / 0.03)
    assert row["paper_over_ours"] == pytest.approx(2622.69)
    assert row["times_hybrid_paper"] == pytest.approx(2622.69 / 1.48)
    shares = pd.read_csv(outputs["parts"]).set_index("part")["share"]
    assert shares.sum() == pytest.approx(1.0)
    assert shares["the rest"] == pytest.approx(2100.0 / 3600.0)
