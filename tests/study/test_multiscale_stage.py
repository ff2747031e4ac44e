"""The run with a network at every Gauss point: networks alone, one load step, any threads, killed and gone on with."""

import hashlib
import json
import os
import pickle
import signal
import subprocess
import time
import tracemalloc

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from fibers import exponential
from reference import respond
from small_study import NETWORK_FILES, SPECIMEN_FILE, small_specimen
from workflow_runs import job_line, job_of

from fibrous.errors import ConfigError, ConvergenceError
from fibrous.fe.solver import LoadStepper, Walk
from fibrous.materials.contract import Mixture
from fibrous.materials.neo_hookean import NeoHookean
from fibrous.materials.network import FiberNetworks
from fibrous.networks.guard import EquilibriumSolver
from fibrous_study import datasets, provenance
from fibrous_study.checkpoint import Checkpoint
from fibrous_study.paper import section
from fibrous_study.schema import KINDS
from fibrous_study.steps import table_2
from fibrous_study.steps import tissue_coupled as multiscale
from fibrous_study.steps.hgo_fits import fits_key

SCALE = 10.0 * np.pi * 0.1**2 / 8.0**2  # k π R²/χ²


def same_bits(one: xr.Dataset, other: xr.Dataset) -> bool:
    return all(one[name].values.tobytes() == other[name].values.tobytes() for name in KINDS["tissue"].variables)


@pytest.fixture(scope="module")
def coupled(study, tmp_path_factory):
    """The study with its unbroken run."""
    whole = study.with_files(tmp_path_factory.mktemp("coupled"), SPECIMEN_FILE, *NETWORK_FILES)
    whole.run("tissue_coupled", run="multiscale")
    return whole


def test_every_gauss_point_holds_its_network_in_equilibrium(coupled):
    """The networks alone, led along the F of the run, and the matrix by its formula make up the stress."""
    tissue = coupled.tissue("multiscale")
    assert tissue["converged"].all()
    for element, point in ((0, 0), (5, 3), (11, 7)):
        gradients = tissue["deformation_gradient"].values[:, element, point]
        path = np.concatenate([np.eye(3)[None], gradients])
        alone = respond(EquilibriumSolver.of(coupled.networks()[element], exponential(2.5)), path, SCALE)
        J = np.linalg.det(gradients)[:, None, None]
        matrix = 2.0 * 0.025 / J * (gradients @ gradients.swapaxes(1, 2) - np.eye(3)) + 0.417 * np.log(J) / J * np.eye(
            3
        )
        np.testing.assert_allclose(
            tissue["cauchy_stress"][:, element, point], alone.cauchy_stress[1:] + matrix, rtol=0.0, atol=1e-10
        )


def test_counts_are_those_of_the_library_called_by_hand(coupled):
    specimen, tissue = small_specimen(), coupled.tissue("multiscale")
    material = Mixture((NeoHookean(0.025, 0.417), FiberNetworks.of(coupled.networks())))
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
    coupled.run("tissue_coupled", run="multiscale_one_step")
    one, all_ = coupled.tissue("multiscale_one_step"), coupled.tissue("multiscale")
    assert one.sizes["step"] == 1
    for name, tolerance in (("displacement", 1e-7), ("cauchy_stress", 1e-8)):
        np.testing.assert_allclose(one[name][-1], all_[name][-1], rtol=0.0, atol=tolerance)


def test_load_steps_that_do_not_divide_the_specimens_are_refused(coupled):
    odd = {"run": "odd", "model": {"name": "odd", "law": "network", "load_steps": 2}}
    with pytest.raises(ConfigError, match="odd has load_steps 2, must divide the specimen's 3"):
        coupled.run("tissue_coupled", odd, run="multiscale_one_step")


def job(study, *options: str) -> list[str]:
    """The command of the rule."""
    content = job_of(study.config, "tissue_coupled", run="multiscale").content
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


class Stopped(Exception):
    """Of a run that is stopped after its first load step."""


@pytest.fixture(scope="module")
def stopped(study, tmp_path_factory):
    """A study with the checkpoint of its run after the first load step."""
    begun = study.with_files(tmp_path_factory.mktemp("stopped"), SPECIMEN_FILE, *NETWORK_FILES)
    real = Walk.advance

    def once(walk):
        if walk.step == 1:
            raise Stopped
        return real(walk)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(Walk, "advance", once)
        with pytest.raises(Stopped):
            begun.run("tissue_coupled", run="multiscale")
    return begun


CHECKPOINT = "results/tissue/multiscale.checkpoint"


def content_of(begun) -> bytes:
    return (begun.folder / CHECKPOINT).read_bytes()


def checkpoint_of(begun) -> Checkpoint:
    params = job_of(begun.config, "tissue_coupled", run="multiscale").params
    return Checkpoint(begun.folder / "results/tissue/multiscale.nc", params)


def arrays_like(content: bytes) -> list[np.ndarray]:
    """Room for the arrays of a checkpoint, filled with a number."""
    listed = json.loads(content.splitlines()[1])["arrays"]
    return [np.full(shape, 7, dtype=dtype) for dtype, shape in listed]


def sealed(content: bytes) -> bytes:
    """With the digest of what it says now."""
    return content[:-32] + hashlib.sha256(content[:-32]).digest()


def edited(content: bytes, change) -> bytes:
    """A whole checkpoint whose second line is another."""
    header, line, rest = content.split(b"\n", 2)
    index = json.loads(line)
    change(index)
    return sealed(b"\n".join([header, json.dumps(index).encode(), rest]))


def is_refused(begun, content: bytes, capsys) -> str:
    """What is said of a checkpoint of this content, of which nothing is taken over."""
    arrays, taken = arrays_like(content_of(begun)), []
    checkpoint = checkpoint_of(begun)
    kept = checkpoint.path.read_bytes()
    try:
        checkpoint.path.write_bytes(content)
        assert not checkpoint.read(arrays, taken.append)
    finally:
        checkpoint.path.write_bytes(kept)
    assert not taken
    assert all((array == 7).all() for array in arrays)
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    return said


def test_a_checkpoint_with_a_flipped_bit_is_refused(stopped, capsys, rng):
    content = bytearray(content_of(stopped))
    # Anywhere, and in the lines of text and the digest, which are small beside the arrays.
    lines = len(b"".join(bytes(content).split(b"\n", 2)[:2])) + 2
    places = [*rng.integers(0, len(content), 100), *rng.integers(0, lines, 80)]
    for place in [*places, *rng.integers(len(content) - 32, len(content), 20)]:
        bit = 1 << int(rng.integers(0, 8))
        content[place] ^= bit
        is_refused(stopped, bytes(content), capsys)
        content[place] ^= bit
    arrays = arrays_like(bytes(content))
    assert checkpoint_of(stopped).read(arrays, lambda notes: None)
    assert not all((array == 7).all() for array in arrays)


class Executed:
    """Unpickling it makes a folder."""

    def __init__(self, folder):
        self.folder = folder

    def __reduce__(self):
        return os.mkdir, (str(self.folder),)


@pytest.mark.parametrize("what", ["pickle", "pickle after the header", "sealed pickle", "nothing", "header", "half"])
def test_what_is_no_checkpoint_is_refused_and_not_executed(stopped, capsys, tmp_path, what):
    content, made = content_of(stopped), pickle.dumps(Executed(tmp_path / "executed"))
    header = content[: content.index(b"\n") + 1]
    is_refused(
        stopped,
        {
            "pickle": made,
            "pickle after the header": header + made,
            "sealed pickle": sealed(header + made + bytes(32)),
            "nothing": b"",
            "header": header,
            "half": content[: len(content) // 2],
        }[what],
        capsys,
    )
    assert not (tmp_path / "executed").exists()


@pytest.mark.parametrize(
    "change",
    [
        lambda index: index["arrays"][0].__setitem__(0, "<f4"),
        lambda index: index["arrays"][0].__setitem__(0, "|O"),
        lambda index: index["arrays"][0][1].append(1),
        lambda index: index["arrays"].pop(),
        lambda index: index.pop("notes"),
        lambda index: index.pop("arrays"),
    ],
)
def test_arrays_of_another_kind_are_refused(stopped, capsys, change):
    is_refused(stopped, edited(content_of(stopped), change), capsys)
    longer = sealed(content_of(stopped)[:-32] + bytes(8 + 32))
    assert "not as long" in is_refused(stopped, longer, capsys)


@pytest.mark.parametrize(
    "change",
    [
        lambda notes: notes.clear(),
        lambda notes: notes.update(walk=[1, 2]),
        lambda notes: notes["walk"].update(step="many"),
        lambda notes: notes["walk"].update(step=9),
        lambda notes: notes["walk"].update(increment=float("inf")),
        lambda notes: notes["walk"].update(step=float("inf")),
        lambda notes: notes["walk"].update(linear_solvers=None),
        lambda notes: notes["walk"].update(attempts=[[1, 2, 3]]),
        lambda notes: notes.update(seconds={"a": "long"}),
    ],
)
def test_notes_of_another_kind_leave_the_record_as_it_was(stopped, capsys, change):
    specimen = small_specimen()
    walk = Walk(
        LoadStepper.of(specimen.mesh, NeoHookean(0.025, 0.417), specimen.prescribed), specimen.prescribed.values
    )
    kept = multiscale._Kept(walk, np.zeros((3, 3), dtype=np.int64), {}, 0.0)
    checkpoint = Checkpoint(stopped.folder / "results/tissue/other.nc", {"stage": "", "config": {}, "code_hash": ""})
    checkpoint.write(kept.arrays, kept.notes)
    checkpoint.path.write_bytes(edited(checkpoint.path.read_bytes(), lambda index: change(index["notes"])))
    before = json.dumps(kept.notes)
    assert not checkpoint.read(kept.arrays, kept.take)
    assert json.dumps(kept.notes) == before
    assert capsys.readouterr().err.count("\n") == 1


@pytest.mark.parametrize("change", ["config", "code", "library", "content"])
def test_a_checkpoint_of_another_origin_or_a_broken_one_is_ignored(
    coupled, stopped, other, capsys, monkeypatch, change
):
    begun = other(SPECIMEN_FILE, *NETWORK_FILES)
    params = job_of(begun.config, "tissue_coupled", run="multiscale").params
    if change == "config":
        params["config"] = {**params["config"], "linear_solver": "direct"}
    if change == "code":
        params["code_hash"] = "another"
    if change == "library":
        monkeypatch.setattr(provenance, "RECORDED", ("numpy",))
    checkpoint = Checkpoint(begun.folder / "results/tissue/multiscale.nc", params)
    checkpoint.write([np.zeros(3)], {})
    if change == "content":
        broken = bytearray(content_of(stopped))
        broken[-1000] ^= 4
        checkpoint.path.write_bytes(broken)
    monkeypatch.undo()
    begun.run("tissue_coupled", run="multiscale")
    said = capsys.readouterr().err
    assert ("kept by another config" in said) == (change != "content")
    assert ("damaged" in said) == (change == "content")
    assert same_bits(begun.tissue("multiscale"), coupled.tissue("multiscale"))


def test_writing_a_checkpoint_takes_no_second_copy_of_its_arrays(tmp_path):
    arrays = [np.ones(4_000_000), np.ones(1_000_000, dtype=np.float32).reshape(1000, 1000).T, np.empty((0, 3))]
    params = {"stage": "", "config": {}, "code_hash": ""}
    checkpoint, found = Checkpoint(tmp_path / "a.nc", params), [np.zeros_like(array) for array in arrays]
    tracemalloc.start()
    checkpoint.write(arrays, {"a": 1})
    assert checkpoint.read(found, lambda notes: None)
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert most < arrays[0].nbytes / 4
    assert all(np.array_equal(one, same) for one, same in zip(arrays, found, strict=True))


def test_a_run_that_fails_keeps_what_converged(other, monkeypatch):
    begun = other(SPECIMEN_FILE, *NETWORK_FILES)
    real = Walk.advance

    def fails(walk):
        if walk.step == 1:
            monkeypatch.setattr(walk.stepper.assembly, "evaluate", never)
        return real(walk)

    def never(*_):
        raise ConvergenceError("element 3, Gauss point 1: its network finds no stable equilibrium")

    monkeypatch.setattr(Walk, "advance", fails)
    with pytest.raises(ConvergenceError, match=r"model multiscale: step 2: .*element 3, Gauss point 1.*failed\.nc"):
        begun.run("tissue_coupled", run="multiscale")
    failed = datasets.read(begun.folder / "results/tissue/multiscale.failed.nc", "tissue")
    assert failed["converged"].values.tolist() == [True, False, False]
    assert np.isfinite(failed["cauchy_stress"][0]).all()


def test_a_walk_goes_on_from_a_record():
    """Any law: all that a walk needs are the arrays and notes of its record."""
    specimen = small_specimen_steps(6)
    material = Mixture((NeoHookean(0.025, 0.417),))
    first, second = (LoadStepper.of(specimen.mesh, material, specimen.prescribed) for _ in range(2))
    whole = first.follow(specimen.prescribed.values)
    begun = Walk(first, specimen.prescribed.values)
    for _ in range(4):
        begun.advance()
    on = Walk(second, specimen.prescribed.values)
    for array, kept in zip(on.arrays, begun.arrays, strict=True):
        array[...] = kept
    on.take(json.loads(json.dumps(begun.notes)))
    while not on.is_over:
        on.advance()
    assert on.solution.displacement.tobytes() == whole.displacement.tobytes()
    assert on.solution.piola.tobytes() == whole.piola.tobytes()
    assert on.solution.attempts == whole.attempts


def small_specimen_steps(steps: int):
    specimen = small_specimen()
    whole = specimen.prescribed_displacement[-1]
    parts = np.arange(1, steps + 1)[:, None, None] / steps
    return type(specimen)(
        specimen.mesh, specimen.fiber_direction, specimen.structure_tensor, specimen.enthesis, parts * whole, "parts"
    )


def test_table_2_sums_up_what_the_processes_counted(tmp_path):
    form = {"energy": "families", "objective": "stress"}
    config = {"reference": "multiscale", "model": form, "load_set": "set", "loads_used": 0.5}
    config["paper"] = section("table_2")
    params = {"stage": "fibrous_study.steps.table_2", "config": config, "code_hash": ""}

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

    parts = json.dumps({"equilibrium": 1000.0, "condensation": 500.0})
    inputs = {
        "networks": [written("n.nc", 7.2)],
        # Half of the loads and one law of two: what is left is beyond the method.
        "initial": [
            written("a.nc", 36.0),
            written("b.nc", 36.0),
            written("f.nc", 48.0, cpu_seconds_of_fits=json.dumps({fits_key(form, "set"): 30.0, "other": 12.0})),
        ],
        "refit": [written("c.nc", 18.0)],
        "hybrid": [written("d.nc", 9.0), written("e.nc", 9.0)],
        "multiscale": [written("multiscale.nc", 3600.0, cpu_seconds_of_parts=parts)],
    }
    outputs = {"table_2": tmp_path / "t.csv", "parts": tmp_path / "p.csv"}
    table_2.run(inputs, outputs, params)
    table = pd.read_csv(outputs["table_2"]).set_index(["method", "task"])["cpu_hours"]
    assert table["hybrid", "total"] == pytest.approx(108.0 / 3600.0)
    (initial,) = [hours for (method, task), hours in table.items() if task.startswith("initial simulation")]
    assert initial == pytest.approx((36.0 + 36.0) / 3600.0)
    (beyond,) = [hours for (method, _), hours in table.items() if method == "beyond"]
    assert beyond == pytest.approx((36.0 + 12.0) / 3600.0)
    row = pd.read_csv(outputs["table_2"]).iloc[-1]
    assert row["times_hybrid"] == pytest.approx(1.0 / 0.03)
    assert row["paper_over_ours"] == pytest.approx(2622.69)
    assert row["times_hybrid_paper"] == pytest.approx(2622.69 / 1.48)
    shares = pd.read_csv(outputs["parts"]).set_index("part")["share"]
    assert shares.sum() == pytest.approx(1.0)
    assert shares["the rest"] == pytest.approx(2100.0 / 3600.0)
