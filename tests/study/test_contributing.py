"""What CONTRIBUTING shows somebody who adds to the project works as printed."""

import re
import shutil
import subprocess
import sys
from pathlib import Path

from test_readme import applied

ROOT = Path(__file__).parents[2]
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")

# In a study of the copy: fit the new law, run it, and label it; then compare with the law that it is.
LAW_AT_WORK = """
import sys
from pathlib import Path

import numpy as np
from small_study import FITS_FILE, Study
from test_fits_stage import curves_file, run_fits

from fibrous.fe.solver import LoadStepper
from fibrous.materials.hgo import HGOStructureTensor
from fibrous.materials.neo_hookean import NeoHookean
from fibrous_study.solutions import read_specimen
from fibrous_study.words import law_label

study = Study(Path(sys.argv[1]))
model = next(model for model in study.config["tissue"]["models"] if model["name"] == "one_axis")
assert law_label(model) == "Eq. 2 about one axis fitted and run"
study.run("specimen")
table = study.folder / FITS_FILE
run_fits([curves_file(study.folder / "curves.nc", range(12))], table, [{"energy": "one_axis", "objective": "energy"}])
study.run("tissue_run", run="one_axis")
tissue = study.tissue("one_axis")
C2, C3 = tissue["C2"][0].values[:, None], tissue["C3"][0].values[:, None]
assert (C2 > 0.0).all() and np.ptp(C2) > 0.0
first = tissue["structure_tensor"].values[:, None, 0, 0, None, None]
H = first * np.diag([1.0, 0.0, 0.0]) + 0.5 * (1.0 - first) * np.diag([0.0, 1.0, 1.0])
specimen = read_specimen(study.folder / "results/tissue/specimen.nc")[0]
law = NeoHookean(0.025, 0.417) + HGOStructureTensor(C2, C3, H)
found = LoadStepper.of(specimen.mesh, law, specimen.prescribed).follow(specimen.prescribed.values)
np.testing.assert_allclose(tissue["displacement"].values, found.displacement, atol=1e-9)
"""


def test_the_law_that_is_added_is_fitted_run_and_labelled(tmp_path):
    copy = tmp_path / "project"
    for name in ("src", "config", "workflow"):
        shutil.copytree(ROOT / name, copy / name, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copy(ROOT / "Snakefile", copy)
    section = re.search(r"^## To add a law of tissue$(.*?)^## ", CONTRIBUTING, re.M | re.S)
    diffs = re.findall(r"```diff\n\+\+\+ (\S+)\n(.*?)```", section[1], re.S)
    assert len(diffs) == 3
    for name, diff in diffs:
        before = (copy / name).read_text(encoding="utf-8") if (copy / name).exists() else ""
        changed = applied(before, diff) if before else "".join(f"{line[1:]}\n" for line in diff.splitlines())
        (copy / name).write_text(changed, encoding="utf-8")
    paths = ":".join(map(str, [copy / "src", ROOT / "tests", ROOT / "tests/study"]))
    done = subprocess.run(
        [sys.executable, "-c", LAW_AT_WORK, str(tmp_path)], env={"PYTHONPATH": paths}, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stderr
