"""What the statements are judged by: the study's results as the checks ask for them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from fibrous.comparison import TOP, Comparison, Fields
from fibrous.curves import Curves
from fibrous.specimen import SYNTHETIC
from fibrous_study.audit.verdict import Array, Quantity, Thresholds, alike, numbers


@dataclass(frozen=True)
class Constants:
    """(C2, C3) of Eq. 2 fitted to the energies of one group of loads; all arrays of shape (networks,).

    names : of a name the paper's network stands first, then its replicates, as in the curves
    H11, H22, H33 : alignment; amplitude : largest λ_f fitted
    C2 in MPa; C3; r_squared of the fit
    """

    names: NDArray[np.str_]
    H11: Array
    H22: Array
    H33: Array
    C2: Array
    C3: Array
    r_squared: Array
    amplitude: Array

    def called(self, name: str) -> Self:
        """The networks of that name."""
        return self.of(self.names == name)

    def along_x(self) -> Self:
        """The networks aligned with x, the direction loaded, more than with y or z."""
        return self.of((self.H11 >= self.H22) & (self.H11 >= self.H33))

    def of(self, kept: NDArray[np.bool_]) -> Self:
        """The networks where `kept` is true."""
        return replace(self, **{field: value[kept] for field, value in vars(self).items()})

    @property
    def known(self) -> NDArray[np.bool_]:
        """Which networks have constants and the quality of their fit, shape (networks,)."""
        return np.asarray(np.isfinite([self.C2, self.C3, self.r_squared]).all(axis=0))

    def alike(self, other: Self, thresholds: Thresholds) -> NDArray[np.bool_]:
        """Whose C2 and C3 are both those of `other` up to the factor that counts as the same magnitude."""
        factor = thresholds.same_magnitude
        return alike(self.C2, other.C2, factor) & alike(self.C3, other.C3, factor)


@dataclass(frozen=True)
class Tissue:
    """The runs of Fig. 9 at the last load step, and where the specimen comes from.

    multiscale, initial, refit : their fields
    gradient : F of the multiscale run, shape (elements, Gauss points, 3, 3)
    """

    origin: str
    multiscale: Fields
    initial: Fields
    refit: Fields
    gradient: Array

    def comparison(self, refitted: bool) -> Comparison:
        """Errors of the hybrid method."""
        return Comparison.of(self.refit if refitted else self.initial, self.multiscale)

    @property
    def peaks(self) -> int:
        """Number of the elements that count as peaks."""
        return max(1, round(TOP * len(self.multiscale.shear_stress)))

    def size(self) -> list[Quantity]:
        """What every verdict on a specimen depends on."""
        return numbers(elements=len(self.multiscale.shear_stress), synthetic=self.origin == SYNTHETIC)


@dataclass(frozen=True)
class Costs:
    """CPU time of a study, and what it was spent on.

    initial, refit, finite_elements, multiscale : CPU-hours of the tasks of Table 2
    networks : elements of the tissue, each with one network
    loads, steps : of the load set whose constants are fitted first, per network; load_steps : of the tissue
    runs : finite element runs of the hybrid method
    fibers, nodes : medians over the tissue's networks, interior nodes alone
    evaluations, network_evaluations : Gauss points times Newton iterations of a hybrid and of the multiscale run
    law_seconds, networks_seconds : CPU seconds that these spent in the fibre law and in networks
    hybrid_seconds, multiscale_seconds : CPU seconds of these runs as a whole
    origin : where the specimen comes from
    """

    initial: float
    refit: float
    finite_elements: float
    multiscale: float
    networks: int
    loads: int
    steps: int
    load_steps: int
    runs: int
    fibers: float
    nodes: float
    evaluations: int
    network_evaluations: int
    law_seconds: float
    networks_seconds: float
    hybrid_seconds: float
    multiscale_seconds: float
    origin: str

    @property
    def hybrid(self) -> float:
        """CPU-hours of the hybrid method."""
        return self.initial + self.refit + self.finite_elements

    def size(self) -> list[Quantity]:
        """What was computed for these hours."""
        return numbers(
            networks=self.networks,
            loads=self.loads,
            steps=self.steps,
            load_steps=self.load_steps,
            runs=self.runs,
            synthetic=self.origin == SYNTHETIC,
        )


Networks = TypeVar("Networks", Curves, "Constants")


class Evidence:
    """The study's config and results. Networks without an equilibrium or constants are left out of curves and fits.

    load_sets, paper : by name, as in the config and in config/paper.yaml
    case_name, survey : names of the case-study network and of networks 1 to 5; asked : H asked of the named networks
    tension_only : whether laws carry nothing in compression; largest_C3 : bound of the fits
    tensors, fractions : H and volume fraction of the case-study network and its replicates
    small, large, path : curves of the named networks and replicates at 10 and 112 % Green strain and along Eq. 9
    ensemble : curves of all networks at 112 %
    small_fits, large_fits, ensemble_small_fits, ensemble_large_fits : constants of the same by load set, each network
        followed up to its own λ_f
    initial, refit : constants of section 2.6 before and after the refit, of the case-study network in `path`
    surface_r_squared, surface_coefficients : of Eq. 11 over `ensemble_large_fits`, for "C2" and "C3", by load set;
        coefficients of shape (9,), MPa and 1
    left_out : number of networks left out of the named ones with replicates, and of the ensemble
    """

    tensors: Array
    fractions: Array
    small: Curves
    large: Curves
    path: Curves
    ensemble: Curves
    small_fits: Mapping[str, Constants]
    large_fits: Mapping[str, Constants]
    ensemble_small_fits: Mapping[str, Constants]
    ensemble_large_fits: Mapping[str, Constants]
    initial: Constants
    refit: Constants
    surface_r_squared: Mapping[str, Mapping[str, float]]
    surface_coefficients: Mapping[str, Mapping[str, Array]]
    tissue: Tissue
    costs: Costs
    left_out: Mapping[str, int]

    def __init__(self, config: Mapping[str, Any], **results: Any) -> None:
        """`config` is that of the rule `claims`; a check needs those of the `results` that it reads."""
        self.paper: Mapping[str, Any] = config["paper"]
        self.thresholds = Thresholds(**config["claims"])
        self.load_sets = {entry["name"]: tuple(entry["loads"]) for entry in config["load_sets"]}
        self.case_name: str = config["case"]
        self.survey = tuple(config["survey"])
        self.tension_only: bool = config["tension_only"]
        self.largest_C3: float = config["fit"]["largest_C3"]
        self.asked = {
            entry["name"]: np.diag([entry["H11"], entry["H22"], 1.0 - entry["H11"] - entry["H22"]])
            for entry in config["named"]
        }
        vars(self).update(results)

    def case(self, networks: Networks) -> Networks:
        """The case-study network and its replicates."""
        return networks.called(self.case_name)

    def network(self, number: int) -> Curves:
        """Network 1 to 5 of the survey and its replicates at the large range."""
        return self.large.called(self.survey[number - 1])
