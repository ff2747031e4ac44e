# Sections 2.3 and 3.1: how the constants of Eq. 2 move with what the paper leaves open, one key of the config at a time.


rule try_variant:
    input:
        unpack(inputs("sensitivity")),
    output:
        **outputs("sensitivity"),
    log:
        "logs/sensitivity/{variant}.log",
    threads: 1
    resources:
        mem_mb=1500,
        config=CONFIG,
    params:
        job=job("sensitivity"),
    message:
        "Making, loading and fitting networks for the sensitivities: variant {wildcards.variant}"
    shell:
        JOB


rule tables_of_sensitivity:
    input:
        unpack(inputs("sensitivity_tables")),
    output:
        **outputs("sensitivity_tables"),
    log:
        "logs/sensitivity/tables.log",
    threads: 1
    resources:
        mem_mb=1000,
        config=CONFIG,
    params:
        job=job("sensitivity_tables"),
    message:
        "Summing up how the constants move"
    shell:
        JOB


rule figure_sensitivity:
    input:
        unpack(inputs("figure_sensitivity")),
    output:
        **outputs("figure_sensitivity"),
    log:
        "logs/figures/sensitivity.log",
    threads: 1
    resources:
        mem_mb=1000,
        config=CONFIG,
    params:
        job=job("figure_sensitivity"),
    message:
        "Drawing how the constants move"
    shell:
        JOB


rule sensitivity:
    input:
        stages.files("sensitivity", "trials", config),
        [stages.files("sensitivity_tables", name, config) for name in ("table", "sentences")],
        [stages.files("figure_sensitivity", name, config) for name in ("png", "svg", "data")],
    message:
        "Sensitivities of the constants of Eq. 2"
