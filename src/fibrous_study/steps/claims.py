"""Rule `claims`: every statement of the paper with what came out here, and the verdict."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from fibrous.errors import ConfigError
from fibrous_study import datasets
from fibrous_study.audit.finding import Statement
from fibrous_study.audit.statements import CHECKS
from fibrous_study.evidence import gathered

EQUATIONS = "the paper's equations alone"  # data of a statement that needs none of the study's


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Judge the config's `statements` by the files of the study; write `claims`, one row a statement in their order.

    Raises ConfigError for a statement that nothing judges, DatasetError for a file that does not hold what is needed.
    """
    statements = [statement_of(entry) for entry in params["config"]["statements"]]
    for one in statements:
        if one.id not in CHECKS:
            raise ConfigError(
                f"config/claims.yaml: nothing judges '{one.id}'; give it a check in fibrous_study.audit.statements"
            )
    evidence = gathered(inputs, params["config"])
    rows = []
    for one in statements:
        check = CHECKS[one.id]
        finding = check.finding(one, evidence)
        rows.append(
            {
                "id": one.id,
                "section": one.where,
                "says": one.says + _printed(one),
                "here": finding.here + _left_out(evidence.lost(check.data)),
                "spread": finding.spread,
                "verdict": finding.verdict.value,
                "why": finding.why,
                "data": "; ".join(_together([path for name in check.data for path in inputs[name]])) or EQUATIONS,
            }
        )
    datasets.write_table(pd.DataFrame(rows), outputs["claims"], params, "claims")


def statement_of(entry: Mapping[str, Any]) -> Statement:
    """A statement as config/claims.yaml holds it."""
    value, half_width = (np.array(entry.get(key, []), dtype=float).ravel() for key in ("value", "half_width"))
    return Statement(entry["id"], entry["where"], entry["says"], tuple(value.tolist()), tuple(half_width.tolist()))


def _printed(statement: Statement) -> str:
    """What the paper prints, as words behind the statement."""
    if not statement.value:
        return ""
    half_widths = statement.half_width or (np.nan,) * len(statement.value)
    pairs = zip(statement.value, half_widths, strict=True)
    return ": " + ", ".join(f"{value:g}" + ("" if np.isnan(half) else f" ± {half:g}") for value, half in pairs)


def _left_out(count: int) -> str:
    """What is said of networks without an equilibrium or constants, which count for nothing."""
    if not count:
        return ""
    return f"; {count} network{' is' if count == 1 else 's are'} left out, for want of an equilibrium or of a fit"


def _together(paths: list[Path]) -> list[str]:
    """Paths from `results` on, batches of one folder as one pattern."""
    found = []
    for path in paths:
        at = path.parts.index("results") if "results" in path.parts else 0
        name = f"*{path.suffix}" if path.stem.isdigit() else path.name
        found.append("/".join((*path.parts[at:-1], name)))
    return list(dict.fromkeys(found))
