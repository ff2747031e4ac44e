# Figures of the paper, and of the study beside it. Those of its own networks are left out with a tissue of one's own.


rule figure_2:
    input:
        networks="results/networks/named/00.nc",
        states=f"results/states/named/{ROLES['case']}_{ROLES['large']}.nc",
        curves=f"results/curves/named/{ROLES['large']}/00.nc",
        fits=f"results/fits/named/{ROLES['large']}.csv",
    output:
        png="results/figures/figure_2.png",
        svg=drawn("results/figures/figure_2.svg"),
        data="results/figures/figure_2.csv",
    log:
        "logs/figure_2.log",
    resources:
        mem_mb=1500,
    params:
        **job(
            "figure_2",
            lambda wildcards: {
                "network": ROLES["case"],
                "load_set": config["load_sets"][0],
                "jobs": {"networks": len(NETWORKS), "curves": len(INITIAL_CURVES), "fits": len(INITIAL_FITS)},
            },
        ),
    message:
        "Drawing Figure 2: from fibers to two constants"
    shell:
        JOB


rule figure_3:
    input:
        states=expand("results/states/named/{network}_{protocol}.nc", network=ROLES["case"], protocol=RANGES),
        curves=expand("results/curves/named/{protocol}/00.nc", protocol=RANGES),
    output:
        png="results/figures/figure_3.png",
        svg=drawn("results/figures/figure_3.svg"),
        data="results/figures/figure_3.csv",
    log:
        "logs/figure_3.log",
    resources:
        mem_mb=1500,
    params:
        **job("figure_3", lambda wildcards: {"network": ROLES["case"], "protocols": RANGES}),
    message:
        "Drawing Figure 3: the case-study network deformed, and its realignment"
    shell:
        JOB


rule figure_5:
    input:
        curves=expand("results/curves/named/{protocol}/00.nc", protocol=RANGES),
        fits=expand("results/fits/named/{protocol}.csv", protocol=RANGES),
    output:
        png="results/figures/figure_5.png",
        svg=drawn("results/figures/figure_5.svg"),
        data="results/figures/figure_5.csv",
    log:
        "logs/figure_5.log",
    resources:
        mem_mb=1000,
    params:
        **job("figure_5", lambda wildcards: {"network": ROLES["case"], "protocols": RANGES, **part("load_sets")}),
    message:
        "Drawing Figure 5: curves of the case-study network with their fits"
    shell:
        JOB


rule figure_6:
    input:
        networks="results/networks/named/00.nc",
        curves=f"results/curves/named/{ROLES['large']}/00.nc",
        fits=expand("results/fits/{ensemble}/{protocol}.csv", ensemble=["named", "delaunay"], protocol=ROLES["large"]),
        surface="results/tables/surface.nc",
    output:
        png="results/figures/figure_6.png",
        svg=drawn("results/figures/figure_6.svg"),
        curves="results/figures/figure_6_curves.csv",
        constants="results/figures/figure_6_constants.csv",
        surface="results/figures/figure_6_surface.csv",
    log:
        "logs/figure_6.log",
    resources:
        mem_mb=1500,
    params:
        **job(
            "figure_6",
            lambda wildcards: {"networks": ROLES["survey"], "protocol": ROLES["large"], **part("load_sets")},
        ),
    message:
        "Drawing Figure 6: five networks with their curves, and the surface over alignment"
    shell:
        JOB


rule figure_7:
    output:
        png="results/figures/figure_7.png",
        svg=drawn("results/figures/figure_7.svg"),
        data="results/figures/figure_7.csv",
    log:
        "logs/figure_7.log",
    resources:
        mem_mb=1000,
    params:
        **job("figure_7", lambda wildcards: {"paper": section("figure_7")}),
    message:
        "Drawing Figure 7: the three-fibre example, computed"
    shell:
        JOB


if plan.tried_models(config):

    rule figure_8:
        input:
            stresses="results/tables/section_2_6_stresses.csv",
        output:
            png="results/figures/figure_8.png",
            svg=drawn("results/figures/figure_8.svg"),
            data="results/figures/figure_8.csv",
        log:
            "logs/figure_8.log",
        resources:
            mem_mb=1000,
        params:
            **job("figure_8"),
        message:
            "Drawing Figure 8: stresses of the network and of the laws under Eq. 9"
        shell:
            JOB


rule figure_specimen:
    input:
        specimen="results/tissue/specimen.nc",
        tissue=expand("results/tissue/{run}.nc", run=[run.name for run in plan.drawn_runs(config)]),
    output:
        png="results/figures/specimen.png",
        svg=drawn("results/figures/specimen.svg"),
        data="results/figures/specimen.csv",
    log:
        "logs/figure_specimen.log",
    resources:
        mem_mb=1500,
    params:
        **job("figure_specimen"),
    message:
        "Drawing the specimen, its constants and its deformation"
    shell:
        JOB


STUDY += rules.figure_specimen.output


if plan.reference_run(config) and len(RUNS) > 1:

    rule figure_comparison:
        input:
            comparison="results/tables/comparison.csv",
            steps="results/tables/comparison_steps.csv",
        output:
            png="results/figures/comparison.png",
            svg=drawn("results/figures/comparison.svg"),
            data="results/figures/comparison.csv",
        log:
            "logs/figure_comparison.log",
        resources:
            mem_mb=1000,
        params:
            **job("figure_comparison"),
        message:
            "Drawing the errors of every run, and how they grow"
        shell:
            JOB

    STUDY += rules.figure_comparison.output


if plan.reference_run(config) and HYBRID:

    rule figure_9:
        input:
            specimen="results/tissue/specimen.nc",
            tissue=JUDGED_RUNS,
        output:
            png="results/figures/figure_9.png",
            svg=drawn("results/figures/figure_9.svg"),
            data="results/figures/figure_9.csv",
        log:
            "logs/figure_9.log",
        resources:
            mem_mb=4000,
        params:
            **job("figure_9"),
        message:
            "Drawing Figure 9: maximum shear of the run with networks and of the hybrid method"
        shell:
            JOB

    STUDY += rules.figure_9.output


rule figure_microstructure:
    input:
        states=expand(
            "results/states/tissue/{run}_{element}.nc",
            run=config["microstructure"]["runs"],
            element=config["microstructure"]["elements"],
        ),
    output:
        png="results/figures/microstructure.png",
        svg=drawn("results/figures/microstructure.svg"),
        data="results/figures/microstructure.csv",
    log:
        "logs/figure_microstructure.log",
    resources:
        mem_mb=1500,
    params:
        **job("figure_microstructure"),
    message:
        "Drawing networks inside elements of the tissue"
    shell:
        JOB


# What tells of the paper's networks; with a tissue of one's own it is made where it is asked for.
PAPER = [*rules.figure_3.input.states]
for name in ("case_study", "claims", "figure_2", "figure_3", "figure_5", "figure_6", "figure_7", "figure_8"):
    PAPER += workflow.get_rule(name).output if workflow.is_rule(name) else []
STUDY += [] if plan.own_specimen(config) else PAPER


rule paper:
    input:
        PAPER,
        rules.table_1.output,
    message:
        "Tables and figures of the paper's networks"
