"""The coupled (multiscale) run, with a network at every Gauss point, against the law that is fitted to the networks."""

import matplotlib.pyplot as plt
import numpy as np

import fibrous as fb
from fibrous.deformation import element_shear


def main(elements=(6, 7, 1)):
    specimen = fb.Slab(elements).specimen(steps=10)
    matrix = fb.NeoHookean(C1=0.025, lame_lambda=0.417)  # MPa

    # A network for every element, with the fibres' alignment there.
    fiber = fb.Fiber(modulus_MPa=10.0, nonlinearity=2.5, radius_um=0.1)
    networks = [
        fb.delaunay(H, fiber, volume_fraction=0.04, edge_um=10.0, seed=seed, tolerance=0.02)
        for seed, H in enumerate(specimen.structure_tensor)
    ]
    coupled = fb.solve(specimen, matrix + fb.FiberNetworks.of(networks))

    # Eq. 2 fitted to the stress of each network: C2 in MPa and C3, shape (elements, 1), stand for it in its element.
    cases = fb.loads({"x_uniaxial": 1.3, "xy_biaxial": None, "xz_biaxial": None, "xy_shear": None, "xz_shear": None})
    laws = [fb.fit_hgo(network.load(cases), objective="stress").law for network in networks]
    C2, C3, H = (np.array([getattr(law, name) for law in laws]) for name in ("C2", "C3", "structure_tensor"))
    hybrid = fb.solve(specimen, matrix + fb.HGOStructureTensor(C2[:, None], C3[:, None], H[:, None]))

    figure, axes = plt.subplots(figsize=(4, 4), layout="constrained")
    of_coupled, of_law = (1000.0 * element_shear(run.cauchy[-1]) for run in (coupled, hybrid))
    axes.plot(of_coupled, of_law, "o")
    axes.axline((of_coupled.mean(), of_coupled.mean()), slope=1.0, color="black", lw=0.8)
    axes.set(xlabel="maximum shear stress, coupled run, kPa", ylabel="maximum shear stress, law, kPa")
    figure.savefig("coupled_and_law.png", dpi=150)

    difference = fb.compare(hybrid, coupled)
    print(coupled)
    print(f"force along x: coupled {coupled.reaction[-1, 1, 0]:.3f} N, law {hybrid.reaction[-1, 1, 0]:.3f} N")
    print(f"RMS error of the law: maximum shear stress {difference.shear_stress}, strain {difference.shear_strain}")
    return coupled, hybrid


if __name__ == "__main__":
    main()
