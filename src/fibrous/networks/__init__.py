"""Discrete fibre networks: generation, fibre law, equilibrium, homogenisation."""
