"""The house of the package: imports run one way, and rooms that should not know each other do not."""

import ast
import re
import subprocess
import sys
from functools import cache
from graphlib import TopologicalSorter
from pathlib import Path

import pytest

import fibrous

SOURCES = Path(fibrous.__file__).parents[1]
ROOTS = [SOURCES / "fibrous", SOURCES / "fibrous_study"]
MODULES = {
    ".".join(path.relative_to(SOURCES).with_suffix("").parts): path for root in ROOTS for path in root.rglob("*.py")
}
TISSUE = ["fitting", "fe", "hybrid", "specimen", "tissue"]
# room of the library: what it must not import, itself or through others
FORBIDDEN = {
    "deformation": ["networks", "materials", *TISSUE, "io"],
    "curves": ["networks", "materials", *TISSUE, "io"],
    "networks": ["materials", *TISSUE, "io"],
    "materials": [*TISSUE, "io"],
    "fitting": ["networks", "fe", "hybrid", "specimen", "tissue", "io"],
    "fe": ["networks", "fitting", "hybrid", "specimen", "tissue", "io"],
    "specimen": ["networks", "fitting", "hybrid", "tissue", "io"],
    "hybrid": ["specimen", "io"],
    "comparison": ["networks", "fitting", "hybrid", "specimen", "tissue", "io"],
    "tissue": ["networks", "fitting", "hybrid"],
    "io": ["fitting", "hybrid", "tissue"],
}
# the same of the study
STUDY = {
    "audit": ["datasets", "curve_datasets", "steps", "figures", "report"],
    "report": ["datasets", "curve_datasets", "steps", "figures"],
    "sensitivity": ["datasets", "curve_datasets", "steps", "figures"],
    "datasets": ["steps", "figures", "audit", "report"],
    "figures": ["steps"],
    "steps": ["figures"],
}


@cache
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


def room_of(module: str) -> str:
    if module == "fibrous.io.netcdf":  # how any file is read and written; it knows nothing of what is in it
        return module
    return ".".join(module.split(".")[:2])


@pytest.mark.parametrize(
    ("package", "room", "forbidden"),
    [
        (package, *rooms)
        for package, rules in (("fibrous", FORBIDDEN), ("fibrous_study", STUDY))
        for rooms in rules.items()
    ],
)
def test_rooms_do_not_know_what_is_above_them(package, room, forbidden):
    inside = [name for name in MODULES if room_of(name) == f"{package}.{room}"]
    banned = {f"{package}.{other}" for other in forbidden}
    assert inside
    assert banned <= {room_of(name) for name in MODULES}
    for name in inside:
        for module in reached(name):
            assert room_of(module) not in banned, (name, module)


def test_the_library_knows_nothing_of_the_study():
    for name in [name for name in MODULES if name.startswith("fibrous.")]:
        assert not any(module.startswith("fibrous_study") for module in imports(name)), name


def test_only_figures_draw_and_nothing_knows_snakemake():
    for name, path in MODULES.items():
        text = path.read_text(encoding="utf-8")
        if name != "fibrous_study.config":  # config files are merged as Snakemake merges them
            assert not re.search(r"^ *(import|from) snakemake", text, re.M)
        if not name.startswith("fibrous_study.figures"):
            assert "import matplotlib" not in text
            assert "from matplotlib" not in text


# Docstrings --------------------------------------------------------------------------------------------------------

CODE = [*MODULES.values(), *Path(__file__).parents[1].rglob("*.py")]


def docstrings(path: Path) -> list[str]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    holders = [node for node in ast.walk(tree) if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)]
    return [text for text in map(ast.get_docstring, holders) if text]


def test_rule_module_and_log_carry_one_name():
    text = "\n".join(path.read_text() for path in (SOURCES.parent / "workflow/rules").glob("*.smk"))
    rules = set(re.findall(r"^ *rule (\w+):", text, re.M)) | {"refit_curves"}
    jobs, logs = set(re.findall(r'\bjob\(\s*"(\w+)"', text)), set(re.findall(r'"logs/(\w+)', text))
    assert logs == jobs <= rules
    folders = ("fibrous_study.steps.", "fibrous_study.figures.figure_")
    steps = {name.rpartition(".")[2] for name in MODULES if name.startswith(folders)}
    assert jobs == steps - {"__init__"}
    for name, path in MODULES.items():
        if name.startswith("fibrous_study.steps.") and (opening := re.match(r"Rules? `(\w+)`", docstrings(path)[0])):
            assert opening[1] == name.rpartition(".")[2]


def test_no_docstring_is_cut():
    """Quotes, backticks and brackets come in pairs, and a summary is a sentence."""
    for text in [text for path in CODE for text in docstrings(path)]:
        prose = re.sub(r"^ *>>>.*?(?=\n\s*\n|\Z)", "", text, flags=re.M | re.S)
        assert not any(prose.count(mark) % 2 for mark in '"`'), text
        assert not re.search(r'"\s*\n\s*"', prose), text
        assert all(prose.count(a) == prose.count(b) for a, b in ("()", "[]", "{}")), text
        assert re.search(r"[.:…][\")]*$", prose.split("\n\n")[0].rstrip()), text


# Stages that solve for no network.
TELLING = tuple(
    f"fibrous_study.steps.{name}"
    for name in (
        "hgo_fits", "table_1", "specimen", "comparison", "tissue_table", "febio", "table_2", "claims", "convergence",
        "stage_costs", "table_pages", "report",
    )
)  # fmt: skip
NETWORKS = tuple(f"fibrous_study.steps.{name}" for name in ("network_curves", "refit_curves", "network_states"))


@pytest.mark.parametrize(
    ("modules", "spared"),
    [
        (TELLING, ("numba", "matplotlib", "scipy.stats", "snakemake")),
        (
            [name for name in MODULES if ".figures." in name],
            ("numba", "scipy.stats", "meshio"),
        ),
        (NETWORKS, ("matplotlib", "scipy.stats", "meshio")),
    ],
    ids=["tables", "figures", "curves"],
)
def test_a_job_imports_what_it_uses(modules, spared):
    """Hundreds of jobs start a process each: an import of half a second is minutes of the study."""
    line = f"import sys, {', '.join(modules)}; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", line], capture_output=True, text=True, check=True)
    assert not set(spared) & set(done.stdout.split())
