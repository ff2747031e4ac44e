"""One job of the study: ``python -m fibrous.study.job --params JSON --input NAME FILE… --output NAME FILE``.

The process that a rule starts. It hands files and params to the stage's `run` and turns a user's mistake into one line.
"""

from __future__ import annotations

import argparse
import ctypes
import importlib
import json
import os
import signal
import sys
from pathlib import Path

from threadpoolctl import threadpool_limits

from fibrous.errors import FibrousError

# The whole config, as JSON. Not a param: a result would be made anew for every change that does not concern it.
STUDY_CONFIG = "FIBROUS_STUDY_CONFIG"
PR_SET_PDEATHSIG = 1  # linux/prctl.h
THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def main(arguments: list[str] | None = None) -> int:
    """Run one stage. Returns the exit code: 0, or 1 after one line on stderr that says what is wrong and what to do."""
    end_with_run()
    # Batches are the unit of parallel work: more threads than one a job would only fight for the same cores.
    os.environ.update(dict.fromkeys(THREAD_VARIABLES, "1"))
    # A job writes files that nobody else knows and asks for a lock itself where it reads; some file systems have none.
    os.environ["HDF5_USE_FILE_LOCKING"] = "FALSE"
    parser = argparse.ArgumentParser(prog="python -m fibrous.study.job", description=__doc__.splitlines()[0])
    parser.add_argument("--params", required=True, type=json.loads, help="stage, config and code hash, as JSON")
    parser.add_argument("--input", nargs="+", action="append", default=[], metavar=("NAME", "FILE"))
    parser.add_argument("--output", nargs=2, action="append", default=[], metavar=("NAME", "FILE"))
    parser.add_argument("--threads", type=int, default=1, help="for stages that use more than one")
    parser.add_argument("--terminal", type=int, help="file descriptor on which long stages say how far they are")
    given = parser.parse_args(arguments)
    # Beside the config: results do not depend on them.
    given.params |= {"threads": given.threads, "terminal": given.terminal}
    if STUDY_CONFIG in os.environ:
        given.params["study_config"] = os.environ[STUDY_CONFIG]
    inputs = {name: [Path(path) for path in paths] for name, *paths in given.input}
    outputs = {name: Path(path) for name, path in given.output}
    try:
        stage = importlib.import_module(given.params["stage"])
        with threadpool_limits(limits=1):
            stage.run(inputs, outputs, given.params)
    except FibrousError as error:
        return _say(str(error))
    except MemoryError:
        return _say("out of memory: run fewer jobs at once (snakemake -j1) or use more batches")
    except OSError as error:
        if error.errno is None:
            raise
        where = f"{error.filename}: " if error.filename else ""
        return _say(f"{where}{error.strerror}; free space or mend the permission, then run again")
    return 0


def end_with_run() -> None:
    """Let Ctrl-C end this process at once, and ask Linux to kill it when the Snakemake that started it dies.

    A job that outlives its run would go on writing while the next run already works on the same files.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


def _say(line: str) -> int:
    print(" ".join(line.split()), file=sys.stderr)
    return 1


if __name__ == "__main__":
    sys.exit(main())
