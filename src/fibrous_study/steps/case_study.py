"""Rule `case_study`: one network against the laws fitted to it, under a deformation they were not fitted to (2.6)."""

from __future__ import annotations

import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
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
from fibrous_study.curve_datasets import read_curves
from fibrous_study.fit_tables import ALL, SINGLE, TENSOR_COLUMNS, fits_of, structure_tensors
from fibrous_study.loading import member_called

NETWORK = "network"  # in the column `model`
INITIAL, REFIT = "initial", "refit"
FIT_COLUMNS = (
    "name", "load_set", "deformation", "energy", "objective", *TENSOR_COLUMNS, "C2_MPa", "C3", "r_squared",
)  # fmt: skip
# Section 2.5 fits the slope where an energy fit is poor; it stays the energy's fit.
NOTHING = {"constants": "", "law": "", "energy": "", "objective": "", "C2_MPa": np.nan, "C3": np.nan}


@dataclass(frozen=True)
class _Model:
    """A law with its constants, and what the tables say of it."""

    about: dict[str, Any]
    material: Material
    r_squared: float


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
    about = {"model": NETWORK, **NOTHING}
    states = [_states(about, path, path.strain_energy_density[0, 0], network)[used]]
    errors: list[dict[str, Any]] = []
    for model in _models(inputs, config, path.loads[0]):
        # The steps as Gauss points of one element, for fibres that belong to an element.
        stress, energy = model.material.stress(gradients[None])[0], model.material.energy(gradients[None])[0]
        states.append(_states(model.about, path, energy, stress))
        errors += _errors(model, stress[compared], network[compared])
    datasets.write_table(pd.concat(states, ignore_index=True), outputs["stresses"], params)
    datasets.write_table(pd.DataFrame(errors), outputs["errors"], params)


def _path_of(path: Path, name: str) -> Curves:
    """The network of that name under the only deformation of a file of curves."""
    curves = read_curves([path])
    if len(curves.loads) != 1:
        raise DatasetError(f"{path}: holds {len(curves.loads)} deformations where the case study has one")
    return curves.network(_index_of(curves.names, name, path))


def _index_of(names: np.ndarray, name: str, path: Path) -> int:
    found = np.flatnonzero(names == name)
    if found.size != 1:
        raise DatasetError(f"{path}: holds {found.size} networks named '{name}' where the case study has one")
    return int(found[0])


def _models(inputs: Mapping[str, list[Path]], config: Mapping[str, Any], deformation: str) -> Iterator[_Model]:
    """The laws of the config, in its order; one that is fitted again comes twice."""
    groups = {INITIAL: (config["load_set"], ALL), REFIT: (SINGLE, deformation)}
    fits = dict(zip(groups, inputs["fits"], strict=True))
    for entry in config["models"]:
        if LAWS[entry["law"]].has_networks:
            about = {"model": entry["name"], **NOTHING, "law": entry["law"]}
            network = member_called(inputs["networks"][0], config["network"]).network
            yield _Model(about, AffineFibers.of_networks([network]), np.nan)
        elif entry.get("constants") == "fit":
            for constants in (INITIAL, REFIT) if entry.get("refit") else (INITIAL,):
                with naming(f"{fits[constants]}: model '{entry['name']}'"):
                    row = _row(datasets.read_table(fits[constants], FIT_COLUMNS), config, entry, groups[constants])
                    yield _fitted(row, entry, constants, config["tension_only"])


def _row(
    fits: pd.DataFrame, config: Mapping[str, Any], entry: Mapping[str, Any], group: tuple[str, str]
) -> pd.DataFrame:
    """The one row with the constants of a model."""
    found = fits_of(fits, entry["energy"], entry["objective"], *group)
    found = found[found["name"] == config["network"]]
    if len(found) != 1:
        raise DatasetError(
            f"{len(found)} fits of '{config['network']}' to {group[0]}, {group[1]}, with the energy {entry['energy']} "
            f"and the objective {entry['objective']}, where one is needed; delete the table and run again"
        )
    return found


def _fitted(row: pd.DataFrame, entry: Mapping[str, Any], constants: str, tension_only: bool) -> _Model:
    fit = row.to_dict("records")[0]
    C2, C3 = fit["C2_MPa"], fit["C3"]
    material = law_called(entry["law"]).material.of_structure_tensor(structure_tensors(row)[0], C2, C3, tension_only)
    about = {"model": entry["name"], "constants": constants, "law": entry["law"], "energy": entry["energy"]}
    return _Model({**about, "objective": fit["objective"], "C2_MPa": C2, "C3": C3}, material, fit["r_squared"])


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


def _errors(model: _Model, stress: np.ndarray, network: np.ndarray) -> Iterator[dict[str, Any]]:
    """Rows of the table of errors, one a component."""
    about = {key: model.about[key] for key in ("model", "constants", "law", "energy", "objective")}
    for component, error in stress_errors(stress, network).items():
        yield {
            **about,
            "component": component,
            "points_used": len(network),
            "rms_error_MPa": error.rms_error,
            "rms_network_MPa": error.rms_reference,
            "relative_rms_error": error.relative_rms_error,
            "largest_error_MPa": error.largest_error,
            "end_error_MPa": error.end_error,
            "r_squared": model.r_squared,
        }
