# Sections 2.5 to 2.7: finite elements with constants from networks, refits to the deformation found, the case study.


rule specimen:
    input:
        unpack(inputs("specimen")),
    output:
        **outputs("specimen"),
    log:
        "logs/tissue/specimen.log",
    threads: 1
    resources:
        mem_mb=1000,
        config=CONFIG,
    params:
        job=job("specimen"),
    message:
        "Making the specimen: mesh, fibers, and the motion of its entheses"
    shell:
        JOB


rule tissue:
    input:
        stages.files_of_target("tissue", config),
    message:
        "All finite element runs of the tissue"


for number in plan.refit_sources(config):

    rule:
        name:
            f"deform_networks_as_in_tissue_{number}"
        input:
            unpack(inputs("refit_curves", round=number)),
        output:
            **stages.STAGES["refit_curves"].files(config, {"round": number, "batch": "{batch}"}),
        log:
            f"logs/curves/tissue/refit_{number}_{{batch}}.log",
        threads: 1
        resources:
            mem_mb=1500,
            config=CONFIG,
        params:
            job=job("refit_curves", round=number),
        message:
            "Deforming batch {wildcards.batch} of the tissue's networks as their elements are in the runs to be refitted"
        shell:
            JOB


rule refit_networks:
    input:
        unpack(inputs("refits")),
    output:
        **outputs("refits"),
    log:
        "logs/fits/tissue/refit_{run}.log",
    threads: 1
    resources:
        mem_mb=1500,
        config=CONFIG,
    params:
        job=job("refits"),
    message:
        "Fitting the constants anew to the deformation of run {wildcards.run}"
    shell:
        JOB


rule deform_tissue:
    input:
        unpack(inputs("tissue")),
    output:
        **outputs("tissue"),
    log:
        "logs/tissue/{run}.log",
    wildcard_constraints:
        run=only_runs("tissue"),
    threads: 1
    resources:
        mem_mb=2500,
        config=CONFIG,
    params:
        job=job("tissue"),
    message:
        "Deforming the specimen: run {wildcards.run}"
    shell:
        JOB


rule deform_tissue_with_networks:
    input:
        unpack(inputs("multiscale")),
    output:
        **outputs("multiscale"),
    log:
        "logs/tissue/{run}.log",
    wildcard_constraints:
        run=only_runs("multiscale"),
    threads: workflow.resource_settings.cores or 1
    resources:
        mem_mb=6000,
        config=CONFIG,
    params:
        job=job("multiscale"),
    message:
        "Deforming the specimen with a network at every Gauss point: run {wildcards.run}"
    shell:
        LONG_JOB


rule write_febio_model:
    input:
        unpack(inputs("febio")),
    output:
        **outputs("febio"),
    log:
        "logs/tissue/{run}_febio.log",
    threads: 1
    resources:
        mem_mb=1000,
        config=CONFIG,
    params:
        job=job("febio"),
    message:
        "Writing the problem of run {wildcards.run} for FEBio"
    shell:
        JOB


rule tissue_table:
    input:
        unpack(inputs("tissue_table")),
    output:
        **outputs("tissue_table"),
    log:
        "logs/tissue/table.log",
    threads: 1
    resources:
        mem_mb=2500,
        config=CONFIG,
    params:
        job=job("tissue_table"),
    message:
        "Setting the finite element runs side by side"
    shell:
        JOB


rule case_study:
    input:
        unpack(inputs("case_study")),
    output:
        **outputs("case_study"),
    log:
        "logs/case_study.log",
    threads: 1
    resources:
        mem_mb=1000,
        config=CONFIG,
    params:
        job=job("case_study"),
    message:
        "Trying the laws on a deformation that they were not fitted to (section 2.6)"
    shell:
        JOB
