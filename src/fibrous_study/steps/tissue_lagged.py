"""Rule `deform_tissue_with_lagged_constants`: a run that fits its constants anew at every load step (Fig. 4b)."""

from __future__ import annotations

import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from fibrous.clock import Clock
from fibrous.fe.solver import LoadStepper
from fibrous.fitting.hgo import fit_hgo
from fibrous.hybrid import LaggedRefit, LaggedStepError
from fibrous.materials.registry import law_called
from fibrous.networks.guard import Limits
from fibrous.tissue import Solution
from fibrous_study.loading import networks_of
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
    """Read `specimen`, the initial `fits` and the `networks`; write `tissue` and `vtu`.

    Raises ConvergenceError as the rule `deform_tissue` does, DatasetError where an element has no network or no
    constants.
    """
    config = params["config"]
    model, matrix = config["model"], config["matrix"]
    specimen, numbers = read_specimen(inputs["specimen"][0])
    initial = fitted_constants(inputs["fits"][0], numbers, model, config["load_set"])
    clock = Clock()

    def stepper_of(C2: np.ndarray, C3: np.ndarray) -> LoadStepper:
        material = tissue_material(config, Constants(C2, C3, initial.structure_tensor), clock)
        return LoadStepper.of(specimen.mesh, material, specimen.prescribed, config["linear_solver"], clock=clock)

    refit = LaggedRefit(
        stepper_of,
        networks_of(inputs["networks"], numbers.tolist()),
        lambda curves: fit_hgo(
            curves,
            law_called(model["energy"]).material,
            model["objective"],
            tension_only=config["tension_only"],
            **config["fit"],
        ),
        Limits(**config["equilibrium"]),
    )
    failure = None
    try:
        found = refit.follow(specimen.prescribed.values, initial.C2, initial.C3, config["iterations_of_last_step"])
    except LaggedStepError as error:
        found, failure = error.found, error
    say(found.solution.attempts)
    for network, step in found.lost_states:
        print(
            f"network {numbers[network]}, step {step}: no equilibrium was found; left out of the fits", file=sys.stderr
        )
    for C2, C3 in found.last_changes:
        print(f"last step again: C2 changed by up to {C2:.3g} MPa, C3 by up to {C3:.3g}", file=sys.stderr)
    solution = Solution.of(specimen, found.solution)
    dataset = tissue_dataset(solution, found.C2, found.C3, initial.structure_tensor, matrix, clock)
    write_tissue(solution, dataset, failure, outputs, params)
