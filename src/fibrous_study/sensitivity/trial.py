"""One network under its loads, Eq. 2 fitted to its answer, and the law's stress on a path that it was not fitted to."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fibrous.comparison import WHOLE, stress_errors
from fibrous.curves import Curves
from fibrous.fitting.hgo import fit_hgo
from fibrous.materials.hgo import HGOStructureTensor

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


def tried(fitted: Curves, judged: Curves, largest_C3: float, slope_fit_below_r_squared: float) -> Trial:
    """Eq. 2 with the constants that fit the energies of `fitted`, against the network's stress along `judged`."""
    fit = fit_hgo(fitted, largest_C3=largest_C3, slope_fit_below_r_squared=slope_fit_below_r_squared)
    return Trial(
        C2=fit.C2,
        C3=fit.C3,
        r_squared=fit.r_squared,
        amplitude=fit.largest_stretch,
        stress_error=stress_error(fit.C2, fit.C3, judged),
        points_used=fit.points_used,
        states_failed=int((~fitted.converged).sum()),
        judged_states_failed=int((~judged.converged).sum()),
    )


def stress_error(C2: float, C3: float, path: Curves) -> float:
    """RMS difference of Eq. 2's Cauchy stress from the network's as a part of the network's own RMS, Frobenius norm.

    C2 in MPa. Over the states after rest of the only load of `path` in which its only network found an equilibrium;
    NaN where there is none, or where the fit gave no constants.
    """
    used = path.converged[0, 0]
    used[0] = False
    if not used.any() or np.isnan(C2):
        return np.nan
    stress = HGOStructureTensor(C2, C3, path.structure_tensor[0]).stress(path.deformation_gradient[0, 0, used])
    return stress_errors(stress, path.cauchy_stress[0, 0, used])[WHOLE].relative_rms_error
