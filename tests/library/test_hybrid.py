"""Lagged constants (Fig. 4b): each step runs with what the networks did before it, and the last one with its own."""

from dataclasses import fields, replace
from functools import partial

import numpy as np
import pytest
from conftest import small_network
from fibers import stress_scale
from reference import respond
from tissues import stretched_box

from fibrous.curves import Curves
from fibrous.fe.mesh import box
from fibrous.fe.solver import LoadStepError, LoadStepper
from fibrous.fitting.hgo import HGOFit, fit_hgo
from fibrous.hybrid import LaggedRefit
from fibrous.materials.contract import Mixture
from fibrous.materials.hgo import HGOFamilies, HGOStructureTensor
from fibrous.materials.neo_hookean import NeoHookean
from fibrous.networks.engine import Engine
from fibrous.networks.network import Network

MESH = box((2, 1, 1))
STRETCHES = (0.04, 0.08, 0.12, 0.16)
C2, C3 = np.array([0.1, 0.2]), np.array([0.0, 1.0])
SCALE = stress_scale(10.0, 0.1, 8.0)
fit_energy, fit_stress = (
    partial(
        fit_hgo,
        law=law,
        objective=objective,
        tension_only=True,
        largest_C3=50.0,
        slope_fit_below_r_squared=0.5,
    )
    for law, objective in ((HGOStructureTensor, "energy"), (HGOFamilies, "stress"))
)


class Losing(Engine):
    """Has no equilibrium where the stretch along x lies in a range."""

    lost = (np.inf, np.inf)

    def advance(self, state, F):
        least, most = self.lost
        new = super().advance(state, F)
        return new._replace(converged=new.converged & ~((least < F[0, 0]) & (F[0, 0] < most)))


def followed(H, seed, engine=Engine):
    """A network, solved by an engine of some kind."""

    class Followed(Network):
        def engine(self, *limits):
            return engine.of(self, self.fiber, *limits)

    network = small_network(seed, H, edge_length_um=8.0)
    return Followed(**{entry.name: getattr(network, entry.name) for entry in fields(network)})


@pytest.fixture(scope="module")
def networks():
    return [followed((0.6, 0.25, 0.15), 0), followed((0.45, 0.2, 0.35), 1)]


def stepper(networks, C2, C3, stretches=STRETCHES):
    tensor = np.array([network.structure_tensor for network in networks])
    fibers = HGOFamilies.of_structure_tensor(tensor[:, None], C2[:, None], C3[:, None])
    material = Mixture((NeoHookean(0.025, 0.417), fibers))
    return LoadStepper.of(MESH, material, stretched_box(MESH, stretches), tolerance=1e-12)


def follow(networks, fit, repetitions=0, stretches=STRETCHES):
    targets = stretched_box(MESH, stretches).values
    return LaggedRefit(partial(stepper, networks), networks, fit).follow(targets, C2, C3, repetitions)


def history(found, step, element):
    """Average F of an element from rest to a load step, counted from 0, shape (step + 2, 3, 3)."""
    gauss_points = found.solution.deformation_gradient[: step + 1, element]
    return np.concatenate([np.eye(3)[None], sum(gauss_points[:, q] for q in range(8)) / 8.0])


def refitted(network, gradients, fit, without=()):
    """The constants that one walk of the network along its whole history gives."""
    response = respond(network.engine().guard, gradients, SCALE)
    energy = response.strain_energy_density.copy()
    stress = response.cauchy_stress.copy()
    energy[list(without)], stress[list(without)] = np.nan, np.nan
    found = fit(Curves.of_network(gradients[None], network.structure_tensor, energy[None], stress[None]))
    return found.C2, found.C3


def test_constants_that_never_change_give_the_plain_run(networks):
    def unchanged(curves: Curves) -> HGOFit:
        element = int(np.array_equal(curves.structure_tensor[0], networks[1].structure_tensor))
        numbers = dict.fromkeys(HGOFit.__dataclass_fields__, 0.0)
        return HGOFit(**numbers | {"C2": C2[element], "C3": C3[element]})

    found = follow(networks, unchanged, repetitions=2)
    plain = stepper(networks, C2, C3).follow(stretched_box(MESH, STRETCHES).values)
    for name in ("displacement", "internal_force", "deformation_gradient", "piola"):
        np.testing.assert_allclose(getattr(found.solution, name), getattr(plain, name), atol=1e-10)
    assert found.solution.converged.all()
    np.testing.assert_array_equal(found.C2, np.tile(C2, (4, 1)))
    np.testing.assert_array_equal(found.C3, np.tile(C3, (4, 1)))
    np.testing.assert_array_equal(found.last_changes, np.zeros((2, 2)))
    assert found.lost_states == ()


@pytest.mark.parametrize("fit", [fit_energy, fit_stress])
def test_each_step_runs_with_what_the_networks_did_before_it(networks, fit):
    found = follow(networks, fit)
    np.testing.assert_array_equal(found.C2[0], C2)
    np.testing.assert_array_equal(found.C3[0], C3)
    for step in range(3):
        expected = [refitted(network, history(found, step, k), fit) for k, network in enumerate(networks)]
        np.testing.assert_allclose(np.transpose([found.C2[step + 1], found.C3[step + 1]]), expected, rtol=1e-6)
    # Every step is an equilibrium of the law with that step's constants, and of no other step's.
    for step in range(4):
        assembly = stepper(networks, found.C2[step], found.C3[step]).assembly
        point = assembly.evaluate(found.solution.displacement[step], assembly.split(None))
        assert np.abs(point.internal_force.ravel()[assembly.free]).max() < 1e-11 * point.force_scale
        np.testing.assert_allclose(point.piola, found.solution.piola[step], rtol=0.0, atol=1e-14)
    assert np.abs(np.diff(found.C2, axis=0)).min() > 1e-4
    assert found.last_changes.shape == (0, 2)


def test_the_last_step_repeated_ends_at_constants_that_belong_to_its_own_deformation(networks):
    lagged, found = follow(networks, fit_stress), follow(networks, fit_stress, repetitions=8)
    for name in ("C2", "C3"):
        np.testing.assert_array_equal(getattr(found, name)[:3], getattr(lagged, name)[:3])
    np.testing.assert_array_equal(found.solution.displacement[:3], lagged.solution.displacement[:3])
    assert (found.last_changes[0] > 1e-4).all()
    assert (found.last_changes[-1] < 1e-7).all()
    expected = [refitted(network, history(found, 3, k), fit_stress) for k, network in enumerate(networks)]
    np.testing.assert_allclose(np.transpose([found.C2[3], found.C3[3]]), expected, rtol=1e-6)
    # Once is not enough, and what it changes is what it says.
    once = follow(networks, fit_stress, repetitions=1)
    changes = [np.abs(once.C2[3] - lagged.C2[3]).max(), np.abs(once.C3[3] - lagged.C3[3]).max()]
    np.testing.assert_array_equal(once.last_changes, [changes])
    np.testing.assert_array_equal(found.last_changes[0], once.last_changes[0])


def test_all_that_is_spent_on_the_last_step_is_counted(networks):
    found = follow(networks, fit_stress, repetitions=3).solution
    assert [attempt.step for attempt in found.attempts] == [0, 1, 2, 3, 3, 3, 3]
    spent = [sum(len(one.residuals) for one in found.attempts if one.step == step) for step in range(4)]
    np.testing.assert_array_equal(found.newton_iterations, spent)
    assert found.linear_solvers == {"direct": sum(spent)}


def test_a_step_that_fails_leaves_what_converged_with_its_constants(networks):
    with pytest.raises(LoadStepError, match=r"^step 3: no equilibrium found .* turned inside out") as error:
        follow(networks, fit_energy, repetitions=2, stretches=(0.04, 0.08, -1.5, 0.1))
    whole, found = follow(networks, fit_energy, stretches=(0.04, 0.08)), error.value.found
    assert error.value.step == 2
    assert error.value.solution is found.solution
    np.testing.assert_array_equal(found.solution.converged, [True, True, False, False])
    for name in ("displacement", "internal_force", "deformation_gradient", "piola"):
        values = getattr(found.solution, name)
        np.testing.assert_array_equal(values[:2], getattr(whole.solution, name))
        assert np.isnan(values[2:]).all()
    np.testing.assert_array_equal(found.C2[:2], whole.C2)
    np.testing.assert_array_equal(found.C3[:2], whole.C3)
    assert np.isfinite(found.C2[2]).all()
    assert np.isnan(found.C2[3]).all()
    assert found.solution.cuts[2] > 0
    assert found.solution.newton_iterations[3] == 0
    assert {attempt.step for attempt in found.solution.attempts} == {0, 1, 2}


def test_a_repetition_that_fails_takes_the_last_step_with_it(networks):
    def stiffer_every_time(curves: Curves) -> HGOFit:
        return replace(fit_energy(curves), C2=1e308 if len(curves.strain_energy_density[0, 0]) == 5 else 0.1, C3=0.0)

    with pytest.raises(LoadStepError, match=r"^step 4: ") as error:
        follow(networks, stiffer_every_time, repetitions=1)
    found = error.value.found
    np.testing.assert_array_equal(found.solution.converged, [True, True, True, False])
    np.testing.assert_array_equal(found.C2[3], [1e308, 1e308])
    assert np.isnan(found.solution.displacement[3]).all()


def test_a_network_without_equilibrium_is_left_out_and_listed(networks):
    other = followed((0.6, 0.25, 0.15), 0, type("OnTheWay", (Losing,), {"lost": (1.08, 1.13)}))
    found = follow([other, networks[1]], fit_energy)
    stretch = [history(found, 3, 0)[step, 0, 0] for step in range(1, 5)]
    assert [bool(1.08 < one < 1.13) for one in stretch] == [False, True, False, False]
    assert found.lost_states == ((0, 2),)
    for step in (1, 2):
        expected = refitted(networks[0], history(found, step, 0), fit_energy, without=[2])
        np.testing.assert_allclose((found.C2[step + 1, 0], found.C3[step + 1, 0]), expected, rtol=1e-6)


def test_a_network_that_never_had_an_equilibrium_leaves_the_constants_alone(networks):
    never = followed((0.6, 0.25, 0.15), 0, type("Never", (Losing,), {"lost": (1.0, 2.0)}))
    found = follow([never, networks[1]], fit_energy, repetitions=1)
    np.testing.assert_array_equal(found.C2[:, 0], np.full(4, C2[0]))
    np.testing.assert_array_equal(found.C3[:, 0], np.full(4, C3[0]))
    assert found.lost_states == ((0, 1), (0, 2), (0, 3), (0, 4))
    assert (found.C2[1:, 1] != C2[1]).all()
