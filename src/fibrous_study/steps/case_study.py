"""Rule `case_study`: one network against the laws fitted to it, under a deformation they were not fitted to (2.6)."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from fibrous.comparison import COMPONENTS, stress_errors
from fibrous.curves import Curves
from fibrous.errors import DatasetError, naming
from fibrous.materials.affine_fibers import AffineFibers
from fibrous.materials.contract import Material
from fibrous.materials.registry import LAWS, law_called
from fibrous_study import datasets
from fibrous_study.curve_datasets import curves_called
from fibrous_study.fit_tables import ALL, INITIAL, REFIT, SINGLE, fits_of, structure_tensors
from fibrous_study.loading import member_called

NETWORK = "network"  # in the column `model`
# Section 2.5 fits the slope where an energy fit is poor; it stays the energy's fit.
NOTHING = {"constants": "", "law": "", "energy": "", "objective": "", "C2_MPa": np.nan, "C3": np.nan}


# A law with its constants, what the tables say of it, and the R² of its fit.
Model = tuple[Material, dict[str, Any], float]


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Cauchy stress of the fibres along the one deformation of inputs["curves"]: the network's and every law's.

    inputs["fits"] holds the fits to many loads, then those to this deformation alone; inputs["networks"] the network's
    fibres. The config holds the `network`'s name, the `load_set` of the initial fits, `tension_only` and `models`, of
    which those count here whose constants are fitted, and the affine fibres. Writes outputs["stresses"], a row a state,
    and outputs["errors"], a row for each law and component over the steps after rest. States in which the network found
    no equilibrium are left out of its rows and of the errors, and named on stderr.
    Raises DatasetError where a file does not hold what is asked of it, MaterialError for constants that are none.
    """
    config = params["config"]
    path = _path_of(inputs["curves"][0], config["network"])
    network, gradients, used = path.cauchy_stress[0, 0], path.deformation_gradient[0, 0], path.converged[0, 0]
    for step in np.flatnonzero(~used):
        print(f"{config['network']}, step {step}: no equilibrium was found; the state is left out", file=sys.stderr)
    compared = used & (np.arange(len(used)) > 0)
    if not compared.any():
        raise DatasetError(
            f"{inputs['curves'][0]}: {config['network']} found no equilibrium beyond rest; load it in more steps"
        )
    states = [_states({"model": NETWORK, **NOTHING}, path, path.strain_energy_density[0, 0], network)[used]]
    errors: list[dict[str, Any]] = []
    for material, about, r_squared in _models(inputs, config, path.loads[0]):
        # The steps as Gauss points of one element, for fibres that belong to an element.
        stress, energy = material.stress(gradients[None])[0], material.energy(gradients[None])[0]
        states.append(_states(about, path, energy, stress))
        of_law = {name: about[name] for name in ("model", "constants", "law", "energy", "objective")}
        for component, error in stress_errors(stress[compared], network[compared]).items():
            row = {
                "component": component,
                "points_used": int(compared.sum()),
                "rms_error_MPa": error.rms_error,
                "rms_network_MPa": error.rms_reference,
                "relative_rms_error": error.relative_rms_error,
                "largest_error_MPa": error.largest_error,
                "end_error_MPa": error.end_error,
                "r_squared": r_squared,
            }
            errors.append({**of_law, **row})
    datasets.write_table(pd.concat(states, ignore_index=True), outputs["stresses"], params, "section_2_6_stresses")
    datasets.write_table(pd.DataFrame(errors), outputs["errors"], params, "section_2_6_errors")


def _path_of(path: Path, name: str) -> Curves:
    """The network of that name under the only deformation of a file of curves."""
    curves = curves_called(path, name)
    if len(curves.loads) != 1:
        raise DatasetError(f"{path}: holds {len(curves.loads)} deformations where the case study has one")
    return curves


def _models(inputs: Mapping[str, list[Path]], config: Mapping[str, Any], deformation: str) -> Iterator[Model]:
    """The laws of the config, in its order; one that is fitted again comes twice."""
    groups = {INITIAL: (config["load_set"], ALL), REFIT: (SINGLE, deformation)}
    fits = dict(zip(groups, inputs["fits"], strict=True))
    for entry in config["models"]:
        about = {"model": entry["name"], **NOTHING, "law": entry["law"]}
        if LAWS[entry["law"]].has_networks:
            network = member_called(inputs["networks"][0], config["network"]).network
            yield AffineFibers.of_networks([network]), about, np.nan
        elif entry.get("constants") == "fit":
            for constants in (INITIAL, REFIT) if entry.get("refit") else (INITIAL,):
                with naming(f"{fits[constants]}: model '{entry['name']}'"):
                    table = datasets.read_table(fits[constants], "fits")
                    row = _row(table, config["network"], entry, *groups[constants])
                    (fit,) = row.to_dict("records")
                    of_fit = {name: fit[name] for name in ("objective", "C2_MPa", "C3")}
                    material = law_called(entry["law"]).material.of_structure_tensor(
                        structure_tensors(row)[0], fit["C2_MPa"], fit["C3"], config["tension_only"]
                    )
                    of_model = {"constants": constants, "energy": entry["energy"]}
                    yield material, {**about, **of_model, **of_fit}, fit["r_squared"]


def _row(table: pd.DataFrame, network: str, entry: Mapping[str, Any], load_set: str, deformation: str) -> pd.DataFrame:
    """The one row with the constants of a model."""
    fits = fits_of(table, entry["energy"], entry["objective"], load_set, deformation)
    fits = fits[fits["name"] == network]
    if len(fits) != 1:
        raise DatasetError(
            f"{len(fits)} fits of '{network}' to {load_set}, {deformation}, with the energy {entry['energy']} and the "
            f"objective {entry['objective']}, where one is needed; delete the table and run again"
        )
    return fits


def _states(about: Mapping[str, Any], path: Curves, energy: np.ndarray, stress: np.ndarray) -> pd.DataFrame:
    """Rows of the table of stresses, one a step."""
    states = {
        "step": np.arange(len(energy)),
        "magnitude": path.magnitude[0, 0],
        "averaged_stretch": path.averaged_stretch[0, 0],
        "strain_energy_density_MPa": energy,
        **{f"sigma_{name}_MPa": stress[:, i, j] for name, (i, j) in COMPONENTS.items()},
    }
    return pd.DataFrame({**about, **states})
