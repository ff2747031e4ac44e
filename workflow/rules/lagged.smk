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
    params:
        params("lagged"),
    message:
        "Deforming the specimen, with constants fitted anew at every load step: run {wildcards.run}"
    shell:
        'exec "$PYTHON" -m fibrous.study.job --params {params:q} --input specimen {input.specimen:q}'
        " --input fits {input.fits:q} --input networks {input.networks:q}"
        " --output tissue {output.tissue:q} --output vtu {output.vtu:q} > {log:q} 2>&1"
