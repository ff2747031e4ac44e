# Sections 2.3, 2.4, 3.1 and 3.2: curves of every network, HGO constants fitted to them, and the surface over alignment.


rule curves:
    input:
        stages.files_of_target("curves", config),
    message:
        "All curves of the study, and the list of states that found no equilibrium"


rule fits:
    input:
        stages.files_of_target("fits", config),
    message:
        "All fits of the study, and the list of states that found no equilibrium"


rule deform_networks:
    input:
        unpack(inputs("curves")),
    output:
        **outputs("curves"),
    log:
        "logs/curves/{ensemble}/{protocol}/{batch}.log",
    threads: 1
    resources:
        mem_mb=1500,
        config=CONFIG,
    params:
        job=job("curves"),
    message:
        "Deforming batch {wildcards.batch} of the {wildcards.ensemble} networks by the loads of protocol {wildcards.protocol}"
    shell:
        JOB


rule record_states:
    input:
        unpack(inputs("states")),
    output:
        **outputs("states"),
    log:
        "logs/states/{ensemble}/{network}_{protocol}.log",
    threads: 1
    resources:
        mem_mb=1500,
        config=CONFIG,
    params:
        job=job("states"),
    message:
        "Recording every deformed state of network {wildcards.network} under protocol {wildcards.protocol}"
    shell:
        JOB


rule fit_networks:
    input:
        unpack(inputs("fits")),
    output:
        **outputs("fits"),
    log:
        "logs/fits/{ensemble}/{protocol}.log",
    threads: 1
    resources:
        mem_mb=1500,
        config=CONFIG,
    params:
        job=job("fits"),
    message:
        "Fitting Eq. 2 to the curves of the {wildcards.ensemble} networks under protocol {wildcards.protocol}"
    shell:
        JOB


rule list_unconverged_states:
    input:
        unpack(inputs("convergence")),
    output:
        **outputs("convergence"),
    log:
        "logs/convergence.log",
    threads: 1
    resources:
        mem_mb=1000,
        config=CONFIG,
    params:
        job=job("convergence"),
    message:
        "Listing the states that found no equilibrium"
    shell:
        JOB
