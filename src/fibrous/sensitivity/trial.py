"""One network under its loads, Eq. 2 fitted to its answer, and the law's stress on a path that it was not fitted to."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fibrous.deformation import LoadPath
from fibrous.fitting.hgo import Curves, fit_constants
from fibrous.material_point import WHOLE, along_path, stress_errors
from fibrous.materials.hgo import HGOStructureTensor
from fibrous.networks.engine import Engine
from fibrous.networks.path import follow

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Trial:
    """Eq. 2 fitted by energy to the loads of one network, and judged along another path of the same network.

    C2 in MPa, C3, r_squared and amplitude (largest λ_f fitted) of the fit
    stress_error : see `stress_error`
    points_used : states fitted
    states_failed, judged_states_failed : states without an equilibrium among those to be fitted, and along the path;
        both are left out
    """

    C2: float
    C3: float
    r_squared: float
    amplitude: float
    stress_error: float
    points_used: int
    states_failed: int
    judged_states_failed: int


def answers(engine: Engine, structure_tensor: Array, scale: float, paths: Sequence[LoadPath]) -> Curves:
    """What a network of structure tensor H, shape (3, 3), answers to paths of one length; `scale` in MPa as in follow.

    Raises NetworkError for a network that is a mechanism at rest.
    """
    gradients = np.array([path.gradients for path in paths])
    response = follow(engine, gradients, scale)
    return Curves(gradients, structure_tensor, response.strain_energy_density, response.cauchy_stress)


def tried(fitted: Curves, judged: Curves, largest_C3: float, slope_fit_below_r_squared: float) -> Trial:
    """Eq. 2 with the constants that fit the energies of `fitted`, against the network's stress along `judged`."""
    fit = fit_constants(
        fitted,
        "structure_tensor",
        "energy",
        tension_only=True,
        largest_C3=largest_C3,
        slope_fit_below_r_squared=slope_fit_below_r_squared,
    )
    return Trial(
        C2=fit.C2,
        C3=fit.C3,
        r_squared=fit.r_squared,
        amplitude=fit.largest_stretch,
        stress_error=stress_error(fit.C2, fit.C3, judged),
        points_used=fit.points_used,
        states_failed=int(np.isnan(fitted.strain_energy_density).sum()),
        judged_states_failed=int(np.isnan(judged.strain_energy_density).sum()),
    )


def stress_error(C2: float, C3: float, path: Curves) -> float:
    """RMS difference of Eq. 2's Cauchy stress from the network's as a part of the network's own RMS, Frobenius norm.

    C2 in MPa. Over the states after rest of the only deformation of `path` in which the network found an equilibrium;
    NaN where there is none, or where the fit gave no constants.
    """
    found = np.isfinite(path.strain_energy_density[0])
    found[0] = False
    if not found.any() or np.isnan(C2):
        return np.nan
    law = along_path(HGOStructureTensor(C2, C3, path.structure_tensor), path.deformation_gradient[0, found])
    return stress_errors(law.cauchy_stress, path.cauchy_stress[0, found])[WHOLE].relative_rms_error
