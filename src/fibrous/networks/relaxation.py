"""Newton's method in eight lanes, compiled: from predictions to stable equilibria, or to word that there are none near.

What `Engine.relax` promises is done here, in one function that holds Python's lock at no time. Lanes go step by step
together, since a factor serves all eight; what each of them is at stands in `_Lanes`.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from fibrous.compiled import njit
from fibrous.networks.elimination import factorize, solve
from fibrous.networks.fiber_law import Fibers
from fibrous.networks.guard import FIRST_SHARE, FLAT, LARGEST_MOVE, SHORTEST, SUFFICIENT
from fibrous.networks.kernels import Topology, assemble, begin_step, dot, pull, soften, spread_lane, stored_energy
from fibrous.networks.lanes import LANES, load, store

Array = NDArray[np.float64]
Count = NDArray[np.int64]
Mask = NDArray[np.bool_]

#: What became of a lane.
RUNNING, CONVERGED, STUCK = range(3)
# A factor is used again where the last step shrank the residual at least to this part, and this many steps as good as
# the last would reach the tolerance. Rates ∂u/∂F that come from such a factor miss by as much, a tangent by its square.
SHARP = 0.01
REUSED = 3
# Least fall of the residual in a step of the quick way.
FALL = 0.5
# What joins the large loops becomes a part of what calls it: else each of them would be compiled anew at every level.
_joined = njit(nogil=True, error_model="numpy", inline="always")
# Shares of negative tension that are left out of an indefinite Hessian, tried side by side.
_SHARES = np.minimum(FIRST_SHARE * 3.0 ** np.arange(LANES), 1.0)[None]


class Space(NamedTuple):
    """Arrays in which eight networks of n interior nodes are solved, all with lanes behind.

    vectors, stiffness : end-to-end vectors, shape (fibers, 3), and the fibres' blocks, (fibers, 2); see `kernels.pull`
    residual : shape (n + 1, 3); factor : of the Hessians, (blocks, 9)
    factored : u at which the factor was made last, except on the quick way, shape (n, 3)
    right : right side and solution of a step, shape (n, 3, 1)
    start : where steps began, shape (n + 1, 3), with a last row of zeros; move : their full length, (n, 3)
    lane_vectors, lane_stiffness, lane_softened, lane_factor, lane_right : the same of a single lane, in all eight
    """

    vectors: Array
    stiffness: Array
    residual: Array
    factor: Array
    factored: Array
    right: Array
    start: Array
    move: Array
    lane_vectors: Array
    lane_stiffness: Array
    lane_softened: Array
    lane_factor: Array
    lane_right: Array


class _Lanes(NamedTuple):
    """What the lanes are at; every array has shape (8,) but those of shape (1, 8) that compiled loops fill.

    status : `RUNNING`, `CONVERGED` or `STUCK`; steps : begun; indefinite : Hessians met that were not definite
    norm, bound : ‖r‖, and the least that is out of balance; before : ‖r‖ where the last step began
    good, finite : whether that is in balance, and whether it is any number
    ready : whether a step is to begin; trying : whether one is being tried
    definite : whether the factor in the space is that of the lane's Hessian as it is, with nothing left out
    steady : whether that Hessian is so by enough for those near by
    sound : whether the step at hand began at a definite one; blended : whether the next one must leave out tension
    fraction : what is taken of the step; slope : of its energy where it began, (1, 8); start_energy : there, or NaN
    """

    status: Count
    steps: Count
    indefinite: Count
    norm: Array
    bound: Array
    before: Array
    good: Mask
    finite: Mask
    ready: Mask
    trying: Mask
    definite: Mask
    steady: Mask
    sound: Mask
    blended: Mask
    fraction: Array
    slope: Array
    start_energy: Array


@njit(nogil=True, error_model="numpy")
def relax(
    topology: Topology,
    fibers: Fibers,
    space: Space,
    F: Array,
    u: Array,
    tolerance: float,
    limit: int,
    quick: bool,
    least_pivot: float,
) -> tuple[Count, Count, Count, Array]:
    """Status, steps, indefinite Hessians and ‖r‖/(√n max(1, f_rms)), all of shape (8,); see `Engine.relax`."""
    size = len(topology.starts) - 1
    lanes = _lanes()
    space.start[size] = 0.0
    factored = False
    while True:
        balance(topology, fibers, space, F, u, lanes.norm, lanes.bound)
        for q in range(LANES):
            lanes.bound[q] *= tolerance
            lanes.good[q] = lanes.norm[q] <= lanes.bound[q]
            lanes.finite[q] = np.isfinite(lanes.norm[q] + lanes.bound[q])
        if quick:
            _judge_quickly(lanes)
        else:
            _judge(topology, fibers, space, F, u, lanes)
        if _choose(lanes, limit, quick, factored):
            _factorize(topology, space, u, lanes, quick, least_pivot)
            factored = True
        if not (lanes.status == RUNNING).any():
            break
        if lanes.ready.any():
            _step(topology, space, u, lanes, quick, least_pivot)
    for q in range(LANES):
        scale = 1e-300 if lanes.bound[q] < 1e-300 else lanes.bound[q]
        lanes.norm[q] = tolerance * lanes.norm[q] / scale
    return lanes.status, lanes.steps, lanes.indefinite, lanes.norm


@njit(nogil=True, error_model="numpy")
def balance(topology: Topology, fibers: Fibers, space: Space, F: Array, u: Array, norm: Array, scale: Array) -> None:
    """Forces at F and u into the space; fill ‖r‖ and √n max(1, f_rms), shape (8,)."""
    sums = np.empty((2, LANES))
    pull(topology, fibers, F, u, space.vectors, space.stiffness, space.residual, sums)
    size, count = len(topology.starts) - 1, len(fibers.rest_lengths)
    for q in range(LANES):
        norm[q] = np.sqrt(sums[0, q])
        mean = np.sqrt(sums[1, q] / count)
        scale[q] = np.sqrt(size) * (1.0 if mean < 1.0 else mean)


@_joined
def hessian(
    topology: Topology, vectors: Array, stiffness: Array, factor: Array, least_pivot: float, slack: Array
) -> None:
    """The factors of Hessians with the fibres' blocks; see `elimination.factorize`."""
    assemble(topology, vectors, stiffness, factor)
    factorize(topology.starts, topology.rows, topology.leaders, factor, least_pivot, slack)


@njit(nogil=True, error_model="numpy")
def _lanes() -> _Lanes:
    """All lanes before they begin."""
    return _Lanes(
        np.full(LANES, RUNNING),
        np.zeros(LANES, dtype=np.int64),
        np.zeros(LANES, dtype=np.int64),
        np.empty(LANES),
        np.empty(LANES),
        np.full(LANES, np.inf),
        np.zeros(LANES, dtype=np.bool_),
        np.zeros(LANES, dtype=np.bool_),
        np.zeros(LANES, dtype=np.bool_),
        np.zeros(LANES, dtype=np.bool_),
        np.zeros(LANES, dtype=np.bool_),
        np.zeros(LANES, dtype=np.bool_),
        np.zeros(LANES, dtype=np.bool_),
        np.zeros(LANES, dtype=np.bool_),
        np.ones(LANES),
        np.zeros((1, LANES)),
        np.full(LANES, np.nan),
    )


@njit(nogil=True, error_model="numpy")
def _judge_quickly(lanes: _Lanes) -> None:
    """Lanes whose step did not bring the residual down are stuck."""
    for q in range(LANES):
        if lanes.trying[q] and not (lanes.good[q] or lanes.norm[q] <= FALL * lanes.before[q]):
            lanes.status[q] = STUCK
        lanes.trying[q] = False


@njit(nogil=True, error_model="numpy")
def _judge(topology: Topology, fibers: Fibers, space: Space, F: Array, u: Array, lanes: _Lanes) -> None:
    """Accept or shorten the steps that are being tried.

    With a definite Hessian a step is accepted without asking the energy, whose digits end sooner than the residual's,
    where the slope along the step has fallen to a part of its first value; else where it lowers the energy enough.
    """
    if not lanes.trying.any():
        return
    size, slope = len(topology.starts) - 1, np.empty((1, LANES))
    dot(size, space.move, space.residual, slope)
    for q in range(LANES):
        if not lanes.trying[q] or lanes.status[q] != RUNNING:
            continue
        flat = lanes.good[q] or abs(slope[0, q]) <= FLAT * abs(lanes.slope[0, q])
        lanes.trying[q] = False
        if (lanes.finite[q] and lanes.sound[q] and flat) or _lower(topology, fibers, space, F, u, lanes, q):
            continue
        lanes.fraction[q] *= 0.5
        if lanes.fraction[q] <= SHORTEST:
            lanes.status[q] = STUCK
        for a in range(size):
            for i in range(3):
                u[a, i, q] = space.start[a, i, q] + lanes.fraction[q] * space.move[a, i, q]
        lanes.trying[q] = True


@njit(nogil=True, error_model="numpy")
def _lower(topology: Topology, fibers: Fibers, space: Space, F: Array, u: Array, lanes: _Lanes, q: int) -> bool:
    """Whether the step of a lane lowers its energy by enough of what the slope promises."""
    if np.isnan(lanes.start_energy[q]):
        lanes.start_energy[q] = stored_energy(topology, fibers, F, space.start, q)
    energy = stored_energy(topology, fibers, F, u, q)
    promised = SUFFICIENT * lanes.fraction[q] * lanes.slope[0, q]
    return energy < lanes.start_energy[q] + promised


@njit(nogil=True, error_model="numpy")
def _choose(lanes: _Lanes, limit: int, quick: bool, factored: bool) -> bool:
    """Settle what becomes of lanes between two steps, and which are ready for one; whether that needs a new factor."""
    others = False
    for q in range(LANES):
        good = lanes.good[q]
        lanes.ready[q] = lanes.status[q] == RUNNING and not lanes.trying[q]
        if not lanes.ready[q]:
            others |= lanes.status[q] == RUNNING
        elif not lanes.finite[q] or (lanes.steps[q] == limit and not good):
            lanes.status[q] = STUCK
        elif good and lanes.definite[q] and lanes.steady[q] and lanes.norm[q] / lanes.before[q] <= SHARP:
            lanes.status[q] = CONVERGED
        else:
            others |= not good
        lanes.ready[q] &= lanes.status[q] == RUNNING
    renewed = False
    for q in range(LANES):
        # Lanes in balance wait for the others: a single factor tells of all whether they are stable.
        if not quick and others and lanes.good[q]:
            lanes.ready[q] = False
        shrunk = lanes.norm[q] / lanes.before[q]
        reusable = lanes.definite[q] and shrunk <= SHARP and lanes.norm[q] * shrunk**REUSED <= lanes.bound[q]
        renewed |= lanes.ready[q] and not (factored and reusable and not lanes.good[q])
    return renewed


@_joined
def _factorize(topology: Topology, space: Space, u: Array, lanes: _Lanes, quick: bool, least_pivot: float) -> None:
    """Factors of all lanes' Hessians as they are, and what they tell of those that are ready."""
    slack = np.empty((2, LANES))
    hessian(topology, space.vectors, space.stiffness, space.factor, least_pivot, slack)
    if not quick:
        for a in range(len(space.factored)):
            for i in range(3):
                store(space.factored, (a, i), load(u, (a, i)))
    for q in range(LANES):
        # What was factorised of a lane in the midst of a step is a point that it has left, and tells nothing of it.
        lanes.definite[q] = slack[0, q] > 0.0 and not lanes.trying[q]
        lanes.steady[q] = slack[1, q] > 0.0
        ready, good, definite = lanes.ready[q], lanes.good[q], lanes.definite[q]
        if ready and good and definite:
            lanes.status[q] = CONVERGED
        elif lanes.status[q] == CONVERGED and not definite:
            # What was believed to be stable may turn out not to be.
            lanes.status[q] = STUCK
        elif ready and not definite:
            lanes.indefinite[q] += 1
            if good or quick:
                # A stationary point that is no minimum is left by the guard.
                lanes.status[q] = STUCK
        lanes.ready[q] &= lanes.status[q] == RUNNING
        lanes.blended[q] = lanes.ready[q] and not definite


@_joined
def _step(topology: Topology, space: Space, u: Array, lanes: _Lanes, quick: bool, least_pivot: float) -> None:
    """Newton's step of the lanes that are ready."""
    size = len(topology.starts) - 1
    for a in range(size):
        for i in range(3):
            store(space.right, (a, i, 0), load(space.residual, (a, i)))
    solve(topology.starts, topology.rows, space.factor, space.right)
    for q in range(LANES):
        if lanes.blended[q] and not blend(topology, space, least_pivot, q):
            lanes.status[q], lanes.ready[q] = STUCK, False
        lanes.blended[q] = False
    ready, farthest = np.zeros((1, LANES)), np.empty((1, LANES))
    for q in range(LANES):
        if lanes.ready[q]:
            ready[0, q] = 1.0
    begin_step(space.residual, space.right, ready, LARGEST_MOVE, u, space.start, space.move, lanes.slope, farthest)
    for q in range(LANES):
        if lanes.ready[q]:
            if quick and farthest[0, q] > LARGEST_MOVE:
                lanes.status[q] = STUCK
            lanes.sound[q] = lanes.definite[q]
            lanes.fraction[q], lanes.start_energy[q] = 1.0, np.nan
            lanes.steps[q] += 1
            lanes.trying[q] = True
            lanes.before[q] = lanes.norm[q]


@_joined
def blend(topology: Topology, space: Space, least_pivot: float, lane: int) -> bool:
    """Put K⁻¹ r of a lane into `space.right`, where K lacks the least of some fractions of negative tension.

    The eight lanes try the fractions side by side. Returns whether one of them makes K positive definite.
    """
    size, slack = len(topology.starts) - 1, np.empty((2, LANES))
    spread_lane(lane, space.vectors, space.lane_vectors)
    spread_lane(lane, space.stiffness, space.lane_stiffness)
    spread_lane(lane, space.residual, space.lane_right.reshape(size, 3, LANES))
    soften(space.lane_vectors, space.lane_stiffness, _SHARES, space.lane_softened)
    hessian(topology, space.lane_vectors, space.lane_softened, space.lane_factor, least_pivot, slack)
    solve(topology.starts, topology.rows, space.lane_factor, space.lane_right)
    for q in range(LANES):
        if slack[0, q] > 0.0:
            space.right[:, :, 0, lane] = space.lane_right[:, :, 0, q]
            return True
    return False
