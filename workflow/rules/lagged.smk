# Fig. 4b: constants refitted at one load step serve the next.


rule deform_tissue_with_lagged_constants:
    input:
        unpack(inputs("lagged")),
    output:
        **outputs("lagged"),
    log:
        "logs/tissue/{run}.log",
    wildcard_constraints:
        run=only_runs("lagged"),
    threads: 1
    resources:
        mem_mb=4000,
        config=CONFIG,
    params:
        job=job("lagged"),
    message:
        "Deforming the specimen, with constants fitted anew at every load step: run {wildcards.run}"
    shell:
        JOB
