"""Eq. 2 fitted anew to a part of the curves: to some of the loads, or up to one averaged stretch."""

from __future__ import annotations

import math

import numpy as np

from fibrous.audit.evidence import Constants, Curves
from fibrous.fitting import hgo

# λ_f of a state that a load was matched to may miss it by so much.
ROUNDING = 1e-9


def constants_up_to(curves: Curves, largest_C3: float, stretch: float = math.inf) -> Constants:
    """Constants of every network from the energies of all its loads, pooled, in states of λ_f up to `stretch`."""
    beyond = curves.averaged_stretch > stretch * (1.0 + ROUNDING)
    energy = np.where(beyond, np.nan, curves.strain_energy_density)
    fits = [
        hgo.fit_constants(
            hgo.Curves(curves.deformation_gradient[i], curves.structure_tensor[i], energy[i], curves.cauchy_stress[i]),
            "structure_tensor",
            "energy",
            tension_only=True,  # Eq. 2 is fitted where λ_f > 1, whatever this is
            largest_C3=largest_C3,
            slope_fit_below_r_squared=-math.inf,  # the energy, however poor the fit
        )
        for i in range(len(curves.names))
    ]
    H11, H22, H33 = np.einsum("nii->in", curves.structure_tensor)
    return Constants(
        names=curves.names,
        H11=H11,
        H22=H22,
        H33=H33,
        C2=np.array([fit.C2 for fit in fits]),
        C3=np.array([fit.C3 for fit in fits]),
        r_squared=np.array([fit.r_squared for fit in fits]),
        amplitude=np.array([fit.largest_stretch for fit in fits]),
    )
