"""A slab of tissue between two bones, one of which moves away: the force on it against the motion."""

import matplotlib.pyplot as plt
import numpy as np

import fibrous as fb


def main(elements=(8, 10, 2)):
    # A slab 10 mm long, 16 mm high and 2 mm thick; the moved bone goes 1 mm along x, in ten steps.
    slab = fb.Slab(elements, length_mm=10.0, height_mm=16.0, thickness_mm=2.0)
    motion = fb.RigidMotion(gap_mm=1.0, slide_mm=0.0, rotation_degrees=0.0)
    specimen = slab.specimen(steps=10, motion=motion)

    # Every element has fibres of its own direction and alignment: H has the shape (elements, 1, 3, 3).
    matrix = fb.NeoHookean(C1=0.025, lame_lambda=0.417)  # MPa
    fibers = fb.HGOStructureTensor(C2=0.1, C3=0.4, structure_tensor=specimen.structure_tensor[:, None])  # C2 in MPa
    solution = fb.solve(specimen, matrix + fibers)

    gap_mm = motion.gap_mm * np.arange(1, 11) / 10
    force_N = solution.reaction[:, 1, 0]  # of the moved bone on the tissue, along x

    figure, axes = plt.subplots(figsize=(5, 3.5), layout="constrained")
    axes.plot(np.append(0.0, gap_mm), np.append(0.0, force_N), "o-")
    axes.set(xlabel="displacement of the moved bone, mm", ylabel="force along x, N")
    figure.savefig("tissue_with_a_law.png", dpi=150)

    print(solution)
    print(f"force at {gap_mm[-1]:.1f} mm: {force_N[-1]:.3f} N")
    return specimen, solution


if __name__ == "__main__":
    main()
