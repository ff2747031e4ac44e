"""A specimen, a law or networks, and their comparison, by the names that `import fibrous` gives."""

import numpy as np
import pytest

import fibrous as fb
from fibrous.errors import ConvergenceError
from fibrous.fe.mesh import MeshError


def test_the_way_from_a_network_to_the_comparison_of_two_tissues(tmp_path):
    fiber = fb.Fiber(modulus_MPa=10.0, nonlinearity=2.5, radius_um=0.1)
    slab = fb.Slab(elements=(2, 2, 1)).specimen(steps=2)
    networks = [
        fb.delaunay(H, fiber, volume_fraction=0.04, edge_um=8.0, seed=seed, tolerance=0.05)
        for seed, H in enumerate(slab.structure_tensor)
    ]
    curves = networks[0].load([fb.LoadCase("x_uniaxial", 1.3)], steps=8)
    fit = fb.fit_hgo(curves)
    F, W = curves["deformation_gradient"].values[0], curves["strain_energy_density"].values[0]
    assert fit.r_squared > 0.99
    np.testing.assert_allclose(fit.law.energy(F)[-1], W[-1], rtol=0.1)
    matrix = fb.NeoHookean(0.025, 0.417)
    hybrid, coupled = fb.solve(slab, matrix + fit.law), fb.solve(slab, matrix + fb.FiberNetworks.of(networks))
    for solution in (hybrid, coupled):
        assert solution.converged.all()
        # The two bones pull against each other.
        np.testing.assert_allclose(solution.reaction.sum(axis=1), 0.0, atol=1e-6 * np.abs(solution.reaction).max())
    expected = np.linalg.norm(hybrid.reaction[-1, 1] - coupled.reaction[-1, 1])
    comparison = fb.compare(hybrid, coupled)
    assert comparison.reaction.rms_error == pytest.approx(expected, rel=1e-12)
    assert comparison.reaction.unit == "N"
    for thing in (slab, fit, hybrid, comparison):
        assert "\n" not in repr(thing)
    coupled.save(tmp_path / "state.vtu")
    assert (tmp_path / "state.vtu").stat().st_size > 1000


def test_what_cannot_be_compared_or_solved_says_so():
    matrix, small = fb.NeoHookean(0.025, 0.417), fb.Slab(elements=(2, 2, 1)).specimen(1)
    other = fb.solve(fb.Slab(elements=(2, 1, 1)).specimen(1), matrix)
    with pytest.raises(MeshError, match="different meshes"):
        fb.compare(fb.solve(small, matrix), other)
    crushed = fb.Slab(elements=(2, 2, 1)).specimen(2, motion=fb.RigidMotion(gap_mm=-19.0))
    with pytest.raises(ConvergenceError) as error:
        fb.solve(crushed, matrix, smallest_increment=0.25)
    assert error.value.solution.specimen is crushed


def test_every_public_name_is_there():
    for name in fb.__all__:
        assert getattr(fb, name) is not None
    assert set(fb.__all__) <= set(dir(fb))
    with pytest.raises(AttributeError, match="no attribute 'felupe'"):
        fb.felupe  # noqa: B018
