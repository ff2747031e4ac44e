"""One network under its loads, Eq. 2 fitted to its answer, and the law's stress on a path that it was not fitted to."""

from __future__ import annotations

from typing import Any

import numpy as np

from fibrous.comparison import WHOLE, stress_errors
from fibrous.curves import Curves
from fibrous.fitting.hgo import fit_hgo
from fibrous.materials.hgo import HGOStructureTensor


def trial(fitted: Curves, judged: Curves, largest_C3: float, slope_fit_below_r_squared: float) -> dict[str, Any]:
    """Eq. 2 fitted by energy to the loads `fitted` of one network, and its error along `judged`: columns of a row.

    States without an equilibrium are left out of both and counted. For `stress_error` see there.
    """
    fit = fit_hgo(fitted, largest_C3=largest_C3, slope_fit_below_r_squared=slope_fit_below_r_squared)
    return {
        "C2_MPa": fit.C2,
        "C3": fit.C3,
        "r_squared": fit.r_squared,
        "stress_error": stress_error(fit.C2, fit.C3, judged),
        "lambda_f_max": fit.largest_stretch,
        "points_used": fit.points_used,
        "states_failed": int((~fitted.converged).sum()),
        "judged_states_failed": int((~judged.converged).sum()),
    }


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
