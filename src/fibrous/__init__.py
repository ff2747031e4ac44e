"""Fibre networks of soft tissue, and the continuum laws that stand in for them.

>>> import fibrous as fb
>>> fiber = fb.Fiber(modulus_MPa=10.0, nonlinearity=2.5, radius_um=0.1)
>>> fb.delaunay((0.6, 0.25, 0.15), fiber, volume_fraction=0.04, edge_um=10.0, seed=1)
<Network: 453 fibres, 35 interior nodes, H = (0.60, 0.25, 0.15), φ = 0.040>
"""

from importlib import import_module
from typing import Any

# Public names and their modules, which are imported when asked for: some bring compiled code.
_MODULES = {
    "BucklingFiber": "networks.fiber_law",
    "Curves": "curves",
    "Fiber": "networks.fiber_law",
    "Limits": "networks.guard",
    "LoadCase": "deformation",
    "Network": "networks.network",
    "delaunay": "networks.generation",
    "loads": "deformation",
    "read_network": "io.networks",
}

__all__ = sorted(_MODULES)


def __getattr__(name: str) -> Any:
    if name not in _MODULES:
        raise AttributeError(f"module 'fibrous' has no attribute '{name}'")
    value = getattr(import_module(f"fibrous.{_MODULES[name]}"), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*globals(), *__all__]
