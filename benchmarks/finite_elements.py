"""What a Newton iteration of the finite elements costs, beside the same problem in FElupe.

    python benchmarks/finite_elements.py [elements along an edge ...]

The code-to-code problem of the tests: a unit cube, one face clamped, the other pulled by 0.2 in five steps, three
fibre families in a neo-Hookean matrix. In FElupe the matrix is its own and the families are this project's functions,
so its material is no slower for being written by a guest. Prints, for each size, CPU time an element of everything but
the linear solution (material, assembly, boundary conditions), CPU time of a whole Newton iteration with each code's
default solver, both ratios, and the reactions. Needs the extra `bench`; one thread.
"""

import os
import platform
import sys
import time
from importlib.metadata import version

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"))

import felupe
import numpy as np
from scipy.sparse.linalg import spsolve

from fibrous.fe.boundary import PrescribedDisplacement, reaction_force
from fibrous.fe.linear import linear_solver
from fibrous.fe.mesh import box
from fibrous.fe.solver import LoadStepper
from fibrous.materials.contract import Mixture
from fibrous.materials.hgo import HGOFamilies
from fibrous.materials.neo_hookean import NeoHookean

SIZES = (10, 15, 20)
PULL = np.linspace(0.04, 0.2, 5)
FAMILIES = HGOFamilies(0.05, 1.0, np.array([0.5, 0.3, 0.2]), np.eye(3), tension_only=False)


class Stopwatch:
    """Adds up CPU seconds of calls of a function."""

    def __init__(self, function) -> None:
        self.function, self.seconds, self.calls = function, 0.0, 0

    def __call__(self, *args, **options):
        """The function's value."""
        start = time.process_time()
        try:
            return self.function(*args, **options)
        finally:
            self.seconds += time.process_time() - start
            self.calls += 1


def measured_here(count: int) -> tuple[float, float, float]:
    """Seconds of an iteration without and with its linear solution, and the reaction."""
    mesh = box((count, count, count))
    x = mesh.node_position[:, 0]
    left, right = np.flatnonzero(x == 0.0), np.flatnonzero(x == 1.0)
    prescribed = PrescribedDisplacement.joined(
        PrescribedDisplacement.at(left, 0.0, steps=len(PULL)),
        PrescribedDisplacement.at(right, PULL[:, None, None], axes=(0,), steps=len(PULL)),
    )
    material = Mixture((NeoHookean(0.025, 0.417), FAMILIES))
    solve = Stopwatch(linear_solver("auto"))
    stepper = LoadStepper(LoadStepper.of(mesh, material, prescribed).assembly, solve)
    run = Stopwatch(stepper.follow)
    solution = run(prescribed.values)
    iterations = int(solution.newton_iterations.sum())
    reaction = float(reaction_force(solution.internal_force[-1], right)[0])
    return (run.seconds - solve.seconds) / iterations, run.seconds / iterations, reaction


def measured_in_felupe(count: int) -> tuple[float, float, float]:
    """The same of FElupe."""

    def stress(x, **_):
        return [np.moveaxis(FAMILIES(np.moveaxis(x[0], (0, 1), (-2, -1)))[0], (-2, -1), (0, 1)), x[-1]]

    def elasticity(x, **_):
        return [np.moveaxis(FAMILIES(np.moveaxis(x[0], (0, 1), (-2, -1)))[1], (-4, -3, -2, -1), (0, 1, 2, 3))]

    region = felupe.RegionHexahedron(felupe.Cube(n=count + 1))
    field = felupe.FieldContainer([felupe.Field(region, dim=3)])
    material = felupe.NeoHookeCompressible(mu=0.05, lmbda=0.417) & felupe.Material(stress, elasticity)
    body = felupe.SolidBody(material, field)
    boundaries = {
        "left": felupe.Boundary(field[0], fx=0),
        "right": felupe.Boundary(field[0], fx=1, skip=(0, 1, 1)),
    }
    step = felupe.Step([body], ramp={boundaries["right"]: PULL}, boundaries=boundaries)
    job = felupe.CharacteristicCurve(steps=[step], boundary=boundaries["right"])
    solve = Stopwatch(spsolve)
    run = Stopwatch(job.evaluate)
    run(verbose=0, x0=field, solver=solve)
    reaction = float(np.abs(np.array(job.y)[-1][0]))
    return (run.seconds - solve.seconds) / solve.calls, run.seconds / solve.calls, reaction


def main() -> None:
    """Run both, print."""
    for count in [int(argument) for argument in sys.argv[1:]] or SIZES:
        ours, theirs = measured_here(count), measured_in_felupe(count)
        here, there = (1e6 * seconds / count**3 for seconds in (ours[0], theirs[0]))
        print(
            f"n = {count}\n"
            f"  material, assembly, boundary: {here:.1f} us an element, FElupe {there:.1f}, ratio {here / there:.2f} "
            "(to reach: at most 0.6)\n"
            f"  whole Newton iteration: {ours[1]:.3f} s, FElupe {theirs[1]:.3f}, ratio {ours[1] / theirs[1]:.3f} "
            "(to reach: at most 0.2 at n = 20)\n"
            f"  reactions: {ours[2]:.10f} N, FElupe {theirs[2]:.10f}",
            flush=True,
        )
    print(
        f"{platform.processor() or platform.machine()}, Python {platform.python_version()}, "
        + ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy", "felupe"))
    )


if __name__ == "__main__":
    main()
