# Sections 2.5 to 2.7: finite elements with constants from networks, refits to the deformation found, the coupled run.

COUPLED = [run for run in RUNS if run.law.is_solved]
LAGGED = [run for run in RUNS if run.lagged]
CONTINUUM = [run for run in RUNS if run not in COUPLED + LAGGED]
# FEBio can be given families that carry tension alone, with constants that never change.
IN_FEBIO = [run.name for run in CONTINUUM if run.law.in_febio and config["tissue"]["tension_only"]]
TISSUE = expand("results/tissue/{run}.nc", run=[run.name for run in RUNS])


rule tissue:
    input:
        "results/tissue/specimen.nc",
        TISSUE,
        expand("results/tissue/{run}.vtu", run=[run.name for run in RUNS]),
        expand("results/tissue/{run}.feb", run=IN_FEBIO),
        "results/tables/tissue.csv",
        "results/tables/convergence.csv",
    message:
        "All finite element runs of the tissue"


rule specimen:
    input:
        **config["specimen_files"],
    output:
        specimen="results/tissue/specimen.nc",
    log:
        "logs/specimen.log",
    resources:
        mem_mb=1000,
    params:
        **job(
            "specimen",
            lambda wildcards: (
                part("specimen_files") if plan.own_specimen(config) else part("seed", "synthetic_specimen")
            ),
        ),
    message:
        "Making the specimen: mesh, fibers, and the motion of its entheses"
    shell:
        JOB


rule tissue_run:
    input:
        specimen="results/tissue/specimen.nc",
        fits=fits_of_run,
        surface=surface_of_run,
        networks=networks_of_run,
    output:
        tissue="results/tissue/{run}.nc",
        vtu="results/tissue/{run}.vtu",
    log:
        "logs/tissue_run/{run}.log",
    wildcard_constraints:
        run=only(CONTINUUM),
    resources:
        mem_mb=2500,
    params:
        **job("tissue_run", part_of_run),
    message:
        "Deforming the specimen: run {wildcards.run}"
    shell:
        JOB


# Networks driven as their elements go in all runs of a round, side by side.
for number, found in plan.refit_rounds(config).items():

    rule:
        name:
            "refit_curves" if number == 1 else f"refit_curves_{number}"
        input:
            networks="results/networks/tissue/{batch}.nc",
            specimen="results/tissue/specimen.nc",
            tissue=expand("results/tissue/{run}.nc", run=found),
        output:
            **{run: f"results/curves/tissue/refit_{run}/{{batch}}.nc" for run in found},
        log:
            f"logs/refit_curves/round_{number}_{{batch}}.log",
        resources:
            mem_mb=1500,
        params:
            **job("refit_curves", lambda wildcards, found=found: {"runs": found, **part("equilibrium")}),
        message:
            "Deforming batch {wildcards.batch} of the tissue's networks as their elements are in the runs to be refitted"
        shell:
            JOB


# Fig. 4b: constants refitted at one load step serve the next.
rule tissue_lagged:
    input:
        specimen="results/tissue/specimen.nc",
        fits=fits_of_run,
        networks=networks_of("tissue"),
    output:
        tissue="results/tissue/{run}.nc",
        vtu="results/tissue/{run}.vtu",
    log:
        "logs/tissue_lagged/{run}.log",
    wildcard_constraints:
        run=only(LAGGED),
    resources:
        mem_mb=4000,
    params:
        **job(
            "tissue_lagged",
            lambda wildcards: {
                **part_of_run(wildcards),
                "iterations_of_last_step": config["tissue"]["refit_rounds"],
                **part("fit", "equilibrium"),
            },
        ),
    message:
        "Deforming the specimen, with constants fitted anew at every load step: run {wildcards.run}"
    shell:
        JOB


rule tissue_coupled:
    input:
        specimen="results/tissue/specimen.nc",
        networks=networks_of("tissue"),
    output:
        tissue="results/tissue/{run}.nc",
        vtu="results/tissue/{run}.vtu",
    log:
        "logs/tissue_coupled/{run}.log",
    wildcard_constraints:
        run=only(COUPLED),
    threads: workflow.resource_settings.cores or 1
    resources:
        mem_mb=6000,
    params:
        **job("tissue_coupled", lambda wildcards: {**part_of_run(wildcards), **part("equilibrium")}),
    message:
        "Deforming the specimen with a network at every Gauss point: run {wildcards.run}"
    shell:
        JOB


if IN_FEBIO:

    rule febio:
        input:
            specimen="results/tissue/specimen.nc",
            tissue=expand("results/tissue/{run}.nc", run=IN_FEBIO),
        output:
            **{run: f"results/tissue/{run}.feb" for run in IN_FEBIO},
        log:
            "logs/febio.log",
        resources:
            mem_mb=1000,
        params:
            **job("febio", lambda wildcards: {"runs": IN_FEBIO, **part("matrix")}),
        message:
            "Writing the problems of the runs that FEBio can be given"
        shell:
            JOB


rule tissue_table:
    input:
        tissue=TISSUE,
    output:
        table="results/tables/tissue.csv",
    log:
        "logs/tissue_table.log",
    resources:
        mem_mb=2500,
    params:
        **job("tissue_table", lambda wildcards: part_of_all_runs()),
    message:
        "Setting the finite element runs side by side"
    shell:
        JOB


STUDY += [*rules.tissue.input[:-1], *(path for path in CURVES + FITS if path not in STUDY)]


rule microstructure:
    input:
        expand(
            "results/states/tissue/{run}_{element}.nc",
            run=config["microstructure"]["runs"],
            element=config["microstructure"]["elements"],
        ),
        expand("results/figures/microstructure.{ending}", ending=["png", "svg", "csv"]),
    message:
        "Networks inside elements of the tissue"


rule network_microstructure:
    input:
        networks=networks_of("tissue"),
        specimen="results/tissue/specimen.nc",
        tissue="results/tissue/{run}.nc",
    output:
        states="results/states/tissue/{run}_{element}.nc",
    log:
        "logs/network_microstructure/{run}_{element}.log",
    resources:
        mem_mb=2500,
    params:
        **job(
            "network_microstructure",
            lambda wildcards: {
                "run": wildcards.run,
                "element": int(wildcards.element),
                "model": plan.run_called(config, wildcards.run).model,
                **part("equilibrium"),
            },
        ),
    message:
        "Following the network of element {wildcards.element} through run {wildcards.run}"
    shell:
        JOB
