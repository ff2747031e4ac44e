"""Rule `deform_tissue`: one finite element run of the specimen, with a law of the fibres and its constants."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fibrous.clock import Clock
from fibrous.errors import ConfigError, naming
from fibrous.fe.solver import LoadStepError
from fibrous.materials.registry import LAWS
from fibrous.specimen import Specimen
from fibrous.tissue import Solution, solve
from fibrous_study import datasets
from fibrous_study.loading import networks_of
from fibrous_study.prediction import Predictor
from fibrous_study.solutions import (
    Constants,
    fitted_constants,
    read_specimen,
    say,
    tissue_dataset,
    tissue_material,
    write_tissue,
)


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Read `specimen` and what the model needs of `fits`, `surface` and `networks`; write `tissue` and `vtu`.

    Raises ConvergenceError where a load step is not reached, after the converged part was kept beside `tissue` with
    the ending .failed.nc; MaterialError for impossible constants, DatasetError where an element has none.
    """
    config = params["config"]
    specimen, networks = read_specimen(inputs["specimen"][0])
    constants = _constants(inputs, config, specimen, networks)
    law = LAWS[config["model"]["law"]]
    fibers = None
    if law.has_networks:
        fibers = law.material.of_networks(networks_of(inputs["networks"], networks.tolist()))
    clock = Clock()
    with naming(f"model {config['run']}"):
        material = tissue_material(config, constants, clock, fibers)
    failure = None
    try:
        solution = solve(specimen, material, config["linear_solver"], clock=clock)
    except LoadStepError as error:
        solution, failure = Solution.of(specimen, error.solution), error
    say(solution.attempts)
    steps = len(solution.converged)
    C2, C3 = (np.tile(values, (steps, 1)) for values in (constants.C2, constants.C3))
    dataset = tissue_dataset(solution, C2, C3, constants.structure_tensor, config["matrix"], clock)
    write_tissue(solution, dataset, failure, outputs, params)


def _constants(
    inputs: Mapping[str, list[Path]], config: Mapping[str, Any], specimen: Specimen, networks: np.ndarray
) -> Constants:
    model = config["model"]
    match model.get("constants"):
        case None:
            nothing = np.full(len(networks), np.nan)
            return Constants(nothing, nothing, specimen.structure_tensor)
        case "fit":
            return fitted_constants(inputs["fits"][0], networks, model, config.get("load_set"))
        case "surface":
            dataset = datasets.read(inputs["surface"][0], "surface")
            predictor = Predictor.of(dataset, config["surface_protocol"], config["load_set"])
            # The surface speaks of principal axes; a polynomial through scattered constants may dip below zero.
            eigenvalues = np.linalg.eigvalsh(specimen.structure_tensor)[:, ::-1]
            predictions = []
            for element, values in enumerate(eigenvalues):
                with naming(f"element {element}"):
                    predictions.append(predictor.at(np.diag(values)))
            C2, C3 = (np.maximum([getattr(of, name) for of in predictions], 0.0) for name in ("C2_MPa", "C3"))
            return Constants(C2, C3, specimen.structure_tensor)
        case unknown:
            raise ConfigError(f"constants is '{unknown}', must be fit or surface")
