"""Which function judges which statement, and by which data: the table of the audit."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property

from fibrous.curves import Curves
from fibrous_study.audit import (
    constants,
    costs,
    curves,
    example,
    families,
    laws,
    printed_table,
    scatter,
    tissue,
    trends,
)
from fibrous_study.audit.evidence import Constants, Fits
from fibrous_study.audit.finding import Array, Finding, Statement, Thresholds
from fibrous_study.audit.refits import constants_up_to
from fibrous_study.three_fibers import affine, equilibrium

ALONG, ACROSS = 1.5, 2.0 / 3.0  # stretches of Fig. 7b and c


@dataclass(frozen=True)
class Evidence:
    """What the study found. Networks without an equilibrium or constants are left out of curves and fits.

    thresholds, load_sets; largest_C3 : bound of the fits; tension_only : whether laws carry nothing in compression
    case, survey : names of the case-study network and of networks 1 to 5; asked : H asked of the named networks
    tensors, fractions : H and volume fraction of the case-study network and its replicates
    small, large, path : curves of the named networks and replicates at 10 and 112 % Green strain and along Eq. 9
    small_fits, large_fits : constants of the same by load set, each network followed up to its own λ_f
    case_fits : those of section 2.6, laws.INITIAL and laws.REFIT, in the order of `path`
    ensemble : curves of all networks at the large range; ensemble_small_fits, ensemble_large_fits by load set
    surface_r_squared : of Eq. 11 over `ensemble_large_fits`, C2 and C3, by load set
    surface_coefficients : of the same for "C2" and "C3", shape (9,), MPa and 1, by load set
    tissue, costs : the runs of the tissue, Table 2
    left_out : number of networks left out, by the name of the input; of the ensemble, or of all others
    """

    thresholds: Thresholds
    load_sets: Mapping[str, tuple[str, ...]]
    largest_C3: float
    tension_only: bool
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
    costs: costs.Costs
    left_out: Mapping[str, int]

    def of_case(self, found: Curves) -> Curves:
        """The case-study network and its replicates."""
        return found.called(self.case)

    def networks(self, index: int) -> Curves:
        """Network 1 to 5 of the survey, counted from 0, and its replicates at the large range."""
        return self.large.called(self.survey[index])

    def case_constants(self) -> dict[str, Constants]:
        """Those of the case-study network at the large range, by load set."""
        return {name: one.called(self.case) for name, one in self.large_fits.items()}

    @cached_property
    def own_fits(self) -> dict[str, Fits]:
        """Fits up to each network's own λ_f, by load set."""
        return {name: self._fits(self.ensemble_large_fits[name], self.large_fits[name]) for name in self.load_sets}

    @cached_property
    def common_fits(self) -> dict[str, Fits]:
        """Fits up to the largest λ_f that all networks reach under the load that the others are matched to."""
        ends = [self.networks(index) for index in (0, -1)]
        common = min(float(one.averaged_stretch[:, 0, -1].min()) for one in (self.ensemble, *ends))
        return {
            name: self._fits(
                *(constants_up_to(one.under(loads), self.largest_C3, common) for one in (self.ensemble, self.large))
            )
            for name, loads in self.load_sets.items()
        }

    def lost(self, data: tuple[str, ...]) -> int:
        """How many networks are left out of the inputs of these names."""
        counts = {name.startswith("ensemble"): self.left_out[name] for name in data if name in self.left_out}
        return sum(counts.values())

    def _fits(self, ensemble: Constants, named: Constants) -> Fits:
        return Fits(ensemble, named.called(self.survey[0]), named.called(self.survey[-1]))

    @cached_property
    def errors(self) -> dict[tuple[str, str], laws.Errors]:
        """Errors of the fitted laws along Eq. 9."""
        return laws.errors(self.of_case(self.path), self.case_fits, self.tension_only)

    @cached_property
    def group_fits(self) -> list[families.GroupFit]:
        """Eq. 2 fitted to families of loads and to whole load sets, in the case-study network and networks 1 to 5."""
        ranges = {"112 %": self.large, "10 %": self.small}
        return families.group_fits(ranges, (self.case, *self.survey), self.load_sets, self.largest_C3)


@dataclass(frozen=True)
class Check:
    """How a statement is judged, and the names of the inputs that it is judged by."""

    finding: Callable[[Statement, Evidence], Finding]
    data: tuple[str, ...] = ()


NAMED = ("small", "large")
HYBRID = ("tissue",)
PATH = ("path", "fits_initial", "fits_refit")
TRENDS = ("large", "fits_large", "ensemble", "ensemble_fits_large")
TIMES = ("table_2", "tissue")
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
        lambda s, e: scatter.fit_spread(
            {name: e.large.called(name) for name in e.survey}, e.ensemble_large_fits, e.load_sets, e.thresholds
        ),
        ("large", "ensemble_fits_large"),
    ),
    "network3-stretches": Check(
        lambda s, e: curves.magnitudes(s, e.networks(2), e.asked[e.survey[2]], e.thresholds), ("large",)
    ),
    "network3-stiffer-transverse": Check(lambda s, e: curves.stiffer_across(e.networks(2), e.thresholds), ("large",)),
    "c2-trend": Check(lambda s, e: trends.near_isotropy(e.own_fits, e.common_fits, e.thresholds), TRENDS),
    "c2-trend-discussion": Check(lambda s, e: trends.growth(e.own_fits, e.common_fits, e.thresholds), TRENDS),
    "table1-c2": Check(
        lambda s, e: printed_table.table_1(s, "C2", e.ensemble_large_fits, e.surface_coefficients["C2"], e.thresholds),
        ("ensemble_fits_large", "surface"),
    ),
    "table1-c3": Check(
        lambda s, e: printed_table.table_1(s, "C3", e.ensemble_large_fits, e.surface_coefficients["C3"], e.thresholds),
        ("ensemble_fits_large", "surface"),
    ),
    "surface-r2": Check(
        lambda s, e: printed_table.surface_r_squared(
            s, e.surface_r_squared, e.ensemble_large_fits, e.large_fits, e.thresholds
        ),
        ("surface", "ensemble_fits_large", "fits_large"),
    ),
    "eq9-isochoric": Check(lambda s, e: tissue.most_stretched(s, e.tissue), HYBRID),
    "initial-fit-under-eq9": Check(lambda s, e: laws.initial_fit(e.errors, e.tension_only, e.thresholds), PATH[:2]),
    "refit-under-eq9": Check(lambda s, e: laws.refit(e.errors, e.tension_only, e.thresholds), PATH),
    "hgo-locates-peaks": Check(lambda s, e: tissue.peaks(e.tissue, e.thresholds), HYBRID),
    "hgo-initial-bias": Check(lambda s, e: tissue.bias(e.tissue, e.thresholds), HYBRID),
    "rms-initial": Check(lambda s, e: tissue.rms(e.tissue, refitted=False), HYBRID),
    "rms-refit": Check(lambda s, e: tissue.rms(e.tissue, refitted=True), HYBRID),
    "newton-iterations": Check(lambda s, e: curves.newton_iterations(s, e.ensemble, e.thresholds), ("ensemble",)),
    "time-ensemble": Check(
        lambda s, e: costs.time(s, e.costs.initial, e.costs.initial_words, e.costs, e.thresholds), TIMES
    ),
    "time-refit": Check(lambda s, e: costs.time(s, e.costs.refit, e.costs.refit_words, e.costs, e.thresholds), TIMES),
    "time-fe": Check(
        lambda s, e: costs.time(s, e.costs.finite_elements, e.costs.finite_element_words, e.costs, e.thresholds), TIMES
    ),
    "time-multiscale": Check(
        lambda s, e: costs.time(s, e.costs.multiscale, e.costs.multiscale_words, e.costs, e.thresholds), TIMES
    ),
    "time-total": Check(lambda s, e: costs.total(s, e.costs, e.thresholds), TIMES),
    "cost-estimate": Check(lambda s, e: costs.per_gauss_point(e.costs), ("tissue", "tissue_networks")),
    "refit-direction": Check(lambda s, e: tissue.refit_direction(e.tissue, e.thresholds), HYBRID),
    "dissimilar-with-alignment": Check(
        lambda s, e: scatter.dissimilarity(e.ensemble, e.load_sets, e.thresholds), ("ensemble",)
    ),
    "family-fits": Check(lambda s, e: families.families(e.group_fits, True, e.thresholds), NAMED),
    "family-fits-denied": Check(lambda s, e: families.families(e.group_fits, False, e.thresholds), NAMED),
    "shear-pair": Check(
        lambda s, e: constants.shear_pair(
            e.ensemble_large_fits,
            e.case_constants(),
            (e.of_case(e.small), e.of_case(e.large), e.ensemble),
            e.load_sets,
            e.thresholds,
        ),
        ("small", "large", "fits_large", "ensemble", "ensemble_fits_large"),
    ),
    "eq2-run-as-eq10c": Check(lambda s, e: laws.mixture(e.errors, e.tension_only, e.thresholds), PATH[::2]),
    "constants-of-alignment-alone": Check(
        lambda s, e: constants.amplitude(
            (_any(e.small_fits).called(e.case), _any(e.large_fits).called(e.case)),
            (_any(e.ensemble_small_fits), _any(e.ensemble_large_fits)),
            (e.of_case(e.small), e.small.called(e.survey[0])),
            e.thresholds,
        ),
        ("small", "fits_small", "fits_large", "ensemble_fits_small", "ensemble_fits_large"),
    ),
    "febio-hgo": Check(
        lambda s, e: laws.hgo_in_febio(e.of_case(e.path), e.case_fits[laws.REFIT], e.tension_only, e.thresholds),
        PATH[::2],
    ),
    "figure-3-rows": Check(lambda s, e: curves.rows_of_figure_3(e.of_case(e.small), e.of_case(e.large)), NAMED),
}


def _any(fits: Mapping[str, Constants]) -> Constants:
    """Those of the first load set, where what is asked does not depend on it or one answer is enough."""
    return next(iter(fits.values()))
