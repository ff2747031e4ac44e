"""From results to ParaView: the states of a tissue as files, one per load step."""

import fibrous as fb


def main(elements=(8, 10, 2)):
    steps = 5
    specimen = fb.Slab(elements).specimen(steps)
    fibers = fb.HGOStructureTensor(C2=0.1, C3=0.4, structure_tensor=specimen.structure_tensor[:, None])  # C2 in MPa
    solution = fb.solve(specimen, fb.NeoHookean(C1=0.025, lame_lambda=0.417) + fibers)

    # In ParaView: File > Open > tissue_..vtu (the five states are a time series), Apply, then Filters > Warp By Vector
    # with `displacement_mm`, and colour by `maximum_shear_stress_MPa`.
    for step in range(steps):
        solution.save(f"tissue_{step + 1}.vtu", step)

    print(solution)
    print(f"tissue_1.vtu to tissue_{steps}.vtu: {len(specimen.mesh.node_position)} nodes, lengths in mm, stress in MPa")
    return specimen, solution


if __name__ == "__main__":
    main()
