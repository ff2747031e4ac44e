"""Flips a sign in a numerical module and asks the tests whether they notice.

    python benchmarks/mutate.py

Each mutation replaces one text, which occurs once, in a copy of the project; the tests named beside it must then
fail. Prints one line a mutation and exits with 1 where one survives.
"""

import shutil
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).resolve().parent.parent


@dataclass(frozen=True)
class Mutation:
    """One sign flip: the module under src/fibrous, the text, its replacement, the test file that must notice."""

    name: str
    module: str
    text: str
    flipped: str
    tests: str


MUTATIONS = [
    Mutation(
        "Green strain of the fibre law",
        "networks/fiber_law.py",
        "growth = np.expm1(0.5 * self.nonlinearity * (cut * cut - 1.0))",
        "growth = np.expm1(0.5 * self.nonlinearity * (cut * cut + 1.0))",
        "test_fiber_law.py",
    ),
    Mutation(
        "closed form of the fibre energy",
        "networks/fiber_law.py",
        "dawsn(root * cut) - dawsn(root)",
        "dawsn(root * cut) + dawsn(root)",
        "test_fiber_law.py",
    ),
    Mutation(
        "force at a fibre's tail",
        "networks/kernels.py",
        "residual[tails[m], i] -= forces[m, i]",
        "residual[tails[m], i] += forces[m, i]",
        "test_equilibrium.py",
    ),
    Mutation(
        "coupling of two nodes in the Hessian",
        "networks/kernels.py",
        "band[3 * tail + j, 3 * (head - tail) + i - j] -= block",
        "band[3 * tail + j, 3 * (head - tail) + i - j] += block",
        "test_equilibrium.py",
    ),
    Mutation(
        "tension in the axial stiffness",
        "networks/assembly.py",
        "axial = (stiffness / self.lengths - tension)",
        "axial = (stiffness / self.lengths + tension)",
        "test_equilibrium.py",
    ),
    Mutation(
        "static condensation",
        "networks/assembly.py",
        "(direct - coupling.T @ self.solve(factor, coupling))",
        "(direct + coupling.T @ self.solve(factor, coupling))",
        "test_homogenization.py",
    ),
    Mutation(
        "tangent prediction",
        "networks/assembly.py",
        "return -self.solve(factor, self._residual_rate(point, gradient_rate)[1])",
        "return self.solve(factor, self._residual_rate(point, gradient_rate)[1])",
        "test_equilibrium.py",
    ),
    Mutation(
        "stability: an indefinite Hessian accepted",
        "networks/assembly.py",
        "return factor if info == 0 else None",
        "return factor if info >= 0 else None",
        "test_equilibrium.py",
    ),
    Mutation(
        "averaged stretch of the matched load",
        "deformation.py",
        "structure_tensor)) - target",
        "structure_tensor)) + target",
        "test_deformation.py",
    ),
    Mutation(
        "direction of simple shear",
        "deformation.py",
        "gradient[..., self.axes[1], self.axes[0]] = magnitude",
        "gradient[..., self.axes[1], self.axes[0]] = -magnitude",
        "test_deformation.py",
    ),
    Mutation(
        "correction of the alignment asked for",
        "networks/generation.py",
        "asked = asked - error",
        "asked = asked + error",
        "test_generation.py",
    ),
    Mutation(
        "plane of the face at the negative end",
        "networks/generation.py",
        "np.hstack([points < -0.5, points > 0.5])",
        "np.hstack([points < 0.5, points > 0.5])",
        "test_generation.py",
    ),
    Mutation(
        "where an edge passes the plane of a face",
        "networks/generation.py",
        "low, high = (-0.5 - start) / vector",
        "low, high = (-0.5 + start) / vector",
        "test_generation.py",
    ),
    Mutation(
        "margin around the cube's oblique preimage",
        "networks/generation.py",
        "<= half_cube + MARGIN * np.linalg.norm",
        "<= half_cube - MARGIN * np.linalg.norm",
        "test_generation.py",
    ),
    Mutation(
        "the two nodes of an edge in one number",
        "networks/generation.py",
        "* len(cloud) + np.maximum(first, second)",
        "* len(cloud) - np.maximum(first, second)",
        "test_generation.py",
    ),
    Mutation(
        "area of the alignments left of H11",
        "networks/generation.py",
        "first = room - np.sqrt(",
        "first = room + np.sqrt(",
        "test_generation.py",
    ),
    Mutation(
        "volume ratio of the Cauchy stress",
        "networks/homogenization.py",
        "stress @ gradient.T / np.linalg.det(gradient)",
        "stress @ gradient.T * np.linalg.det(gradient)",
        "test_homogenization.py",
    ),
    Mutation(
        "axial part of the force rates",
        "networks/kernels.py",
        "+ axial[m] * along * vectors[m, i]",
        "- axial[m] * along * vectors[m, i]",
        "test_homogenization.py",
    ),
    Mutation(
        "bend of the cubic prediction",
        "networks/equilibrium.py",
        "forward + 5.0 * bend",
        "forward - 5.0 * bend",
        "test_equilibrium.py",
    ),
    Mutation(
        "scaling of C2 by the largest exponential",
        "fitting/hgo.py",
        "C2=float(found.amplitude * unit * np.exp(-found.s)",
        "C2=float(found.amplitude * unit * np.exp(found.s)",
        "test_hgo_fit.py",
    ),
    Mutation(
        "slope of the sum of squares",
        "fitting/projection.py",
        "return -at.amplitude * float(",
        "return at.amplitude * float(",
        "test_hgo_fit.py",
    ),
    Mutation(
        "growth of the stress of a family",
        "fitting/shapes.py",
        "np.exp(s[..., None] * (q - 1.0))",
        "np.exp(s[..., None] * (q + 1.0))",
        "test_hgo_forms.py",
    ),
    Mutation(
        "volume ratio of the stress fitted",
        "fitting/hgo.py",
        "largest**2 / np.linalg.det(gradient)",
        "largest**2 * np.linalg.det(gradient)",
        "test_hgo_forms.py",
    ),
    Mutation(
        "symmetric part of the stress fitted",
        "fitting/hgo.py",
        "tensor[..., rows, columns] + tensor",
        "tensor[..., rows, columns] - tensor",
        "test_hgo_forms.py",
    ),
    Mutation(
        "families that carry when shortened",
        "fitting/hgo.py",
        "excess = np.maximum(excess, 0.0)",
        "excess = np.minimum(excess, 0.0)",
        "test_hgo_forms.py",
    ),
    Mutation(
        "states that stretch a family",
        "fitting/hgo.py",
        "(np.abs(excess) > RESTING)",
        "(np.abs(excess) > -RESTING)",
        "test_hgo_forms.py",
    ),
    Mutation(
        "variance of a predicted network",
        "fitting/surface.py",
        "variance = surface.residual_variance + row",
        "variance = surface.residual_variance - row",
        "test_surface.py",
    ),
    Mutation(
        "tangent of the matrix",
        "materials/neo_hookean.py",
        "tangent -= crossed.swapaxes(1, 3)",
        "tangent += crossed.swapaxes(1, 3)",
        "test_materials.py",
    ),
    Mutation(
        "resistance of the matrix to collapse",
        "materials/neo_hookean.py",
        "pressure = lame * _logarithm(J) - 2.0 * C1",
        "pressure = lame * _logarithm(J) + 2.0 * C1",
        "test_materials.py",
    ),
    Mutation(
        "stiffening of the HGO laws",
        "materials/hgo.py",
        "(1.0 + 2.0 * nonlinear)",
        "(1.0 - 2.0 * nonlinear)",
        "test_materials.py",
    ),
    Mutation(
        "tension-only switch",
        "materials/hgo.py",
        "active = excess > -RESTING",
        "active = excess < -RESTING",
        "test_materials.py",
    ),
    Mutation(
        "families in the tangent at rest",
        "materials/hgo.py",
        "active = excess > -RESTING",
        "active = excess > +RESTING",
        "test_materials.py",
    ),
    Mutation(
        "axial stiffness of the affine fibres",
        "materials/affine_fibers.py",
        "axial = (stiffness - tension)",
        "axial = (stiffness + tension)",
        "test_materials.py",
    ),
    Mutation(
        "update of a later column in the sparse factor",
        "networks/elimination.py",
        "store(blocks, (c, i), load(blocks, (c, i)) - x0 * w0 - x1 * w1 - x2 * w2)",
        "store(blocks, (c, i), load(blocks, (c, i)) + x0 * w0 - x1 * w1 - x2 * w2)",
        "test_elimination.py",
    ),
    Mutation(
        "definiteness of eight Hessians",
        "networks/elimination.py",
        "room = least(p2 - a22, room)",
        "room = least(p2 + a22, room)",
        "test_elimination.py",
    ),
    Mutation(
        "lesser of two vectors",
        "networks/lanes.py",
        'builder.fcmp_ordered("<", one, other)',
        'builder.fcmp_ordered(">", one, other)',
        "test_elimination.py",
    ),
    Mutation(
        "force at a fibre's tail in lanes",
        "networks/lane_kernels.py",
        "load(residual, (tail, i)) - pulled",
        "load(residual, (tail, i)) + pulled",
        "test_network_material.py",
    ),
    Mutation(
        "coupling of fluctuation and F",
        "networks/lane_kernels.py",
        "load(right, (head, i, p)) - pulled",
        "load(right, (head, i, p)) + pulled",
        "test_network_material.py",
    ),
    Mutation(
        "rates of a fibre's ends in the condensed tangent",
        "networks/lane_kernels.py",
        "load(G, (head, i, p)) - load(G, (tail, i, p))",
        "load(G, (head, i, p)) + load(G, (tail, i, p))",
        "test_network_material.py",
    ),
    Mutation(
        "prediction of the fluctuation",
        "networks/lane_kernels.py",
        "moved = moved + load(from_G, (a, i, p)) * change",
        "moved = moved - load(from_G, (a, i, p)) * change",
        "test_network_material.py",
    ),
    Mutation(
        "bend of the fluctuation",
        "networks/lane_kernels.py",
        "3.0 * missed + (there - here)",
        "3.0 * missed - (there - here)",
        "test_network_material.py",
    ),
    Mutation(
        "stability of networks in lanes: an indefinite Hessian accepted",
        "networks/relaxation.py",
        "~(slack[0] > 0.0)",
        "~(slack[0] < np.inf)",
        "test_network_material.py",
    ),
    Mutation(
        "Newton step of networks in lanes",
        "networks/relaxation.py",
        "u[:size] -= move[:, :, 0]",
        "u[:size] += move[:, :, 0]",
        "test_network_material.py",
    ),
    Mutation(
        "number of the first element of a block",
        "materials/network.py",
        "first_element=self.first_element + start",
        "first_element=self.first_element - start",
        "test_network_material.py",
    ),
    Mutation(
        "increment that the bend belongs to",
        "materials/network.py",
        "new.increment[...] = F - before.gradient",
        "new.increment[...] = before.gradient - F",
        "test_network_material.py",
    ),
    Mutation(
        "gradient of the shape functions",
        "fe/hex8.py",
        "factors = 1.0 + local[..., None, :] * CORNERS",
        "factors = 1.0 - local[..., None, :] * CORNERS",
        "test_hex8.py",
    ),
    Mutation(
        "tangent prediction of the free components",
        "fe/solver.py",
        "- here.coupling @ change",
        "+ here.coupling @ change",
        "test_fe_solver.py",
    ),
    Mutation(
        "bend of the prediction",
        "fe/solver.py",
        "(self.response - ratio * before.response)",
        "(self.response + ratio * before.response)",
        "test_fe_solver.py",
    ),
    Mutation(
        "state committed without convergence",
        "fe/solver.py",
        "point = assembly.evaluate(displacement.copy(), here.states, near)",
        "point = assembly.evaluate(displacement.copy(), near if residuals else here.states, near)",
        "test_fe_solver.py",
    ),
    Mutation(
        "growth of increments",
        "fe/solver.py",
        "min(1.0, 2.0 * record.increment)",
        "min(1.0, 1.0 * record.increment)",
        "test_fe_solver.py",
    ),
    Mutation(
        "residual of conjugate gradients",
        "fe/linear.py",
        "<= 2.0 * tolerance * np",
        ">= 2.0 * tolerance * np",
        "test_linear.py",
    ),
    Mutation(
        "sense of the bone's turn",
        "specimen.py",
        "arms @ (turns - np.eye(3)).swapaxes(1, 2)",
        "arms @ (turns - np.eye(3))",
        "test_specimen.py",
    ),
    Mutation(
        "side of the rows where fibres are oblique",
        "specimen.py",
        "depth = 0.5 - flat[:, 1] / height_mm",
        "depth = 0.5 + flat[:, 1] / height_mm",
        "test_specimen.py",
    ),
    Mutation(
        "tangent of the bent slab",
        "specimen.py",
        "np.stack([np.cos(turn), 0.0 * turn, -np.sin(turn)], axis=-1)",
        "np.stack([np.cos(turn), 0.0 * turn, np.sin(turn)], axis=-1)",
        "test_specimen.py",
    ),
    Mutation(
        "Green-Lagrange strain",
        "fe/fields.py",
        "(right_cauchy_green(gradient) - np.eye(3))",
        "(right_cauchy_green(gradient) + np.eye(3))",
        "test_vtu_files.py",
    ),
    Mutation(
        "maximum shear",
        "fe/fields.py",
        "principal[..., 2] - principal[..., 0]",
        "principal[..., 2] + principal[..., 0]",
        "test_vtu_files.py",
    ),
    Mutation(
        "order of the families' weights for FEBio",
        "febio_files.py",
        "weights, axes = eigenvalues[:, ::-1], eigenvectors[..., ::-1]",
        "weights, axes = eigenvalues, eigenvectors[..., ::-1]",
        "test_febio_files.py",
    ),
    Mutation(
        "second direction of a user's fibres",
        "mesh_files.py",
        "third = np.cross(first, transverse)",
        "third = transverse - first",
        "test_mesh_files.py",
    ),
    Mutation(
        "law less network",
        "material_point.py",
        "difference = stress - reference",
        "difference = reference - stress",
        "test_material_point.py",
    ),
    Mutation(
        "steps that the errors compare",
        "study/case_study.py",
        'compared = used & (path["step"].values > 0)',
        "compared = used",
        "test_case_study.py",
    ),
    Mutation(
        "initial fit and refit",
        "study/case_study.py",
        'groups = {INITIAL: (config["load_set"], ALL), REFIT: (SINGLE, deformation)}',
        'groups = {REFIT: (SINGLE, deformation), INITIAL: (config["load_set"], ALL)}',
        "test_case_study.py",
    ),
    Mutation(
        "outward normals of a mesh",
        "figures/surface_of_mesh.py",
        "np.cross(c - a, d - b)",
        "np.cross(c - a, b - d)",
        "test_tissue_figures.py",
    ),
    Mutation(
        "angle of a sharp edge",
        "figures/surface_of_mesh.py",
        "> 2.0 * np.cos(",
        "> 2.0 * np.sin(",
        "test_tissue_figures.py",
    ),
    Mutation(
        "nodes of the deformed specimen",
        "figures/deformed.py",
        'specimen["node_position"].values + last["displacement"].values',
        'specimen["node_position"].values - last["displacement"].values',
        "test_tissue_figures.py",
    ),
    Mutation(
        "a step refitted to what it has not done yet",
        "hybrid.py",
        "step if repetition else step - 1, C2, C3",
        "step if repetition else step + 1, C2, C3",
        "test_hybrid.py",
    ),
    Mutation(
        "history of a network up to the present step",
        "hybrid.py",
        "upto = slice(0, step + 2)",
        "upto = slice(0, step + 1)",
        "test_hybrid.py",
    ),
    Mutation(
        "states that are lost",
        "hybrid.py",
        "if not state.converged:",
        "if state.converged:",
        "test_hybrid.py",
    ),
    Mutation(
        "constants of a network without values",
        "hybrid.py",
        "np.where(unknown, C2, new_C2)",
        "np.where(unknown, new_C2, C2)",
        "test_hybrid.py",
    ),
    Mutation(
        "change of the constants in the last step",
        "hybrid.py",
        "np.array([C2, C3]) - constants[:, step]",
        "np.array([C2, C3]) + constants[:, step]",
        "test_hybrid.py",
    ),
    Mutation(
        "where a step begins",
        "hybrid.py",
        "start = solved[-1][-1].displacement[0]",
        "start = -solved[-1][-1].displacement[0]",
        "test_hybrid.py",
    ),
    Mutation(
        "surface below zero",
        "study/tissue.py",
        "np.maximum([getattr(one, name) for one in found], 0.0)",
        "np.minimum([getattr(one, name) for one in found], 0.0)",
        "test_tissue_stages.py",
    ),
    Mutation(
        "principal axes of an element for the surface",
        "study/tissue.py",
        "np.linalg.eigvalsh(specimen.structure_tensor)[:, ::-1]",
        "np.linalg.eigvalsh(specimen.structure_tensor)[:, ::+1]",
        "test_tissue_stages.py",
    ),
    Mutation(
        "force of the bones",
        "fe/boundary.py",
        "return internal_force[..., nodes, :].sum(axis=-2)",
        "return -internal_force[..., nodes, :].sum(axis=-2)",
        "test_tissue_stages.py",
    ),
    Mutation(
        "state that is shown",
        "study/solutions.py",
        "last = dataset.isel(step=-1)",
        "last = dataset.isel(step=+1)",
        "test_tissue_outputs.py",
    ),
    Mutation(
        "what a refit changed",
        "study/tissue_table.py",
        "last[name].values - first[name].values",
        "last[name].values + first[name].values",
        "test_tissue_outputs.py",
    ),
    Mutation(
        "displacement that a refit changed",
        "study/tissue_table.py",
        'last["displacement"].values - first["displacement"].values',
        'last["displacement"].values + first["displacement"].values',
        "test_tissue_outputs.py",
    ),
    Mutation(
        "stress that a refit changed",
        "study/tissue_table.py",
        "_shear(state) - _shear(before)",
        "_shear(state) + _shear(before)",
        "test_tissue_outputs.py",
    ),
    Mutation(
        "law less coupled simulation",
        "comparison.py",
        "(values - reference, reference)",
        "(values + reference, reference)",
        "test_comparison.py",
    ),
    Mutation(
        "elements that count as peaks",
        "comparison.py",
        "np.argsort(-one, kind",
        "np.argsort(one, kind",
        "test_comparison.py",
    ),
    Mutation(
        "step at which a run in other steps is compared",
        "study/comparison.py",
        "if same else [-1]",
        "if same else [0]",
        "test_comparison.py",
    ),
    Mutation(
        "matrix beside the network",
        "microstructure.py",
        "network_stress + of_matrix - tissue_stress",
        "network_stress - of_matrix - tissue_stress",
        "test_microstructure.py",
    ),
    Mutation(
        "force of a fibre looked at",
        "microstructure.py",
        "fiber_modulus_MPa * solver.assembly",
        "-fiber_modulus_MPa * solver.assembly",
        "test_microstructure.py",
    ),
    Mutation(
        "amplitude of another protocol's first load",
        "study/variants.py",
        'plan.protocol(config, FITTED_PROTOCOL)["loads"][0], "magnitude"',
        'plan.protocol(config, FITTED_PROTOCOL)["loads"][-1], "magnitude"',
        "test_sensitivity.py",
    ),
    Mutation(
        "states along the path in which a law is judged",
        "sensitivity/trial.py",
        "found = np.isfinite(path.strain_energy_density[0])",
        "found = ~np.isfinite(path.strain_energy_density[0])",
        "test_sensitivity.py",
    ),
    Mutation(
        "how far medians move",
        "sensitivity/sentences.py",
        "self.medians.max(axis=1) - self.medians.min(axis=1)",
        "self.medians.max(axis=1) + self.medians.min(axis=1)",
        "test_sensitivity.py",
    ),
    Mutation(
        "a move beyond the seeds",
        "sensitivity/sentences.py",
        "self.size > self.largest - self.least",
        "self.size < self.largest - self.least",
        "test_sensitivity.py",
    ),
    Mutation(
        "error maps",
        "figures/figure_9.py",
        "one.elements[name] - reference.elements[name]",
        "reference.elements[name] - one.elements[name]",
        "test_comparison_figures.py",
    ),
    Mutation(
        "red for more, blue for less",
        "figures/figure_9.py",
        "Normalize(-largest, largest)",
        "Normalize(largest, -largest)",
        "test_comparison_figures.py",
    ),
    Mutation(
        "the step that a killed run goes on with",
        "fe/solver.py",
        "            record.step += 1\n",
        "            record.step += 2\n",
        "test_multiscale_stage.py",
    ),
    Mutation(
        "counts of networks at a step",
        "study/multiscale.py",
        "_sums(walk.record) - before",
        "_sums(walk.record) + before",
        "test_multiscale_stage.py",
    ),
    Mutation(
        "CPU-hours of the hybrid method",
        "study/table_2.py",
        "spent / hybrid",
        "hybrid / spent",
        "test_multiscale_stage.py",
    ),
    Mutation(
        "states of a fit beyond the common stretch",
        "audit/refits.py",
        "beyond = curves.averaged_stretch > stretch",
        "beyond = curves.averaged_stretch < stretch",
        "test_audit.py",
    ),
    Mutation(
        "a modulus that falls with alignment",
        "audit/trends.py",
        "rank <= -thresholds.trend_of(self.count)",
        "rank >= -thresholds.trend_of(self.count)",
        "test_audit_constants.py",
    ),
    Mutation(
        "eigenvalues of H about one axis",
        "audit/laws.py",
        "mean = 0.5 * (values[0] + values[1])",
        "mean = 0.5 * (values[1] - values[0])",
        "test_audit_laws.py",
    ),
    Mutation(
        "what a network costs over what a law costs",
        "audit/costs.py",
        "judged([network > law, network / law >= wanted])",
        "judged([network < law, network / law >= wanted])",
        "test_audit_laws.py",
    ),
    Mutation(
        "layers of the flow chart",
        "figures/flow.py",
        "max((1 + longest_way(other, reads)",
        "max((1 - longest_way(other, reads)",
        "test_flow.py",
    ),
    Mutation(
        "distance of boxes in the flow chart",
        "figures/flow.py",
        "{node: first[index] + index for",
        "{node: first[index] - index for",
        "test_flow.py",
    ),
]


def passes(tests: str, copy: Path) -> bool:
    """Whether the tests pass in the copy; a run that neither passes nor fails ends the script, as it proves nothing."""
    command = [sys.executable, "-m", "pytest", "-q", "-x", "-p", "no:cacheprovider", f"tests/{tests}"]
    # The copy's sources come first, before the installed package.
    done = subprocess.run(command, cwd=copy, env={"PYTHONPATH": str(copy / "src")}, capture_output=True, text=True)
    if done.returncode not in (0, 1):
        raise SystemExit(f"pytest could not run tests/{tests}:\n{done.stdout}{done.stderr}")
    return done.returncode == 0


def survives(mutation: Mutation, copy: Path) -> bool:
    """Whether the tests pass with the sign flipped. The text must occur once, so that the list cannot go stale."""
    module = copy / "src" / "fibrous" / mutation.module
    source = module.read_text(encoding="utf-8")
    if source.count(mutation.text) != 1:
        raise SystemExit(
            f"{mutation.name}: '{mutation.text}' occurs {source.count(mutation.text)} times; mend the list"
        )
    module.write_text(source.replace(mutation.text, mutation.flipped), encoding="utf-8")
    try:
        return passes(mutation.tests, copy)
    finally:
        module.write_text(source, encoding="utf-8")


def main() -> int:
    """Try every mutation in a copy of the project; the number that survive."""
    with tempfile.TemporaryDirectory() as folder:
        copy = Path(folder) / "project"
        copy.mkdir()
        for name in ("src", "tests", "config", "workflow"):
            shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
        for name in ("pyproject.toml", "Snakefile"):
            shutil.copy(ROOT / name, copy / name)
        for tests in sorted({mutation.tests for mutation in MUTATIONS}):
            if not passes(tests, copy):
                raise SystemExit(f"tests/{tests} fails without a flip; mend it first")
        alive = 0
        for mutation in MUTATIONS:
            lives = survives(mutation, copy)
            alive += lives
            print(f"{'SURVIVED' if lives else 'red'}: {mutation.name} ({mutation.module})", flush=True)
    print(f"{len(MUTATIONS) - alive} of {len(MUTATIONS)} sign flips turn a test red")
    return alive


if __name__ == "__main__":
    sys.exit(min(main(), 1))
