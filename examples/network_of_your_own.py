"""A network of one's own: nodes and fibres from arrays, and the same from CSV files."""

import csv

import numpy as np

import fibrous as fb


def main():
    # Positions in edges of the unit cube about the origin. One node inside is joined to the corners and the faces.
    corners = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    faces = 0.5 * np.concatenate([np.eye(3), -np.eye(3)])
    position = np.concatenate([[[0.05, -0.02, 0.03]], corners, faces])
    on_boundary = np.abs(position).max(axis=1) == 0.5  # moves with F; all other nodes seek equilibrium
    ends = np.array([[0, node] for node in range(1, len(position))])

    fiber = fb.Fiber(modulus_MPa=10.0, nonlinearity=2.5, radius_um=0.1)
    network = fb.Network(position, on_boundary, ends, fiber=fiber, edge_um=2.0)

    # The same from two tables, as a spreadsheet or a program that reads microscopes' images writes them.
    for path, header, rows in (("nodes.csv", ("x", "y", "z"), position), ("fibers.csv", ("tail", "head"), ends)):
        with open(path, "w", newline="") as file:
            csv.writer(file).writerows([header, *rows.tolist()])
    read = fb.read_network("nodes.csv", "fibers.csv", fiber=fiber, edge_um=2.0)

    F = np.diag([1.2, 1.2**-0.5, 1.2**-0.5])
    print(network)
    for name, what in (("arrays", network), ("CSV", read)):
        print(f"from {name}: σ_xx = {1000.0 * what.stress(F)[0, 0]:.2f} kPa at a stretch of 1.2")
    read.save("network.nc")  # fb.read_network("network.nc") knows its fibres and edge, too
    return network, read


if __name__ == "__main__":
    main()
