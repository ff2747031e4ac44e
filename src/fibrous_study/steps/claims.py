"""Rule `claims`: the verdict on every statement of the paper, and the numbers behind it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pandas as pd

from fibrous.errors import ConfigError
from fibrous_study import datasets
from fibrous_study.audit.checks import CHECKS
from fibrous_study.audit.verdict import numbers
from fibrous_study.audit.wording import printed_numbers, worded
from fibrous_study.evidence import gathered
from fibrous_study.schema import TABLES


def run(inputs: Mapping[str, list[Path]], outputs: Mapping[str, Path], params: Mapping[str, Any]) -> None:
    """Judge the `statements` of the config's `paper` by the files of the study; write `claims`, a row per quantity.

    Raises ConfigError for a statement that nothing judges or a sentence that names a quantity that is not there,
    DatasetError for a file that does not hold what is needed.
    """
    statements = params["config"]["paper"]["statements"]
    evidence = gathered(inputs, params["config"])
    rows: list[dict[str, Any]] = []
    for statement in statements:
        name = statement["id"]
        if name not in CHECKS:
            raise ConfigError(f"config/paper.yaml: nothing judges '{name}'; give it a function in fibrous_study.audit")
        check = CHECKS[name]
        finding = check.judge(evidence, printed_numbers(statement))
        replicates = [one.replicates for one in finding.numbers if one.replicates]
        quantities = [*finding.numbers, *numbers(left_out=sum(evidence.left_out[group] for group in check.networks))]
        if replicates:
            quantities += numbers(replicates=min(replicates))
        rows += [
            {"claim": name, "quantity": one.name, **asdict(one), "verdict": finding.verdict.value} for one in quantities
        ]
    table = pd.DataFrame(rows)[list(TABLES["claims"].columns)]
    worded(table, statements)
    datasets.write_table(table, outputs["claims"], params, "claims")
