"""CPU seconds of the parts of a long computation, summed over the threads that share it."""

from __future__ import annotations

import time
from collections import defaultdict
from collections.abc import Iterator
from contextlib import contextmanager
from threading import Lock


class Clock:
    """Sums CPU seconds by name; `seconds` may be read at any time."""

    def __init__(self) -> None:
        self.seconds: defaultdict[str, float] = defaultdict(float)
        self._lock = Lock()

    @contextmanager
    def of(self, part: str) -> Iterator[None]:
        """Count the CPU time that this thread spends inside as that of `part`."""
        start = time.thread_time()
        try:
            yield
        finally:
            with self._lock:
                self.seconds[part] += time.thread_time() - start
