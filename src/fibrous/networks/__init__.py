"""Discrete fibre networks: generation, fibre law, equilibrium, homogenisation."""

from collections.abc import Callable
from importlib import import_module
from typing import Any

#: Ways to make a network of an alignment, by the names that configs have for them: module and function, which takes the
#: arguments of `generation.delaunay`.
GENERATORS = {"delaunay": ("generation", "delaunay")}


def generator(name: str) -> Callable[..., Any]:
    """The function of a name of `GENERATORS`."""
    module, function = GENERATORS[name]
    generate: Callable[..., Any] = getattr(import_module(f"fibrous.networks.{module}"), function)
    return generate
