"""Sentences about the statements of the paper: the templates of config/paper.yaml filled with the audit's numbers.

A template names quantities in braces. `{name}` is a number with three digits, `{name:%}` a percentage, `{name:.2f}` as
Python writes it, `{name:yes|no}` the first word where the quantity is true and the second where it is not;
`{name.printed}` is the paper's number. `says` has the numbers of the statement's `printed` as they stand there.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pandas as pd

from fibrous.errors import ConfigError
from fibrous_study.words import number, percent, spoken

SHORT = {"not reproduced": "not", "contradicted by the paper itself": "contradicted"}  # verdicts as keys of templates


@dataclass(frozen=True)
class Said:
    """A statement as a reader meets it.

    under : the figure or table of the report that it belongs to
    says : what the paper says, with what it prints; here : what came out; spread : the same over replicates, or nothing
    why : the reason of the verdict
    """

    id: str
    under: str
    section: str
    says: str
    here: str
    spread: str
    verdict: str
    why: str


@dataclass(frozen=True)
class Written:
    """A quantity that a template writes; as its range over the replicates where it is `ranged` and has a range."""

    value: float
    low: float
    high: float
    paper: float
    ranged: bool

    @property
    def printed(self) -> Written:
        """The paper's number."""
        return Written(self.paper, math.nan, math.nan, math.nan, False)

    def __format__(self, spec: str) -> str:
        if self.ranged and np.isfinite(self.low):
            low, high = _written(self.low, spec), _written(self.high, spec)
            return low if low == high else f"{low} to {high}"
        return _written(self.value, spec)


def _written(value: float, spec: str) -> str:
    if "|" in spec:
        return spec.split("|")[0 if value else 1]
    if not math.isfinite(value):
        return "unknown"
    return number(value) if not spec else percent(value) if spec == "%" else format(value, spec)


def printed_numbers(statement: Mapping[str, Any]) -> dict[str, Any]:
    """What the paper prints with a statement: numbers, or lists of them, by name."""
    return {
        name: [np.nan if one is None else float(one) for one in value] if isinstance(value, list) else float(value)
        for name, value in statement.get("printed", {}).items()
    }


def worded(claims: pd.DataFrame, statements: Sequence[Mapping[str, Any]]) -> list[Said]:
    """The rows of results/claims.csv as sentences, a statement each, in the order of config/paper.yaml.

    Raises ConfigError for a template that names a quantity that the claim does not have.
    """
    by_claim = dict(iter(claims.assign(load_set=claims["load_set"].fillna("")).groupby("claim", sort=False)))
    return [_said(one["id"], one, by_claim[one["id"]]) for one in statements if one["id"] in by_claim]


def _said(name: str, statement: Mapping[str, Any], rows: pd.DataFrame) -> Said:
    verdict = str(rows["verdict"].iloc[0])
    why = statement["why"]
    if isinstance(why, Mapping):
        why = why.get(SHORT.get(verdict, verdict), why.get("otherwise", ""))
    here, spread = (" ".join(_here(name, statement, rows, ranged)) for ranged in (False, True))
    whole = _quantities(rows, "", False)
    spread = f"{spread}; over {whole['replicates']} replicates" if "replicates" in whole and spread != here else ""
    if whole["left_out"].value:
        here += f"; networks left out, for want of an equilibrium or of a fit: {whole['left_out']}"
    says = _filled(name, "says", statement["says"], statement.get("printed", {}))
    return Said(
        name, statement["under"], str(statement["where"]), says, here, spread, verdict, _filled(name, "why", why, whole)
    )


def _here(name: str, statement: Mapping[str, Any], rows: pd.DataFrame, ranged: bool) -> Iterator[str]:
    """What came out: `here`, and `each` for every load set."""
    whole = _quantities(rows, "", ranged)
    if "here" in statement:
        yield _filled(name, "here", statement["here"], whole)
    if "each" in statement:
        sets = [one for one in rows["load_set"].unique() if one]
        yield "; ".join(
            f"{spoken(one)}: {_filled(name, 'each', statement['each'], whole | _quantities(rows, one, ranged))}"
            for one in sets
        )


def _quantities(rows: pd.DataFrame, load_set: str, ranged: bool) -> dict[str, Written]:
    rows = rows[rows["load_set"] == load_set].set_index("quantity")
    numbers = rows[["value", "low", "high", "printed"]].to_dict("index")
    return {
        str(name): Written(one["value"], one["low"], one["high"], one["printed"], ranged)
        for name, one in numbers.items()
    }


def _filled(claim: str, key: str, template: str, quantities: Mapping[str, Any]) -> str:
    try:
        return " ".join(template.format_map(quantities).split())
    except (KeyError, AttributeError, ValueError, IndexError) as error:
        raise ConfigError(
            f"config/paper.yaml: {key} of {claim} cannot be written ({error}); the quantities of {claim} are "
            f"{', '.join(quantities)}"
        ) from None
