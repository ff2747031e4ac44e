"""One job of the study: ``python -m fibrous_study.job JOB --config CONFIG``.

The process that a rule starts. Files tell it what to do, since a command of Linux ends at 128 KiB, which the names of a
few hundred files fill. It hands files and params to the step's `run`, records of each file that was written where it
comes from, and turns a user's mistake into one line.
"""

from __future__ import annotations

import argparse
import ctypes
import gc
import hashlib
import importlib
import json
import os
import signal
import sys
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from threadpoolctl import threadpool_limits

from fibrous.errors import DatasetError, FibrousError
from fibrous_study import provenance

FOLDER = Path(".snakemake") / "fibrous"
PR_SET_PDEATHSIG = 1  # linux/prctl.h
THREAD_VARIABLES = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")


def hand_over(content: Mapping[str, Any]) -> str:
    """Write what a job reads as JSON into FOLDER, and return the path; the file's name is a hash of the content.

    Equal content has one path, which therefore tells Snakemake whether a job has changed, and no run overwrites what
    another one reads. A job's content holds its params, and its files by name as `inputs` and `outputs`.
    Raises DatasetError where the file cannot be written.
    """
    text = json.dumps(content, sort_keys=True)
    path = FOLDER / f"{hashlib.sha256(text.encode()).hexdigest()[:32]}.json"
    with suppress(OSError):
        if path.read_text(encoding="utf-8") == text:
            return str(path)
    beside = path.with_suffix(f".{os.getpid()}")
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        beside.write_text(text, encoding="utf-8")
        beside.replace(path)
    except OSError as error:
        raise DatasetError(f"{path}: cannot be written ({error.strerror}); free space or mend the permission") from None
    return str(path)


def main(arguments: list[str] | None = None) -> int:
    """Run one step. Returns the exit code: 0, or 1 after one line on stderr that says what is wrong and what to do."""
    end_with_run()
    # Batches are the unit of parallel work: more than one thread per job would only fight for the same cores.
    os.environ.update(dict.fromkeys(THREAD_VARIABLES, "1"))
    # A job writes files that nobody else knows and asks for a lock itself where it reads; some file systems have none.
    os.environ["HDF5_USE_FILE_LOCKING"] = "FALSE"
    parser = argparse.ArgumentParser(prog="python -m fibrous_study.job", description=__doc__.splitlines()[0])
    parser.add_argument("job", type=Path, help="file with the step, its config and code hash, and its files by name")
    parser.add_argument("--config", type=Path, required=True, help="file with the whole config, for the record")
    parser.add_argument("--threads", type=int, default=1, help="for steps that use more than one")
    parser.add_argument("--terminal", type=int, help="file descriptor on which long steps say how far they are")
    given = parser.parse_args(arguments)
    try:
        _run(given)
    except FibrousError as error:
        return _fail(str(error))
    except MemoryError:
        return _fail("out of memory: run fewer jobs at once (snakemake -j1) or use more batches")
    except OSError as error:
        if error.errno is None:
            raise
        where = f"{error.filename}: " if error.filename else ""
        return _fail(f"{where}{error.strerror}; free space or mend the permission, then run again")
    return 0


def _run(given: argparse.Namespace) -> None:
    params = json.loads(given.job.read_text(encoding="utf-8"))
    inputs = {name: [Path(path) for path in paths] for name, paths in params.pop("inputs").items()}
    outputs = {name: Path(path) for name, path in params.pop("outputs").items()}
    # The whole config is recorded, no param: a result would be made anew for every change that does not concern it.
    params["study_config"] = given.config.read_text(encoding="utf-8")
    step = _imported(params["stage"])
    read = {str(path): provenance.digest(path) for paths in inputs.values() for path in paths if path.is_file()}
    with threadpool_limits(limits=1):
        # Results do not depend on threads and terminal.
        step.run(inputs, outputs, {**params, "threads": given.threads, "terminal": given.terminal})
    for path in outputs.values():
        provenance.record(path, params, read, given.job.stem)


def _imported(module: str) -> Any:
    """The module, without the collector of garbage, which finds none and takes a tenth of the time of importing."""
    gc.disable()
    try:
        return importlib.import_module(module)
    finally:
        gc.enable()


def end_with_run() -> None:
    """Let Ctrl-C end this process at once, and ask Linux to kill it when the Snakemake that started it dies.

    A job that outlives its run would go on writing while the next run already works on the same files.
    """
    signal.signal(signal.SIGINT, signal.SIG_DFL)
    if sys.platform == "linux":
        ctypes.CDLL(None).prctl(PR_SET_PDEATHSIG, signal.SIGKILL)


def _fail(line: str) -> int:
    print(" ".join(line.split()), file=sys.stderr)
    return 1


if __name__ == "__main__":
    sys.exit(main())
