"""A fibre network under load: strain energy density W against stretch."""

import matplotlib.pyplot as plt

import fibrous as fb


def main():
    fiber = fb.Fiber(modulus_MPa=10.0, nonlinearity=2.5, radius_um=0.1)
    # H is the structure tensor: 60 % of the fibres' length along x, 25 % along y, 15 % along z.
    network = fb.delaunay(H=(0.6, 0.25, 0.15), fiber=fiber, volume_fraction=0.04, edge_um=10.0, seed=1)

    # Stretched to 1.3 along x; the two others end where the mean fibre is stretched as much.
    curves = network.load(fb.loads({"x_uniaxial": 1.3, "xy_biaxial": None, "xy_shear": None}), steps=20)

    figure, axes = plt.subplots(figsize=(5, 3.5), layout="constrained")
    for load in curves["deformation"].values:
        curve = curves.sel(deformation=load)
        axes.plot(curve["averaged_stretch"], 1000.0 * curve["strain_energy_density"], label=load)
    axes.set(xlabel="averaged stretch of the fibres λ_f", ylabel="strain energy density W, kPa")
    axes.legend(frameon=False)
    figure.savefig("network_under_load.png", dpi=150)

    print(network)
    for load in curves["deformation"].values:
        end = curves.sel(deformation=load, step=20)
        print(
            f"{load}: W = {1000.0 * end['strain_energy_density']:.3f} kPa, "
            f"σ_xx = {1000.0 * end['cauchy_stress'][0, 0]:.1f} kPa at λ_f = {end['averaged_stretch']:.3f}"
        )
    return curves


if __name__ == "__main__":
    main()
