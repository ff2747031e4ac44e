"""``python -m fibrous_study check`` compares the results with the present config and code.

``describe`` prints what the files hold, ``describe-config`` what the config may hold, and ``readme`` puts the numbers
of the run in docs/run into the README.
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from fibrous.errors import FibrousError
from fibrous_study import config_page
from fibrous_study.check import check
from fibrous_study.config import PROJECT
from fibrous_study.datasets import read_table
from fibrous_study.paper import section
from fibrous_study.report.readme import blocks, filled
from fibrous_study.schema import described

README = PROJECT / "README.md"
SHOWN_RUN = PROJECT / "docs" / "run"  # the tables of the paper-size run that the README shows


def main(arguments: list[str] | None = None) -> int:
    """Print a line for every result that does not belong, and a last line. Returns 0 if there is none, else 1."""
    parser = argparse.ArgumentParser(prog="python -m fibrous_study", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    checking = commands.add_parser("check", help="compare the results in this folder with the present config and code")
    checking.add_argument("--config", type=Path, help="a config file merged over the default one, as for the run")
    commands.add_parser("describe", help="print what every file of the study holds, as Markdown")
    commands.add_parser("describe-config", help="print every key of the config, as Markdown")
    commands.add_parser("readme", help="put the numbers of the tables in docs/run into README.md")
    given = parser.parse_args(arguments)
    if given.command == "describe":
        print(described(), end="")
        return 0
    try:
        if given.command == "describe-config":
            print(config_page.described(), end="")
            return 0
        if given.command == "readme":
            README.write_text(refreshed(README.read_text(encoding="utf-8")), encoding="utf-8")
            return 0
        lines, total = check(given.config, Path())
    except FibrousError as error:
        print(error, file=sys.stderr)
        return 1
    for line in lines:
        print(line)
    if lines:
        print(
            f"{len(lines)} findings; the study has {total} files: delete those named here that are not missing, "
            "then run snakemake again with the same config"
        )
        return 1
    print(f"all {total} files of the study belong to the present config and code")
    return 0


def refreshed(page: str) -> str:
    """The README with the numbers of the run that it shows. Raises DatasetError for a table that cannot be read."""
    names = ("claims", "comparison", "stages", "table_2", "targets")
    tables = {name: read_table(SHOWN_RUN / f"{name}.csv", name) for name in names}
    return filled(page, blocks(tables, section("statements")))


if __name__ == "__main__":
    sys.exit(main())
