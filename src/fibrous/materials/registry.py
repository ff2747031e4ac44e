"""The laws of tissue by name: what configs, tables, labels, FEBio and the study's rules know of each.

To add one, write its class in a module of this folder and name it here.
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib import import_module
from typing import Any

from fibrous.materials.contract import MaterialError


@dataclass(frozen=True)
class Law:
    """A law of tissue.

    label : what figures and reports call it
    source : module and class of its material, imported when asked for since some bring compiled code
    has_constants : whether it is of the class `HGO`, with constants C2 and C3 to be fitted, and `tension_only`
    has_networks : whether it is made of networks, by its `of_networks`
    is_solved : whether these are solved for at every Gauss point, not evaluated
    in_febio : whether `io.febio` writes it, in tension alone
    """

    label: str
    source: str
    has_constants: bool = False
    has_networks: bool = False
    is_solved: bool = False
    in_febio: bool = False

    @property
    def material(self) -> Any:
        """Its class."""
        module, _, name = self.source.partition(":")
        return getattr(import_module(module), name)


class _Laws(dict[str, Law]):
    """Laws by name; raises MaterialError for a name that is none."""

    def __missing__(self, name: str) -> Law:
        raise MaterialError(f"law '{name}' is unknown; choose one of {', '.join(self)}")


#: The fibres of a tissue, beside its matrix; `matrix` has none.
LAWS = _Laws(
    matrix=Law("matrix alone", "fibrous.materials.neo_hookean:NeoHookean"),
    structure_tensor=Law("Eq. 2", "fibrous.materials.hgo:HGOStructureTensor", has_constants=True),
    families=Law("Eq. 10C", "fibrous.materials.hgo:HGOFamilies", has_constants=True, in_febio=True),
    affine=Law("affine fibres, nothing fitted", "fibrous.materials.affine_fibers:AffineFibers", has_networks=True),
    junction=Law("junction law, nothing fitted", "fibrous.materials.junction:Junction", has_networks=True),
    network=Law(
        "a network at every Gauss point", "fibrous.materials.network:FiberNetworks", has_networks=True, is_solved=True
    ),
)
WITH_CONSTANTS = [name for name, law in LAWS.items() if law.has_constants]


def law_called(name: str) -> Law:
    """The law with constants of that name; raises MaterialError for any other name.

    >>> law_called("families").label
    'Eq. 10C'
    """
    if name not in WITH_CONSTANTS:
        raise MaterialError(f"law '{name}' has no constants C2 and C3; those that have are {', '.join(WITH_CONSTANTS)}")
    return LAWS[name]
