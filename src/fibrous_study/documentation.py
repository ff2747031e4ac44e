"""What every file of the study holds, for the page `docs/files.md`: variables from datasets.py, columns from here.

Apart from datasets.py, so that rewording a meaning does not count as a change of the code that made the results.
"""

from __future__ import annotations

from fibrous_study.datasets import KINDS

# Columns of the tables, with unit and meaning; the unit of one with a dimension is in its name, too.
_FIT = {
    "network": ("1", "number of the network in its ensemble"),
    "load_set": ("", "load set fitted, or `single` for one load"),
    "deformation": ("", "load fitted, or `all` for those of the load set, pooled"),
    "energy": ("", "law fitted: `structure_tensor` is Eq. 2, `families` Eq. 10C along the eigenvectors of H"),
    "objective": ("", "what was fitted: `energy`, its `slope` in λ_f, or `stress`, all components of Cauchy's"),
    **dict.fromkeys(("H11", "H22", "H33", "H12", "H13", "H23"), ("1", "component of the structure tensor")),
    "lambda_f_max": ("1", "amplitude: largest averaged stretch fitted"),
    "C2_MPa": ("MPa", "C2 of the law"),
    "C3": ("1", "C3 of the law"),
    "C2_half_width_MPa": ("MPa", "95 % half-width; empty at a bound"),
    "C3_half_width": ("1", "95 % half-width; empty at a bound"),
    "r_squared": ("1", "coefficient of determination of the objective; of stress, about the mean of each component"),
    "rule": (
        "",
        "the objective, `zero` (no fibre stretched, section 2.5) or `none` (nothing converged where one is)",
    ),
    "identifiable": ("1", "whether both constants lie inside their bounds and the points tell them apart"),
    "points_used": ("1", "states fitted"),
    "points_dropped": (
        "1",
        "states that stretch no fibres (Eq. 2: λ_f ≤ 1; Eq. 10C: no family stretched) or without an equilibrium",
    ),
    "name": ("", "name of the network, empty in an ensemble without names"),
}
_AMPLITUDE = {
    "protocol": ("", "protocol of the fits behind the surface"),
    "load_set": ("", "load set of the fits behind the surface"),
    "lambda_f_max_least": ("1", "least amplitude among the networks fitted"),
    "lambda_f_max_largest": ("1", "largest amplitude among the networks fitted"),
}
_R_SQUARED = {
    name: ("1", meaning)
    for name, meaning in {
        "C2_r_squared": "R² of the surface of C2",
        "C2_cross_validated_r_squared": "the same over held-out folds",
        "C2_r_squared_paper": "R² of the surface of C2, as printed",
        "C3_nine_terms_r_squared": "R² of the surface of C3 with nine terms",
        "C3_nine_terms_cross_validated_r_squared": "the same over held-out folds",
        "C3_eight_terms_r_squared": "R² of the surface of C3 with eight terms",
        "C3_eight_terms_cross_validated_r_squared": "the same over held-out folds",
        "C3_r_squared_paper": "R² of the surface of C3, as printed",
    }.items()
}
_COMPONENTS = ("xx", "yy", "zz", "xy", "xz", "yz")
_LAW = {
    "model": ("", "name of the law in the config, or `network`"),
    "constants": ("", "`initial` or `refit`; empty where nothing is fitted"),
    "law": ("", "`families` (Eq. 10C), `structure_tensor` (Eq. 2) or `affine`; empty for the network"),
    "energy": ("", "form of the energy that was fitted"),
    "objective": ("", "what was fitted: `energy`, its `slope` in λ_f, or `stress`"),
}
# Errors from the coupled simulation, at the last load step in the one table, at every step in the other.
_SHEAR_STRESS_RELATIVE = ("1", "root mean square error of maximum shear stress over that of the reference itself")
_SHEAR_STRAIN_RELATIVE = ("1", "root mean square error of maximum shear strain over that of the reference itself")
_CAUCHY_RELATIVE = ("1", "root mean square error of the Cauchy tensor over that of the reference itself")
_REACTION_RELATIVE = ("1", "error of the reaction over the size of the reference's own")
_CONSTANTS = {
    "C2": ("MPa", "C2 of Eq. 2, fitted to the energy of the load set"),
    "C3": ("1", "C3 of Eq. 2"),
    "r_squared": ("1", "coefficient of determination of the fit"),
    "stress_error": (
        "1",
        "root mean square of Eq. 2's Cauchy stress less the network's along Eq. 9's path, Frobenius norm, over that of "
        "the network's own",
    ),
}
_LEFT_OUT = {
    "states_failed": ("1", "states of the load set without an equilibrium, which are left out"),
    "judged_states_failed": ("1", "states along Eq. 9's path without an equilibrium, which are left out"),
    "loads_limited": ("1", "loads of the set that end at the limit of the principal stretch"),
}
_VARIED = {
    "factor": ("", "key of `sensitivity` in the config that is varied, `base` for the study's own values"),
    "value": ("1", "its value, in `unit`; empty for the base"),
    "unit": ("", "unit of the value"),
}
TABLES: dict[str, dict[str, tuple[str, str]]] = {
    "fits/{ensemble}/{protocol}.csv": _FIT,
    "tables/table_1.csv": {
        **_AMPLITUDE,
        "networks": ("1", "networks fitted"),
        "networks_with_C2_at_bound": ("1", "of them, those whose C2 is 0"),
        "networks_with_C3_at_bound": ("1", "of them, those whose C3 is 0 or the largest allowed"),
        "ij": ("", "powers of H11 and H22 in Eq. 11"),
        "alpha_MPa": ("MPa", "coefficient of C2, ours"),
        "alpha_half_width_MPa": ("MPa", "its 95 % half-width"),
        "alpha_paper_MPa": ("MPa", "coefficient of C2, as printed"),
        "alpha_paper_half_width_MPa": ("MPa", "its half-width, as printed"),
        "beta_nine_terms": ("1", "coefficient of C3 with all nine terms"),
        "beta_nine_terms_half_width": ("1", "its 95 % half-width"),
        "beta_eight_terms": ("1", "coefficient of C3 without the term 22, as the paper has it"),
        "beta_eight_terms_half_width": ("1", "its 95 % half-width"),
        "beta_paper": ("1", "coefficient of C3, as printed"),
        "beta_paper_half_width": ("1", "its half-width, as printed"),
        **_R_SQUARED,
    },
    "tables/surface_over_triangle.csv": {
        "surface": ("", "ours with nine or eight terms for C3, or Table 1 as printed or with its indices swapped"),
        **_AMPLITUDE,
        "over": ("", "an alignment, or the region over which the row sums up"),
        "H11": ("1", "alignment evaluated"),
        "H22": ("1", "alignment evaluated"),
        "C2_MPa": ("MPa", "C2 there"),
        "C3": ("1", "C3 there"),
        "C2_negative_fraction": ("1", "share of the region's area with C2 < 0"),
        "C2_least_MPa": ("MPa", "least C2 over the region"),
        "C2_largest_MPa": ("MPa", "largest C2 over the region"),
        "C3_negative_fraction": ("1", "share of the region's area with C3 < 0"),
        "C3_least": ("1", "least C3 over the region"),
        "C3_largest": ("1", "largest C3 over the region"),
    },
    "tables/table_2.csv": {
        "specimen": ("", "where the tissue comes from"),
        "method": ("", "`hybrid`, `multiscale`, or `both`"),
        "runs": ("", "runs of the tissue that are summed up"),
        "task": ("", "what was computed"),
        "paper_cpu_hours": ("hour", "CPU-hours as printed in Table 2"),
        "cpu_hours": (
            "hour",
            "CPU-hours that the processes counted; of a killed run up to its last checkpoint",
        ),
        "paper_over_ours": ("1", "their ratio"),
        "times_hybrid": ("1", "CPU-hours of a run with networks over those of the whole hybrid method"),
        "times_hybrid_paper": ("1", "the same of the printed ones"),
        "processes": ("1", "files whose processes were summed up"),
        "largest_peak_memory_MB": ("MB", "largest memory of one of them"),
        "machine": ("", "processor and usable cores"),
        "versions": ("", "versions of Python and the libraries, as JSON"),
    },
    "tables/table_2_parts.csv": {
        "specimen": ("", "where the tissue comes from"),
        "run": ("", "a run with networks"),
        "part": (
            "",
            "networks' `equilibrium` and `condensation`, the `macroscopic solve`, or the rest",
        ),
        "cpu_seconds": ("s", "CPU seconds spent there"),
        "share": ("1", "share of the whole process"),
    },
    "tables/convergence.csv": {
        "ensemble": ("", "ensemble of a state without an equilibrium"),
        "protocol": ("", "its protocol"),
        "network": ("1", "its network's number"),
        "name": ("", "its network's name"),
        "load": ("", "its load"),
        "step": ("1", "its step"),
        "amplitude_limited": ("1", "whether the load was cut at the principal stretch's limit"),
        "newton_iterations": ("1", "iterations spent on it"),
    },
    "tables/section_2_6_stresses.csv": {
        **_LAW,
        "C2_MPa": ("MPa", "C2 of the law, empty in one without it"),
        "C3": ("1", "C3 of the law, empty in one without it"),
        "step": ("1", "step of the deformation; 0 is rest"),
        "magnitude": ("1", "part of the way from rest to Eq. 9's F"),
        "averaged_stretch": ("1", "averaged fiber stretch √(H:C) of the network"),
        "strain_energy_density_MPa": ("MPa", "strain energy density of the fibers"),
        **{f"sigma_{name}_MPa": ("MPa", "Cauchy stress of the fibers alone") for name in _COMPONENTS},
    },
    "tables/section_2_6_errors.csv": {
        **_LAW,
        "component": ("", "component of Cauchy stress, or `all` for the tensor by its Frobenius norm"),
        "points_used": ("1", "steps compared: those after rest in which the network found an equilibrium"),
        "rms_error_MPa": ("MPa", "root mean square of law less network over these steps"),
        "rms_network_MPa": ("MPa", "root mean square of the network's stress over these steps"),
        "relative_rms_error": ("1", "their ratio"),
        "largest_error_MPa": ("MPa", "largest absolute difference"),
        "end_error_MPa": ("MPa", "law less network at the last of these steps; of `all`, the size of the difference"),
        "r_squared": ("1", "coefficient of determination of the fit that gave the constants"),
    },
    "claims.csv": {
        "claim": ("", "statement of the paper, as config/paper.yaml has it"),
        "quantity": ("", "number behind the verdict, as the statement's sentences in config/paper.yaml name it"),
        "load_set": ("", "load set that it belongs to, or nothing"),
        "value": ("1", "the number, in `unit`; 1 and 0 where it says whether something holds"),
        "unit": ("", "its unit"),
        "low": ("1", "least over the replicates of the network that the value is of"),
        "high": ("1", "largest over them"),
        "printed": ("1", "the paper's number"),
        "verdict": (
            "",
            "of the statement: `reproduced`, `partly`, `not reproduced`, `contradicted by the paper itself` or `cannot "
            "be checked: data not public`, by the thresholds of `claims` in the config",
        ),
    },
    "tables/stages.csv": {
        "stage": ("", "stage of the study"),
        "reads": ("", "stages whose files its jobs read"),
        "jobs": ("1", "number of its jobs"),
        "cpu_seconds": ("s", "CPU seconds that they counted of themselves"),
        "largest_peak_memory_MB": ("MB", "largest memory of one of them"),
        "machine": ("", "processor and usable cores"),
        "versions": ("", "versions of Python and the libraries, as JSON"),
    },
    "tables/targets.csv": {
        "target": ("", "target of the workflow; `all` is the study without its report"),
        "jobs": ("1", "jobs that it needs from an empty folder"),
        "cpu_seconds": ("s", "CPU seconds of these jobs"),
    },
    "sensitivity/{variant}.csv": {
        **_VARIED,
        "network": ("", "name of the alignment"),
        "replicate": ("1", "number of the network in the ensemble of replicates, from which its seed follows"),
        "seed": ("1", "seed from which this network alone is generated"),
        "load_set": ("", "load set fitted"),
        **{{"C2": "C2_MPa"}.get(name, name): said for name, said in _CONSTANTS.items()},
        "lambda_f_max": ("1", "amplitude: largest averaged stretch fitted"),
        "points_used": ("1", "states fitted"),
        **_LEFT_OUT,
        "fibers": ("1", "fibers of the network"),
    },
    "tables/sensitivity.csv": {
        "factor": ("", "key of `sensitivity` in the config that is varied"),
        "unit": _VARIED["unit"],
        "value": ("1", "its value, in `unit`"),
        "network": ("", "name of the alignment"),
        "load_set": ("", "load set fitted"),
        "is_base": ("1", "whether the value is the study's own"),
        "replicates": ("1", "networks summed up"),
        **{
            f"{name}_{of}{'_MPa' if unit == 'MPa' else ''}": (unit, f"{of} over the networks: {meaning}")
            for name, (unit, meaning) in _CONSTANTS.items()
            for of in ("median", "least", "largest")
        },
        **{
            f"{name}_over_base": ("1", f"median of {name} over that of the base; empty where that is 0")
            for name in _CONSTANTS
        },
        **_LEFT_OUT,
    },
    "tables/sensitivity_sentences.csv": {
        "factor": ("", "what is varied; also `shear_directions`, the load sets, and `seeds`, the networks"),
        "sentence": (
            "",
            "how far medians over networks move, in cases of an alignment and a load set each, and whether by more "
            "than the base's networks are apart",
        ),
    },
    "tables/comparison.csv": {
        "run": ("", "run of the tissue that is compared with the coupled multiscale simulation, at the last load step"),
        "specimen": ("", "where the specimen comes from"),
        "model": ("", "name of its model in the config"),
        "law": ("", "`families` (Eq. 10C), `structure_tensor` (Eq. 2), `affine`, `matrix` or `network`"),
        "constants": ("", "`fit` or `surface`; empty where nothing is fitted"),
        "energy": ("", "form of the energy that was fitted"),
        "objective": ("", "what was fitted: `energy` or `stress`"),
        "refits": ("1", "how often its constants were fitted anew"),
        "load_steps": ("1", "load steps of the run"),
        "shear_stress_rms_error_MPa": (
            "MPa",
            "maximum shear of Cauchy stress, mean over an element's Gauss points: root mean square error over elements",
        ),
        "shear_stress_relative_rms_error": _SHEAR_STRESS_RELATIVE,
        "shear_stress_largest_error_MPa": ("MPa", "largest absolute error of it in an element"),
        "shear_strain_rms_error": ("1", "the same of maximum shear of Green-Lagrange strain"),
        "shear_strain_relative_rms_error": _SHEAR_STRAIN_RELATIVE,
        "shear_strain_largest_error": ("1", "largest absolute error of it in an element"),
        "cauchy_stress_rms_error_MPa": ("MPa", "root mean square of the error's Frobenius norm over Gauss points"),
        "cauchy_stress_relative_rms_error": _CAUCHY_RELATIVE,
        "displacement_rms_error_mm": ("mm", "root mean square of the length of the error over nodes"),
        "reaction_error_N": ("N", "length of the error of the moved bone's force on the tissue"),
        "reaction_relative_error": _REACTION_RELATIVE,
        "shear_stress_peak_overlap": (
            "1",
            "share of the reference's top tenth of elements in the run's top tenth; 0.1 by chance",
        ),
        "shear_strain_peak_overlap": ("1", "the same of maximum shear strain"),
        "cpu_seconds": ("s", "CPU time of the process that computed the run"),
    },
    "tables/comparison_steps.csv": {
        "run": ("", "run of the tissue"),
        "specimen": ("", "where the tissue comes from"),
        "step": ("1", "load step of the reference; a run with another number of steps has its last one alone"),
        "shear_stress_relative_rms_error": _SHEAR_STRESS_RELATIVE,
        "shear_strain_relative_rms_error": _SHEAR_STRAIN_RELATIVE,
        "cauchy_stress_relative_rms_error": _CAUCHY_RELATIVE,
        "reaction_relative_error": _REACTION_RELATIVE,
    },
}
PLACES = {
    "networks": "networks/{ensemble}/{batch}.nc",
    "curves": "curves/{ensemble}/{protocol}/{batch}.nc",
    "states": "states/{ensemble}/{network}_{protocol}.nc",
    "surface": "tables/surface.nc",
    "specimen": "tissue/specimen.nc",
    "tissue": "tissue/{model}.nc",
    "microstructure": "states/tissue/{run}_{element}.nc",
}


def described() -> str:
    """Every file of the study with its variables, dimensions, units and meanings, as a page of Markdown."""
    lines = [
        "# What the files hold",
        "",
        "Generated by `python -m fibrous_study describe`. Paths are under `results/`. Axis indices 0, 1, 2 are",
        "x, y, z; lengths of networks are in edges of the unit cube. Attributes of NetCDF files, and the `.json`",
        "beside tables, hold",
        "stage, config, hashes, seed, versions, CPU seconds and peak memory of the process that wrote them.",
    ]
    for kind, declared in KINDS.items():
        lines += ["", f"## `{PLACES[kind]}`", "", "| variable | dimensions | unit | meaning |", "|---|---|---|---|"]
        lines += [
            f"| `{name}` | {', '.join(one.dims)} | {'text' if one.kind == 'U' else one.units} | {one.long_name} |"
            for name, one in declared.items()
        ]
    for place, columns in TABLES.items():
        lines += ["", f"## `{place}`", "", "| column | unit | meaning |", "|---|---|---|"]
        lines += [f"| `{name}` | {unit or 'text'} | {meaning} |" for name, (unit, meaning) in columns.items()]
    return "\n".join(lines) + "\n"
