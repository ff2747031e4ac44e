"""What the README shows a user works as printed."""

import json
import os
import re
import shutil
import subprocess
import sys
from pathlib import Path

import pytest
import yaml
from PIL import Image
from test_workflow_tissue import OWN_TISSUE

from fibrous_study.__main__ import refreshed
from fibrous_study.audit.checks import CHECKS
from fibrous_study.config import DEFAULT, validated

ROOT = Path(__file__).parents[2]
CONTRIBUTING = (ROOT / "CONTRIBUTING.md").read_text(encoding="utf-8")
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


@pytest.mark.parametrize(("number", "said"), [(0, "[[ 0.1117"), (1, "C2_MPa")])
def test_the_examples_of_the_library_run(number, said):
    example = blocks("python")[number]
    assert len([line for line in example.splitlines() if line]) <= 10
    done = subprocess.run([sys.executable, "-W", "error", "-c", example], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert said in done.stdout


def applied(text: str, diff: str) -> str:
    """The text with the change of a diff, whose lines it must hold one after the other, once."""
    before, after = (
        "".join(f"{line[1:]}\n" for line in diff.splitlines() if not line.startswith(sign)) for sign in "+-"
    )
    assert text.count(before) == 1
    return text.replace(before, after)


def test_the_diffs_apply_and_leave_a_study_that_runs():
    config = DEFAULT.read_text(encoding="utf-8")
    *of_config, of_figure = blocks("diff")
    assert len(of_config) == 4
    for diff in of_config:
        changed = applied(config, diff)
        assert validated(yaml.safe_load(changed)) != validated(yaml.safe_load(config))
    assert applied((ROOT / "src/fibrous_study/figures/figure_5.py").read_text(encoding="utf-8"), of_figure)


def test_every_number_of_the_run_is_that_of_its_tables():
    assert refreshed(README) == README
    assert README.count("<!-- end of ") == 4


def test_the_picture_is_of_the_run_that_the_numbers_come_from():
    made = [json.loads(Image.open(path).info["fibrous"]) for path in sorted((ROOT / "docs").glob("figure_*.png"))]
    beside = json.loads((ROOT / "docs/run/claims.csv.json").read_text(encoding="utf-8"))
    assert {one["study_config"] for one in made} == {beside["study_config"]}


def test_the_configs_of_own_networks_and_tissue_are_yaml():
    """The tests of the workflow run configs of these keys."""
    networks, tissue = (yaml.safe_load(example) for example in blocks("yaml"))
    assert set(networks) == {"network", "network_files"}
    assert tissue == OWN_TISSUE


def test_files_that_the_page_links_to_exist():
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        assert (ROOT / target).exists(), target


def test_a_claim_takes_two_files(tmp_path):
    """The statement and the check that CONTRIBUTING shows, in a copy of the sources, judge and read as any other."""
    diffs = re.findall(r"```diff\n\+\+\+ (\S+)\n(.*?)```", CONTRIBUTING, flags=re.DOTALL)
    of_claim = [(path, diff) for path, diff in diffs if "end-of-the-large-range" in diff]
    assert [path for path, _ in of_claim] == ["config/paper.yaml", "src/fibrous_study/audit/curves.py"]
    for folder in ("src", "config", "workflow"):
        shutil.copytree(ROOT / folder, tmp_path / folder, ignore=shutil.ignore_patterns("__pycache__", "*.egg-info"))
    shutil.copy(ROOT / "Snakefile", tmp_path)
    for path, diff in of_claim:
        text = (tmp_path / path).read_text(encoding="utf-8")
        (tmp_path / path).write_text(applied(text, diff), encoding="utf-8")
    paths = os.pathsep.join(str(folder) for folder in (tmp_path / "src", ROOT / "tests"))
    line = (
        "from made_up_evidence import curves, found; from fibrous_study.audit.checks import CHECKS; "
        "print(found('end-of-the-large-range', large=curves()).verdict, len(CHECKS))"
    )
    done = subprocess.run(
        [sys.executable, "-c", line], env=os.environ | {"PYTHONPATH": paths}, capture_output=True, text=True
    )
    assert done.stdout == f"reproduced {len(CHECKS) + 1}\n", done.stderr
