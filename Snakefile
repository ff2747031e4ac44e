# The study of one paper, from random fibres to tissue. `snakemake -j2` runs all of it, `snakemake -j2 figure_3` what one
# figure needs; other targets: networks, curves, fits, table_1, specimen, tissue, case_study, figure_2, figure_4 to figure_9,
# figure_specimen, comparison, figure_comparison, table_2, claims, report, microstructure, sensitivity.

from snakemake.utils import min_version

min_version("9.19")


configfile: f"{workflow.basedir}/config/config.yaml"


# The platform of the lock; ignored unless Snakemake is told to use containers.
container: "docker://python:3.11-slim"


include: "workflow/rules/common.smk"
include: "workflow/rules/networks.smk"


if not plan.own_networks(config):

    include: "workflow/rules/tissue.smk"
    include: "workflow/rules/tables.smk"
    include: "workflow/rules/figures.smk"
    include: "workflow/rules/sensitivity.smk"
    include: "workflow/rules/report.smk"


rule all:
    default_target: True
    input:
        STUDY,
        REPORT,
    message:
        "All networks, curves, fits, tables and figures of the study"


onsuccess:
    print("\n".join(end_of_run()))
