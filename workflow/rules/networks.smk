# Section 2.3: random networks, in batches that run side by side.


rule networks:
    input:
        stages.files_of_target("networks", config),
    message:
        "All networks of the study"


rule make_networks:
    input:
        unpack(inputs("networks")),
    output:
        **outputs("networks"),
    log:
        "logs/networks/{ensemble}/{batch}.log",
    threads: 1
    resources:
        mem_mb=1000,
    params:
        params("networks"),
    message:
        "Making batch {wildcards.batch} of the {wildcards.ensemble} networks"
    shell:
        'exec "$PYTHON" -m fibrous.study.job --params {params:q} --input files {input.files:q}'
        " --output networks {output.networks:q} > {log:q} 2>&1"
