"""What the coupled multiscale simulation costs: a network at every Gauss point of the synthetic specimen.

    python benchmarks/multiscale.py [--elements X Y Z] [--edge CHI_UM] [--steps N] [--threads N] [--growth]

Prints CPU milliseconds of a Gauss point and load step with all that surrounds it, network and macroscopic iterations,
the minutes that 900 hexahedra in 20 steps would take at that, and what a network iteration costs in parts: equilibrium
(forces, factors, moves) and condensation. With ``--growth`` the same for 112, 900 and 3,000
hexahedra with small networks instead: the time of a Gauss point and step must not grow.
"""

import argparse
import os
import platform
import time
from importlib.metadata import version

os.environ.update(dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS"), "1"))

import numpy as np

from fibrous.clock import Clock
from fibrous.fe.solver import LoadStepper
from fibrous.materials.contract import Mixture
from fibrous.materials.neo_hookean import NeoHookean
from fibrous.materials.network import FiberNetworks
from fibrous.networks.fiber_law import Fiber
from fibrous.networks.generation import delaunay, network_seed
from fibrous.specimen import Slab

PAPER = 900 * 8 * 20


def run(counts, edge_um: float, steps: int, threads: int, distinct: int = 10**6) -> float:
    """Follow the specimen, print, and return CPU milliseconds a Gauss point and load step.

    Elements beyond `distinct` have the networks of the first ones again.
    """
    specimen = Slab(tuple(counts)).specimen(steps)
    fiber, tolerance = Fiber(modulus_MPa=10.0, nonlinearity=2.5, radius_um=0.1), 0.002 if edge_um > 15.0 else 0.03
    start = time.process_time()
    made = [
        delaunay(H, fiber, 0.04, edge_um, network_seed(2021, "tissue", k), tolerance)
        for k, H in enumerate(specimen.structure_tensor[:distinct])
    ]
    networks = [made[k % len(made)] for k in range(len(specimen.structure_tensor))]
    generated = time.process_time() - start
    clock = Clock()
    fibers = FiberNetworks.of(networks, threads, clock=clock)
    stepper = LoadStepper.of(specimen.mesh, Mixture((NeoHookean(0.025, 0.417), fibers)), specimen.prescribed)
    # Rest and its rates, and all compilation, before the clock starts.
    stepper.assembly.evaluate(np.zeros_like(specimen.mesh.node_position), stepper.assembly.split(None))
    clock.seconds.clear()
    start = time.process_time()
    solution = stepper.follow(specimen.prescribed.values)
    seconds = time.process_time() - start
    state, points = solution.state[1], 8 * len(networks) * steps
    interior = np.mean([one.size for one in fibers.engines])
    print(
        f"{len(networks)} hexahedra, {steps} steps, networks of {interior:.0f} interior nodes and "
        f"{np.mean([len(network.fiber_nodes) for network in networks]):.0f} fibres at {edge_um:g} um; "
        f"generated in {generated:.1f} s\n"
        f"  {1e3 * seconds / points:.3f} ms a Gauss point and step; 900 hexahedra in 20 steps: "
        f"{seconds / points * PAPER / 60.0:.2f} CPU-minutes\n"
        f"  iterations: {state.iterations.mean() / steps:.2f} a Gauss point and step, macroscopic "
        f"{solution.newton_iterations.mean():.2f} a step; cuts {state.cuts.sum()}, indefinite Hessians "
        f"{state.indefinite.sum()}, macroscopic cuts {solution.cuts.sum()}"
    )
    for part, spent in clock.seconds.items():
        print(
            f"  {part}: {1e3 * spent / state.iterations.sum():.4f} ms a network iteration, {spent / seconds:.0%} of all"
        )
    return 1e3 * seconds / points


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description="Cost of the coupled multiscale simulation.")
    parser.add_argument("--elements", type=int, nargs=3, default=(6, 7, 1), help="along x, y and z")
    parser.add_argument("--edge", type=float, default=20.0, help="of the network cube, um")
    parser.add_argument("--steps", type=int, default=20)
    parser.add_argument("--threads", type=int, default=1)
    parser.add_argument("--growth", action="store_true", help="cost against the number of elements, small networks")
    chosen = parser.parse_args()
    if chosen.growth:
        costs = [run(counts, 8.0, 5, chosen.threads, distinct=50) for counts in ((7, 8, 2), (15, 20, 3), (20, 30, 5))]
        print(
            "ms a Gauss point and step over that of 112 hexahedra: " + ", ".join(f"{c / costs[0]:.2f}" for c in costs)
        )
    else:
        run(chosen.elements, chosen.edge, chosen.steps, chosen.threads)
    print(
        f"{platform.processor() or platform.machine()}, Python {platform.python_version()}, "
        + ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy", "numba"))
    )


if __name__ == "__main__":
    main()
