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
        config=CONFIG,
    params:
        job=job("networks"),
    message:
        "Making batch {wildcards.batch} of the {wildcards.ensemble} networks"
    shell:
        JOB
