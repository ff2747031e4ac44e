"""Where a long run stands: kept beside its result after every load step, for the same config, code and libraries."""

from __future__ import annotations

import json
import pickle
import sys
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from fibrous.datasets import place
from fibrous.provenance import config_hash, versions

ENDING = ".checkpoint"


class Checkpoint:
    """The file beside `output` for a job with these `params`; no rule declares it, so that a killed run leaves it."""

    def __init__(self, output: Path, params: Mapping[str, Any]) -> None:
        self.path = output.with_suffix(ENDING)
        made_by = {"config_hash": config_hash(params["config"]), "code_hash": params["code_hash"], **versions()}
        self._header = json.dumps({"stage": params["stage"], **made_by}, sort_keys=True).encode() + b"\n"

    def read(self) -> Any:
        """What was kept, or None where there is nothing, or what there is belongs to another config or code."""
        self._clear()
        try:
            with open(self.path, "rb") as stream:
                if stream.readline() != self._header:
                    print(f"{self.path}: kept by another config, code or library; starting anew", file=sys.stderr)
                    return None
                return pickle.load(stream)
        except FileNotFoundError:
            return None
        except (OSError, EOFError, pickle.UnpicklingError, AttributeError, ImportError) as error:
            print(f"{self.path}: not readable ({type(error).__name__}); starting anew", file=sys.stderr)
            return None

    def write(self, kept: Any) -> None:
        """Keep it in place of what was kept before. Raises DatasetError where it cannot be written."""
        place(self._header + pickle.dumps(kept, protocol=pickle.HIGHEST_PROTOCOL), self.path)

    def remove(self) -> None:
        """The run is over: nothing is to be gone on with."""
        self.path.unlink(missing_ok=True)

    def _clear(self) -> None:
        """Remove what was being written when a run was killed."""
        for left in self.path.parent.glob(f".{self.path.name}.*"):
            left.unlink(missing_ok=True)
