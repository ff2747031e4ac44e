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
from fibrous.study.stages import STAGES

ROOT = Path(fibrous.__file__).parent
MODULES = {".".join(("fibrous", *path.relative_to(ROOT).with_suffix("").parts)): path for path in ROOT.rglob("*.py")}
# What knows the files of the study; the library below it knows none of them.
ABOVE = ["datasets", "curve_datasets", "provenance", "prediction", "study", "figures"]
# Formats of other programs, whose readers and writers nothing else of the library needs.
FORMATS = ["network_files", "mesh_files", "vtu_files", "febio_files"]
TISSUE = ["fitting", "fe", "hybrid", "specimen", "material_point"]
# room: what it must not import, itself or through others
FORBIDDEN = {
    "deformation": ["networks", "materials", *TISSUE, *FORMATS, *ABOVE],
    "curves": ["networks", "materials", *TISSUE, *FORMATS, *ABOVE],
    "networks": ["curves", "materials", *TISSUE, *FORMATS, *ABOVE],
    "materials": [*TISSUE, *FORMATS, *ABOVE],
    "fitting": ["networks", "fe", "hybrid", "specimen", "material_point", *FORMATS, *ABOVE],
    "fe": ["networks", "fitting", "hybrid", "specimen", "material_point", *FORMATS, *ABOVE],
    "specimen": ["networks", "fitting", "hybrid", "material_point", *FORMATS, *ABOVE],
    "hybrid": ["specimen", *FORMATS, *ABOVE],
    "material_point": ["networks", "fitting", "hybrid", "specimen", *FORMATS, *ABOVE],
    **{name: ["fitting", "hybrid", *ABOVE] for name in FORMATS},
    "audit": [*FORMATS, *ABOVE],
    "report": [*FORMATS, *ABOVE],
    "sensitivity": ["hybrid", "specimen", *FORMATS, *ABOVE],
    **{
        name: ["networks", "materials", *TISSUE, *FORMATS, "prediction", "study", "figures"]
        for name in ("datasets", "curve_datasets")
    },
    "figures": ["study"],
    "study": ["figures"],
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
    return module.removeprefix("fibrous.").partition(".")[0]


@pytest.mark.parametrize("room", FORBIDDEN)
def test_rooms_do_not_know_what_is_above_them(room):
    inside = [name for name in MODULES if room_of(name) == room]
    assert inside
    for name in inside:
        for module in reached(name):
            assert room_of(module) not in FORBIDDEN[room], (name, module)


def test_every_forbidden_room_exists():
    assert {other for forbidden in FORBIDDEN.values() for other in forbidden} <= {room_of(name) for name in MODULES}


def test_only_figures_draw_and_nothing_knows_snakemake():
    for name, path in MODULES.items():
        text = path.read_text(encoding="utf-8")
        assert "import snakemake" not in text
        assert "from snakemake" not in text
        if not name.startswith("fibrous.figures"):
            assert "import matplotlib" not in text
            assert "from matplotlib" not in text


# Docstrings --------------------------------------------------------------------------------------------------------

RULE = re.compile(r"^ *rule (\w+):.*?(?=^ *rule |\Z)", re.M | re.S)
CODE = [*ROOT.rglob("*.py"), *Path(__file__).parent.glob("*.py")]


def rules() -> dict[str, set[str]]:
    """Names of the rules that run each module, by the module."""
    found: dict[str, set[str]] = {}
    for path in (ROOT.parents[1] / "workflow/rules").glob("*.smk"):
        for block in RULE.finditer(path.read_text(encoding="utf-8")):
            if stage := re.search(r"\bjob\(\"(\w+)\"\)", block[0]):
                found.setdefault(STAGES[stage[1]].module, set()).add(block[1])
    return found


def docstrings(path: Path) -> list[str]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    holders = [node for node in ast.walk(tree) if isinstance(node, ast.Module | ast.ClassDef | ast.FunctionDef)]
    return [text for text in map(ast.get_docstring, holders) if text]


def test_a_step_names_the_rules_that_run_it():
    known, named = rules(), 0
    for name, path in MODULES.items():
        if (opening := re.match(r"Rules? (`\w+`(?:(?:,| and) `\w+`)*):", docstrings(path)[0])) is not None:
            assert set(re.findall(r"`(\w+)`", opening[1])) == known[name], name
            named += 1
    assert named > 20
    every = set().union(*known.values())
    for path in CODE:
        for text in docstrings(path):
            assert set(re.findall(r"\brule\s+`(\w+)`", text)) <= every, path


def test_no_docstring_is_cut():
    """Quotes, backticks and brackets come in pairs, and a summary is a sentence."""
    for text in [text for path in CODE for text in docstrings(path)]:
        prose = re.sub(r"^ *>>>.*?(?=\n\s*\n|\Z)", "", text, flags=re.M | re.S)
        assert not any(prose.count(mark) % 2 for mark in '"`'), text
        assert not re.search(r'"\s*\n\s*"', prose), text
        assert all(prose.count(a) == prose.count(b) for a, b in ("()", "[]", "{}")), text
        assert re.search(r"[.:…][\")]*$", prose.split("\n\n")[0].rstrip()), text


# Stages that solve for no network.
TELLING = (
    "study.fits", "study.surface", "study.specimen", "study.comparison", "study.tissue_table", "study.febio",
    "study.table_2", "study.claims", "study.convergence", "study.stage_costs", "study.table_pages", "study.report",
)  # fmt: skip


@pytest.mark.parametrize(
    ("modules", "spared"),
    [
        (TELLING, ("numba", "matplotlib", "scipy.stats", "snakemake")),
        (
            [name.removeprefix("fibrous.") for name in MODULES if ".figures." in name],
            ("numba", "scipy.stats", "meshio"),
        ),
        (("study.curves", "study.refit_curves", "study.states"), ("matplotlib", "scipy.stats", "meshio")),
    ],
    ids=["tables", "figures", "curves"],
)
def test_a_job_imports_what_it_uses(modules, spared):
    """Hundreds of jobs start a process each: an import of half a second is minutes of the study."""
    line = f"import sys, {', '.join(f'fibrous.{name}' for name in modules)}; print(*sys.modules)"
    done = subprocess.run([sys.executable, "-c", line], capture_output=True, text=True, check=True)
    assert not set(spared) & set(done.stdout.split())
