"""Where a long run stands, in a line for the log and the terminal."""

from __future__ import annotations

import os
import sys
import time
from contextlib import suppress

from fibrous.fe.solver import Walk


class Progress:
    """Says after every Newton iteration how far a walk is; `terminal` is a file descriptor besides stderr, or None."""

    def __init__(self, name: str, terminal: int | None) -> None:
        self.name, self.terminal = name, terminal
        self.network_iterations = 0
        self._start, self._first = time.monotonic(), 0

    def goes_on(self, walk: Walk) -> None:
        """The walk begins at a step that was not the first: what came before says nothing of the speed."""
        self._first = walk.step
        self._say(f"{self.name}: going on after load step {self._first} of {len(walk.targets)}")

    def __call__(self, walk: Walk) -> None:
        """To be called with the walk after every Newton iteration."""
        step, steps = walk.step, len(walk.targets)
        elapsed = time.monotonic() - self._start
        done = step - self._first
        left = f", about {_clock(elapsed / done * (steps - step))} left" if done else ""
        where = f"load step {step + 1} of {steps}, iteration {len(walk.residuals)}, residual {walk.residuals[-1]:.1e}"
        spent = f"{self.network_iterations} network iterations before it, {_clock(elapsed)} elapsed{left}"
        self._say(f"{self.name}: {where}, {spent}")

    def _say(self, line: str) -> None:
        print(line, file=sys.stderr, flush=True)
        if self.terminal is not None:
            with suppress(OSError):  # a closed terminal is no reason to stop
                os.write(self.terminal, f"{line}\n".encode())


def _clock(seconds: float) -> str:
    minutes, seconds = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{seconds:02d}"
