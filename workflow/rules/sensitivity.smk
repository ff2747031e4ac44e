# Sections 2.3 and 3.1: how the constants of Eq. 2 move with what the paper leaves open, one key of the config at a time.

TRIALS = expand("results/sensitivity/{variant}.csv", variant=variants.variants(config))


rule sensitivity:
    input:
        TRIALS,
        "results/tables/sensitivity.csv",
        "results/tables/sensitivity_sentences.csv",
        expand("results/figures/sensitivity.{ending}", ending=["png", "svg", "csv"]),
    message:
        "Sensitivities of the constants of Eq. 2"


rule sensitivity_trial:
    output:
        trials="results/sensitivity/{variant}.csv",
    log:
        "logs/sensitivity_trial/{variant}.log",
    resources:
        mem_mb=1500,
    params:
        **job("sensitivity_trial", lambda wildcards: variants.trial(config, wildcards.variant)),
    message:
        "Making, loading and fitting networks for the sensitivities: variant {wildcards.variant}"
    shell:
        JOB


rule sensitivity_tables:
    input:
        trials=TRIALS,
    output:
        table="results/tables/sensitivity.csv",
        sentences="results/tables/sensitivity_sentences.csv",
    log:
        "logs/sensitivity_tables.log",
    resources:
        mem_mb=1000,
    params:
        **job("sensitivity_tables", lambda wildcards: {"factors": variants.own_values(config), **part("load_sets")}),
    message:
        "Summing up how the constants move"
    shell:
        JOB


rule figure_sensitivity:
    input:
        trials=TRIALS,
    output:
        png="results/figures/sensitivity.png",
        svg=drawn("results/figures/sensitivity.svg"),
        data="results/figures/sensitivity.csv",
    log:
        "logs/figure_sensitivity.log",
    resources:
        mem_mb=1000,
    params:
        **job("figure_sensitivity", lambda wildcards: {"factors": variants.own_values(config), **part("load_sets")}),
    message:
        "Drawing how the constants move"
    shell:
        JOB
