"""A network that owns its fibres and its cube: energies and stresses in MPa, loads, and what it refuses."""

import pickle
import subprocess
import sys
from dataclasses import FrozenInstanceError, replace

import numpy as np
import pytest
from conftest import small_network
from fibers import exponential
from reference import respond

import fibrous as fb
from fibrous.deformation import averaged_stretch
from fibrous.errors import ConfigError, ConvergenceError, LoadError, NetworkError
from fibrous.networks.guard import EquilibriumSolver

F = np.array([[1.2, 0.1, 0.0], [0.0, 0.95, 0.05], [0.02, 0.0, 0.9]])


def test_stress_tangent_and_energy_are_derivatives_of_each_other(network):
    step = 1e-5
    changes = step * np.eye(9).reshape(3, 3, 3, 3)
    differences = (network.energy(F + changes) - network.energy(F - changes)) / (2.0 * step)
    piola = network.piola(F)
    np.testing.assert_allclose(piola, differences, atol=1e-6 * np.abs(piola).max())
    differences = (network.piola(F + changes) - network.piola(F - changes)) / (2.0 * step)
    tangent = network.tangent(F)
    np.testing.assert_allclose(tangent, differences.transpose(2, 3, 0, 1), atol=1e-5 * np.abs(tangent).max())
    np.testing.assert_allclose(network.stress(F), piola @ F.T / np.linalg.det(F), rtol=1e-12)
    assert network.stress(np.broadcast_to(F, (2, 5, 3, 3))).shape == (2, 5, 3, 3)


def test_stress_is_the_guards_in_megapascal():
    network = small_network(1, edge_length_um=8.0)
    unit = 10.0 * np.pi * 0.1**2 / 8.0**2
    expected = respond(EquilibriumSolver.of(network, network.fiber), np.array([np.eye(3), F]), unit)
    np.testing.assert_allclose(network.stress(F), expected.cauchy_stress[1], atol=1e-9)
    np.testing.assert_allclose(network.energy(F), expected.strain_energy_density[1], rtol=1e-8)


@pytest.mark.parametrize(("change", "power"), [({"modulus_MPa": 30.0}, 1), ({"radius_um": 0.3}, 2)])
def test_stress_grows_with_modulus_and_section_and_shrinks_with_the_face(network, change, power):
    stress = network.stress(F)
    stiffer = replace(network, fiber=exponential(**change))
    np.testing.assert_allclose(stiffer.stress(F), 3.0**power * stress, rtol=1e-12)
    np.testing.assert_allclose(replace(network, edge_um=3.0 * network.edge_um).stress(F), stress / 9.0, rtol=1e-12)


def test_volume_fraction_counts_sections(network):
    count = len(network.fiber_nodes)
    thicker = replace(network, fiber=exponential(section=np.where(np.arange(count) < count // 2, 2.0, 1.0)))
    lengths = network.fiber_lengths
    expected = np.pi * 0.1**2 * (lengths.sum() + lengths[: count // 2].sum()) / network.edge_um**2
    assert thicker.volume_fraction == pytest.approx(expected, rel=1e-12)


def test_loads_end_at_one_averaged_stretch_and_answers_are_those_of_single_states(network):
    cases = fb.loads({"x_uniaxial": 1.2, "xy_shear": None, "mine": F})
    curves = network.load(cases, steps=3, geometry=True, tangent=True)
    H = network.structure_tensor
    ends = averaged_stretch(curves["deformation_gradient"].values[:, -1], H)
    assert ends[1] == pytest.approx(ends[0], rel=1e-12)
    np.testing.assert_array_equal(curves["deformation_gradient"].sel(deformation="mine", step=3), F)
    for name, alone in {
        "cauchy_stress": network.stress,
        "first_piola_kirchhoff_stress": network.piola,
        "strain_energy_density": network.energy,
        "tangent": network.tangent,
    }.items():
        values, expected = curves[name].values[:, -1], alone(curves["deformation_gradient"].values[:, -1])
        np.testing.assert_allclose(values, expected, atol=1e-7 * np.abs(expected).max(), err_msg=name)
    boundary = network.node_is_boundary
    np.testing.assert_allclose(
        curves["node_position"].sel(deformation="mine", step=3).values[boundary],
        network.node_position[boundary] @ F.T,
        atol=1e-12,
    )
    assert curves["cauchy_stress"].attrs["units"] == "MPa"
    held = fb.Curves.from_dataset(curves)
    np.testing.assert_array_equal(held.cauchy_stress[0], curves["cauchy_stress"].values)
    assert held.loads == ("x_uniaxial", "xy_shear", "mine")


def test_a_state_that_is_not_found_is_flagged_or_refused(network):
    hasty = fb.Limits(largest_number_of_iterations=2, largest_number_of_cuts=0)
    curves = network.load(fb.loads({"x_uniaxial": 2.0}), steps=2, limits=hasty)
    np.testing.assert_array_equal(curves["converged"].values[0], [True, False, False])
    assert np.isnan(curves["cauchy_stress"].values[0, 1:]).all()
    with pytest.raises(ConvergenceError, match="go there in steps"):
        network.stress(np.stack([np.eye(3), np.diag([1.0, 1.0, -1.0])]))


def test_a_network_is_fixed_and_can_be_sent_to_another_process(network):
    with pytest.raises(FrozenInstanceError):
        network.edge_um = 5.0
    with pytest.raises(ValueError, match="read-only"):
        network.node_position[0] = 0.0
    network.stress(F)
    sent = pickle.loads(pickle.dumps(network))
    np.testing.assert_array_equal(sent.stress(F), network.stress(F))


@pytest.mark.parametrize(
    ("change", "error"),
    [
        ({"edge_um": 0.0}, NetworkError),
        ({"edge_um": np.nan}, NetworkError),
        ({"node_position": np.zeros((4, 2))}, NetworkError),
        ({"node_is_boundary": np.zeros(3, dtype=bool)}, NetworkError),
        ({"fiber": exponential(section=np.ones(3))}, ConfigError),
    ],
)
def test_what_is_no_network_is_refused_in_a_line(network, change, error):
    with pytest.raises(error) as refused:
        replace(network, **change)
    assert "\n" not in str(refused.value)


def test_calls_out_of_range_are_refused(network):
    with pytest.raises(ConfigError, match="must be"):
        network.stress(np.eye(2))
    with pytest.raises(ConfigError, match="no load"):
        network.load(())
    with pytest.raises(LoadError, match="needs a magnitude"):
        network.load(fb.loads({"x_uniaxial": None}))


def test_public_objects_show_themselves_in_a_line(network):
    many = exponential(section=np.ones(len(network.fiber_nodes)))
    curves = fb.Curves.from_dataset(network.load(fb.loads({"x_uniaxial": 1.1}), steps=1))
    for shown in (network, many, fb.Limits(), *fb.loads({"mine": F, "x_uniaxial": 1.1}), curves):
        assert "\n" not in repr(shown)
        assert len(repr(shown)) < 120


def test_the_package_imports_without_compiled_code():
    code = (
        "import sys, fibrous; print(sorted({'numba', 'scipy', 'xarray'} & set(sys.modules)));"
        "print(set(fibrous.__all__) - set(dir(fibrous)))"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert done.stdout.split() == ["[]", "set()"]
    assert all(getattr(fb, name).__doc__ for name in fb.__all__)
