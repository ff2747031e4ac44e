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
    params:
        params("figure_2"),
    message:
        "Drawing Figure 2: from fibers to two constants"
    shell:
        'exec "$PYTHON" -m fibrous.study.job --params {params:q} --input networks {input.networks:q} --input states {input.states:q} --input curves {input.curves:q} --input fits {input.fits:q}'
        " --output png {output.png:q} --output svg {output.svg:q} --output data {output.data:q} > {log:q} 2>&1"


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
        params:
            params("figure_4"),
        message:
            "Drawing Figure 4: the hybrid method, and the stages of the study"
        shell:
            'exec "$PYTHON" -m fibrous.study.job --params {params:q} --input specimen {input.specimen:q} --input networks {input.networks:q} --input curves {input.curves:q} --input fits {input.fits:q}'
            " --input refit_curves {input.refit_curves:q} --input refits {input.refits:q} --input tissue {input.tissue:q}"
            " --output png {output.png:q} --output svg {output.svg:q} --output data {output.data:q} > {log:q} 2>&1"


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
    params:
        params("stage_costs"),
    message:
        "Summing up what every stage and every target costs"
    shell:
        'exec "$PYTHON" -m fibrous.study.job --params {params:q} --input files {input.files:q}'
        " --output stages {output.stages:q} --output targets {output.targets:q} > {log:q} 2>&1"


rule show_table:
    input:
        unpack(inputs("table_page")),
    output:
        **outputs("table_page"),
    log:
        "logs/report/{table}.log",
    threads: 1
    resources:
        mem_mb=1000,
    params:
        params("table_page"),
    message:
        "Writing table {wildcards.table} as a page"
    shell:
        'exec "$PYTHON" -m fibrous.study.job --params {params:q} --input table {input.table:q} --output page {output.page:q} > {log:q} 2>&1'


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
    params:
        params("report"),
    message:
        "Writing the report"
    shell:
        'exec "$PYTHON" -m fibrous.study.job --params {params:q} --input figures {input.figures:q} --input tables {input.tables:q} --output page {output.page:q} > {log:q} 2>&1'
