"""Every file of the study, declared once: where it lies, and the unit and meaning of each variable and column.

Checks at reading and writing (datasets.py), the page docs/files.md (`described`) and the tables of the report
(report/tables.py) derive from it. To add a column, write it in its step and declare it here.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

from fibrous.materials.registry import LAWS
from fibrous_study.fit_tables import TENSOR_COLUMNS


@dataclass(frozen=True)
class Field:
    """A variable of a NetCDF file, or a column of a table.

    type : the unit of real numbers, "1" for pure ones, or "int", "bool" or "text"
    dims : of a variable, in their order; heading : of a column that the report shows
    """

    type: str
    meaning: str
    heading: str = ""
    dims: tuple[str, ...] = ()

    @property
    def dtype(self) -> str:
        """NumPy's kind: f, i, b or U."""
        return {"int": "i", "bool": "b", "text": "U"}.get(self.type, "f")

    @property
    def unit(self) -> str:
        """Of what is no real number, "1"."""
        return self.type if self.dtype == "f" else "1"


@dataclass(frozen=True)
class Kind:
    """A kind of NetCDF file: its place under results/, variables by name, and the numbers its attributes must hold."""

    place: str
    variables: Mapping[str, Field]
    attributes: tuple[str, ...] = ()


@dataclass(frozen=True)
class Table:
    """A CSV: its place under results/ and its columns, in their order.

    rows : values that a row of the report may have, by column; all others are left out
    law : heading of a first column of the report that says in words what the law of a row is, or nothing
    """

    place: str
    columns: Mapping[str, Field]
    rows: Mapping[str, tuple[str, ...]] = field(default_factory=dict)
    law: str = ""

    @property
    def path(self) -> str:
        """Its path from the study's folder."""
        return f"results/{self.place}"

    @property
    def headings(self) -> dict[str, str]:
        """Columns that the report shows, and their headings."""
        return {name: column.heading for name, column in self.columns.items() if column.heading}


def _kind(place: str, variables: Mapping[str, tuple[str, str, str]], attributes: str = "") -> Kind:
    declared = {name: Field(of, meaning, dims=tuple(dims.split())) for name, (dims, of, meaning) in variables.items()}
    return Kind(place, declared, tuple(attributes.split()))


def _table(
    place: str,
    columns: Mapping[str, tuple[str, ...]],
    rows: Mapping[str, tuple[str, ...]] | None = None,
    law: str = "",
) -> Table:
    declared = {name: Field(of, meaning, "".join(heading)) for name, (of, meaning, *heading) in columns.items()}
    return Table(place, declared, rows or {}, law)


# fmt: off
_TENSOR = "network axis axis_b"
_STATES = "network deformation step"
_SURFACE = "protocol load_set constant"
_NAME = ("network", "text", "name of the network, empty in an ensemble without names")
_H = (_TENSOR, "1", "generalized structure tensor H (Eq. 3)")

# Kinds of NetCDF files. Of each variable: dimensions, type or unit, meaning.
KINDS: dict[str, Kind] = {
    "networks": _kind("networks/{ensemble}/{batch}.nc", {
        "node_count": ("network", "int", "number of nodes; the network's rows in the dimension node"),
        "fiber_count": ("network", "int", "number of fibers; the network's rows in the dimension fiber"),
        "node_position": ("node axis", "edge", "reference position in the unit cube centred on the origin"),
        "node_is_boundary": ("node", "bool", "whether the node lies on a face and moves with F"),
        "fiber_nodes": ("fiber end", "int", "nodes at the fiber's ends, numbered within their own network"),
        "structure_tensor": _H,
        "target_structure_tensor": (_TENSOR, "1", "structure tensor asked of the generator"),
        "volume_fraction": ("network", "1", "fiber volume fraction (Eq. 5)"),
        "shortest_fiber": ("network", "edge", "reference length of the shortest fiber"),
        "seed": ("network", "int", "seed from which this network alone is generated"),
        "name": _NAME,
    }, "edge_length_um fiber_radius_um fiber_modulus_MPa fiber_nonlinearity fiber_linear_beyond_stretch"),
    "curves": _kind("curves/{ensemble}/{protocol}/{batch}.nc", {
        "deformation_gradient": (f"{_STATES} axis axis_b", "1", "deformation gradient F"),
        "magnitude": (_STATES, "1", "stretch, amount of shear, or part of the way"),
        "averaged_stretch": (_STATES, "1", "averaged fiber stretch √(H:C)"),
        "strain_energy_density": (_STATES, "MPa", "strain energy density of the fibers"),
        "cauchy_stress": (f"{_STATES} axis axis_b", "MPa", "Cauchy stress (Eq. 7)"),
        "first_piola_kirchhoff_stress": (f"{_STATES} axis axis_b", "MPa", "first Piola-Kirchhoff stress dW/dF"),
        "largest_orientation_eigenvalue": (
            _STATES, "1", "largest eigenvalue of the length-weighted orientation tensor h"),
        "newton_iterations": (_STATES, "int", "Newton iterations spent on the state"),
        "cuts": (_STATES, "int", "times the step to this state was halved"),
        "converged": (_STATES, "bool", "whether the state is a stable equilibrium"),
        "amplitude_limited": (
            "network deformation", "bool", "whether the load ends at the limit of the principal stretch"),
        "structure_tensor": _H,
        "name": _NAME,
    }),
    "states": _kind("states/{ensemble}/{network}_{protocol}.nc", {
        "node_position": ("deformation step node axis", "edge", "position in the deformed state"),
        "fiber_stretch": ("deformation step fiber", "1", "stretch of the fiber"),
        "fiber_nodes": ("fiber end", "int", "nodes at the fiber's ends"),
        "averaged_stretch": ("deformation step", "1", "averaged fiber stretch √(H:C)"),
        "deformation_gradient": ("deformation step axis axis_b", "1", "deformation gradient F"),
    }),
    "surface": _kind("tables/surface.nc", {
        "coefficient": (f"{_SURFACE} term", "MPa for C2, 1 for C3", "coefficient of Eq. 11"),
        "half_width": (f"{_SURFACE} term", "MPa for C2, 1 for C3", "95 % half-width of the coefficient"),
        "covariance": (f"{_SURFACE} term term_b", "squared unit of the constant", "covariance of the coefficients"),
        "residual_variance": (_SURFACE, "squared unit of the constant", "variance of a network about the surface"),
        "degrees_of_freedom": (_SURFACE, "int", "networks less terms"),
        "r_squared": (_SURFACE, "1", "coefficient of determination"),
        "cross_validated_r_squared": (_SURFACE, "1", "the same over held-out folds"),
        "networks_at_bound": (_SURFACE, "int", "networks whose constant is at a bound"),
        "network_count": ("protocol load_set", "int", "networks fitted"),
        **{
            f"{name}_range": ("protocol load_set bound", "1", f"least and largest {meaning}")
            for name, meaning in {
                **{H: f"{H} of the networks fitted" for H in ("H11", "H22", "H33")},
                "lambda_f_max": "amplitude λ_f of the networks' fits",
            }.items()
        },
    }),
    "specimen": _kind("tissue/specimen.nc", {
        "node_position": ("node axis", "mm", "reference position"),
        "element_nodes": ("element corner", "int", "nodes at the element's corners, in the order of VTK"),
        "element_network": ("element", "int", "number of the element's network in the ensemble tissue"),
        "structure_tensor": ("element axis axis_b", "1", "structure tensor H asked of the element's network"),
        "fiber_direction": ("element axis", "1", "mean direction of the element's fibers, a unit vector"),
        "enthesis": ("node", "int", "1 at nodes of the fixed, 2 of the moved enthesis, 0 elsewhere"),
        "prescribed_displacement": (
            "step node axis", "mm", "displacement at the end of the step, NaN at nodes of no enthesis"),
    }),
    "tissue": _kind("tissue/{run}.nc", {
        "displacement": ("step node axis", "mm", "displacement at the end of the step"),
        "deformation_gradient": ("step element gauss_point axis axis_b", "1", "deformation gradient F"),
        "cauchy_stress": ("step element gauss_point axis axis_b", "MPa", "Cauchy stress of matrix and fibers"),
        "reaction_force": ("step enthesis axis", "N", "force of the bone on the tissue"),
        "newton_iterations": ("step", "int", "Newton iterations spent on the step"),
        "cuts": ("step", "int", "times an increment of the step was halved"),
        "converged": ("step", "bool", "whether the step's displacement was reached in equilibrium"),
        "network_iterations": ("step", "int",
            "Newton iterations of all networks in the increments that converged; 0 in laws without networks"),
        "network_cuts": ("step", "int", "times the increment of a network was halved there"),
        "indefinite_hessians": ("step", "int", "indefinite Hessians of networks met there"),
        "structure_tensor": ("element axis axis_b", "1", "structure tensor H of the element's fibers"),
        "C2": ("step element", "MPa", "fiber modulus of the step, NaN in a law without it"),
        "C3": ("step element", "1", "fiber nonlinearity of the step, NaN in a law without it"),
    }),
    "microstructure": _kind("states/tissue/{run}_{element}.nc", {
        "node_position": ("path step node axis", "edge", "position in the deformed state"),
        "fiber_nodes": ("fiber end", "int", "nodes at the fiber's ends"),
        "fiber_stretch": ("path step fiber", "1", "stretch of the fiber"),
        "fiber_stress": ("path step fiber", "MPa", "force of the fiber over its undeformed section (Eq. 6)"),
        "orientation_tensor": (
            "path step axis axis_b", "1", "length-weighted orientation tensor h of the deformed fibers"),
        "cauchy_stress": ("path step axis axis_b", "MPa", "Cauchy stress of the network alone (Eq. 7)"),
        "deformation_gradient": ("path step axis axis_b", "1", "deformation gradient F"),
        "converged": ("path step", "bool", "whether the state is a stable equilibrium, else NaN"),
    }, "element network edge_length_um fiber_radius_um"),
}
# Coordinates of all kinds and their meanings; they count or name, and have no unit.
COORDINATES = {
    "network": "number of the network in its whole ensemble",
    "deformation": "name of the load",
    "step": "step of the load; 0 is rest",
    "path": "Gauss point whose F the network follows, or `mean` for the mean over the element's",
    "enthesis": "1 is the fixed, 2 the moved enthesis",
    "protocol": "name of the protocol",
    "load_set": "name of the load set",
    "constant": "constant of Eq. 2; C3_eight is C3 without the term 22",
    "term": "powers of H11 and H22 in Eq. 11",
    "term_b": "powers of H11 and H22 in Eq. 11",
    "bound": "least and largest",
}

# Columns that several tables share. Of each column: type or unit, meaning, heading in the report.
_LAWS = ", ".join(f"`{name}` ({law.label})" for name, law in LAWS.items())
_OBJECTIVE = ("text", "what was fitted: `energy`, its `slope` in λ_f, or `stress`, all components of Cauchy's")
_AMPLITUDE = {
    "protocol": ("text", "protocol of the fits behind the surface"),
    "load_set": ("text", "load set of the fits behind the surface", "load set"),
    "lambda_f_max_least": ("1", "least amplitude among the networks fitted", "fitted up to λ_f, least"),
    "lambda_f_max_largest": ("1", "largest amplitude among the networks fitted", "largest"),
}
_CASE_STUDY_LAW = {
    "model": ("text", "name of the law in the config, or `network`"),
    "constants": ("text", "`initial` or `refit`; empty where nothing is fitted", "constants"),
    "law": ("text", f"{_LAWS}; empty for the network"),
    "energy": ("text", "law whose energy was fitted"),
    "objective": _OBJECTIVE,
}
_TISSUE_LAW = {
    "law": ("text", _LAWS),
    "constants": ("text", "`fit` or `surface`; empty where nothing is fitted"),
    "energy": ("text", "law whose energy was fitted"),
    "objective": ("text", "what was fitted: `energy` or `stress`"),
    "refits": ("int", "how often its constants were fitted anew"),
}
_OF_SELF = "over that of the reference itself"
_RELATIVE_ERRORS = {
    "shear_stress": ("1", f"root mean square error of maximum shear stress {_OF_SELF}",
                     "relative error: maximum shear stress (1)"),
    "shear_strain": ("1", f"root mean square error of maximum shear strain {_OF_SELF}", "maximum shear strain (1)"),
    "cauchy_stress": ("1", f"root mean square error of the Cauchy tensor {_OF_SELF}", "Cauchy tensor (1)"),
    "reaction": ("1", "error of the reaction over the size of the reference's own", "force on the bone (1)"),
}
_COSTS = {
    "largest_peak_memory_MB": ("MB", "largest memory of one of them", "largest memory of a job (MB)"),
    "machine": ("text", "processor and usable cores"),
    "versions": ("text", "versions of Python and the libraries, as JSON"),
}
_TRIED = {  # ending of the name, unit, meaning
    "C2": ("_MPa", "MPa", "C2 of Eq. 2, fitted to the energy of the load set"),
    "C3": ("", "1", "C3 of Eq. 2"),
    "r_squared": ("", "1", "coefficient of determination of the fit"),
    "stress_error": ("", "1", "root mean square of Eq. 2's Cauchy stress less the network's along Eq. 9's path, "
                     "Frobenius norm, over that of the network's own"),
}
_LEFT_OUT = {
    "states_failed": ("int", "states of the load set without an equilibrium, which are left out"),
    "judged_states_failed": ("int", "states along Eq. 9's path without an equilibrium, which are left out"),
    "loads_limited": ("int", "loads of the set that end at the limit of the principal stretch"),
}

TABLES: dict[str, Table] = {
    "fits": _table("fits/{ensemble}/{protocol}.csv", {
        "network": ("int", "number of the network in its ensemble"),
        "load_set": ("text", "load set fitted, or `single` for one load"),
        "deformation": ("text", "load fitted, or `all` for those of the load set, pooled"),
        "energy": ("text", "law fitted: `structure_tensor` is Eq. 2, `families` Eq. 10C along the eigenvectors of H"),
        "objective": _OBJECTIVE,
        **dict.fromkeys(TENSOR_COLUMNS, ("1", "component of the structure tensor")),
        "lambda_f_max": ("1", "amplitude: largest averaged stretch fitted"),
        "C2_MPa": ("MPa", "C2 of the law"),
        "C3": ("1", "C3 of the law"),
        "C2_half_width_MPa": ("MPa", "95 % half-width; empty at a bound"),
        "C3_half_width": ("1", "95 % half-width; empty at a bound"),
        "r_squared": (
            "1", "coefficient of determination of the objective; of stress, about the mean of each component"),
        "rule": ("text", "the objective, `zero` (no fiber stretched, section 2.5) or `none` (no state with a stretched "
            "fiber converged)"),
        "identifiable": ("bool", "whether both constants lie inside their bounds and the points tell them apart"),
        "points_used": ("int", "states fitted"),
        "points_dropped": ("int", "states that stretch no fibers (Eq. 2: λ_f ≤ 1; Eq. 10C: no family stretched) or "
                           "without an equilibrium"),
        "name": ("text", "name of the network, empty in an ensemble without names"),
    }),
    "table_1": _table("tables/table_1.csv", {
        **_AMPLITUDE,
        "networks": ("int", "networks fitted"),
        "networks_with_C2_at_bound": ("int", "of them, those whose C2 is 0"),
        "networks_with_C3_at_bound": ("int", "of them, those whose C3 is 0 or the largest allowed"),
        "ij": ("text", "powers of H11 and H22 in Eq. 11", "ij"),
        "alpha_MPa": ("MPa", "coefficient of C2, ours", "α, ours (MPa)"),
        "alpha_half_width_MPa": ("MPa", "its 95 % half-width", "±"),
        "alpha_paper_MPa": ("MPa", "coefficient of C2, as printed", "α, paper (MPa)"),
        "alpha_paper_half_width_MPa": ("MPa", "its half-width, as printed", "±"),
        "beta_nine_terms": ("1", "coefficient of C3 with all nine terms"),
        "beta_nine_terms_half_width": ("1", "its 95 % half-width"),
        "beta_eight_terms": ("1", "coefficient of C3 without the term 22, as the paper has it", "β, ours (1)"),
        "beta_eight_terms_half_width": ("1", "its 95 % half-width", "±"),
        "beta_paper": ("1", "coefficient of C3, as printed", "β, paper (1)"),
        "beta_paper_half_width": ("1", "its half-width, as printed", "±"),
        "C2_r_squared": ("1", "R² of the surface of C2"),
        "C2_cross_validated_r_squared": ("1", "the same over held-out folds"),
        "C2_r_squared_paper": ("1", "R² of the surface of C2, as printed"),
        "C3_nine_terms_r_squared": ("1", "R² of the surface of C3 with nine terms"),
        "C3_nine_terms_cross_validated_r_squared": ("1", "the same over held-out folds"),
        "C3_eight_terms_r_squared": ("1", "R² of the surface of C3 with eight terms"),
        "C3_eight_terms_cross_validated_r_squared": ("1", "the same over held-out folds"),
        "C3_r_squared_paper": ("1", "R² of the surface of C3, as printed"),
    }, rows={"protocol": ("large",)}),
    "surface_over_triangle": _table("tables/surface_over_triangle.csv", {
        "surface": ("text", "ours with nine or eight terms for C3, or Table 1 as printed or with its indices swapped",
            "surface"),
        **_AMPLITUDE,
        "over": ("text", "an alignment, or the region over which the row sums up", "where"),
        "H11": ("1", "alignment evaluated", "H11"),
        "H22": ("1", "alignment evaluated", "H22"),
        "C2_MPa": ("MPa", "C2 there", "C2 (MPa)"),
        "C3": ("1", "C3 there", "C3 (1)"),
        "C2_negative_fraction": ("1", "share of the region's area with C2 < 0", "share with C2 < 0"),
        "C2_least_MPa": ("MPa", "least C2 over the region"),
        "C2_largest_MPa": ("MPa", "largest C2 over the region"),
        "C3_negative_fraction": ("1", "share of the region's area with C3 < 0", "share with C3 < 0"),
        "C3_least": ("1", "least C3 over the region"),
        "C3_largest": ("1", "largest C3 over the region"),
    }, rows={
        "protocol": ("large", ""),
        "surface": ("this_study_C3_eight_terms", "table_1_as_printed", "table_1_indices_swapped"),
    }),
    "section_2_6_stresses": _table("tables/section_2_6_stresses.csv", {
        **{name: column[:3] for name, column in _CASE_STUDY_LAW.items()},
        "C2_MPa": ("MPa", "C2 of the law, empty in one without it"),
        "C3": ("1", "C3 of the law, empty in one without it"),
        "step": ("int", "step of the deformation; 0 is rest"),
        "magnitude": ("1", "part of the way from rest to Eq. 9's F"),
        "averaged_stretch": ("1", "averaged fiber stretch √(H:C) of the network"),
        "strain_energy_density_MPa": ("MPa", "strain energy density of the fibers"),
        **{f"sigma_{name}_MPa": ("MPa", "Cauchy stress of the fibers alone")
           for name in ("xx", "yy", "zz", "xy", "xz", "yz")},
    }),
    "section_2_6_errors": _table("tables/section_2_6_errors.csv", {
        **_CASE_STUDY_LAW,
        "component": ("text", "component of Cauchy stress, or `all` for the tensor by its Frobenius norm", "component"),
        "points_used": ("int", "steps compared: those after rest in which the network found an equilibrium"),
        "rms_error_MPa": ("MPa", "root mean square of law less network over these steps"),
        "rms_network_MPa": ("MPa", "root mean square of the network's stress over these steps"),
        "relative_rms_error": ("1", "their ratio", "RMS error over the network's own (1)"),
        "largest_error_MPa": ("MPa", "largest absolute difference"),
        "end_error_MPa": ("MPa", "law less network at the last of these steps; of `all`, the size of the difference",
            "difference at the end (MPa)"),
        "r_squared": ("1", "coefficient of determination of the fit that gave the constants", "R² of the fit"),
    }, rows={"component": ("xx", "yy", "all")}, law="law"),
    "tissue": _table("tables/tissue.csv", {
        "run": ("text", "run of the tissue", "run"),
        "specimen": ("text", "where the specimen comes from"),
        **_TISSUE_LAW,
        "elements": ("int", "elements of the mesh"),
        "load_steps": ("int", "load steps of the run"),
        "newton_iterations": ("int", "Newton iterations of all steps", "Newton iterations"),
        "cuts": ("int", "times an increment was halved", "cuts"),
        "elements_of_C2_zero": ("int", "elements whose C2 is 0"),
        "C2_mean_MPa": ("MPa", "mean C2 over elements", "mean C2 (MPa)"),
        "C3_mean": ("1", "mean C3 over elements", "mean C3 (1)"),
        "stretch_percentile_99": ("1", "99th percentile over elements of the largest principal stretch, mean over "
                                  "Gauss points, at the last step", "99th percentile of stretch"),
        "stretch_largest": ("1", "its largest value over elements"),
        "J_least": ("1", "least determinant of F at any step and Gauss point", "least J"),
        "J_largest": ("1", "largest determinant of F at any step and Gauss point", "largest J"),
        "maximum_shear_stress_rms_MPa": (
            "MPa", "root mean square over elements of maximum shear stress, mean over Gauss points, at the last "
            "step", "RMS maximum shear stress (MPa)"),
        **{f"reaction_{axis}_N": ("N", f"force of the moved bone on the tissue along {axis} at the last step")
           for axis in "xyz"},
        **{
            f"{name}_change_{ending}": (
                unit or "1", f"{size} over {over} of the change of {what} by the last refit; empty without one")
            for name, unit, over, what in (
                ("C2", "MPa", "elements", "C2"), ("C3", "", "elements", "C3"),
                ("displacement", "mm", "nodes", "displacement"),
                ("maximum_shear_stress", "MPa", "elements", "maximum shear stress"),
            )
            for ending, size in ((f"rms{unit and '_' + unit}", "root mean square"),
                                 (f"largest{unit and '_' + unit}", "largest absolute value"))
        },
    }, law="law"),
    "comparison": _table("tables/comparison.csv", {
        "run": ("text", "run of the tissue that is compared with the coupled multiscale simulation, at the last load "
                "step", "run"),
        "specimen": ("text", "where the specimen comes from", "specimen"),
        "model": ("text", "name of its model in the config"),
        **_TISSUE_LAW,
        "load_steps": ("int", "load steps of the run"),
        "shear_stress_rms_error_MPa": (
            "MPa", "maximum shear of Cauchy stress, mean over an element's Gauss points: root mean square error "
            "over elements", "RMS error of maximum shear stress (MPa)"),
        "shear_stress_relative_rms_error": _RELATIVE_ERRORS["shear_stress"],
        "shear_stress_largest_error_MPa": ("MPa", "largest absolute error of it in an element"),
        "shear_strain_rms_error": ("1", "the same of maximum shear of Green-Lagrange strain"),
        "shear_strain_relative_rms_error": _RELATIVE_ERRORS["shear_strain"],
        "shear_strain_largest_error": ("1", "largest absolute error of it in an element"),
        "cauchy_stress_rms_error_MPa": ("MPa", "root mean square of the error's Frobenius norm over Gauss points"),
        "cauchy_stress_relative_rms_error": _RELATIVE_ERRORS["cauchy_stress"],
        "displacement_rms_error_mm": ("mm", "root mean square of the length of the error over nodes"),
        "reaction_error_N": ("N", "length of the error of the moved bone's force on the tissue"),
        "reaction_relative_error": _RELATIVE_ERRORS["reaction"],
        "shear_stress_peak_overlap": (
            "1", "share of the reference's top tenth of elements in the run's top tenth; 0.1 by chance",
            "peaks of stress found (1)"),
        "shear_strain_peak_overlap": ("1", "the same of maximum shear strain"),
        "cpu_seconds": ("s", "CPU time of the process that computed the run", "CPU time of the finite elements (s)"),
    }, law="law"),
    "comparison_steps": _table("tables/comparison_steps.csv", {
        "run": ("text", "run of the tissue"),
        "specimen": ("text", "where the specimen comes from"),
        "step": ("int", "load step of the reference; a run with another number of steps has its last one alone"),
        **{f"{name}_relative_{'' if name == 'reaction' else 'rms_'}error": column[:3]
           for name, column in _RELATIVE_ERRORS.items()},
    }),
    "table_2": _table("tables/table_2.csv", {
        "specimen": ("text", "where the specimen comes from"),
        "method": ("text", "`hybrid`, `multiscale`, `both`, or `beyond` the method", "method"),
        "runs": ("text", "runs of the tissue that are summed up", "runs"),
        "task": ("text", "what was computed", "task"),
        "paper_cpu_hours": ("hour", "CPU-hours as printed in Table 2", "paper (CPU-hours)"),
        "cpu_hours": ("hour", "CPU-hours that the processes counted; of a killed run up to its last checkpoint",
                      "here (CPU-hours)"),
        "paper_over_ours": ("1", "their ratio", "paper over ours"),
        "times_hybrid": ("1", "CPU-hours of a run with networks over those of the whole hybrid method",
                         "coupled over hybrid, here"),
        "times_hybrid_paper": ("1", "the same of the printed ones", "coupled over hybrid, paper"),
        "processes": ("int", "files whose processes were summed up"),
        **{name: column[:3] for name, column in _COSTS.items()},
    }),
    "table_2_parts": _table("tables/table_2_parts.csv", {
        "specimen": ("text", "where the specimen comes from"),
        "run": ("text", "a run with networks", "run"),
        "part": ("text", "networks' `equilibrium` and `condensation`, the `macroscopic solve`, or the "
                 "rest", "part"),
        "cpu_seconds": ("s", "CPU seconds spent there", "CPU time (s)"),
        "share": ("1", "share of the whole process", "share of the run"),
    }),
    "claims": _table("claims.csv", {
        "claim": ("text", "statement of the paper, as config/paper.yaml has it", "statement"),
        "quantity": ("text", "number behind the verdict, as the statement's sentences in config/paper.yaml name it",
                     "quantity"),
        "load_set": ("text", "load set that it belongs to, or nothing", "load set"),
        "value": ("1", "the number, in `unit`; 1 and 0 where it says whether something holds", "value"),
        "unit": ("text", "its unit", "unit"),
        "low": ("1", "least over the replicates of the network that the value is of", "least over replicates"),
        "high": ("1", "largest over them", "largest over replicates"),
        "printed": ("1", "the paper's number", "printed"),
        "verdict": ("text", "of the statement: `reproduced`, `partly`, `not reproduced`, `contradicted by the paper "
                    "itself` or `cannot be checked: data not public`, by the thresholds of `claims` in the config",
                    "verdict"),
    }),
    "convergence": _table("tables/convergence.csv", {
        "ensemble": ("text", "ensemble of a state without an equilibrium"),
        "protocol": ("text", "its protocol"),
        "network": ("int", "its network's number"),
        "name": ("text", "its network's name"),
        "load": ("text", "its load"),
        "step": ("int", "its step"),
        "amplitude_limited": ("bool", "whether the load was cut at the principal stretch's limit"),
        "newton_iterations": ("int", "iterations spent on it"),
    }),
    "stages": _table("tables/stages.csv", {
        "stage": ("text", "stage of the study", "stage"),
        "reads": ("text", "stages whose files its jobs read", "reads"),
        "jobs": ("int", "number of its jobs", "jobs"),
        "cpu_seconds": ("s", "CPU seconds that they counted of themselves", "CPU time (s)"),
        **_COSTS,
    }),
    "targets": _table("tables/targets.csv", {
        "target": ("text", "target of the workflow; `all` is the study without its report", "target"),
        "jobs": ("int", "jobs that it needs from an empty folder", "jobs from an empty folder"),
        "cpu_seconds": ("s", "CPU seconds of these jobs", "CPU time (s)"),
    }),
    "sensitivity_trials": _table("sensitivity/{variant}.csv", {
        "factor": ("text", "key of `sensitivity` in the config that is varied, `base` for the study's own values"),
        "value": ("1", "its value, in `unit`; empty for the base"),
        "unit": ("text", "unit of the value"),
        "network": ("text", "name of the alignment"),
        "replicate": ("int", "number of the network in the ensemble of replicates, from which its seed follows"),
        "seed": ("int", "seed from which this network alone is generated"),
        "load_set": ("text", "load set fitted"),
        **{f"{name}{ending}": (unit, meaning) for name, (ending, unit, meaning) in _TRIED.items()},
        "lambda_f_max": ("1", "amplitude: largest averaged stretch fitted"),
        "points_used": ("int", "states fitted"),
        **_LEFT_OUT,
        "fibers": ("int", "fibers of the network"),
    }),
    "sensitivity": _table("tables/sensitivity.csv", {
        "factor": ("text", "key of `sensitivity` in the config that is varied"),
        "unit": ("text", "unit of the value"),
        "value": ("1", "its value, in `unit`"),
        "network": ("text", "name of the alignment"),
        "load_set": ("text", "load set fitted"),
        "is_base": ("bool", "whether the value is the study's own"),
        "replicates": ("int", "networks summed up"),
        **{f"{name}_{of}{ending}": (unit, f"{of} over the networks: {meaning}")
           for name, (ending, unit, meaning) in _TRIED.items() for of in ("median", "least", "largest")},
        **{f"{name}_over_base": ("1", f"median of {name} over that of the base; empty where that is 0")
           for name in _TRIED},
        **_LEFT_OUT,
    }),
    "sensitivity_sentences": _table("tables/sensitivity_sentences.csv", {
        "factor": ("text", "what is varied; also `shear_directions`, the load sets, and `seeds`, the networks"),
        "quantity": ("text", "`C2_MPa`, `C3`, `r_squared` or `stress_error`, as in `sensitivity.csv`"),
        "cases": ("int", "networks under one load set each; networks alone where load sets are compared"),
        "beyond_seeds": ("int", "cases whose medians move by more than the base's networks are apart"),
        "network": ("text", "alignment of the case that moves most among those beyond seeds, or among all"),
        "load_set": ("text", "its load set; empty where load sets are compared"),
        "least": ("1", "its least median, in the unit of the quantity"),
        "least_at": ("text", "value of the factor there, or load set"),
        "largest": ("1", "its largest median, in the unit of the quantity"),
        "largest_at": ("text", "value of the factor there, or load set"),
        "seeds_least": ("1", "the least of the base's networks in this case, in the unit of the quantity"),
        "seeds_largest": ("1", "the largest of them"),
        "states_failed": ("int", "states without an equilibrium, which are left out"),
        "sentence": ("text", "the same in words"),
    }),
}
# Files that say themselves what they hold, or that are pictures of others.
OTHERS = {
    "tissue/{run}.vtu": "last state of a run for ParaView: displacement (mm), F, Cauchy stress (MPa), constants",
    "tissue/{run}.feb": "the problem of a run as an input of FEBio 4",
    "figures/{figure}.svg": "a figure, and the same as .png",
    "figures/{figure}.csv": "the points that the figure draws, named as in the tables that they come from",
    "report/{table}.html": "a table as a page",
    "report.html": "the report",
}
# fmt: on

_OPENING = """# What the files hold

Generated by `python -m fibrous_study describe` from `src/fibrous_study/schema.py`. Paths are under `results/`. Axis
indices 0, 1, 2 are x, y, z; lengths of networks are in edges of the unit cube. Attributes of NetCDF files, and the
`.json` beside all others, hold stage, config, hashes, seed, versions, CPU seconds and peak memory of the process that
wrote them.
"""


def described() -> str:
    """Every file of the study with its variables, dimensions, units and meanings, as a page of Markdown."""
    lines = [_OPENING.rstrip()]
    for kind in KINDS.values():
        lines += ["", f"## `{kind.place}`", "", "| variable | dimensions | unit | meaning |", "|---|---|---|---|"]
        lines += [
            f"| `{name}` | {', '.join(one.dims)} | {_unit(one)} | {one.meaning} |"
            for name, one in kind.variables.items()
        ]
    for table in TABLES.values():
        lines += ["", f"## `{table.place}`", "", "| column | unit | meaning |", "|---|---|---|"]
        lines += [f"| `{name}` | {_unit(one)} | {one.meaning} |" for name, one in table.columns.items()]
    lines += ["", "## Other files", "", "| file | holds |", "|---|---|"]
    lines += [f"| `{place}` | {holds} |" for place, holds in OTHERS.items()]
    return "\n".join(lines) + "\n"


def _unit(field_: Field) -> str:
    return "text" if field_.type == "text" else field_.unit
