"""A specimen of tissue with its material, solved by finite elements: displacements, stresses and reactions."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from fibrous.comparison import Comparison, Fields
from fibrous.fe.boundary import reaction_force
from fibrous.fe.linear import Name
from fibrous.fe.mesh import MeshError
from fibrous.fe.solver import Equilibria, LoadStepError, LoadStepper
from fibrous.io.vtu import vtu
from fibrous.materials.contract import Material
from fibrous.specimen import FIXED, MOVED, Specimen

Array = NDArray[np.float64]


@dataclass(frozen=True, repr=False)
class Solution(Equilibria):
    """Equilibria of a specimen at the ends of its load steps, the leading axis of every array.

    displacement (steps, nodes, 3), mm; cauchy (steps, elements, 8 Gauss points, 3, 3), MPa; reaction (steps, 2, 3), N;
    converged (steps,); and more, see `fe.solver.Equilibria`. Where a step did not converge, its fields are NaN.
    """

    specimen: Specimen

    @classmethod
    def of(cls, specimen: Specimen, equilibria: Equilibria) -> Self:
        """What the finite elements found, with its specimen."""
        return cls(**vars(equilibria) | {"specimen": specimen})

    @property
    def reaction(self) -> Array:
        """Force of the fixed and of the moved bone on the tissue, shape (steps, 2, 3), N."""
        nodes = [np.flatnonzero(self.specimen.enthesis == enthesis) for enthesis in (FIXED, MOVED)]
        return np.stack([reaction_force(self.internal_force, held) for held in nodes], axis=1)

    def vtu(self, step: int = -1, cells: Mapping[str, Array] | None = None) -> bytes:
        """The content of a file for ParaView: the state at the end of a step, fields as in `io.vtu`.

        `cells` are further numbers of each element, shape (elements,), by name.
        """
        return vtu(
            self.specimen,
            self.displacement[step],
            self.deformation_gradient[step],
            self.cauchy[step],
            {} if cells is None else cells,
        )

    def save(self, path: Path | str, step: int = -1) -> None:
        """Write the state at the end of a step, by default the last, for ParaView (.vtu)."""
        Path(path).write_bytes(self.vtu(step))


def solve(specimen: Specimen, material: Material, solver: Name = "auto", **limits: Any) -> Solution:
    """Equilibria of a specimen under its motion.

    Parameters
    ----------
    material : its parameters are the same everywhere, or have shape (elements, 1, ...)
    solver : of linear systems, see `fe.linear`
    limits : `tolerance`, `largest_number_of_iterations`, `smallest_increment`, `clock`, see `fe.solver.LoadStepper`

    Raises LoadStepError, a ConvergenceError with the part that converged as its `solution`, where a load step is not
    reached.

    >>> from fibrous.materials.hgo import HGOStructureTensor
    >>> from fibrous.materials.neo_hookean import NeoHookean
    >>> from fibrous.specimen import Slab
    >>> specimen = Slab(elements=(2, 2, 1)).specimen(steps=2)
    >>> fibers = HGOStructureTensor(0.1, 0.4, specimen.structure_tensor[:, None])
    >>> solve(specimen, NeoHookean(0.025, 0.417) + fibers)
    <Solution: 4 elements, 2 of 2 steps, 6 Newton iterations, 0 cutbacks>
    """
    stepper = LoadStepper.of(specimen.mesh, material, specimen.prescribed, solver, **limits)
    try:
        return Solution.of(specimen, stepper.follow(specimen.prescribed.values))
    except LoadStepError as error:
        raise LoadStepError(error.step, error.reason, Solution.of(specimen, error.solution)) from None


def compare(solution: Solution, reference: Solution, step: int = -1) -> Comparison:
    """How far a solution is from another at the end of a load step, by default the last of each.

    Raises MeshError where they are not of one mesh.

    >>> from fibrous.materials.neo_hookean import NeoHookean
    >>> from fibrous.specimen import Slab
    >>> specimen = Slab(elements=(2, 2, 1)).specimen(steps=1)
    >>> compare(*(solve(specimen, NeoHookean(C1, 0.417)) for C1 in (0.03, 0.025))).shear_stress
    0.0022 MPa (18.5%)
    """
    if solution.cauchy[0].shape != reference.cauchy[0].shape:
        raise MeshError("solutions on different meshes cannot be compared; solve both for one specimen")
    states = (
        Fields.of(of.deformation_gradient[step], of.cauchy[step], of.displacement[step], of.reaction[step, 1])
        for of in (solution, reference)
    )
    return Comparison.of(*states)
