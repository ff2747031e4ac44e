"""What a finished run says of its ensemble and its cost: python benchmarks/ensemble.py [folder with results/].

Prints fibres, interior nodes, coordination and volume fraction of the networks beside the laboratory's published ones,
and states, iterations, convergence, CPU seconds and peak memory of every protocol.
"""

import sys
from pathlib import Path

import numpy as np

from fibrous.networks.network import unpacked
from fibrous_study import datasets


def main() -> None:
    """Read the results and print."""
    results = Path(sys.argv[1] if len(sys.argv) > 1 else ".") / "results"
    opened = [datasets.read(path, "networks") for path in sorted(results.glob("networks/delaunay/*.nc"))]
    networks = [network for dataset in opened for network in unpacked(dataset)]
    misses = [
        np.abs(network.structure_tensor - target).max()
        for dataset in opened
        for network, target in zip(unpacked(dataset), dataset["target_structure_tensor"].values, strict=True)
    ]
    fibers = [len(network.fiber_nodes) for network in networks]
    interior = [int((~network.node_is_boundary).sum()) for network in networks]
    coordination = np.average([network.interior_coordination for network in networks], weights=interior)
    fractions = np.concatenate([dataset["volume_fraction"].values for dataset in opened])
    shortest = min(float(dataset["shortest_fiber"].min()) for dataset in opened)
    print(
        f"{len(networks)} networks: fibers {min(fibers)}-{max(fibers)}, mean {np.mean(fibers):.0f} (laboratory: 2890)"
    )
    print(f"interior nodes {min(interior)}-{max(interior)}, mean {np.mean(interior):.0f} (288)")
    print(f"mean interior coordination {coordination:.2f} (15.5)")
    print(f"volume fraction {fractions.min():.8f} to {fractions.max():.8f}; shortest fiber {shortest:.2e} edges")
    print(f"largest miss of a component of the target structure tensor: {max(misses):.4f}")
    for folder in sorted(results.glob("curves/*/*")):
        found = [datasets.read(path, "curves") for path in sorted(folder.glob("*.nc"))]
        states = sum(one["converged"].values[..., 1:].size for one in found)
        converged = sum(int(one["converged"].values[..., 1:].sum()) for one in found)
        iterations = sum(int(one["newton_iterations"].sum()) for one in found)
        limited = sum(int(one["amplitude_limited"].sum()) for one in found)
        cuts = sum(int(one["cuts"].sum()) for one in found)
        seconds = sum(float(one.attrs["cpu_seconds"]) for one in found)
        memory = max(float(one.attrs["peak_memory_MB"]) for one in found)
        print(
            f"{folder.relative_to(results)}: {converged} of {states} states converged, {iterations / states:.2f} "
            f"iterations a state, {cuts} cuts, {limited} loads amplitude-limited, {seconds:.0f} CPU s, "
            f"at most {memory:.0f} MB a job"
        )


if __name__ == "__main__":
    main()
