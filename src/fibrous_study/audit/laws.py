"""Statements of sections 2.6, 2.7 and 3.3: the fitted law under a deformation that it was not fitted to."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import asdict, dataclass
from functools import cache

import numpy as np

from fibrous.curves import Curves
from fibrous.materials.contract import Material
from fibrous.materials.registry import LAWS as ALL_LAWS
from fibrous_study.audit.evidence import Constants, Evidence
from fibrous_study.audit.verdict import Array, Finding, Verdict, judged, judges, numbers
from fibrous_study.fit_tables import INITIAL, REFIT

EQ_2, EQ_10C = "eq_2", "eq_10c"
# The law that is fitted, and the law that the finite elements run with the same constants.
LAWS: dict[str, Callable[[Array, float, float, bool], Material]] = {
    EQ_2: ALL_LAWS["structure_tensor"].material.of_structure_tensor,
    EQ_10C: ALL_LAWS["families"].material.of_structure_tensor,
}


@dataclass(frozen=True)
class Errors:
    """How far a law with the constants of each network is from that network, shape (networks,).

    end_ratio : σ_xx of the law over the network's at the end
    shape : what is left of the error of σ_xx over the path, as a fraction of the network's own, when the law's σ_xx is
        scaled by the best single factor
    along_x : root mean square error of σ_xx over the path as a fraction of the network's own
    others : the same of the other components, by their Frobenius norm
    whole : the same of the tensor
    energy_ratio : W of the law over the network's at the end
    """

    end_ratio: Array
    shape: Array
    along_x: Array
    others: Array
    whole: Array
    energy_ratio: Array


@cache
def errors(evidence: Evidence) -> dict[tuple[str, str], Errors]:
    """Errors of both laws with constants of each kind, INITIAL and REFIT, along Eq. 9 in the case-study network.

    States in which a network found no equilibrium are left out.
    """
    path, tension = evidence.case(evidence.path), evidence.tension_only

    def of_law(law: str, fits: Constants) -> Errors:
        materials = (LAWS[law](*_constants(path, fits, i), tension) for i in range(len(path.names)))
        return Errors(*np.transpose([_errors(path.network(i), one) for i, one in enumerate(materials)]))

    return {
        (law, kind): of_law(law, fits)
        for law in LAWS
        for kind, fits in ((INITIAL, evidence.initial), (REFIT, evidence.refit))
    }


def _constants(path: Curves, fits: Constants, index: int) -> tuple[Array, float, float]:
    return path.structure_tensor[index], float(fits.C2[index]), float(fits.C3[index])


def _errors(path: Curves, material: Material) -> tuple[float, ...]:
    network, energy = path.cauchy_stress[0, 0, 1:], path.strain_energy_density[0, 0, 1:]
    gradients = path.deformation_gradient[0, 0, 1:]
    known = np.isfinite(energy)
    network, law = network[known], material.stress(gradients)[known]
    others = np.ones((3, 3), dtype=bool)
    others[0, 0] = False
    along_x = law[:, 0, 0]
    size = float(along_x @ along_x)
    factor = float(along_x @ network[:, 0, 0]) / size if size else 0.0
    return (
        along_x[-1] / network[-1, 0, 0],
        _relative(factor * along_x, network[:, 0, 0]),
        _relative(along_x, network[:, 0, 0]),
        _relative(law[:, others], network[:, others]),
        _relative(law, network),
        material.energy(gradients)[known][-1] / energy[known][-1],
    )


def _relative(values: Array, reference: Array) -> float:
    return float(np.linalg.norm(values - reference) / np.linalg.norm(reference))


@judges("initial-fit-under-eq9")
def initial_fit(evidence: Evidence, _: Mapping[str, float]) -> Finding:
    """Section 3.3: the initial fit's stress is of a similar magnitude, but its curve has another shape."""
    thresholds, parts, found = evidence.thresholds, [], numbers(tension_only=evidence.tension_only)
    for law in LAWS:
        of_law = errors(evidence)[law, INITIAL]
        parts += [thresholds.same(of_law.end_ratio), thresholds.mostly(of_law.shape >= thresholds.shape_error)]
        found += numbers({f"{law}_{name}": values for name, values in asdict(of_law).items()})
    return Finding(judged(parts), found)


@judges("refit-under-eq9")
def refit(evidence: Evidence, _: Mapping[str, float]) -> Finding:
    """Section 3.3: the refit largely corrects the shape of the curve; after it, those of σ_xx and of the tensor."""
    thresholds, found = evidence.thresholds, numbers(tension_only=evidence.tension_only)
    parts: list[bool] = []
    for law in LAWS:
        before, after = (asdict(errors(evidence)[law, kind]) for kind in (INITIAL, REFIT))
        other_shape = thresholds.mostly(before["shape"] >= thresholds.shape_error)
        held = {
            name: thresholds.mostly(after[name] <= thresholds.correction * before[name])
            for name in ("shape", "along_x", "whole")
        }
        held["shape"] = other_shape and held["shape"]
        parts += held.values()
        found += numbers({f"{law}_other_shape": other_shape})
        for name, corrected in held.items():
            found += numbers({f"{law}_{name}_before": before[name], f"{law}_{name}_after": after[name]})
            found += numbers({f"{law}_{name}_corrected": corrected})
    return Finding(judged(parts), found)


@judges("eq2-run-as-eq10c")
def mixture(evidence: Evidence, _: Mapping[str, float]) -> Finding:
    """Section 2.7: constants of Eq. 2 are run in Eq. 10C, as if both were one law."""
    fitted, run = (errors(evidence)[law, REFIT] for law in LAWS)
    ratio = run.energy_ratio / fitted.energy_ratio
    return Finding(
        Verdict.REPRODUCED if evidence.thresholds.same(ratio) else Verdict.CONTRADICTED,
        [
            *numbers(W_ratio=ratio, eq_10c_end_ratio=run.end_ratio, tension_only=evidence.tension_only),
            *numbers(eq_2_energy_ratio=fitted.energy_ratio, eq_10c_energy_ratio=run.energy_ratio),
        ],
    )


@judges("febio-hgo")
def hgo_in_febio(evidence: Evidence, _: Mapping[str, float]) -> Finding:
    """Section 2.7: FEBio has no HGO law, so that Eq. 10C is run.

    FEBio's `HGO unconstrained` has two families at ±γ with one dispersion κ. With γ = 0, k1 = C2/2, k2 = C3 and κ from
    H its fibres are Eq. 2 with the mean of the two smaller eigenvalues of H in place of both. Judged by W of that law
    and of Eq. 10C over W of Eq. 2 at the end of Eq. 9, with the refitted constants. The statement is denied where
    FEBio's own law does what the paper wanted.
    """
    path, ratios = evidence.case(evidence.path), []
    for i in range(len(path.names)):
        gradient = path.deformation_gradient[i, 0, 1:]
        tensor, C2, C3 = _constants(path, evidence.refit, i)
        averaged, families, exact = (
            LAWS[law](one, C2, C3, evidence.tension_only).energy(gradient)[-1]
            for law, one in ((EQ_2, about_one_axis(tensor)), (EQ_10C, tensor), (EQ_2, tensor))
        )
        ratios.append((averaged / exact, families / exact))
    febio, families = np.array(ratios).T
    nearer = evidence.thresholds.mostly(np.abs(np.log(febio)) < np.abs(np.log(families)))
    denied = nearer and evidence.thresholds.same(febio)
    return Finding(
        Verdict.NOT if denied else Verdict.PARTLY, numbers(febio_W_ratio=febio, eq_10c_W_ratio=families, nearer=nearer)
    )


def about_one_axis(tensor: Array) -> Array:
    """H, shape (3, 3), with the mean of its two smaller eigenvalues in place of both."""
    values, vectors = np.linalg.eigh(tensor)
    mean = 0.5 * (values[0] + values[1])
    return np.asarray((vectors * np.array([mean, mean, values[2]])) @ vectors.T)
