# What the rules share: the checked config, the command of a job, and the questions put to fibrous_study.stages.

import fcntl
import os
import re
import sys
from pathlib import Path

from fibrous.errors import FibrousError
from fibrous_study.report.outline import SECTIONS
from fibrous_study import plan, stages, variants
from fibrous_study.config import CAPTIONS, validated
from fibrous_study.steps import convergence
from fibrous_study.job import hand_over

try:
    config = validated(config)
except FibrousError as error:
    # A WorkflowError would wrap the line in file names and line numbers.
    sys.exit(str(error))

# A bare `python` may be another one or none. The rules `exec` it, so that a job is Snakemake's own child and dies with it.
os.environ.update(PYTHON=sys.executable)
JOB = 'exec "$PYTHON" -m fibrous_study.job {params.job:q} --config {resources.config:q} > {log:q} 2>&1'
LONG_JOB = (
    'exec "$PYTHON" -m fibrous_study.job {params.job:q} --config {resources.config:q}'
    " --threads {threads} --terminal 3 3>&2 > {log:q} 2>&1"
)

PARAMS = stages.Params(config)

# Section and title of the figure that each stage draws.
FIGURES = {one.stage: (section.title, one.title) for section in SECTIONS for one in section.exhibits if one.stage}


wildcard_constraints:
    ensemble="|".join(plan.ensembles(config)),
    protocol="|".join(plan.protocols(config)),
    batch="[0-9]+",
    run="|".join(run.name for run in plan.runs(config)),
    element="[0-9]+",
    variant="|".join(map(re.escape, variants.variants(config))),


def only_runs(stage):
    """What the wildcard `run` may be in a stage; a pattern that nothing matches where it has no instance."""
    return "|".join(instance["run"] for instance in stages.STAGES[stage].instances(config)) or "(?!)"


def outputs(stage):
    found = dict(stages.STAGES[stage].outputs)
    # Snakemake's own report crops large images and shows no CSV: it gets vectors, and tables as pages.
    if stage in FIGURES:
        caption = CAPTIONS / f"{stage}.rst"
        found["svg"] = report(
            found["svg"], str(caption), category=FIGURES[stage][0], labels={"figure": FIGURES[stage][1]}
        )
    elif stage == "table_pages":
        caption = CAPTIONS / "table.rst"
        found["page"] = []
        for name, path in stages.STAGES[stage].files(config, {}).items():
            page = report(path, str(caption), category="Tables", labels={"table": name})
            found["page"].append(page)
    return found


def inputs(stage, **fixed):
    return lambda wildcards: stages.STAGES[stage].inputs(config, {**wildcards, **fixed})


def job(stage, **fixed):
    # The file that says what a job has to do. Its name changes with its content, and then Snakemake runs the job.
    return lambda wildcards: hand_over(PARAMS.with_files(stage, {**wildcards, **fixed}))


def end_of_run():
    curves = [Path(path) for path in stages.all_curves(config)]
    try:
        return convergence.report([path for path in curves if path.is_file()])
    except FibrousError as error:
        return [str(error)]


def clear_stale_locks():
    """Delete the locks that a killed run left. The open file is returned because the mark on it must live as long.

    Every living run holds a shared mark, so the exclusive mark is only to be had when no run is alive.
    """
    folder = Path(".snakemake")
    try:
        folder.mkdir(exist_ok=True)
        mark = open(folder / "run.flock", "w")
    except OSError as error:
        sys.exit(
            f"{Path.cwd()}: cannot be written ({error.strerror}); free space, mend the permission or choose --directory"
        )
    try:
        try:
            fcntl.flock(mark, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            pass  # another run is alive: its locks are Snakemake's to judge
        else:
            for lock in folder.glob("locks/*.lock"):
                lock.unlink()
        fcntl.flock(mark, fcntl.LOCK_SH)
    except OSError:
        pass  # a file system without such marks: Snakemake's own message will do
    return mark


RUN_MARK = clear_stale_locks()
# The whole config is recorded in every result. A resource, no param: a change reruns what depends on it and nothing else.
try:
    CONFIG = hand_over(config)
except FibrousError as error:
    sys.exit(str(error))
