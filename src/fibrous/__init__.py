"""Fibre networks of soft tissue, and the continuum laws that stand in for them.

>>> import fibrous as fb
>>> specimen = fb.Slab(elements=(2, 2, 1)).specimen(steps=1)
>>> law = fb.HGOStructureTensor(C2=0.1, C3=0.4, structure_tensor=specimen.structure_tensor[:, None])
>>> fb.solve(specimen, fb.NeoHookean(0.025, 0.417) + law)
<Solution: 4 elements, 1 of 1 steps, 4 Newton iterations, 0 cutbacks>
>>> fiber = fb.Fiber(modulus_MPa=10.0, nonlinearity=2.5, radius_um=0.1)
>>> fb.delaunay((0.6, 0.25, 0.15), fiber, volume_fraction=0.04, edge_um=10.0, seed=1)
<Network: 453 fibres, 35 interior nodes, H = (0.60, 0.25, 0.15), φ = 0.040>
"""

from importlib import import_module
from typing import Any

# Public names and their modules, which are imported when asked for: some bring compiled code.
_MODULES = {
    "AffineFibers": "materials.affine_fibers",
    "BucklingFiber": "networks.fiber_law",
    "Curves": "curves",
    "Fiber": "networks.fiber_law",
    "FiberField": "specimen",
    "FiberNetworks": "materials.network",
    "HGOFamilies": "materials.hgo",
    "HGOStructureTensor": "materials.hgo",
    "Junction": "materials.junction",
    "LAWS": "materials.registry",
    "Limits": "networks.guard",
    "LoadCase": "deformation",
    "Material": "materials.contract",
    "NeoHookean": "materials.neo_hookean",
    "Network": "networks.network",
    "RigidMotion": "specimen",
    "Slab": "specimen",
    "compare": "tissue",
    "delaunay": "networks.generation",
    "fit_hgo": "fitting.hgo",
    "loads": "deformation",
    "read_network": "io.networks",
    "read_specimen": "io.meshes",
    "solve": "tissue",
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
