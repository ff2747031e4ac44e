"""What the README shows a user works as printed."""

import re
import subprocess
import sys
from pathlib import Path

import yaml
from test_workflow_tissue import OWN_TISSUE

from fibrous.study.configuration import DEFAULT

ROOT = Path(__file__).parent.parent
README = (ROOT / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


def test_the_example_of_the_library_runs():
    (example,) = blocks("python")
    done = subprocess.run([sys.executable, "-W", "error", "-c", example], capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert "True" in done.stdout
    assert "C2_MPa" in done.stdout


def test_the_diff_is_of_lines_that_the_config_has():
    (diff,) = blocks("diff")
    before = [line[1:] for line in diff.splitlines() if not line.startswith("+")]
    assert all(f"{line}\n" in DEFAULT.read_text(encoding="utf-8") for line in before)


def test_the_configs_of_own_networks_and_tissue_are_yaml():
    """The tests of the workflow run configs of these keys."""
    networks, tissue = (yaml.safe_load(example) for example in blocks("yaml"))
    assert set(networks) == {"network", "network_files"}
    assert tissue == OWN_TISSUE


def test_files_that_the_page_links_to_exist():
    for target in re.findall(r"\]\(([^)#]+)\)", README):
        assert (ROOT / target).exists(), target
