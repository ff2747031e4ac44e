"""Compiled functions whose machine code is kept for the next process, wherever a folder for it can be written."""

from __future__ import annotations

import sys
from collections.abc import Callable
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import Any

import numba
from numba.core.caching import FunctionCache
from numba.core.dispatcher import Dispatcher


def njit(**options: Any) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    """Numba's `njit` with these options; the machine code is kept where Numba's `cache=True` keeps it.

    Where there is no such folder, as in a read-only installation without a home, every process compiles anew, and says
    so in one line on stderr. Code that was kept and is damaged is compiled anew, too.
    """

    def decorated(function: Callable[..., Any]) -> Callable[..., Any]:
        compiled = numba.njit(**options)(function)
        if isinstance(compiled, Dispatcher):  # else Numba is switched off
            try:
                compiled._cache = _Kept(function)  # type: ignore[attr-defined]
            except RuntimeError:
                _say_that_nothing_is_kept()
        return compiled

    return decorated


class _Kept(FunctionCache):
    """Numba's cache of one function, which fails by keeping nothing and counts all of a folder's sources.

    Numba compares the file that the function stands in, although what it calls from others is compiled in.
    Raises RuntimeError where no folder can be written.
    """

    def __init__(self, function: Callable[..., Any]) -> None:
        super().__init__(function)
        stamp = self._cache_file._source_stamp, _digest(Path(function.__code__.co_filename).parent)
        self._cache_file._source_stamp = stamp

    def load_overload(self, sig: Any, target_context: Any) -> Any:
        """The machine code for a signature, None where there is none that can be read."""
        try:
            return super().load_overload(sig, target_context)
        except Exception:  # a damaged file may fail in any way
            self._forget()
            return None

    def save_overload(self, sig: Any, data: Any) -> None:
        """Keep the machine code for a signature, if that can be done."""
        try:
            super().save_overload(sig, data)
        except OSError:
            self.disable()
            _say_that_nothing_is_kept()

    def _forget(self) -> None:
        try:
            self.flush()
        except OSError:
            self.disable()
            _say_that_nothing_is_kept()


@cache
def _digest(folder: Path) -> str:
    """SHA-256 of the sources in a folder."""
    digest = sha256()
    for path in sorted(folder.glob("*.py")):
        digest.update(path.name.encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


@cache
def _say_that_nothing_is_kept() -> None:
    print(
        "fibrous: no folder for compiled code can be written, so that every process compiles it anew; "
        "set NUMBA_CACHE_DIR to one that can",
        file=sys.stderr,
    )
