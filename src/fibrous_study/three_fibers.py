"""The three-fibre example of section 3.2 (Eq. 12, Fig. 7): a plane network small enough to solve by hand.

A unit square centred on the origin holds one free node at its centre and three fibres of reference length 1/2:
fibre 1 runs up to the middle of the top side, fibres 2 and 3 to the middles of the left and right sides. Two of
three equal lengths lie along x, so H = diag(2/3, 1/3) (Eq. 3). The sides move affinely with F = diag(λ_x, λ_y); the
ends of fibres 2 and 3 stay level at y = 0, a width λ_x apart, and the end of fibre 1 rises to λ_y/2. A fibre's force
is linear in its strain, f = k A (L/l − 1) with l = 1/2; here k A = 1.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from fibrous.deformation import averaged_stretch

Array = NDArray[np.float64]

REFERENCE_LENGTH = 0.5
ANCHORS = np.array([[0.0, 0.5], [-0.5, 0.0], [0.5, 0.0]])
STRUCTURE_TENSOR = np.diag([2.0 / 3.0, 1.0 / 3.0])


@dataclass(frozen=True)
class State:
    """The network stretched by λ = `stretch` along x, its free node at `node_height` on the line of symmetry.

    Lengths are in sides of the undeformed square.
    """

    stretch: float
    node_height: float

    @property
    def gradient(self) -> Array:
        """F = diag(λ, 1/λ), shape (2, 2)."""
        return np.diag([self.stretch, 1.0 / self.stretch])

    @property
    def anchors(self) -> Array:
        """Positions of the fibres' outer ends, shape (3, 2), in sides of the square."""
        return ANCHORS @ self.gradient.T

    @property
    def node(self) -> Array:
        """Position of the free node, shape (2,), in sides of the square."""
        return np.array([0.0, self.node_height])

    @property
    def lengths(self) -> Array:
        """L1, L2, L3, shape (3,), in sides of the square."""
        return np.linalg.norm(self.anchors - self.node, axis=1)

    @property
    def fiber_stretches(self) -> Array:
        """L/l of the three fibres, shape (3,)."""
        return self.lengths / REFERENCE_LENGTH

    @property
    def angle(self) -> float:
        """θ of Eq. 12 in degrees: between the downward direction and fibre 2 or 3; 90 where they lie level."""
        return float(np.degrees(np.arctan2(self.anchors[2, 0], self.node_height)))

    @property
    def mean_stretch(self) -> float:
        """Mean of the three fibres' stretches, the paper's λ̄."""
        return float(self.fiber_stretches.mean())

    @property
    def averaged_stretch(self) -> float:
        """λ_f = √(H : C), what the structure tensor makes of F alone."""
        return float(averaged_stretch(self.gradient, STRUCTURE_TENSOR))

    @property
    def vertical_force(self) -> float:
        """Force on the free node along y in units of k A, the right side of Eq. 12; 0 at equilibrium."""
        first, second, _ = self.fiber_stretches - 1.0
        return float(first - 2.0 * second * np.cos(np.radians(self.angle)))


def affine(stretch: float) -> State:
    """The state under F = diag(λ, 1/λ), λ = `stretch`, in which the free node moves with F, too: it stays at rest."""
    return State(stretch, 0.0)


def equilibrium(stretch: float) -> State:
    """The state under F = diag(λ, 1/λ), λ = `stretch`, in which the free node is in balance.

    Eq. 12 with the geometric constraints L2 cos θ + L1 = 1/(2 λ) and L2 sin θ = λ/2, the paper's for λ = 2/3, solved
    for the node's height L2 cos θ.

    >>> state = equilibrium(2 / 3)
    >>> [round(float(length), 3) for length in state.lengths[:2]], round(state.angle, 1)
    ([0.439, 0.456], 47.0)
    """
    # With the node a length l below the level of the sides' middles all fibres pull it up or not at all; with the node
    # at fibre 1's end that fibre pushes it down and the others, longer than l since F is isochoric, pull it down.
    height = brentq(
        lambda y: State(stretch, y).vertical_force, -REFERENCE_LENGTH, 0.5 / stretch, xtol=1e-15, rtol=1e-14
    )
    return State(stretch, float(height))
