"""Statements of sections 2.6, 2.7 and 3.3: the fitted law under a deformation that it was not fitted to."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from fibrous.audit.evidence import Constants, Curves
from fibrous.audit.finding import (
    Array,
    Finding,
    Thresholds,
    Verdict,
    holds_for_most,
    judged,
    percent,
    say,
    share_of,
    span,
)
from fibrous.material_point import along_path
from fibrous.materials.contract import Material
from fibrous.materials.hgo import HGOFamilies, HGOStructureTensor

# The law that is fitted, and the one that the finite elements run with the same constants.
LAWS: dict[str, Callable[[Array, float, float], Material]] = {
    "Eq. 2": lambda tensor, C2, C3: HGOStructureTensor(C2, C3, tensor),
    "Eq. 10C": HGOFamilies.of_structure_tensor,
}
INITIAL, REFIT = "initial", "refit"


@dataclass(frozen=True)
class Errors:
    """How far a law with the constants of each network is from that network, shape (networks,).

    end_ratio : σ_xx of the law over the network's at the end
    along_x : root mean square error of σ_xx over the path as a part of the network's own
    whole : the same of the tensor by its Frobenius norm
    shape : what is left of `whole` when the law's stresses are scaled by the best single factor
    energy_ratio : W of the law over the network's at the end
    """

    end_ratio: Array
    along_x: Array
    whole: Array
    shape: Array
    energy_ratio: Array


def errors(path: Curves, constants: Mapping[str, Constants]) -> dict[tuple[str, str], Errors]:
    """Errors of both laws with constants of each kind, INITIAL and REFIT, along the only load of `path`.

    States in which a network found no equilibrium are left out.
    """
    return {
        (law, kind): Errors(
            *np.array([_errors(path.network(i), of(*_constants(path, fits, i))) for i in range(len(path.names))]).T
        )
        for law, of in LAWS.items()
        for kind, fits in constants.items()
    }


def _constants(path: Curves, fits: Constants, index: int) -> tuple[Array, float, float]:
    return path.structure_tensor[index], float(fits.C2[index]), float(fits.C3[index])


def _errors(path: Curves, material: Material) -> tuple[float, float, float, float, float]:
    network, energy = path.cauchy_stress[0, 0, 1:], path.strain_energy_density[0, 0, 1:]
    response = along_path(material, path.deformation_gradient[0, 0, 1:])
    found = np.isfinite(energy)
    network, law = network[found], response.cauchy_stress[found]
    size = float(np.sum(law * law))
    factor = float(np.sum(law * network)) / size if size else 0.0
    return (
        law[-1, 0, 0] / network[-1, 0, 0],
        _relative(law[:, 0, 0], network[:, 0, 0]),
        _relative(law, network),
        _relative(factor * law, network),
        response.strain_energy_density[found][-1] / energy[found][-1],
    )


def _relative(values: Array, reference: Array) -> float:
    return float(np.linalg.norm(values - reference) / np.linalg.norm(reference))


Found = Mapping[tuple[str, str], Errors]


def initial_fit(found: Found, thresholds: Thresholds) -> Finding:
    """Section 3.3: the initial fit's stress is of a similar magnitude, but its curve has another shape."""
    factor = thresholds.same_magnitude
    parts, said, words, spreads = [], [], [], []
    for law in LAWS:
        one = found[law, INITIAL]
        similar = holds_for_most(np.abs(np.log(one.end_ratio)) <= np.log(factor), thresholds.most)
        other = holds_for_most(one.shape >= thresholds.shape_error, thresholds.most)
        parts += [similar, other]
        said.append(
            f"{law}: σ_xx ends at {say(one.end_ratio[0])} times the network's, the tensor's shape is "
            f"{percent(one.shape[0])} off"
        )
        words.append(
            f"{law} is {'' if similar else 'not '}within a factor of {factor:g} and of "
            f"{'another' if other else 'the same'} shape"
        )
        spreads.append(f"{law}: {span(one.end_ratio[1:])}, {_range(one.shape)}")
    why = "; ".join(words) + "; the paper does not say which of the two its figure shows."
    return Finding("; ".join(said), judged(parts), why, "; ".join(spreads))


def refit(found: Found, thresholds: Thresholds) -> Finding:
    """Section 3.3: the refit largely corrects the curve."""
    parts, said, why, spreads = [], [], [], []
    for law in LAWS:
        before, after = found[law, INITIAL], found[law, REFIT]
        along_x, whole = (
            holds_for_most(one <= thresholds.correction * other, thresholds.most)
            for one, other in ((after.along_x, before.along_x), (after.whole, before.whole))
        )
        parts += [along_x, whole]
        said.append(
            f"{law}: σ_xx {percent(before.along_x[0])} off before, {percent(after.along_x[0])} after the refit; tensor "
            f"{percent(before.whole[0])}, {percent(after.whole[0])}"
        )
        why.append(f"{law}: σ_xx {_corrected(along_x)}, the tensor {_corrected(whole)}")
        spreads.append(f"{law}: after the refit σ_xx {_range(after.along_x)}, tensor {_range(after.whole)}")
    limit = f"Corrected means an error of at most {percent(thresholds.correction)} of the initial one. "
    return Finding("; ".join(said), judged(parts), limit + "; ".join(why) + ".", "; ".join(spreads))


def mixture(found: Found, thresholds: Thresholds) -> Finding:
    """Section 2.7: constants of Eq. 2 are run in Eq. 10C, as if both were one law."""
    fitted, run = (found[law, REFIT] for law in LAWS)
    ratio = run.energy_ratio / fitted.energy_ratio
    same = holds_for_most(np.abs(np.log(ratio)) <= np.log(thresholds.same_magnitude), thresholds.most)
    return Finding(
        f"W of Eq. 10C {say(ratio[0])} times that of Eq. 2 with the same constants; its σ_xx ends at "
        f"{say(run.end_ratio[0])} times the network's",
        Verdict.REPRODUCED if same else Verdict.CONTRADICTED,
        f"Refitted to the network's energy, Eq. 2 ends at {say(fitted.energy_ratio[0])} and Eq. 10C at "
        f"{say(run.energy_ratio[0])} times that energy: by Jensen's inequality the families are the stiffer law, "
        "which no refit of Eq. 2 can mend.",
        span(ratio[1:]),
    )


def hgo_in_febio(tensors: Array, origin: str, thresholds: Thresholds) -> Finding:
    """Section 2.7: FEBio has no HGO law. Its own knows one direction and one dispersion, so one kind of H.

    `tensors` are the structure tensors of the tissue's elements, shape (elements, 3, 3), `origin` where it comes from.
    """
    least, middle, _ = np.linalg.eigvalsh(tensors).T
    ratio = middle / least
    transverse = share_of(ratio <= thresholds.same_magnitude)
    return Finding(
        f"two smaller eigenvalues of H apart by a factor of {say(float(np.median(ratio)))} (median element of the "
        "tissue)",
        Verdict.NOT if transverse >= thresholds.most else Verdict.PARTLY,
        "FEBio has an uncoupled material called Holzapfel-Gasser-Ogden, with one dispersion about the axis of a "
        "family. It could be Eq. 2's fibres only where the two smaller eigenvalues of H agree, which they do within "
        f"a factor of {thresholds.same_magnitude:g} in {percent(transverse)} of the elements here. Specimen: {origin}.",
    )


def _range(values: Array) -> str:
    return f"{percent(values[1:].min())} to {percent(values[1:].max())}"


def _corrected(held: bool) -> str:
    return "corrected" if held else "not corrected"
