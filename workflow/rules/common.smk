# What the rules share: the checked config, the command of a job, and what only a function can say of files and params.

import fcntl
import os
import re
import sys
from pathlib import Path

import yaml

from fibrous.errors import FibrousError
from fibrous_study import batches, plan, variants
from fibrous_study.config import PROJECT, loaded, validated
from fibrous_study.job import FOLDER, hand_over
from fibrous_study.paper import paper, section
from fibrous_study.provenance import code_hash, commit, config_hash
from fibrous_study.report.outline import TARGETS, figures, in_snakemake
from fibrous_study.report.tables import VIEWS
from fibrous_study.steps import convergence

try:
    config = validated(config)
    # Recorded in every result, and no param of a rule: a change reruns what depends on it and nothing else.
    os.environ.update(STUDY_CONFIG=hand_over(config))
except FibrousError as error:
    # A WorkflowError would wrap the line in file names and line numbers.
    sys.exit(str(error))

# A bare `python` may be another one or none. The rules `exec` it, so that a job is Snakemake's own child and dies with it.
os.environ.update(PYTHON=sys.executable)
JOB = (
    'exec "$PYTHON" -m fibrous_study.job {params.job:q} --config "$STUDY_CONFIG"'
    " --threads {threads} --terminal 3 3>&2 > {log:q} 2>&1"
)

ROLES, RUNS = config["roles"], plan.runs(config)
RANGES = [ROLES["large"], ROLES["small"]]
ALIGNMENTS = {key: config["delaunay"][key] for key in ("H11", "smallest_H")}
# What Snakemake's own report says of the figure that each rule draws, and of tables.
SHOWN = in_snakemake(FOLDER / "captions")
STUDY = []  # every file of the whole study in the order in which it is made; each rule adds its own
REPORT = []  # files that tell of all of these


wildcard_constraints:
    ensemble="|".join(plan.ensembles(config)),
    batch="[0-9]+",
    run="|".join(run.name for run in RUNS),
    element="[0-9]+",
    variant="|".join(map(re.escape, variants.variants(config))),


# Jobs -----------------------------------------------------------------------------------------------------------------


def job(name, config_of=lambda wildcards: {}):
    """Params of the rule of that name.

    `job` is the path of a file with the job's part of the config, the hash of its code, and its files by name. Snakemake
    does not compare params that are made of files: it runs a job again where `made_with` is another.
    """
    step = f"fibrous_study.{'figures' if name.startswith('figure_') else 'steps'}.{name}"

    def made_with(wildcards):
        return {"stage": step, "config": config_of(wildcards), "code_hash": code_hash(step)}

    def path_of_job(wildcards, input, output):
        inputs = {key: [files] if isinstance(files, str) else list(files) for key, files in input.items()}
        return hand_over({**made_with(wildcards), "inputs": inputs, "outputs": dict(output.items())})

    return {"job": path_of_job, "made_with": lambda wildcards: config_hash(made_with(wildcards))}


def part(*keys, of=config):
    return {key: of[key] for key in keys}


def only(runs):
    """What the wildcard `run` may be in a rule; a pattern that nothing matches where there is no such run."""
    return "|".join(run.name for run in runs) or "(?!)"


def drawn(path):
    """A figure that Snakemake's own report shows, under the report's heading; of vectors, as it crops large images."""
    name = f"figure_{Path(path).stem.removeprefix('figure_')}"
    return report(path, **SHOWN[name]) if name in SHOWN else path


def figure_of(name):
    """The drawing that the rule called `name` writes."""
    return workflow.get_rule(name).output.svg


# Networks -------------------------------------------------------------------------------------------------------------


def networks_of(ensemble):
    return expand("results/networks/{ensemble}/{batch}.nc", ensemble=ensemble, batch=plan.batches(config, ensemble))


def curves_of(ensemble, protocol):
    files = "results/curves/{ensemble}/{protocol}/{batch}.nc"
    return expand(files, ensemble=ensemble, protocol=protocol, batch=plan.batches(config, ensemble))


def numbers_of(wildcards):
    """Numbers of the networks of a batch, in their whole ensemble."""
    every = plan.network_numbers(config, wildcards.ensemble)
    return [every[i] for i in batches.share(len(every), plan.parts(config, wildcards.ensemble), int(wildcards.batch))]


def source_of_networks(wildcards):
    """What a batch of networks is made from: the specimen, a user's files, or nothing."""
    match wildcards.ensemble:
        case "tissue":
            return "results/tissue/specimen.nc"
        case "file":
            entries = [config["network_files"][number] for number in numbers_of(wildcards)]
            return [entry[key] for entry in entries for key in ("nodes", "fibers", "file") if key in entry]
    return []


def part_of_networks(wildcards):
    """Network k of an ensemble depends on k, and not on how many there are."""
    ensemble = wildcards.ensemble
    if ensemble == "tissue":
        # How many networks there are is only known to who reads the specimen.
        share = {"batch": int(wildcards.batch), "batches": plan.parts(config, ensemble)}
        return {"ensemble": ensemble, **share, **part("seed", "network", "fiber", "cube")}
    numbers = numbers_of(wildcards)
    found = {"ensemble": ensemble, "numbers": numbers, **part("network", "fiber")}
    match ensemble:
        case "file":
            cube = part("edge_length_um", of=config["cube"])
            return {**found, "cube": cube, "network_files": [config["network_files"][number] for number in numbers]}
        case "named":
            found["named"] = config["named"]
        case "replicates":
            found["replicated"] = [config["named"][batches.replicated(number)] for number in numbers]
        case "delaunay":
            found["delaunay"] = ALIGNMENTS
    return {**found, **part("seed", "cube")}


def part_of_load(wildcards):
    protocol = plan.protocol(config, wildcards.protocol)
    return {"protocol": protocol, **part("principal_stretch_limit", "equilibrium")}


def part_of_fits(wildcards):
    """Load sets that the protocol holds, and the forms of the law that are fitted to each."""
    ensemble, protocol = wildcards.ensemble, wildcards.protocol
    if protocol.startswith(plan.REFIT):
        run = plan.run_called(config, protocol.removeprefix(plan.REFIT))
        load_sets, forms = [], [plan.form_of(run.model)]
    else:
        loads = plan.loads(plan.protocol(config, protocol))
        load_sets = [load_set for load_set in config["load_sets"] if set(load_set["loads"]) <= loads]
        # The tissue, and the case study that tries its models on one network, need more than Eq. 2.
        tried = ensemble == "named" and protocol in (ROLES["case_study"], ROLES["path"])
        forms = plan.forms(config) if ensemble == "tissue" or tried else [plan.EQ_2]
    # The fit of Eq. 2 is the same with and without the switch.
    others = any(form["energy"] != plan.EQ_2["energy"] for form in forms)
    tension_only = config["tissue"]["tension_only"] if others else True
    return {
        "protocol": protocol,
        "load_sets": load_sets,
        "forms": forms,
        "tension_only": tension_only,
        **part("fit"),
    }


# Tissue ---------------------------------------------------------------------------------------------------------------


def fits_of_run(wildcards):
    """The table of constants that a run reads: fitted before all runs, or to the deformation that another one found."""
    run = plan.run_called(config, wildcards.run)
    protocol = f"{plan.REFIT}{run.source}" if run.refits and not run.lagged else config["tissue"]["protocol"]
    return f"results/fits/tissue/{protocol}.csv" if run.constants == "fit" else []


def surface_of_run(wildcards):
    return "results/tables/surface.nc" if plan.run_called(config, wildcards.run).constants == "surface" else []


def networks_of_run(wildcards):
    """The fibres of each element, where the law is made of them."""
    return networks_of("tissue") if plan.run_called(config, wildcards.run).law.has_networks else []


def part_of_run(wildcards):
    run, tissue = plan.run_called(config, wildcards.run), config["tissue"]
    found = {"run": run.name, "model": run.model, "refits": run.refits, **part("matrix")}
    keys = ["linear_solver"]
    if run.law.has_constants:
        keys.append("tension_only")
    if run.constants == "surface" or (run.constants == "fit" and (run.lagged or not run.refits)):
        keys.append("load_set")
    if run.constants == "surface":
        keys.append("surface_protocol")
    return {**found, **part(*keys, of=tissue)}


def part_of_all_runs():
    return {
        "runs": [{"name": run.name, "source": run.source, "refits": run.refits, "model": run.model} for run in RUNS]
    }


# The end and the beginning of a run -----------------------------------------------------------------------------------


def end_of_run():
    try:
        return convergence.report([path for path in map(Path, CURVES) if path.is_file()])
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
