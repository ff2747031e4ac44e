"""Fibre networks of soft tissue, and the continuum laws that stand in for them.

>>> import fibrous as fb
>>> specimen = fb.Slab(elements=(2, 2, 1)).specimen(steps=1)
>>> law = fb.HGOStructureTensor(C2=0.1, C3=0.4, structure_tensor=specimen.structure_tensor[:, None])
>>> fb.solve(specimen, fb.NeoHookean(0.025, 0.417) + law)
<Solution: 4 elements, 1 of 1 steps, 4 Newton iterations, 0 cutbacks>
"""

from importlib import import_module
from typing import Any

# Public names and their modules, which are imported when asked for: some bring compiled code.
_MODULES = {
    "AffineFibers": "materials.affine_fibers",
    "FiberField": "specimen",
    "FiberNetworks": "materials.network",
    "HGOFamilies": "materials.hgo",
    "HGOStructureTensor": "materials.hgo",
    "LAWS": "materials.registry",
    "Material": "materials.contract",
    "NeoHookean": "materials.neo_hookean",
    "RigidMotion": "specimen",
    "Slab": "specimen",
    "compare": "tissue",
    "fit_hgo": "fitting.hgo",
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
