"""Eq. 2 fitted anew to a part of the curves: to some of the loads, or up to one averaged stretch."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from fibrous.curves import Curves
from fibrous.fitting.hgo import fit_hgo
from fibrous_study.audit.evidence import Constants

# λ_f of a state that a load was matched to may miss it by so much.
ROUNDING = 1e-9


def constants_up_to(curves: Curves, largest_C3: float, stretch: float = math.inf) -> Constants:
    """Constants of every network from the energies of all its loads, pooled, in states of λ_f up to `stretch`."""
    beyond = curves.averaged_stretch > stretch * (1.0 + ROUNDING)
    part = replace(curves, strain_energy_density=np.where(beyond, np.nan, curves.strain_energy_density))
    fits = [
        # Eq. 2 by the energy, however poor the fit.
        fit_hgo(part.network(i), largest_C3=largest_C3)
        for i in range(len(curves.names))
    ]
    return Constants(
        names=curves.names,
        **dict(zip(("H11", "H22", "H33"), np.einsum("nii->in", curves.structure_tensor), strict=True)),
        **{name: np.array([getattr(fit, name) for fit in fits]) for name in ("C2", "C3", "r_squared")},
        amplitude=np.array([fit.largest_stretch for fit in fits]),
    )
