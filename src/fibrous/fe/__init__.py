"""Finite elements of tissue: hexahedra, total Lagrangian, Newton's method; import its modules by name."""
