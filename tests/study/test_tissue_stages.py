"""Stages of the tissue, from the specimen to its runs: what they write is what the library says, called by hand."""

import json

import numpy as np
import pandas as pd
import pytest
import xarray as xr
from fibers import exponential
from reference import respond
from small_study import (
    ELEMENTS,
    FITS_FILE,
    HGO,
    NETWORK_FILES,
    NO_PARAMS,
    SPECIMEN_FILE,
    SURFACE_FILE,
    constants,
    made_up_fits,
    other_tensors,
    small_specimen,
)

from fibrous.curves import Curves
from fibrous.errors import ConvergenceError, DatasetError, FibrousError, FitError
from fibrous.fe.solver import LoadStepper
from fibrous.fitting.hgo import fit_hgo
from fibrous.materials.affine_fibers import AffineFibers
from fibrous.materials.contract import Mixture
from fibrous.materials.hgo import HGOFamilies, HGOStructureTensor
from fibrous.materials.neo_hookean import NeoHookean
from fibrous.networks.guard import EquilibriumSolver
from fibrous.networks.network import unpacked
from fibrous.specimen import FIXED, MOVED
from fibrous_study import datasets, plan

SPECIMEN, TENSORS = small_specimen(), other_tensors()
SCALE = 10.0 * np.pi * 0.1**2 / 8.0**2  # k π R²/χ²
FORMS = {
    "hgo": ("structure_tensor", "energy"),
    "structure_tensor": ("structure_tensor", "energy"),
    "families": ("families", "energy"),
    "stress": ("families", "stress"),
}


def stepper(fibers):
    matrix = NeoHookean(0.025, 0.417)
    material = matrix if fibers is None else Mixture((matrix, fibers))
    return LoadStepper.of(SPECIMEN.mesh, material, SPECIMEN.prescribed)


def assert_is(found, fibers) -> None:
    """The file holds the solution of the specimen with these fibres."""
    expected = stepper(fibers).follow(SPECIMEN.prescribed.values)
    gradient = expected.deformation_gradient
    cauchy = np.einsum("...iJ,...jJ->...ij", expected.piola, gradient) / np.linalg.det(gradient)[..., None, None]
    np.testing.assert_allclose(found["displacement"], expected.displacement, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(found["deformation_gradient"], gradient, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(found["cauchy_stress"], cauchy, rtol=0.0, atol=1e-9)
    np.testing.assert_array_equal(found["newton_iterations"], expected.newton_iterations)
    assert found["converged"].all()


def test_the_specimen_is_that_of_the_config_and_its_seed(study, other):
    found = study.specimen()
    np.testing.assert_array_equal(found["node_position"], SPECIMEN.mesh.node_position)
    np.testing.assert_array_equal(found["element_nodes"], SPECIMEN.mesh.element_nodes)
    for name in ("structure_tensor", "fiber_direction", "enthesis", "prescribed_displacement"):
        np.testing.assert_array_equal(found[name], getattr(SPECIMEN, name))
    np.testing.assert_array_equal(found["step"], [1, 2, 3])
    np.testing.assert_array_equal(found["element_network"], np.arange(ELEMENTS))
    assert found.attrs["seed"] == 2021
    another = other(seed=7)
    another.run("specimen")
    np.testing.assert_array_equal(another.specimen()["node_position"], found["node_position"])
    assert np.abs(another.specimen()["structure_tensor"] - found["structure_tensor"]).max() > 0.05


def test_networks_meet_their_elements_whatever_the_batches(study, other):
    tensors = [network.structure_tensor for network in study.networks()]
    np.testing.assert_allclose(tensors, study.specimen()["structure_tensor"], rtol=0.0, atol=0.01)
    lengths = np.array([network.fiber_lengths.sum() for network in study.networks()])
    np.testing.assert_allclose(lengths * np.pi * 0.1**2 / 8.0**2, 0.04, rtol=1e-9)
    last = other(SPECIMEN_FILE, tissue={"batches": 6})
    path = last.run("networks", ensemble="tissue", batch="05")["networks"]
    for one, same in zip(unpacked(datasets.read(path, "networks")), study.networks()[10:], strict=True):
        np.testing.assert_array_equal(one.node_position, same.node_position)
        np.testing.assert_array_equal(one.fiber_nodes, same.fiber_nodes)
    assert len(plan.batches(other(SPECIMEN_FILE, tissue={"batches": 13}).config, "tissue")) == ELEMENTS


@pytest.mark.parametrize("run", FORMS)
def test_a_run_has_the_constants_of_its_form(study, run):
    study.run("tissue", run=run)
    found, (C2, C3) = study.tissue(run), constants(*FORMS[run])
    np.testing.assert_allclose(found["C2"], np.tile(C2, (3, 1)), rtol=1e-15)
    np.testing.assert_allclose(found["C3"], np.tile(C3, (3, 1)), rtol=1e-15)
    np.testing.assert_allclose(found["structure_tensor"], TENSORS, rtol=1e-15)
    C2, C3 = C2[:, None], C3[:, None]
    if run == "structure_tensor":
        assert_is(found, HGOStructureTensor(C2, C3, TENSORS[:, None]))
    else:
        assert_is(found, HGOFamilies.of_structure_tensor(TENSORS[:, None], C2, C3))


@pytest.mark.parametrize("change", [{"law": "gasser_dispersion"}, {"constants": "guessed"}])
def test_a_law_or_constants_that_nobody_knows_are_refused(other, change):
    begun = other(SPECIMEN_FILE, FITS_FILE)
    begun.config["tissue"]["models"].append({**HGO, **change, "name": "new"})
    with pytest.raises(FibrousError, match=f"'{next(iter(change.values()))}'"):
        begun.run("tissue", run="new")


def test_a_refitted_run_has_the_constants_of_the_only_load(study):
    C2, C3 = constants("structure_tensor", "energy")
    fibers = HGOFamilies.of_structure_tensor(TENSORS[:, None], 1.5 * C2[:, None], C3[:, None])
    assert_is(study.tissue("hgo_refit"), fibers)


def test_as_printed_families_push_back(study, other):
    C2, C3 = (values[:, None] for values in constants("structure_tensor", "energy"))
    printed = other(SPECIMEN_FILE, FITS_FILE, tissue={"tension_only": False})
    printed.run("tissue", run="hgo")
    assert_is(printed.tissue("hgo"), HGOFamilies.of_structure_tensor(TENSORS[:, None], C2, C3, tension_only=False))
    assert np.abs(printed.tissue("hgo")["displacement"] - study.tissue("hgo")["displacement"]).max() > 1e-3


def test_laws_without_constants(study):
    assert_is(study.tissue("matrix"), None)
    study.run("tissue", run="affine")
    assert_is(study.tissue("affine"), AffineFibers.of_networks(study.networks()))
    for run in ("matrix", "affine"):
        assert np.isnan(study.tissue(run)["C2"]).all()
        assert np.isnan(study.tissue(run)["C3"]).all()


def test_a_run_says_what_its_law_cost(study):
    """Stress and tangent of the fibres, evaluated in every Newton iteration, are a part of the process."""
    for run, parts in (("matrix", {"macroscopic solve"}), ("hgo", {"macroscopic solve", "fibre law"})):
        attributes = study.tissue(run).attrs
        seconds = json.loads(attributes["cpu_seconds_of_parts"])
        assert set(seconds) == parts
        assert min(seconds.values()) > 0.0
        assert sum(seconds.values()) < attributes["cpu_seconds"]


def test_constants_of_the_surface_are_its_predictions_in_principal_axes(study):
    study.run("tissue", run="hgo_surface")
    found, surface = study.tissue("hgo_surface"), datasets.read(study.folder / SURFACE_FILE, "surface")
    surface = surface.sel(protocol="large", load_set="section_3_1")
    H22, H11 = np.linalg.eigvalsh(SPECIMEN.structure_tensor).T[1:]
    terms = np.array([H11 ** int(term[0]) * H22 ** int(term[1]) for term in surface["term"].values])
    C2, C3 = (surface["coefficient"].sel(constant=name).values @ terms for name in ("C2", "C3"))
    assert (C2 > 0.0).all()
    np.testing.assert_allclose(found["C2"][0], C2, rtol=1e-10)
    np.testing.assert_allclose(found["C3"][0], np.maximum(C3, 0.0), atol=1e-10)
    np.testing.assert_array_equal(found["structure_tensor"], SPECIMEN.structure_tensor)
    C2, C3 = (found[name].values[0][:, None] for name in ("C2", "C3"))
    assert_is(found, HGOFamilies.of_structure_tensor(SPECIMEN.structure_tensor[:, None], C2, C3))


def test_a_surface_below_zero_counts_as_zero(study, other):
    surface = datasets.read(study.folder / SURFACE_FILE, "surface")
    coefficient = np.zeros_like(surface["coefficient"].values)
    coefficient[..., 0, 0], coefficient[..., 0, 2], coefficient[..., 1, 0] = -0.31, 0.5, -1.0  # C2 = H11/2 − 0.31
    surface["coefficient"].values[:] = coefficient
    small = other(SPECIMEN_FILE)
    datasets.write(surface, small.folder / SURFACE_FILE, "surface", NO_PARAMS)
    small.run("tissue", run="hgo_surface")
    H11 = np.linalg.eigvalsh(SPECIMEN.structure_tensor)[:, 2]
    assert 0.55 < H11.min() < 0.62 < H11.max()
    np.testing.assert_allclose(small.tissue("hgo_surface")["C2"][0], np.maximum(0.5 * H11 - 0.31, 0.0), atol=1e-15)
    np.testing.assert_array_equal(small.tissue("hgo_surface")["C3"], 0.0)


def test_an_element_outside_the_surface_is_named(other):
    aligned = other(SURFACE_FILE, synthetic_specimen={"H11": [0.85, 0.9]})
    aligned.run("specimen")
    with pytest.raises(FitError, match=r"^element 0: H11 = 0.8.. is outside the fitted range"):
        aligned.run("tissue", run="hgo_surface")
    assert not (aligned.folder / "results/tissue/hgo_surface.nc").exists()


def test_reaction_forces_balance_and_are_the_work_of_the_bone(study):
    found = study.tissue("hgo")["reaction_force"]
    largest = float(np.abs(found).max())
    np.testing.assert_allclose(found.sum("enthesis"), 0.0, atol=1e-7 * largest)
    # A bone that moves on by ±ε along an axis changes the energy by ±ε times its force on the tissue.
    C2, C3 = (values[:, None] for values in constants("structure_tensor", "energy"))
    run = stepper(HGOFamilies.of_structure_tensor(TENSORS[:, None], C2, C3))
    here, end = study.tissue("hgo")["displacement"].values[-1], SPECIMEN.prescribed.values[-1]
    volumes, epsilon = SPECIMEN.mesh.integration[1], 1e-4

    def energy(axis: int, move: float) -> float:
        moved = (SPECIMEN.enthesis[SPECIMEN.prescribed.nodes] == MOVED) & (SPECIMEN.prescribed.axes == axis)
        solution = run.follow((end + move * moved)[None], start=here)
        material = Mixture((NeoHookean(0.025, 0.417), HGOFamilies.of_structure_tensor(TENSORS[:, None], C2, C3)))
        return float((material.energy(solution.deformation_gradient[0]) * volumes).sum())

    work = [(energy(axis, epsilon) - energy(axis, -epsilon)) / (2.0 * epsilon) for axis in range(3)]
    np.testing.assert_allclose(found.sel(step=3, enthesis=MOVED), work, atol=1e-5 * largest)
    assert float(found.sel(step=3, enthesis=FIXED)[0]) < 0.0 < float(found.sel(step=3, enthesis=MOVED)[0])


def test_the_order_of_the_files_changes_no_bit(study, other):
    small = other(SPECIMEN_FILE, *NETWORK_FILES)
    first, second = (small.folder / path for path in NETWORK_FILES)
    first_content, second_content = first.read_bytes(), second.read_bytes()
    first.write_bytes(second_content)
    second.write_bytes(first_content)
    small.run("tissue", run="affine")
    study.run("tissue", run="affine")
    xr.testing.assert_equal(small.tissue("affine"), study.tissue("affine"))
    second.write_bytes(second_content)
    with pytest.raises(DatasetError, match=r"networks/tissue: lacks network 0; delete the folder"):
        small.run("tissue", run="affine")


def refused(study, table, text, run="hgo", protocol="section_2_6"):
    study.write_fits(protocol, table)
    with pytest.raises(DatasetError, match=text) as error:
        study.run("tissue", run=run)
    assert "\n" not in str(error.value)
    assert not (study.folder / f"results/tissue/{run}.nc").exists()


def test_a_network_without_one_fit_is_named(other):
    small = other(SPECIMEN_FILE)
    table = made_up_fits("section_3_1", "all")
    of_five = (table["network"] == 5) & (table["load_set"] == "section_3_1") & (table["objective"] == "energy")
    missing = "has no fit of structure_tensor to energy for network 5; see results/tables/convergence.csv"
    refused(small, table[~of_five], missing)
    refused(small, table.assign(C3=table["C3"].where(~of_five)), missing)
    refused(small, table.assign(load_set="section_2_3"), "no fit of structure_tensor to energy for network 0")
    refused(small, pd.concat([table, table[of_five]]), "more than one fit of structure_tensor to energy for network 5")
    refused(small, table.drop(columns="H23"), "lacks the column 'H23'")
    single = made_up_fits("single", "tissue")
    refused(small, pd.concat([single, single[:1]]), "more than one fit", "hgo_refit", "refit_hgo")
    refused(small, single[single["network"] != 7], "network 7", "hgo_refit", "refit_hgo")


@pytest.mark.parametrize("lagged", [False, True])
def test_a_motion_too_large_leaves_its_converged_part_until_it_succeeds(other, lagged):
    model = {"models": [{**HGO, "refit": True}], "update": "lagged" if lagged else "rounds"}
    small = other(FITS_FILE, *NETWORK_FILES, synthetic_specimen={"load_steps": 2, "gap_mm": -12.0}, tissue=model)
    small.run("specimen")
    run = "hgo_refit" if lagged else "hgo"
    stage = "lagged" if lagged else "tissue"
    with pytest.raises(ConvergenceError) as error:
        small.run(stage, run=run)
    kept = small.folder / f"results/tissue/{run}.failed.nc"
    line = str(error.value)
    assert line.startswith(f"model {run}: step 2: no equilibrium found beyond ")
    assert line.endswith(f"(the converged part is in {kept})")
    assert "turned inside out" in line or "the residual is " in line
    assert "\n" not in line
    assert [path.name for path in kept.parent.iterdir() if path.name != "specimen.nc"] == [kept.name]
    found = datasets.read(kept, "tissue")
    np.testing.assert_array_equal(found["converged"], [True, False])
    for name in ("displacement", "deformation_gradient", "cauchy_stress", "reaction_force"):
        assert np.isfinite(found[name][0]).all()
        assert np.isnan(found[name][1]).all()
    np.testing.assert_allclose(found["C2"][0], constants("structure_tensor", "energy")[0], rtol=1e-15)
    assert found.attrs["origin"] == "synthetic specimen"
    assert found["cuts"][1] > 0
    small.config["synthetic_specimen"]["gap_mm"] = 0.5
    small.run("specimen")
    small.run(stage, run=run)
    assert not kept.exists()
    assert small.tissue(run)["converged"].all()


def test_refit_curves_lead_each_network_as_its_element_went(study):
    """All runs of a round in one job, each with a file of its own."""
    sources = plan.refit_sources(study.config)["1"]
    assert sources == ["hgo", "structure_tensor", "families", "stress"]
    tissues = {run: study.tissue(run)["deformation_gradient"].values for run in sources}
    written = [study.run("refit_curves", round="1", batch=batch) for batch in ("00", "01")]
    networks = study.networks()
    for run in ("hgo", "stress"):
        mean = sum(tissues[run][:, :, q] for q in range(8)) / 8.0
        check_curves_of_elements([datasets.read(paths[run], "curves") for paths in written], mean, networks)
    assert not np.array_equal(tissues["hgo"], tissues["stress"])


def check_curves_of_elements(curves, mean, networks):
    assert [number for one in curves for number in one["network"].values.tolist()] == list(range(ELEMENTS))
    for one in curves:
        assert one["deformation"].values.tolist() == ["tissue"]
        for index, number in enumerate(one["network"].values):
            found = one.isel(network=index, deformation=0)
            path = np.concatenate([np.eye(3)[None], mean[:, number]])
            np.testing.assert_allclose(found["deformation_gradient"], path, rtol=0.0, atol=1e-15)
            np.testing.assert_allclose(found["magnitude"], np.arange(4) / 3.0)
            network = networks[number]
            expected = respond(EquilibriumSolver.of(network, exponential(2.5)), path, SCALE)
            assert expected.converged.all()
            np.testing.assert_allclose(
                found["strain_energy_density"], expected.strain_energy_density, rtol=1e-9, atol=1e-18
            )
            np.testing.assert_allclose(found["cauchy_stress"], expected.cauchy_stress, rtol=0.0, atol=1e-10)
            H = network.structure_tensor
            stretch = np.sqrt(np.einsum("siI,siJ,IJ->s", path, path, H))
            np.testing.assert_allclose(found["averaged_stretch"], stretch, rtol=1e-12)


def test_networks_of_another_specimen_are_refused(study, other):
    sources = plan.refit_sources(study.config)["1"]
    for run in sources:
        study.tissue(run)
    small = other(SPECIMEN_FILE, NETWORK_FILES[0], *(f"results/tissue/{run}.nc" for run in sources))
    foreign = study.specimen()
    foreign["element_network"].values[:] += 3
    datasets.write(foreign, small.folder / SPECIMEN_FILE, "specimen", NO_PARAMS)
    with pytest.raises(DatasetError, match=r"specimen.nc: has no element with network 0"):
        small.run("refit_curves", round="1", batch="00")


def test_a_lagged_run_fits_what_its_networks_did(study, other, capsys):
    model = {"models": [{**HGO, "refit": True}], "update": "lagged", "refit_rounds": 2}
    small = other(SPECIMEN_FILE, FITS_FILE, *NETWORK_FILES, tissue=model)
    small.run("lagged", run="hgo_refit")
    said = capsys.readouterr().err.splitlines()
    found, networks = small.tissue("hgo_refit"), study.networks()
    assert sum(line.startswith("last step again: C2 changed by up to ") for line in said) == 2
    np.testing.assert_allclose(found["C2"][0], constants("structure_tensor", "energy")[0], rtol=1e-15)
    np.testing.assert_allclose(found["C3"][0], constants("structure_tensor", "energy")[1], rtol=1e-15)
    # The second step's constants are those of the first one's deformation.
    first = found["deformation_gradient"][0].mean("gauss_point").values
    for number, network in enumerate(networks):
        path = np.stack([np.eye(3), first[number]])
        response = respond(EquilibriumSolver.of(network, exponential(2.5)), path, SCALE)
        energy, stress = response.strain_energy_density, response.cauchy_stress
        curves = Curves.of_network(path[None], network.structure_tensor, energy[None], stress[None])
        fit = fit_hgo(curves, **small.config["fit"])
        np.testing.assert_allclose((found["C2"][1, number], found["C3"][1, number]), (fit.C2, fit.C3), rtol=1e-6)
    small.config["equilibrium"] |= {"largest_number_of_iterations": 1, "largest_number_of_cuts": 1}
    small.run("lagged", run="hgo_refit")
    assert "network 3, step 1: no equilibrium was found; left out of the fits" in capsys.readouterr().err.splitlines()
    (small.folder / NETWORK_FILES[1]).write_bytes((small.folder / NETWORK_FILES[0]).read_bytes())
    with pytest.raises(DatasetError, match="networks/tissue: lacks network 6"):
        small.run("lagged", run="hgo_refit")
