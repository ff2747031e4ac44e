"""Fibres of the study's size, and what forces in kA are as stresses with them."""

import numpy as np

from fibrous.networks.fiber_law import BucklingFiber, Fiber


def exponential(nonlinearity: float | np.ndarray = 2.5, **numbers) -> Fiber:
    return Fiber(**{"modulus_MPa": 10.0, "radius_um": 0.1, "nonlinearity": nonlinearity} | numbers)


def buckling(compressive: float | np.ndarray, **numbers) -> BucklingFiber:
    return BucklingFiber(**{"modulus_MPa": 10.0, "radius_um": 0.1, "compressive": compressive} | numbers)


def stress_scale(modulus_MPa: float, radius_um: float, edge_um: float) -> float:
    """k A/χ², MPa."""
    return modulus_MPa * np.pi * radius_um**2 / edge_um**2
