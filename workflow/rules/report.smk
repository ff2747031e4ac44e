# What a reader gets: the method in pictures, what every stage cost, every table as a page, and the report.


rule figure_2:
    input:
        unpack(inputs("figure_2")),
    output:
        **outputs("figure_2"),
    log:
        "logs/figures/figure_2.log",
    threads: 1
    resources:
        mem_mb=1500,
        config=CONFIG,
    params:
        job=job("figure_2"),
    message:
        "Drawing Figure 2: from fibers to two constants"
    shell:
        JOB


if stages.STAGES["figure_4"].instances(config):

    rule figure_4:
        input:
            unpack(inputs("figure_4")),
        output:
            **outputs("figure_4"),
        log:
            "logs/figures/figure_4.log",
        threads: 1
        resources:
            mem_mb=3000,
            config=CONFIG,
        params:
            job=job("figure_4"),
        message:
            "Drawing Figure 4: the hybrid method, and the stages of the study"
        shell:
            JOB


rule sum_up_costs:
    input:
        unpack(inputs("stage_costs")),
    output:
        **outputs("stage_costs"),
    log:
        "logs/stage_costs.log",
    threads: 1
    resources:
        mem_mb=1000,
        config=CONFIG,
    params:
        job=job("stage_costs"),
    message:
        "Summing up what every stage and every target costs"
    shell:
        JOB


rule show_tables:
    input:
        unpack(inputs("table_pages")),
    output:
        **outputs("table_pages"),
    log:
        "logs/report_tables.log",
    threads: 1
    resources:
        mem_mb=1000,
        config=CONFIG,
    params:
        job=job("table_pages"),
    message:
        "Writing every table as a page"
    shell:
        JOB


rule report:
    input:
        unpack(inputs("report")),
    output:
        **outputs("report"),
    log:
        "logs/report.log",
    threads: 1
    resources:
        mem_mb=1000,
        config=CONFIG,
    params:
        job=job("report"),
    message:
        "Writing the report"
    shell:
        JOB
