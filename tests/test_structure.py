"""The house of the package: imports run one way, and rooms that should not know each other do not."""

import ast
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import fibrous

ROOT = Path(fibrous.__file__).parent
MODULES = {".".join(("fibrous", *path.relative_to(ROOT).with_suffix("").parts)): path for path in ROOT.rglob("*.py")}
# room: what it must not import, itself or through others
FORBIDDEN = {
    "deformation": ["networks", "fitting", "datasets", "study", "figures"],
    "networks": ["fitting", "datasets", "network_files", "study", "figures"],
    "fitting": ["networks", "datasets", "study", "figures"],
    "datasets": ["networks", "fitting", "study", "figures"],
    "figures": ["study"],
    "study": ["figures"],
}


def imports(name: str) -> set[str]:
    """Modules of the package that a module imports anywhere in its text."""
    found = set()
    for node in ast.walk(ast.parse(MODULES[name].read_text(encoding="utf-8"))):
        if isinstance(node, ast.ImportFrom) and node.module:
            found |= {node.module, *(f"{node.module}.{alias.name}" for alias in node.names)}
        elif isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
    return {module for module in found if module in MODULES}


def reached(name: str) -> set[str]:
    seen: set[str] = set()
    waiting = [name]
    while waiting:
        for module in imports(waiting.pop()) - seen:
            seen.add(module)
            waiting.append(module)
    return seen


def test_no_import_runs_in_a_circle():
    order = list(TopologicalSorter({name: imports(name) for name in MODULES}).static_order())
    assert len(order) == len(MODULES)


@pytest.mark.parametrize("room", FORBIDDEN)
def test_rooms_do_not_know_what_is_above_them(room):
    for name in MODULES:
        if name.startswith(f"fibrous.{room}"):
            for module in reached(name):
                assert not any(module.startswith(f"fibrous.{other}") for other in FORBIDDEN[room]), (name, module)


def test_only_figures_draw_and_nothing_knows_snakemake():
    for name, path in MODULES.items():
        text = path.read_text(encoding="utf-8")
        assert "import snakemake" not in text
        assert "from snakemake" not in text
        if not name.startswith("fibrous.figures"):
            assert "import matplotlib" not in text
            assert "from matplotlib" not in text
