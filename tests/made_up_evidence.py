"""Curves and constants made up so that a statement of the paper is true, half true or false of them."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from workflow_runs import job_of

from fibrous.curves import Curves
from fibrous.deformation import Load, averaged_stretch, load_path, matching_magnitude
from fibrous.fitting.hgo import strain_energy
from fibrous_study.audit.checks import CHECKS
from fibrous_study.audit.constants import Fits
from fibrous_study.audit.evidence import Constants, Evidence
from fibrous_study.audit.verdict import Finding, Thresholds, Verdict
from fibrous_study.audit.wording import printed_numbers
from fibrous_study.config import loaded
from fibrous_study.paper import section

REPRODUCED, PARTLY, NOT, CONTRADICTED, UNKNOWN = Verdict
PRINTED = {entry["id"]: printed_numbers(entry) for entry in section("statements")}
CONFIG = job_of(loaded(), "claims").params["config"]
THRESHOLDS = Thresholds(**CONFIG["claims"])
LOADS = ("x_uniaxial", "xy_biaxial", "xz_biaxial", "xy_shear", "xz_shear", "yz_shear")
SETS = {"with_xz": LOADS[:5], "with_yz": (*LOADS[:4], "yz_shear")}
CASE = np.diag([0.69, 0.21, 0.10])


def evidence(**results: Any) -> Evidence:
    """The study's config with these results, and what else is given in place of what the config says."""
    return Evidence(CONFIG, **{"load_sets": SETS, "case_name": "case", **results})


def found(statement: str, printed: Mapping[str, Any] | None = None, **results: Any) -> Finding:
    """What the check of a statement gives on `results`, with other printed numbers where these are given."""
    return CHECKS[statement].judge(evidence(**results), PRINTED[statement] | (printed or {}))


def verdict_of(statement: str, printed: Mapping[str, Any] | None = None, **results: Any) -> Verdict:
    """The verdict on a statement."""
    return found(statement, printed, **results).verdict


def value_of(finding: Finding, name: str, load_set: str = "") -> float:
    """A number behind a verdict, which must be there once."""
    (value,) = (one.value for one in finding.numbers if (one.name, one.load_set) == (name, load_set))
    return value


def curves(
    factors: Mapping[str, float] | None = None,
    stretch: float = 1.8,
    tensors: np.ndarray = CASE,
    orientation: Mapping[str, float] | None = None,
    iterations: int = 6,
    steps: int = 20,
) -> Curves:
    """Two networks, of one tensor or of two, whose W is that of Eq. 2, C2 = 0.2 MPa, C3 = 0.5, times a factor a load.

    Loads end at the λ_f of x-stretch `stretch`; `orientation` is h's largest eigenvalue at their ends.
    """
    tensors = np.broadcast_to(tensors, (2, 3, 3))
    rows = []
    for tensor in tensors:
        target = float(averaged_stretch(Load.parse("x_uniaxial").deformation_gradient(stretch), tensor))
        ends = [matching_magnitude(Load.parse(load), tensor, target, 20.0)[0] for load in LOADS]
        rows.append([load_path(Load.parse(load), end, steps) for load, end in zip(LOADS, ends, strict=True)])
    magnitude = np.array([[one[0] for one in row] for row in rows])
    gradient = np.array([[one[1] for one in row] for row in rows])
    mean = np.array([averaged_stretch(one, tensor) for one, tensor in zip(gradient, tensors, strict=True)])
    of_load = np.array([(factors or {}).get(load, 1.0) for load in LOADS])
    turned = np.array([(orientation or {}).get(load, 0.7) for load in LOADS])
    return Curves(
        numbers=np.arange(2),
        names=np.array(["case"] * 2),
        loads=LOADS,
        structure_tensor=tensors,
        deformation_gradient=gradient,
        magnitude=magnitude,
        strain_energy_density=strain_energy(0.2, 0.5, mean) * of_load[:, None],
        cauchy_stress=np.zeros(gradient.shape),
        first_piola_kirchhoff_stress=np.zeros(gradient.shape),
        largest_orientation_eigenvalue=np.broadcast_to(turned[:, None], magnitude.shape),
        newton_iterations=np.full(magnitude.shape, iterations),
        cuts=np.zeros(magnitude.shape, dtype=int),
        amplitude_limited=np.zeros(magnitude.shape[:2], dtype=bool),
    )


def constants(C2: np.ndarray, C3: np.ndarray, r_squared: float | np.ndarray = 0.9, names: str = "") -> Constants:
    """Of networks whose H11 grows evenly from 0.33 to 0.80; with `names` one network a letter, called by it."""
    C2, C3 = np.asarray(C2, dtype=float), np.asarray(C3, dtype=float)
    H11 = np.linspace(0.33, 0.80, len(C2))
    return Constants(
        names=np.array(list(names) or [""] * len(C2)),
        H11=H11,
        H22=0.6 * (1.0 - H11),
        H33=0.4 * (1.0 - H11),
        C2=C2,
        C3=C3,
        r_squared=np.broadcast_to(r_squared, C2.shape).astype(float),
        amplitude=np.full(len(C2), 1.5),
    )


def fits(C2: np.ndarray, C3: np.ndarray, ends: tuple[float, float, float, float] | None = None) -> dict[str, Fits]:
    """The same of every load set; networks 1 and 5, two of each, are the ends of the ensemble unless they are given."""
    first_C2, first_C3, fifth_C2, fifth_C3 = ends or (C2[0], C3[0], C2[-1], C3[-1])
    pair = [
        constants(np.full(2, one), np.full(2, other)) for one, other in ((first_C2, first_C3), (fifth_C2, fifth_C3))
    ]
    return {name: Fits(constants(C2, C3), *pair) for name in SETS}
