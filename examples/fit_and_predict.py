"""A law fitted to five loads of a network, and tried on a deformation that it has not seen."""

import matplotlib.pyplot as plt
import numpy as np

import fibrous as fb


def main():
    fiber = fb.Fiber(modulus_MPa=10.0, nonlinearity=2.5, radius_um=0.1)
    network = fb.delaunay(H=(0.6, 0.25, 0.15), fiber=fiber, volume_fraction=0.04, edge_um=10.0, seed=1)

    # Five loads that all end at the same averaged stretch of the fibres, and C2 and C3 of Eq. 2 from their stresses.
    cases = fb.loads({"x_uniaxial": 1.3, "xy_biaxial": None, "xz_biaxial": None, "xy_shear": None, "xz_shear": None})
    fit = fb.fit_hgo(network.load(cases, steps=20), objective="stress")

    # Another deformation: stretch along x and y, and shear at the same time.
    F = np.array([[1.2, 0.1, 0.0], [0.1, 1.1, 0.0], [0.0, 0.0, 0.8]])
    curve = network.load(fb.loads({"mixed": F}), steps=20).sel(deformation="mixed")
    of_network = curve["cauchy_stress"].values  # MPa, shape (steps + 1, 3, 3)
    of_law = fit.law.stress(curve["deformation_gradient"].values)

    figure, axes = plt.subplots(figsize=(5, 3.5), layout="constrained")
    for color, (i, j), name in (("C0", (0, 0), "xx"), ("C1", (1, 1), "yy"), ("C2", (0, 1), "xy")):
        axes.plot(curve["averaged_stretch"], 1000.0 * of_network[:, i, j], color, label=f"σ_{name}, network")
        axes.plot(curve["averaged_stretch"], 1000.0 * of_law[:, i, j], color, ls="--", label=f"σ_{name}, law")
    axes.set(xlabel="averaged stretch of the fibres λ_f", ylabel="Cauchy stress, kPa")
    axes.legend(frameon=False)
    figure.savefig("fit_and_predict.png", dpi=150)

    print(fit)
    print(f"σ_xx at the end: network {1000.0 * of_network[-1, 0, 0]:.1f} kPa, law {1000.0 * of_law[-1, 0, 0]:.1f} kPa")
    return fit, of_network, of_law


if __name__ == "__main__":
    main()
