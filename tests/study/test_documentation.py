"""The page of files is what the code declares."""

from pathlib import Path

from fibrous_study.datasets import KINDS
from fibrous_study.documentation import TABLES, described

PAGE = Path(__file__).parents[2] / "docs" / "files.md"


def test_the_page_is_the_one_that_the_code_describes():
    assert PAGE.read_text(encoding="utf-8") == described()


def test_every_declared_name_is_on_the_page():
    for declared in (*KINDS.values(), *TABLES.values()):
        for name in declared:
            assert f"| `{name}` |" in described()
