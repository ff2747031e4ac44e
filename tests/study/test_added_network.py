"""A way to make networks is added by two files, as CONTRIBUTING shows, and both the library and the config know it."""

import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import numpy as np
from test_readme import applied

from fibrous import read_network

ROOT = Path(__file__).parents[2]
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
USE = """
import copy
import numpy as np
import fibrous as fb
from fibrous.networks import generator
from fibrous_study.config import loaded, validated

config = copy.deepcopy(loaded())
config["network"] = "lattice"
assert validated(config)["network"] == "lattice"
fiber = fb.Fiber(modulus_MPa=10.0, nonlinearity=2.5, radius_um=0.1)
network = generator("lattice")(np.diag([0.5, 0.3, 0.2]), fiber, 0.04, 20.0, seed=1, tolerance=0.03)
network.save("lattice.nc")
"""


def test_a_lattice_is_added_by_a_module_and_a_line(tmp_path):
    for part in ("src", "config", "workflow"):
        shutil.copytree(ROOT / part, tmp_path / part, ignore=shutil.ignore_patterns("*.nbi", "*.nbc", "*.pyc"))
    start = CONTRIBUTING.index("A new way to make networks")
    module, diff = re.findall(r"```(?:python|diff)\n(.*?)```", CONTRIBUTING[start:], flags=re.DOTALL)[:2]
    networks = tmp_path / "src/fibrous/networks"
    (networks / "lattice.py").write_text(module, encoding="utf-8")
    registry = networks / "__init__.py"
    registry.write_text(applied(registry.read_text(encoding="utf-8"), diff), encoding="utf-8")
    environment = {**os.environ, "PYTHONPATH": str(tmp_path / "src")}
    done = subprocess.run([sys.executable, "-c", USE], capture_output=True, text=True, env=environment, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    # Here, where compiled functions are kept.
    network = read_network(tmp_path / "lattice.nc")
    assert network.stress(np.diag([1.1, 0.95, 0.95]))[0, 0] > 0.0
    np.testing.assert_allclose(np.diag(network.structure_tensor), [0.5, 0.3, 0.2], atol=0.03)
