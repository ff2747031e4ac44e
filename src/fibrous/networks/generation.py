"""Networks of a wanted alignment and volume fraction (sections 2.3 and 2.4, Eqs. 3 and 5).

Delaunay networks: a random cloud is triangulated once; its edges are the fibres. The cloud is stretched until the
fibres inside a cube have the target structure tensor, and the cube is sized until they have the target volume
fraction. Both are root-findings on one triangulation, so a network follows from its seed and target alone.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import brentq, root
from scipy.spatial import Delaunay

from fibrous.errors import NetworkError, naming
from fibrous.networks.fiber_law import FiberLaw
from fibrous.networks.geometry import Geometry
from fibrous.networks.network import Network

Array = NDArray[np.float64]

# Spacings of the cloud around the cube: farther from its hull than the longest edge of a Delaunay tetrahedron inside.
MARGIN = 3.0
# A node nearer to a face than this many edges is put on the face: the piece between them would be shorter than a fifth
# of the study's fibre radius, and its stiffness, which grows as 1/length, would rule Newton's method. Sizing the cube
# once more moves nodes by less than this again. Pieces that join two faces may be shorter: they carry no unknown.
SNAP = 1e-3
# Share of an edge below which a piece of it inside the cube is rounding and has no length.
ROUNDING = 1e-12
# Mean length of fibre per unit volume of a Poisson-Delaunay tessellation of unit density: 7.768 edges a node of mean
# length 1.237. Only the size of the first cloud follows from it, not the network.
LENGTH_DENSITY = 9.6

_NODES, _WEIGHTS = np.polynomial.legendre.leggauss(32)


def expected_structure_tensor(stretches: Array) -> Array:
    """Eigenvalues of the structure tensor of an isotropic cloud stretched by diag(s), shape (3,), sum 1.

    H_i = ∫ s_i² n_i² / |s n| dn / ∫ |s n| dn over the unit sphere: an edge along n becomes s n, and weighs its length.
    `stretches` are s, shape (3,).

    >>> expected_structure_tensor(np.ones(3)).round(12)
    array([0.33333333, 0.33333333, 0.33333333])
    """
    z = 0.5 * (_NODES + 1.0)
    angle = 0.25 * np.pi * (_NODES + 1.0)
    ring = np.sqrt(1.0 - z**2)[:, None]
    squares = np.stack(
        [
            (ring * np.cos(angle)) ** 2,
            (ring * np.sin(angle)) ** 2,
            np.broadcast_to(z[:, None] ** 2, (z.size, angle.size)),
        ]
    )
    squares = squares * (np.asarray(stretches, dtype=float) ** 2)[:, None, None]
    length = np.sqrt(squares.sum(axis=0))
    weights = _WEIGHTS[:, None] * _WEIGHTS
    return (weights * squares / length).sum(axis=(1, 2)) / (weights * length).sum()


def stretches_for(eigenvalues: Array) -> Array:
    """Volume-preserving stretches s, shape (3,), whose expected structure tensor has these eigenvalues, shape (3,).

    Raises NetworkError where the eigenvalues are not positive or no stretch gives them.
    """
    eigenvalues = np.asarray(eigenvalues, dtype=float)
    if (eigenvalues <= 0.0).any():
        raise NetworkError(
            f"no cloud can be stretched to the structure tensor eigenvalues {eigenvalues.round(4).tolist()}"
        )

    def excess(logarithms: Array) -> Array:
        stretches = np.exp([logarithms[0], logarithms[1], -logarithms.sum()])
        return (expected_structure_tensor(stretches) - eigenvalues)[:2]

    start = np.log(eigenvalues) - np.log(eigenvalues).mean()
    found = root(excess, start[:2], tol=1e-12)
    if np.abs(found.fun).max() > 1e-9:
        raise NetworkError(
            f"no stretch of a cloud gives the structure tensor eigenvalues {eigenvalues.round(4).tolist()}"
        )
    return np.exp([found.x[0], found.x[1], -found.x.sum()])


def stretch_tensor_for(target: Array) -> Array:
    """Symmetric stretch tensor, shape (3, 3), det 1, that brings an isotropic cloud to `target` in expectation."""
    eigenvalues, directions = np.linalg.eigh(target)
    return (directions * stretches_for(eigenvalues)) @ directions.T


def alignment_targets(numbers: NDArray[np.int64], seed: int, H11: tuple[float, float], smallest_H: float) -> Array:
    """Target structure tensors diag(H11, H22, H33) that cover the admissible alignments evenly, shape (n, 3, 3).

    Point k of a scrambled Halton sequence is mapped, area-preserving, onto H11[0] ≤ H11 ≤ H11[1] with H22 and H33
    no less than `smallest_H`; it depends on k and the seed, not on how many networks there are.
    """
    from scipy.stats import qmc  # here, since its import takes longer than a network and laws import this module

    points = qmc.Halton(2, scramble=True, rng=seed).random(int(numbers.max()) + 1)[numbers]
    least, most = H11
    room = 1.0 - 2.0 * smallest_H
    # H22 has the room (room − H11), so the area left of H11 is a parabola; its inverse spreads the points evenly.
    first = room - np.sqrt((room - least) ** 2 - points[:, 0] * ((room - least) ** 2 - (room - most) ** 2))
    second = smallest_H + points[:, 1] * (room - first)
    diagonals = np.stack([first, second, 1.0 - first - second], axis=1)
    return np.einsum("ki,ij->kij", diagonals, np.eye(3))


def network_seed(ensemble_seed: int, ensemble: str, number: int) -> int:
    """Seed of network `number` of an ensemble: a function of the three alone."""
    words = [ensemble_seed, number, *ensemble.encode()]
    return int(np.random.SeedSequence(words).generate_state(1, np.uint64)[0] >> np.uint64(1))


def delaunay(
    H: ArrayLike, fiber: FiberLaw, volume_fraction: float, edge_um: float, seed: int, tolerance: float = 0.01
) -> Network:
    """A Delaunay network of an alignment and a volume fraction.

    Parameters
    ----------
    H : structure tensor, shape (3, 3), positive definite and of trace 1, or its diagonal, shape (3,)
    fiber : law, modulus and radius of all fibres
    volume_fraction : φ, met to rounding
    edge_um : edge χ of the cube
    seed : of the cloud of points
    tolerance : largest |H − target| over the components of the network's own H

    Raises NetworkError where H cannot be met or the cube would hold too few nodes.

    >>> from fibrous import Fiber
    >>> fiber = Fiber(modulus_MPa=10.0, nonlinearity=2.5, radius_um=0.1)
    >>> delaunay((0.5, 0.3, 0.2), fiber, volume_fraction=0.04, edge_um=8.0, seed=1, tolerance=0.02)
    <Network: 257 fibres, 19 interior nodes, H = (0.50, 0.30, 0.20), φ = 0.040>
    """
    target = _target(H)
    for name, value in (("volume_fraction", volume_fraction), ("edge_um", edge_um), ("tolerance", tolerance)):
        if not 0.0 < value < np.inf:
            raise NetworkError(f"{name} is {value}; it must be a number above 0")
    if np.ndim(fiber.section):
        raise NetworkError("fiber.section must be a number: how many fibers there will be is not known")
    # Eq. 5 solved for the length, in edges.
    total_length = volume_fraction * edge_um**2 / (np.pi * fiber.radius_um**2) / float(fiber.section)
    geometry = _aligned(target, total_length, seed, tolerance)
    with naming("generated network"):
        return Network(**vars(geometry), fiber=fiber, edge_um=edge_um)


def _target(H: ArrayLike) -> Array:
    """H as a tensor, shape (3, 3). Raises NetworkError for what is no structure tensor."""
    target = np.asarray(H, dtype=float)
    if target.shape == (3,):
        target = np.diag(target)
    if target.shape != (3, 3) or not np.allclose(target, target.T) or not abs(np.trace(target) - 1.0) < 1e-6:
        raise NetworkError(
            f"H is {np.asarray(H).tolist()}; it must be three numbers of sum 1, or a symmetric 3 × 3 tensor of trace 1"
        )
    return target


def _aligned(target: Array, total_length: float, seed: int, tolerance: float) -> Geometry:
    """Fibres of the total length, in edges, and of the target's alignment to within the tolerance."""
    cube = np.sqrt(total_length / LENGTH_DENSITY)
    if cube < 1.5:
        raise NetworkError(
            f"a total fiber length of {total_length:.3g} edges leaves fewer than four nodes in the cube; "
            "raise the volume fraction or the edge length, or thin the fibers"
        )
    stretch = stretch_tensor_for(target)
    cloud, edges = _triangulated(stretch, cube, np.random.default_rng(seed))
    asked, best_error = target, np.inf
    for _ in range(20):
        try:
            geometry = _cut(cloud @ stretch_tensor_for(asked), edges, total_length, cube)
        except NetworkError:
            if best_error == np.inf:
                raise
            break
        error = geometry.structure_tensor - target
        best_error = min(best_error, float(np.abs(error).max()))
        if best_error <= tolerance:
            return geometry
        asked = asked - error
        asked = asked / np.trace(asked)
    raise NetworkError(
        f"the structure tensor {np.diag(target).round(4).tolist()} is missed by {best_error:.2g}, more than "
        f"the tolerance {tolerance:g}; raise it or enlarge the cube"
    )


def _triangulated(stretch: Array, cube: float, generator: np.random.Generator) -> tuple[Array, NDArray[np.int64]]:
    """Points of unit density around the cube's preimage, and the edges of their Delaunay tetrahedra."""
    half_cube = 0.5 * 1.15 * cube
    corners = half_cube * np.array(np.meshgrid(*[(-1.0, 1.0)] * 3)).reshape(3, -1).T
    half = np.abs(corners @ np.linalg.inv(stretch)).max(axis=0) + MARGIN
    cloud = generator.uniform(-half, half, size=(int(np.ceil(8.0 * half.prod())), 3))
    # Where the stretch is oblique, much of that box is farther than the margin from the planes of the preimage's faces.
    cloud = cloud[(np.abs(cloud @ stretch) <= half_cube + MARGIN * np.linalg.norm(stretch, axis=0)).all(axis=1)]
    corner = Delaunay(cloud).simplices.astype(np.int64)
    first, second = corner[:, [0, 0, 0, 1, 1, 2]], corner[:, [1, 2, 3, 2, 3, 3]]
    # A pair as one number: whole numbers sort far faster than rows.
    pairs = np.unique(np.minimum(first, second) * len(cloud) + np.maximum(first, second))
    return cloud, np.stack(np.divmod(pairs, len(cloud)), axis=1)


def _cut(points: Array, edges: NDArray[np.int64], total_length: float, cube: float) -> Geometry:
    """The edges inside a cube about the origin, scaled to the unit cube, with the cube sized to the total length."""
    near = _solve(lambda size: _clipped_length(points / size, edges) - total_length, cube)
    snapped = _snapped(points / near)
    size = _solve(lambda size: _clipped_length(_on_faces(points / size, snapped), edges) - total_length, near)
    return _clipped(_on_faces(points / size, snapped), edges)


def _solve(excess: Callable[[float], float], near: float) -> float:
    # Fibres of a strongly stretched cloud are longer than those of the cloud that sized the first guess.
    for widening in (1.05, 1.1, 1.2, 1.3, 1.6, 2.5):
        if excess(near / widening) < 0.0 < excess(near * widening):
            size = float(brentq(excess, near / widening, near * widening, xtol=1e-15, rtol=1e-15))
            if abs(excess(size)) < 1e-9:
                return size
    raise NetworkError("no size of the cube gives the volume fraction; change the seed or the alignment")


def _snapped(points: Array) -> NDArray[np.int64]:
    """Face plane, as ±1, onto which each coordinate of a node is put; 0 for coordinates that stay. Shape (nodes, 3).

    Nodes outside count as well: between a node on a face and one that passes the face's plane as the cube is sized, a
    fibre would be all in or all out, and the length inside the cube would jump.
    """
    return np.where(np.abs(np.abs(points) - 0.5) < SNAP, np.sign(points), 0.0).astype(np.int64)


def _on_faces(points: Array, snapped: NDArray[np.int64]) -> Array:
    return np.where(snapped != 0, 0.5 * snapped, points)


def _pieces(points: Array, edges: NDArray[np.int64]) -> tuple[NDArray[np.int64], Array, Array, Array, Array]:
    """The edges that the unit cube cuts or holds: which, their starts and vectors, and where they enter and leave it.

    Where is a fraction of the edge's length, 0 or 1 at an end inside. Shapes (pieces,), and (pieces, 3) for the starts
    and vectors.
    """
    # One bit a face: an edge with both ends beyond one face, as most are, misses the cube.
    beyond = np.packbits(np.hstack([points < -0.5, points > 0.5]), axis=1)[:, 0]
    near = np.flatnonzero(beyond[edges[:, 0]] & beyond[edges[:, 1]] == 0)
    start = points[edges[near, 0]]
    vector = points[edges[near, 1]] - start
    with np.errstate(divide="ignore", invalid="ignore"):
        low, high = (-0.5 - start) / vector, (0.5 - start) / vector
    # A NaN is an edge that lies in a face: that face does not cut it. Copies, as NumPy reduces rows of three slowly.
    enter = np.fmax.reduce(np.minimum(low, high).T.copy(), initial=0.0)
    leave = np.fmin.reduce(np.maximum(low, high).T.copy(), initial=1.0)
    inside = np.flatnonzero(leave - enter > ROUNDING)
    return near[inside], start[inside], vector[inside], enter[inside], leave[inside]


def _clipped_length(points: Array, edges: NDArray[np.int64]) -> float:
    _, _, vector, enter, leave = _pieces(points, edges)
    return float(((leave - enter) * np.linalg.norm(vector, axis=1)).sum())


def _clipped(points: Array, edges: NDArray[np.int64]) -> Geometry:
    """The pieces inside the unit cube: cut ends and nodes on faces are boundary nodes."""
    crossing, start, vector, enter, leave = _pieces(points, edges)
    count = len(points)
    ends = edges[crossing]
    cut_in, cut_out = np.flatnonzero(enter > 0.0), np.flatnonzero(leave < 1.0)
    ends[cut_in, 0] = count + np.arange(len(cut_in))
    ends[cut_out, 1] = count + len(cut_in) + np.arange(len(cut_out))
    position = np.concatenate(
        [
            points,
            _to_face(start[cut_in] + enter[cut_in, None] * vector[cut_in]),
            _to_face(start[cut_out] + leave[cut_out, None] * vector[cut_out]),
        ]
    )
    used, ends = np.unique(ends, return_inverse=True)
    position = position[used]
    boundary = (used >= count) | (np.abs(position) == 0.5).any(axis=1)
    return Geometry(position, boundary, ends.reshape(-1, 2).astype(np.int64))


def _to_face(position: Array) -> Array:
    """Cut points, with the coordinate that rounding left beside its face put on it."""
    nearest = np.argmax(np.abs(position), axis=1)
    row = np.arange(len(position))
    position[row, nearest] = np.copysign(0.5, position[row, nearest])
    return position
