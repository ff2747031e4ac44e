"""Which function judges which statement, and by which data: the table of the audit."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from fibrous.audit import constants, costs, curves, example, laws, tissue
from fibrous.audit.evidence import Constants, Curves
from fibrous.audit.finding import Array, Finding, Statement, Thresholds
from fibrous.networks.three_fibers import affine, equilibrium

ALONG, ACROSS = 1.5, 2.0 / 3.0  # stretches of Fig. 7b and c


@dataclass(frozen=True)
class Evidence:
    """What the study found.

    thresholds, load_sets; largest_C3 : bound of the fits
    case, survey : names of the case-study network and of networks 1 to 5; asked : H asked of the named networks
    tensors, fractions : H and volume fraction of the case-study network and its replicates
    small, large, path : curves of the named networks and replicates at 10 and 112 % Green strain and along Eq. 9
    small_fits, large_fits : constants of the same by load set
    case_fits : those of section 2.6, laws.INITIAL and laws.REFIT, in the order of `path`
    ensemble : curves of all networks at the large range; ensemble_small_fits, ensemble_large_fits by load set
    surface_r_squared : of Eq. 11 over `ensemble_large_fits`, C2 and C3, by load set
    surface_coefficients : of the same for "C2" and "C3", shape (9,), MPa and 1, by load set
    tissue, element_tensors, costs : the runs of the tissue, H of its elements' networks, Table 2
    """

    thresholds: Thresholds
    load_sets: Mapping[str, tuple[str, ...]]
    largest_C3: float
    case: str
    survey: tuple[str, ...]
    asked: Mapping[str, Array]
    tensors: Array
    fractions: Array
    small: Curves
    large: Curves
    path: Curves
    small_fits: Mapping[str, Constants]
    large_fits: Mapping[str, Constants]
    case_fits: Mapping[str, Constants]
    ensemble: Curves
    ensemble_small_fits: Mapping[str, Constants]
    ensemble_large_fits: Mapping[str, Constants]
    surface_r_squared: Mapping[str, tuple[float, float]]
    surface_coefficients: Mapping[str, Mapping[str, Array]]
    tissue: tissue.Tissue
    element_tensors: Array
    costs: costs.Costs

    def of_case(self, found: Curves) -> Curves:
        """The case-study network and its replicates."""
        return found.called(self.case)

    def ends(self) -> dict[str, Constants]:
        """Constants of networks 1 and 5 at the large range, by load set, the others left out."""
        return {name: one.called(self.survey[0], self.survey[-1]) for name, one in self.large_fits.items()}

    def errors(self) -> dict[tuple[str, str], laws.Errors]:
        """Errors of the fitted laws along Eq. 9."""
        return laws.errors(self.of_case(self.path), self.case_fits)

    def families(self) -> dict[str, Array]:
        """R² of fits within families of loads."""
        ranges = {"10 %": self.of_case(self.small), "112 %": self.of_case(self.large)}
        return curves.fit_families(ranges, self.load_sets, self.largest_C3)


@dataclass(frozen=True)
class Check:
    """How a statement is judged, and the names of the inputs that it is judged by."""

    finding: Callable[[Statement, Evidence], Finding]
    data: tuple[str, ...] = ()


NAMED = ("small", "large")
HYBRID = ("tissue",)
PATH = ("path", "fits_initial", "fits_refit")
CHECKS: dict[str, Check] = {
    "fig7-aligned-estimate": Check(lambda s, e: example.averaged_stretch(s, affine(ALONG), e.thresholds)),
    "fig7-aligned-mean": Check(lambda s, e: example.aligned_mean(s, affine(ALONG), equilibrium(ALONG), e.thresholds)),
    "fig7-transverse-estimate": Check(lambda s, e: example.averaged_stretch(s, affine(ACROSS), e.thresholds)),
    "fig7-transverse-lengths": Check(lambda s, e: example.transverse_lengths(s, equilibrium(ACROSS), e.thresholds)),
    "fig7-transverse-stretches": Check(lambda s, e: example.transverse_stretches(s, equilibrium(ACROSS), e.thresholds)),
    "case-alignment": Check(lambda s, e: curves.alignment(s, e.tensors), ("networks",)),
    "case-volume-fraction": Check(lambda s, e: curves.volume_fraction(s, e.fractions, e.thresholds), ("networks",)),
    "realignment-spread": Check(
        lambda s, e: curves.realignment(e.of_case(e.small), e.of_case(e.large), e.load_sets, e.thresholds), NAMED
    ),
    "curves-converge": Check(
        lambda s, e: curves.convergence_of_curves(e.of_case(e.small), e.of_case(e.large), e.load_sets, e.thresholds),
        NAMED,
    ),
    "fit-spread-grows": Check(
        lambda s, e: curves.fit_spread(
            {name: e.large.called(name) for name in e.survey}, e.ensemble_large_fits, e.load_sets, e.thresholds
        ),
        ("large", "ensemble_fits_large"),
    ),
    "network3-stretches": Check(
        lambda s, e: curves.magnitudes(s, e.large.called(e.survey[2]), e.asked[e.survey[2]], e.thresholds),
        ("large",),
    ),
    "network3-stiffer-transverse": Check(
        lambda s, e: curves.stiffer_across(e.large.called(e.survey[2]), e.thresholds), ("large",)
    ),
    "c2-trend": Check(
        lambda s, e: constants.near_isotropy(e.ensemble_large_fits, e.ends(), e.thresholds),
        ("fits_large", "ensemble_fits_large"),
    ),
    "c2-trend-discussion": Check(
        lambda s, e: constants.growth(e.ensemble_large_fits, e.ends(), e.thresholds),
        ("fits_large", "ensemble_fits_large"),
    ),
    "table1-c2": Check(
        lambda s, e: constants.table_1(s, "C2", e.ensemble_large_fits, e.surface_coefficients["C2"], e.thresholds),
        ("ensemble_fits_large", "surface"),
    ),
    "table1-c3": Check(
        lambda s, e: constants.table_1(s, "C3", e.ensemble_large_fits, e.surface_coefficients["C3"], e.thresholds),
        ("ensemble_fits_large", "surface"),
    ),
    "surface-r2": Check(
        lambda s, e: constants.surface_r_squared(s, e.surface_r_squared, e.thresholds),
        ("surface",),
    ),
    "eq9-isochoric": Check(lambda s, e: tissue.most_stretched(s, e.tissue), HYBRID),
    "initial-fit-under-eq9": Check(lambda s, e: laws.initial_fit(e.errors(), e.thresholds), PATH[:2]),
    "refit-under-eq9": Check(lambda s, e: laws.refit(e.errors(), e.thresholds), PATH),
    "hgo-locates-peaks": Check(lambda s, e: tissue.peaks(e.tissue, e.thresholds), HYBRID),
    "hgo-initial-bias": Check(lambda s, e: tissue.bias(e.tissue), HYBRID),
    "rms-initial": Check(lambda s, e: tissue.rms(e.tissue, refitted=False), HYBRID),
    "rms-refit": Check(lambda s, e: tissue.rms(e.tissue, refitted=True), HYBRID),
    "newton-iterations": Check(lambda s, e: curves.newton_iterations(s, e.ensemble, e.thresholds), ("ensemble",)),
    "time-ensemble": Check(lambda s, e: costs.time(s, e.costs.initial, e.costs.origin, e.thresholds), ("table_2",)),
    "time-refit": Check(lambda s, e: costs.time(s, e.costs.refit, e.costs.origin, e.thresholds), ("table_2",)),
    "time-fe": Check(lambda s, e: costs.time(s, e.costs.finite_elements, e.costs.origin, e.thresholds), ("table_2",)),
    "time-multiscale": Check(
        lambda s, e: costs.time(s, e.costs.multiscale, e.costs.origin, e.thresholds), ("table_2",)
    ),
    "time-total": Check(lambda s, e: costs.total(s, e.costs, e.thresholds), ("table_2",)),
    "cost-estimate": Check(lambda s, e: costs.per_gauss_point(e.costs), ("tissue", "tissue_networks")),
    "refit-direction": Check(lambda s, e: tissue.refit_direction(e.tissue), HYBRID),
    "dissimilar-with-alignment": Check(
        lambda s, e: curves.dissimilarity(e.ensemble, e.load_sets, e.thresholds), ("ensemble",)
    ),
    "family-fits": Check(lambda s, e: curves.families(e.families(), True, e.thresholds), NAMED),
    "family-fits-denied": Check(lambda s, e: curves.families(e.families(), False, e.thresholds), NAMED),
    "shear-pair": Check(
        lambda s, e: constants.shear_pair(
            e.ensemble_large_fits, {name: one.called(e.case) for name, one in e.large_fits.items()}, e.thresholds
        ),
        ("fits_large", "ensemble_fits_large"),
    ),
    "eq2-run-as-eq10c": Check(lambda s, e: laws.mixture(e.errors(), e.thresholds), ("path", "fits_refit")),
    "constants-of-alignment-alone": Check(
        lambda s, e: constants.amplitude(
            _any(e.small_fits).called(e.case),
            _any(e.large_fits).called(e.case),
            (_any(e.ensemble_small_fits), _any(e.ensemble_large_fits)),
            e.thresholds,
        ),
        ("fits_small", "fits_large", "ensemble_fits_small", "ensemble_fits_large"),
    ),
    "febio-hgo": Check(
        lambda s, e: laws.hgo_in_febio(e.element_tensors, e.tissue.origin, e.thresholds), ("tissue_networks",)
    ),
    "figure-3-rows": Check(lambda s, e: curves.rows_of_figure_3(e.of_case(e.small), e.of_case(e.large)), NAMED),
}


def _any(fits: Mapping[str, Constants]) -> Constants:
    """Those of the first load set, where what is asked does not depend on it or one answer is enough."""
    return next(iter(fits.values()))
