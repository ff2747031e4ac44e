"""Whether Eq. 2 fits within families of loads: section 4.1 says so, section 3.1 denies it."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from fibrous.curves import Curves
from fibrous.deformation import Load
from fibrous_study.audit.finding import (
    Array,
    Finding,
    Thresholds,
    Verdict,
    holds_for_most,
    listed,
    number,
    over_replicates,
    percent,
    share_of,
    span,
)
from fibrous_study.audit.refits import constants_up_to

KINDS = ("uniaxial", "biaxial", "shear")


@dataclass(frozen=True)
class GroupFit:
    """Eq. 2 fitted to a group of loads.

    strain : the range, in words; load_set, network : names
    loads : the group; pooled : whether they are the whole load set, not a family of it
    r_squared : of the network and its replicates, shape (networks,)
    """

    strain: str
    load_set: str
    network: str
    loads: tuple[str, ...]
    pooled: bool
    r_squared: Array

    def fits(self, thresholds: Thresholds) -> bool:
        """Whether the fit is one of high confidence."""
        return holds_for_most(self.r_squared >= thresholds.confident_r_squared, thresholds.most)


def group_fits(
    ranges: Mapping[str, Curves], networks: Sequence[str], load_sets: Mapping[str, tuple[str, ...]], largest_C3: float
) -> list[GroupFit]:
    """Fits to every load set and to every family of two loads or more within it; one curve alone would tell little.

    A load with its own deformation gradient belongs to no family.
    `ranges` holds curves by the words that name their strain.
    """
    found = []
    for load_set, loads in load_sets.items():
        of_kind = [tuple(load for load in loads if Load.kind_of(load) == kind) for kind in KINDS]
        groups = [(loads, True), *((family, False) for family in of_kind if len(family) > 1)]
        for strain, curves in ranges.items():
            for name in networks:
                for group, pooled in groups:
                    fits = constants_up_to(curves.called(name).under(group), largest_C3)
                    found.append(GroupFit(strain, load_set, name, group, pooled, fits.r_squared))
    return found


def families(found: Sequence[GroupFit], trusted: bool, thresholds: Thresholds) -> Finding:
    """Whether Eq. 2 fits within families of loads, as section 4.1 says (`trusted`), or not even there, as 3.1 says.

    Each range of strain with each load set is judged by itself, by the share of networks and families that fit and, for
    the denial, by that of fits to all loads together as well. What is false of most everywhere, the other section
    contradicts.
    """
    cells = list(dict.fromkeys((one.strain, one.load_set) for one in found))
    within, pooled = (
        {cell: [one for one in found if (one.strain, one.load_set) == cell and one.pooled == whole] for cell in cells}
        for whole in (False, True)
    )
    # A load set may have no two loads of a kind.
    fitting = [_share(group, thresholds) for group in within.values() if group]
    true = (
        fitting if trusted else [1.0 - one for one in (*fitting, *(_share(one, thresholds) for one in pooled.values()))]
    )
    if all(share >= thresholds.most for share in true):
        verdict = Verdict.REPRODUCED
    else:
        false = all(share <= 1.0 - thresholds.most for share in true)
        verdict = Verdict.CONTRADICTED if false else Verdict.PARTLY
    strains, load_sets = (list(dict.fromkeys(names)) for names in zip(*cells, strict=True))
    over_sets = {
        strain: _share([one for one in found if one.strain == strain and not one.pooled], thresholds)
        for strain in strains
    }
    shares = listed([f"{percent(share)} at {strain}" for strain, share in over_sets.items()])
    nearer = listed([f"section {'4.1' if share > 0.5 else '3.1'} at {strain}" for strain, share in over_sets.items()])
    networks = len({one.network for one in found})
    spreads = dict.fromkeys(
        f"{' + '.join(one.loads)} at {one.strain} {span(one.r_squared[1:])}"
        for one in found
        if one.network == found[0].network and not one.pooled
    )
    return Finding(
        "; ".join(
            f"{strain}, {name}: R² of families {_range(within[strain, name])}, of all loads "
            f"{_range(pooled[strain, name])}"
            for strain, name in cells
        ),
        verdict,
        f"In {networks} networks, with {listed(load_sets)}, R² reaches {number(thresholds.confident_r_squared)} in "
        f"fits to families of two loads in {_counts(within, strains, thresholds)}, and in fits to all loads in "
        f"{_counts(pooled, strains, thresholds)}. The paper says both of families, of which {shares} fit: nearer to "
        f"the truth is {nearer}.",
        over_replicates([f"{found[0].network}: {', '.join(spreads)}"], len(found[0].r_squared) - 1),
    )


def _share(group: Sequence[GroupFit], thresholds: Thresholds) -> float:
    return share_of([one.fits(thresholds) for one in group])


def _counts(groups: Mapping[tuple[str, str], list[GroupFit]], strains: Sequence[str], thresholds: Thresholds) -> str:
    """How many fits are good at each range of strain, in the order of the load sets."""
    said = []
    for strain in strains:
        cells = [group for (one, _), group in groups.items() if one == strain]
        good = listed([str(sum(one.fits(thresholds) for one in group)) for group in cells])
        said.append(f"{good} of {max(map(len, cells))} at {strain}")
    return listed(said)


def _range(group: Sequence[GroupFit]) -> str:
    """R² of the paper's networks."""
    return span([one.r_squared[0] for one in group])
