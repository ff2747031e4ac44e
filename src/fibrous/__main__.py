"""``python -m fibrous check``: do the results belong to the present config and code? ``describe``: what they hold."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from fibrous.check import check
from fibrous.documentation import described
from fibrous.errors import FibrousError
from fibrous.study.configuration import loaded


def main(arguments: list[str] | None = None) -> int:
    """Print a line for every result that does not belong, and a last line. Returns 0 if there is none, else 1."""
    parser = argparse.ArgumentParser(prog="python -m fibrous", description=__doc__)
    commands = parser.add_subparsers(dest="command", required=True)
    checking = commands.add_parser("check", help="compare the results in this folder with the present config and code")
    checking.add_argument("--config", type=Path, help="a config file merged over the default one, as for the run")
    commands.add_parser("describe", help="print what every file of the study holds, as Markdown")
    given = parser.parse_args(arguments)
    if given.command == "describe":
        print(described(), end="")
        return 0
    try:
        lines, total = check(loaded(given.config), Path())
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


if __name__ == "__main__":
    sys.exit(main())
