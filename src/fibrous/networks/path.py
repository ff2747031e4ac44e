"""A network along paths of deformation gradients: from F to energies, stresses and curves (Eqs. 4.1 and 7)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from fibrous.networks.engine import Engine, PathState
from fibrous.networks.lanes import LANES

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Response:
    """What a network answers along paths; the leading axes of every array are the path and the step.

    strain_energy_density : W, shape (paths, steps), MPa
    first_piola_kirchhoff_stress, cauchy_stress : P = (1/V) Σ f ⊗ D and σ = P Fᵀ/J, (paths, steps, 3, 3), MPa
    orientation_tensor : h = Σ l n ⊗ n / Σ l, shape (paths, steps, 3, 3), trace 1
    newton_iterations, cuts, indefinite_hessians : spent on the way from the step before, shape (paths, steps)
    converged : whether the step is a stable equilibrium, shape (paths, steps)
    tangent : ∂P_iJ/∂F_kL along equilibria, shape (paths, steps, 3, 3, 3, 3), MPa; None unless asked for
    node_position : deformed, shape (paths, steps, nodes, 3), edges; None unless asked for
    fiber_stretch : shape (paths, steps, fibers); None unless asked for

    Where a step did not converge, and in all that follow on its path, everything but the counts is NaN.
    """

    strain_energy_density: Array
    first_piola_kirchhoff_stress: Array
    cauchy_stress: Array
    orientation_tensor: Array
    newton_iterations: NDArray[np.int64]
    cuts: NDArray[np.int64]
    indefinite_hessians: NDArray[np.int64]
    converged: NDArray[np.bool_]
    tangent: Array | None = None
    node_position: Array | None = None
    fiber_stretch: Array | None = None

    @property
    def largest_orientation_eigenvalue(self) -> Array:
        """Of the orientation tensor, shape (paths, steps)."""
        known = np.where(self.converged[..., None, None], self.orientation_tensor, 0.0)
        return np.where(self.converged, np.linalg.eigvalsh(known)[..., -1], np.nan)


def follow(engine: Engine, gradients: Array, scale: float, tangent: bool = False, geometry: bool = False) -> Response:
    """The response of a network to paths of F, shape (paths, steps, 3, 3), each from rest.

    `scale` is kA/χ², MPa: what forces in kA over areas in edges² are as stresses. `geometry` asks for positions of
    nodes and stretches of fibres. Paths are followed eight at a time, side by side; a path that comes to a step without
    a stable equilibrium does not stop the others. Raises NetworkError for a network that is a mechanism at rest.
    """
    gradients = np.asarray(gradients, dtype=float)
    paths = len(gradients)
    parts = np.array_split(np.arange(paths), max(1, -(-paths // LANES)))
    collected = [_followed(engine, gradients[part], scale, tangent, geometry) for part in parts]
    names = collected[0]
    return Response(**{name: np.concatenate([part[name] for part in collected]) for name in names})


def _followed(engine: Engine, gradients: Array, scale: float, tangent: bool, geometry: bool) -> dict[str, Array]:
    """The fields of a response along eight paths at most."""
    paths, steps = gradients.shape[:2]
    shape = paths, steps
    fields: dict[str, Array] = {
        "strain_energy_density": np.full(shape, np.nan),
        **{
            name: np.full((*shape, 3, 3), np.nan)
            for name in ("first_piola_kirchhoff_stress", "cauchy_stress", "orientation_tensor")
        },
        **{name: np.zeros(shape, dtype=np.int64) for name in ("newton_iterations", "cuts", "indefinite_hessians")},
        "converged": np.zeros(shape, dtype=bool),
    }
    if tangent:
        fields["tangent"] = np.full((*shape, 3, 3, 3, 3), np.nan)
    if geometry:
        fields["node_position"] = np.full((*shape, *engine.network.node_position.shape), np.nan)
        fields["fiber_stretch"] = np.full((*shape, len(engine.network.fiber_nodes)), np.nan)
    for step, state in enumerate(states(engine, gradients)):
        known = state.converged[:paths]
        W, P, h = (
            scale_ * np.moveaxis(values, -1, 0)[:paths]
            for scale_, values in zip((scale, scale, 1.0), engine.measures(), strict=True)
        )
        F = gradients[:, step]
        fields["strain_energy_density"][known, step] = W[known]
        fields["first_piola_kirchhoff_stress"][known, step] = P[known]
        with np.errstate(all="ignore"):  # an F without a determinant has no stress, and is not known
            sigma = P @ F.swapaxes(-1, -2) / np.linalg.det(F)[:, None, None]
        fields["cauchy_stress"][known, step] = sigma[known]
        fields["orientation_tensor"][known, step] = h[known]
        for name, values in (
            ("newton_iterations", state.iterations),
            ("cuts", state.cuts),
            ("indefinite_hessians", state.indefinite),
            ("converged", state.converged),
        ):
            fields[name][:, step] = values[:paths]
        if tangent:
            A = scale * np.moveaxis(engine.tangent(), -1, 0)[:paths].reshape(paths, 3, 3, 3, 3)
            fields["tangent"][known, step] = A[known]
        if geometry:
            fields["node_position"][known, step] = engine.node_position(state.gradient, state.displacement)[:paths][
                known
            ]
            fields["fiber_stretch"][known, step] = engine.stretches().T[:paths][known]
    return fields


def states(engine: Engine, gradients: Array) -> Iterator[PathState]:
    """States along at most eight paths of F, shape (paths, steps, 3, 3), from rest, step by step.

    The forces of each state are in the room of `engine` until the next. Lanes without a path stay at rest.
    """
    paths, steps = gradients.shape[:2]
    lanes = np.tile(np.eye(3)[..., None], (steps, 1, 1, LANES))
    lanes[..., :paths] = np.moveaxis(gradients, 0, -1)
    state = engine.rest()
    for step in range(steps):
        if step or not (lanes[0] == state.gradient).all():
            state = engine.advance(state, lanes[step])
        yield state
