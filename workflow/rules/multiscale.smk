# Sections 2.7 and 3.4: every run of the tissue judged against the one with a network at every Gauss point.


if stages.STAGES["comparison"].instances(config):

    rule comparison:
        input:
            unpack(inputs("comparison")),
        output:
            **outputs("comparison"),
        log:
            "logs/tissue/comparison.log",
        threads: 1
        resources:
            mem_mb=4000,
            config=CONFIG,
        params:
            job=job("comparison"),
        message:
            "Comparing every run of the tissue with the one with networks"
        shell:
            JOB

    rule figure_comparison:
        input:
            unpack(inputs("figure_comparison")),
        output:
            **outputs("figure_comparison"),
        log:
            "logs/figures/comparison.log",
        threads: 1
        resources:
            mem_mb=1000,
            config=CONFIG,
        params:
            job=job("figure_comparison"),
        message:
            "Drawing the errors of every run, and how they grow"
        shell:
            JOB


if stages.STAGES["table_2"].instances(config):

    rule table_2:
        input:
            unpack(inputs("table_2")),
        output:
            **outputs("table_2"),
        log:
            "logs/table_2.log",
        threads: 1
        resources:
            mem_mb=1000,
            config=CONFIG,
        params:
            job=job("table_2"),
        message:
            "Summing up CPU-hours beside Table 2"
        shell:
            JOB

    rule figure_9:
        input:
            unpack(inputs("figure_9")),
        output:
            **outputs("figure_9"),
        log:
            "logs/figures/figure_9.log",
        threads: 1
        resources:
            mem_mb=4000,
            config=CONFIG,
        params:
            job=job("figure_9"),
        message:
            "Drawing Figure 9: maximum shear of the run with networks and of the hybrid method"
        shell:
            JOB


rule claims:
    input:
        unpack(inputs("claims")),
    output:
        **outputs("claims"),
    log:
        "logs/claims.log",
    threads: 1
    resources:
        mem_mb=2000,
        config=CONFIG,
    params:
        job=job("claims"),
    message:
        "Judging every statement of the paper"
    shell:
        JOB


rule follow_network:
    input:
        unpack(inputs("microstructure")),
    output:
        **outputs("microstructure"),
    log:
        "logs/states/tissue/{run}_{element}.log",
    threads: 1
    resources:
        mem_mb=2500,
        config=CONFIG,
    params:
        job=job("microstructure"),
    message:
        "Following the network of element {wildcards.element} through run {wildcards.run}"
    shell:
        JOB


rule figure_microstructure:
    input:
        unpack(inputs("figure_microstructure")),
    output:
        **outputs("figure_microstructure"),
    log:
        "logs/figures/microstructure.log",
    threads: 1
    resources:
        mem_mb=1500,
        config=CONFIG,
    params:
        job=job("figure_microstructure"),
    message:
        "Drawing networks inside elements of the tissue"
    shell:
        JOB


rule microstructure:
    input:
        stages.files("microstructure", "states", config),
        [stages.files("figure_microstructure", name, config) for name in ("png", "svg", "data")],
    message:
        "Networks inside elements of the tissue"
