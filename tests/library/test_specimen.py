"""The synthetic specimen: geometry of the slab, fields of fibres, rigid motion, and the state it is loaded to."""

import numpy as np
import pytest

from fibrous.fe.mesh import MeshError
from fibrous.fe.solver import LoadStepper
from fibrous.materials.contract import Mixture
from fibrous.materials.hgo import HGOFamilies
from fibrous.materials.neo_hookean import NeoHookean
from fibrous.specimen import (
    FIXED,
    MOVED,
    SYNTHETIC,
    FiberField,
    RigidMotion,
    Slab,
    Specimen,
    smooth_field,
)

SLAB, FIBERS, MOTION = Slab(), FiberField(), RigidMotion()


@pytest.fixture(scope="module")
def specimen() -> Specimen:
    return SLAB.specimen(20, FIBERS, MOTION)


@pytest.mark.parametrize("count", [5, 15, 60])
def test_the_volume_is_that_of_a_bent_slab_of_straight_elements(count):
    # Bending about the middle surface keeps the volume; a straight element spans the sine of the angle of its arc.
    slab = Slab(elements=(count, 4, 3), length_mm=9.0, height_mm=14.0, thickness_mm=2.5, radius_mm=7.0)
    volumes = slab.mesh.integration[1]
    assert (volumes > 0.0).all()
    angle = slab.length_mm / slab.radius_mm / count
    assert volumes.sum() == pytest.approx(9.0 * 14.0 * 2.5 * np.sin(angle) / angle, rel=1e-13)


def test_nodes_lie_on_concentric_cylinders_and_entheses_at_the_ends(specimen):
    x, y, z = specimen.mesh.node_position.T
    layers = np.unique(np.hypot(x, z + SLAB.radius_mm).round(9))
    np.testing.assert_allclose(layers, SLAB.radius_mm + np.linspace(-1.0, 1.0, 4), atol=1e-9)
    np.testing.assert_allclose([y.min(), y.max()], [-8.0, 8.0])
    angle = np.arctan2(x, z + SLAB.radius_mm)
    for number, end in ((FIXED, -1.0), (MOVED, 1.0)):
        nodes = specimen.enthesis == number
        assert nodes.sum() == 21 * 4
        np.testing.assert_allclose(angle[nodes], end * 0.5 * SLAB.length_mm / SLAB.radius_mm, atol=1e-15)
    assert len(specimen.mesh.element_nodes) == 900


def test_fibers_lie_in_the_slab_and_turn_towards_the_lower_rows():
    still = FiberField(deviation_degrees=0.0, tilt_degrees=0.0)
    specimen = SLAB.specimen(1, still, MOTION)
    centers = specimen.mesh.node_position[specimen.mesh.element_nodes].mean(axis=1)
    outward = centers + np.array([0.0, 0.0, SLAB.radius_mm])
    outward[:, 1] = 0.0
    outward /= np.linalg.norm(outward, axis=1, keepdims=True)
    np.testing.assert_allclose((specimen.fiber_direction * outward).sum(axis=1), 0.0, atol=1e-14)
    angle = np.degrees(np.arcsin(specimen.fiber_direction[:, 1]))
    lowest, highest = (centers[:, 1] == end(centers[:, 1]) for end in (np.min, np.max))
    np.testing.assert_allclose(angle[lowest], 20.0, atol=0.05)
    np.testing.assert_allclose(angle[highest], 0.0, atol=0.05)
    order = np.argsort(centers[:, 1], kind="stable")
    assert (np.diff(angle[order]) < 1e-9).all(), "the angle falls from row to row"


def test_structure_tensors_have_their_eigenvalues_along_the_fibers(specimen):
    H = specimen.structure_tensor
    assert (np.swapaxes(H, 1, 2) == H).all()
    np.testing.assert_allclose(np.trace(H, axis1=1, axis2=2), 1.0, atol=1e-14)
    eigenvalues, vectors = np.linalg.eigh(H)
    assert eigenvalues.min() > 0.05
    assert ((eigenvalues[:, 2] > 0.55) & (eigenvalues[:, 2] < 0.80)).all()
    assert np.ptp(eigenvalues[:, 2]) > 0.15, "the specimen has the whole range"
    np.testing.assert_allclose(np.linalg.norm(specimen.fiber_direction, axis=1), 1.0, atol=1e-14)
    np.testing.assert_allclose(np.abs((vectors[..., 2] * specimen.fiber_direction).sum(axis=1)), 1.0, atol=1e-12)
    # The smallest eigenvalue is out of the plane but for the tilt of the fibres.
    outward = SLAB.frames(SLAB.element_centers)[..., 2]
    assert (np.abs((vectors[..., 0] * outward).sum(axis=1)) > np.cos(np.radians(10.0))).all()


def test_neighbours_are_alike(specimen):
    # Two points a distance r apart have the mean square difference 2 (1 − exp(−r²/2 l²)), about (r/l)².
    fibers = specimen.fiber_direction.reshape(15, 20, 3, 3)
    for axis, distance in ((0, 10.0 / 15.0), (1, 16.0 / 20.0), (2, 2.0 / 3.0)):
        turns = np.degrees(np.linalg.norm(np.diff(fibers, axis=axis), axis=-1))
        random = np.hypot(FIBERS.deviation_degrees, FIBERS.tilt_degrees) * distance / FIBERS.correlation_length_mm
        along_arc = np.degrees(10.0 / 15.0 / SLAB.radius_mm) if axis == 0 else 0.0
        down_rows = 1.5 * FIBERS.lowest_row_degrees / 20.0 if axis == 1 else 0.0
        assert turns.max() < 4.0 * random + along_arc + down_rows
        assert turns.max() > 0.0


def test_random_fields_have_the_moments_and_the_correlation_they_promise():
    length, distance = 3.0, 2.0
    points = np.array([[0.0, 0.0, 0.0], [distance, 0.0, 0.0], [0.0, -distance, 0.0], [0.0, 0.0, 50.0]])
    values = np.array([smooth_field(points, length, seed) for seed in range(4000)])
    expected = np.exp(-0.5 * (distance / length) ** 2)
    covariance = values.T @ values / len(values)
    np.testing.assert_allclose(values.mean(axis=0), 0.0, atol=0.06)
    np.testing.assert_allclose(np.diag(covariance), 1.0, atol=0.09)
    np.testing.assert_allclose(covariance[0, 1:3], expected, atol=0.08)
    assert abs(covariance[0, 3]) < 0.06


def test_a_finer_mesh_has_the_same_fibers_at_the_same_places():
    coarse, fine = (Slab(elements=(n, n, n)).specimen(1, FIBERS, MOTION) for n in (3, 9))
    middle = np.arange(9**3).reshape(9, 9, 9)[1::3, 1::3, 1::3].ravel()
    np.testing.assert_allclose(fine.structure_tensor[middle], coarse.structure_tensor, atol=1e-12)


def test_a_seed_gives_one_specimen_and_another_seed_another(specimen):
    again = SLAB.specimen(20, FIBERS, MOTION)
    other = SLAB.specimen(20, FiberField(seed=1), MOTION)
    assert (again.structure_tensor == specimen.structure_tensor).all()
    assert np.abs(other.structure_tensor - specimen.structure_tensor).max() > 0.05
    assert specimen.origin == SYNTHETIC
    assert "synthetic" in SYNTHETIC


def test_the_moved_enthesis_stays_rigid_at_every_step(specimen):
    moved = np.flatnonzero(specimen.enthesis == MOVED)
    rest = specimen.mesh.node_position[moved]
    displacement = specimen.prescribed_displacement[:, moved]

    def distances(position):
        return np.linalg.norm(position[..., :, None, :] - position[..., None, :, :], axis=-1)

    np.testing.assert_allclose(distances(rest + displacement) - distances(rest), 0.0, atol=1e-12)
    # The middle moves along a straight line in equal parts, and the turn grows in equal parts.
    parts = np.arange(1, 21)[:, None] / 20.0
    np.testing.assert_allclose(
        displacement.mean(axis=1), parts * [MOTION.gap_mm, MOTION.slide_mm, 0.0], rtol=0.0, atol=1e-14
    )
    top, bottom = (rest[:, 1] == end(rest[:, 1]) for end in (np.max, np.min))
    bar = (rest + displacement)[:, top].mean(axis=1) - (rest + displacement)[:, bottom].mean(axis=1)
    np.testing.assert_allclose(bar[:, 0], 0.0, atol=1e-14)
    np.testing.assert_allclose(np.degrees(np.arctan2(bar[:, 2], bar[:, 1])), 5.1 * parts[:, 0], atol=1e-12)


def test_prescribed_components_are_those_of_both_entheses(specimen):
    prescribed = specimen.prescribed
    assert len(prescribed.nodes) == 3 * 2 * 84
    full = np.full_like(specimen.prescribed_displacement, np.nan)
    full[:, prescribed.nodes, prescribed.axes] = prescribed.values
    np.testing.assert_array_equal(full, specimen.prescribed_displacement)
    assert (full[:, specimen.enthesis == FIXED] == 0.0).all()


def test_the_default_motion_stretches_the_specimen_as_the_study_needs(specimen):
    families = HGOFamilies.of_structure_tensor(specimen.structure_tensor[:, None], C2=0.15, C3=0.33)
    stepper = LoadStepper.of(
        specimen.mesh, Mixture((NeoHookean(0.025, 0.417), families)), prescribed := specimen.prescribed
    )
    solution = stepper.follow(prescribed.values)
    gradient = stepper.assembly.deformation_gradient(solution.displacement[-1])
    stretch = np.linalg.svd(gradient.mean(axis=1), compute_uv=False)[:, 0]
    assert 1.20 < np.percentile(stretch, 99.0) < 1.28
    determinant = np.linalg.det(gradient)
    assert (determinant > 0.5).all()
    assert (determinant < 1.6).all()
    assert solution.cuts.sum() == 0


def test_impossible_specimens_are_refused(specimen):
    def refused(text, **changes):
        parts = {name: getattr(specimen, name) for name in Specimen.__dataclass_fields__} | changes
        with pytest.raises(MeshError, match=text) as error:
            Specimen(**parts)
        assert "\n" not in str(error.value)

    refused("no node belongs to enthesis 1, the one held fixed", enthesis=np.where(specimen.enthesis == MOVED, 2, 0))
    refused("no node belongs to enthesis 2, the one moved", enthesis=np.where(specimen.enthesis == FIXED, 1, 0))
    moved = int(np.flatnonzero(specimen.enthesis == MOVED)[0])
    displacement = specimen.prescribed_displacement.copy()
    displacement[3, moved, 1] = np.inf
    refused(f"node {moved} has no finite displacement at step 4", prescribed_displacement=displacement)
    fixed = int(np.flatnonzero(specimen.enthesis == FIXED)[5])
    displacement = specimen.prescribed_displacement.copy()
    displacement[7, fixed, 1] = 0.1
    refused(f"node {fixed} of the fixed enthesis 1 moves at step 8", prescribed_displacement=displacement)
    with pytest.raises(MeshError, match="more than half a turn; enlarge radius_mm"):
        Slab(radius_mm=3.0)
