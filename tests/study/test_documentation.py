"""The page of files is what the code declares."""

from pathlib import Path

from fibrous_study.schema import described

PAGE = Path(__file__).parents[2] / "docs" / "files.md"


def test_the_page_is_the_one_that_the_code_describes():
    assert PAGE.read_text(encoding="utf-8") == described()
