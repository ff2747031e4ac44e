"""Compiled functions: found again by the next process, made anew where nothing can be kept or what is kept is bad."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

import fibrous

MODULE = """
from fibrous.compiled import njit
from other import FACTOR


@njit(error_model="numpy")
def times(x):
    return FACTOR * x


@njit()
def more(x):
    return times(x) + 1.0
"""
USE = "import module; print(module.more(2.0), len(module.more.stats.cache_hits), len(module.times.stats.cache_hits))"


@pytest.fixture
def folder(tmp_path) -> Path:
    (tmp_path / "module.py").write_text(MODULE)
    (tmp_path / "other.py").write_text("FACTOR = 3.0\n")
    return tmp_path


def used(folder: Path, code: str = USE, **variables: str) -> tuple[str, str]:
    """What a new process without a home says on both streams."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith(("XDG_", "NUMBA_"))}
    path = os.pathsep.join([str(folder), str(Path(fibrous.__file__).parents[1])])
    done = subprocess.run(
        [sys.executable, "-B", "-c", code],
        env={**kept, "PYTHONPATH": path, "HOME": os.devnull, **variables},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    return done.stdout.strip(), done.stderr


def kept(folder: Path, ending: str) -> list[Path]:
    return sorted(folder.rglob(f"*.{ending}"))


def test_the_next_process_finds_the_code(folder):
    assert used(folder) == ("7.0 0 0", "")
    assert used(folder) == ("7.0 1 0", "")  # times is part of the code of more
    assert {path.parent for path in kept(folder, "nbc")} == {folder / "__pycache__"}


def test_code_is_made_anew_when_a_file_beside_it_changes(folder):
    used(folder)
    (folder / "other.py").write_text("FACTOR = 4.0\n")
    assert used(folder) == ("9.0 0 0", "")


def test_without_a_folder_that_can_be_written_every_process_compiles_and_says_so_once(folder):
    (folder / "__pycache__").write_text("in the way, even of root")
    for _ in range(2):
        printed, said = used(folder)
        assert printed == "7.0 0 0"
        assert said.count("\n") == 1
        assert "NUMBA_CACHE_DIR" in said
    place = folder / "place"
    for hits in (0, 1):
        assert used(folder, NUMBA_CACHE_DIR=str(place)) == (f"7.0 {hits} 0", "")


def test_a_folder_that_cannot_be_written_any_more_is_said_once(folder):
    gone = "import module, shutil; shutil.rmtree('__pycache__'); open('__pycache__', 'w').close(); "
    printed, said = used(folder, f"import os; os.chdir({str(folder)!r}); {gone}{USE}")
    assert printed == "7.0 0 0"
    assert said.count("\n") == 1


@pytest.mark.parametrize("ending", ["nbi", "nbc"])
@pytest.mark.parametrize("damage", ["empty", "half", "noise"])
def test_damaged_code_is_made_anew_and_kept(folder, ending, damage, rng):
    used(folder)
    for path in kept(folder, ending):
        content = path.read_bytes()
        noise = np.frombuffer(rng.bytes(len(content)), dtype=np.uint8).tobytes()
        path.write_bytes({"empty": b"", "half": content[: len(content) // 2], "noise": noise}[damage])
    assert used(folder) == ("7.0 0 0", "")
    assert used(folder) == ("7.0 1 0", "")
