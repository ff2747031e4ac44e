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
        params:
            params("comparison"),
        message:
            "Comparing every run of the tissue with the one with networks"
        shell:
            'exec "$PYTHON" -m fibrous.study.job --params {params:q} --input tissue {input.tissue:q}'
            " --output comparison {output.comparison:q} --output steps {output.steps:q} > {log:q} 2>&1"

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
        params:
            params("figure_comparison"),
        message:
            "Drawing the errors of every run, and how they grow"
        shell:
            'exec "$PYTHON" -m fibrous.study.job --params {params:q} --input comparison {input.comparison:q} --input steps {input.steps:q}'
            " --output png {output.png:q} --output svg {output.svg:q} --output data {output.data:q} > {log:q} 2>&1"


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
        params:
            params("table_2"),
        message:
            "Summing up CPU-hours beside Table 2"
        shell:
            'exec "$PYTHON" -m fibrous.study.job --params {params:q} --input networks {input.networks:q} --input initial {input.initial:q} --input refit {input.refit:q} --input hybrid {input.hybrid:q} --input multiscale {input.multiscale:q}'
            " --output table_2 {output.table_2:q} --output parts {output.parts:q} > {log:q} 2>&1"

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
        params:
            params("figure_9"),
        message:
            "Drawing Figure 9: maximum shear of the run with networks and of the hybrid method"
        shell:
            'exec "$PYTHON" -m fibrous.study.job --params {params:q} --input specimen {input.specimen:q} --input tissue {input.tissue:q}'
            " --output png {output.png:q} --output svg {output.svg:q} --output data {output.data:q} > {log:q} 2>&1"


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
    params:
        params("claims"),
    message:
        "Judging every statement of the paper"
    shell:
        'exec "$PYTHON" -m fibrous.study.job --params {params:q} --input networks {input.networks:q} --input small {input.small:q} --input large {input.large:q} --input path {input.path:q}'
        " --input fits_small {input.fits_small:q} --input fits_large {input.fits_large:q} --input fits_initial {input.fits_initial:q} --input fits_refit {input.fits_refit:q}"
        " --input ensemble {input.ensemble:q} --input ensemble_fits_small {input.ensemble_fits_small:q} --input ensemble_fits_large {input.ensemble_fits_large:q}"
        " --input surface {input.surface:q} --input tissue {input.tissue:q} --input tissue_networks {input.tissue_networks:q} --input table_2 {input.table_2:q}"
        " --output claims {output.claims:q} > {log:q} 2>&1"


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
    params:
        params("microstructure"),
    message:
        "Following the network of element {wildcards.element} through run {wildcards.run}"
    shell:
        'exec "$PYTHON" -m fibrous.study.job --params {params:q} --input networks {input.networks:q} --input specimen {input.specimen:q} --input tissue {input.tissue:q}'
        " --output states {output.states:q} > {log:q} 2>&1"


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
    params:
        params("figure_microstructure"),
    message:
        "Drawing networks inside elements of the tissue"
    shell:
        'exec "$PYTHON" -m fibrous.study.job --params {params:q} --input states {input.states:q}'
        " --output png {output.png:q} --output svg {output.svg:q} --output data {output.data:q} > {log:q} 2>&1"


rule microstructure:
    input:
        stages.files("microstructure", "states", config),
        [stages.files("figure_microstructure", name, config) for name in ("png", "svg", "data")],
    message:
        "Networks inside elements of the tissue"
