"""How far the stress of a network inside a piece of tissue is from the tissue's (section 2.5)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from fibrous.materials.contract import Material

Array = NDArray[np.float64]


def stress_difference(network_stress: Array, matrix: Material, gradients: Array, tissue_stress: Array) -> float:
    """Largest difference of a component, MPa, of the network's and the matrix's Cauchy stress from the tissue's.

    All of shape (..., 3, 3) and in MPa but F; states without an equilibrium, NaN, are left out, and NaN is returned
    where nothing is left.
    """
    difference = np.abs(network_stress + matrix.stress(gradients) - tissue_stress)
    known = difference[np.isfinite(difference)]
    return float(known.max()) if known.size else np.nan
