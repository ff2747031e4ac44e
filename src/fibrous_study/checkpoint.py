"""Where a long run stands: kept beside its result after every load step, for the same config, code and libraries.

The file is a line of JSON that says what it belongs to, a line of JSON with type and shape of every array and the notes
of the run, the bytes of the arrays, and the SHA-256 of all of this. Reading it runs nothing.
"""

from __future__ import annotations

import hashlib
import json
import os
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from fibrous.errors import DatasetError
from fibrous_study.datasets import in_place_of
from fibrous_study.provenance import config_hash, versions

ENDING = ".checkpoint"
CHUNK = 1 << 20  # bytes read at a time where they are only summed up
# What notes may raise that are not those of this run, however they were made.
UNFIT = (ArithmeticError, AttributeError, LookupError, RecursionError, TypeError, ValueError)


class Checkpoint:
    """The file beside `output` for a job with these `params`; no rule declares it, so that a killed run leaves it."""

    def __init__(self, output: Path, params: Mapping[str, Any]) -> None:
        self.path = output.with_suffix(ENDING)
        made_by = {"config_hash": config_hash(params["config"]), "code_hash": params["code_hash"], **versions()}
        self._header = _line({"stage": params["stage"], **made_by})

    def read(self, arrays: Sequence[np.ndarray], take: Callable[[Any], None]) -> bool:
        """Give the notes to `take` and fill the arrays with what was kept; returns whether there was something.

        Nothing is changed by a file of another origin, one that is damaged, or one whose arrays have other types or
        shapes: a line on stderr says so. It says so, too, where `take` raises one of UNFIT, and is to change nothing
        then. Raises DatasetError for a file that can be read once but not again.
        """
        self._clear()
        try:
            with open(self.path, "rb") as stream:
                why, notes = self._judged(stream, arrays)
                if not why:
                    try:
                        take(notes)
                    except UNFIT:
                        why = "its notes are not those of this run"
                if why:
                    print(f"{self.path}: {why}; starting anew", file=sys.stderr)
                    return False
                for array in arrays:
                    _fill(array, stream, self.path)
                return True
        except FileNotFoundError:
            return False
        except OSError as error:
            print(f"{self.path}: not readable ({error.strerror}); starting anew", file=sys.stderr)
            return False

    def write(self, arrays: Sequence[np.ndarray], notes: Any) -> None:
        """Keep arrays of numbers, and notes that JSON can hold, in place of what was kept before.

        Raises DatasetError where they cannot be written.
        """
        with in_place_of(self.path) as beside, open(beside, "wb") as stream:
            digest = hashlib.sha256()
            lines = self._header + _line({"arrays": _listed(arrays), "notes": notes})
            parts: Iterator[bytes | memoryview] = chain([lines], map(_bytes, arrays))
            for part in parts:
                digest.update(part)
                stream.write(part)
            stream.write(digest.digest())

    def remove(self) -> None:
        """The run is over: nothing is to be gone on with."""
        self.path.unlink(missing_ok=True)

    def _judged(self, stream: BinaryIO, arrays: Sequence[np.ndarray]) -> tuple[str, Any]:
        """Why a file is of no use, empty where it is of use, and its notes; the stream is left before the arrays."""
        if stream.read(len(self._header)) != self._header:
            return "kept by another config, code or library", None
        if not _is_whole(stream):
            return "damaged: not the content that was written", None
        stream.seek(len(self._header))
        try:
            listed = json.loads(stream.readline())
            if listed["arrays"] != _listed(arrays):
                return "its arrays have other types or shapes", None
            notes = listed["notes"]
        except UNFIT:
            return "no checkpoint", None
        wanted = stream.tell() + sum(array.nbytes for array in arrays) + hashlib.sha256().digest_size
        return ("" if os.fstat(stream.fileno()).st_size == wanted else "not as long as its arrays"), notes

    def _clear(self) -> None:
        """Remove what was being written when a run was killed."""
        for left in self.path.parent.glob(f".{self.path.name}.*"):
            left.unlink(missing_ok=True)


def _line(content: Any) -> bytes:
    return json.dumps(content, sort_keys=True).encode() + b"\n"


def _listed(arrays: Sequence[np.ndarray]) -> list[Any]:
    """Type and shape of each array, as JSON gives them back."""
    return [[array.dtype.str, list(array.shape)] for array in arrays]


def _bytes(array: np.ndarray) -> memoryview:
    """The bytes of an array, its own where they lie in order."""
    return np.ascontiguousarray(array).reshape(-1).view(np.uint8).data


def _is_whole(stream: BinaryIO) -> bool:
    """Whether a file ends with the SHA-256 of all before."""
    digest, left = hashlib.sha256(), os.fstat(stream.fileno()).st_size - hashlib.sha256().digest_size
    stream.seek(0)
    while left > 0 and (part := stream.read(min(CHUNK, left))):
        digest.update(part)
        left -= len(part)
    return left == 0 and stream.read() == digest.digest()


def _fill(array: np.ndarray, stream: BinaryIO, path: Path) -> None:
    """Read an array into its own memory where that lies in order."""
    target = array if array.flags.c_contiguous else np.empty_like(array, order="C")
    try:
        read = stream.readinto(_bytes(target))  # type: ignore[attr-defined]
    except OSError as error:
        raise DatasetError(f"{path}: not readable a second time ({error.strerror}); run again") from None
    if read != array.nbytes:
        raise DatasetError(f"{path}: changed while it was read; run again")
    if target is not array:
        array[...] = target
