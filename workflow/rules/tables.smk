# Tables of the paper: the surface of Eq. 11, the laws tried on Eq. 9, the runs of the tissue judged, its statements.

PRINTED = {name: section(name) for name in ("table_1", "alignments")}


rule table_1:
    input:
        fits=expand("results/fits/delaunay/{protocol}.csv", protocol=plan.compared_protocols(config)),
    output:
        surface="results/tables/surface.nc",
        table_1="results/tables/table_1.csv",
        surface_over_triangle="results/tables/surface_over_triangle.csv",
    log:
        "logs/table_1.log",
    resources:
        mem_mb=1000,
    params:
        **job("table_1", lambda wildcards: {"delaunay": ALIGNMENTS, "paper": PRINTED, **part("surface")}),
    message:
        "Fitting the surface of Eq. 11 and setting it beside Table 1"
    shell:
        JOB


if "delaunay" in plan.networks(config):
    STUDY += rules.table_1.output


if plan.tried_models(config):

    rule case_study:
        input:
            networks="results/networks/named/00.nc",
            curves=f"results/curves/named/{ROLES['path']}/00.nc",
            fits=expand("results/fits/named/{protocol}.csv", protocol=[ROLES["case_study"], ROLES["path"]]),
        output:
            stresses="results/tables/section_2_6_stresses.csv",
            errors="results/tables/section_2_6_errors.csv",
        log:
            "logs/case_study.log",
        resources:
            mem_mb=1000,
        params:
            **job(
                "case_study",
                lambda wildcards: {
                    "network": ROLES["case"],
                    "models": plan.tried_models(config),
                    **part("load_set", "tension_only", of=config["tissue"]),
                },
            ),
        message:
            "Trying the laws on a deformation that they were not fitted to (section 2.6)"
        shell:
            JOB


# Sections 2.7 and 3.4: every run of the tissue judged against the one with a network at every Gauss point.
if plan.reference_run(config) and len(RUNS) > 1:

    rule comparison:
        input:
            tissue=TISSUE,
        output:
            comparison="results/tables/comparison.csv",
            steps="results/tables/comparison_steps.csv",
        log:
            "logs/comparison.log",
        resources:
            mem_mb=4000,
        params:
            **job("comparison", lambda wildcards: {"reference": plan.reference_run(config), **part_of_all_runs()}),
        message:
            "Comparing every run of the tissue with the one with networks"
        shell:
            JOB

    STUDY += rules.comparison.output


HYBRID = plan.hybrid_runs(config)

if plan.reference_run(config) and HYBRID:

    rule table_2:
        input:
            networks=networks_of("tissue"),
            initial=[
                *curves_of("tissue", config["tissue"]["protocol"]),
                f"results/fits/tissue/{config['tissue']['protocol']}.csv",
            ],
            # With lagged constants the second run counts its own fits.
            refit=[
                path
                for run in HYBRID
                if run.refits and not run.lagged
                for path in [
                    *curves_of("tissue", f"refit_{run.source}"),
                    f"results/fits/tissue/refit_{run.source}.csv",
                ]
            ],
            hybrid=expand("results/tissue/{run}.nc", run=[run.name for run in HYBRID]),
            multiscale=expand("results/tissue/{run}.nc", run=[run.name for run in COUPLED]),
        output:
            table_2="results/tables/table_2.csv",
            parts="results/tables/table_2_parts.csv",
        log:
            "logs/table_2.log",
        resources:
            mem_mb=1000,
        params:
            **job(
                "table_2",
                lambda wildcards: {
                    "reference": plan.reference_run(config),
                    "model": plan.form_of(HYBRID[0].model),
                    "load_set": config["tissue"]["load_set"],
                    "loads_used": plan.loads_used(config),
                    "paper": section("table_2"),
                },
            ),
        message:
            "Summing up CPU-hours beside Table 2"
        shell:
            JOB

    STUDY += rules.table_2.output


JUDGED_RUNS = expand(
    "results/tissue/{run}.nc", run=[plan.reference_run(config), *(run.name for run in plan.drawn_runs(config))]
)

# Table 2 has a line for every statement about time: lagged refits have none of their own.
if plan.reference_run(config) and HYBRID and not LAGGED:

    rule claims:
        input:
            networks=[*networks_of("named"), *networks_of("replicates")],
            small=[*curves_of("named", ROLES["small"]), *curves_of("replicates", ROLES["small"])],
            large=[*curves_of("named", ROLES["large"]), *curves_of("replicates", ROLES["large"])],
            path=[*curves_of("named", ROLES["path"]), *curves_of("replicates", ROLES["path"])],
            fits_small=expand("results/fits/{of}/{protocol}.csv", of=["named", "replicates"], protocol=ROLES["small"]),
            fits_large=expand("results/fits/{of}/{protocol}.csv", of=["named", "replicates"], protocol=ROLES["large"]),
            fits_initial=expand(
                "results/fits/{of}/{protocol}.csv", of=["named", "replicates"], protocol=ROLES["case_study"]
            ),
            fits_refit=expand("results/fits/{of}/{protocol}.csv", of=["named", "replicates"], protocol=ROLES["path"]),
            ensemble=curves_of("delaunay", ROLES["large"]),
            ensemble_fits_small=f"results/fits/delaunay/{ROLES['small']}.csv",
            ensemble_fits_large=f"results/fits/delaunay/{ROLES['large']}.csv",
            surface="results/tables/surface.nc",
            tissue=JUDGED_RUNS,
            tissue_networks=networks_of("tissue"),
            table_2="results/tables/table_2.csv",
        output:
            claims="results/claims.csv",
        log:
            "logs/claims.log",
        resources:
            mem_mb=2000,
        params:
            **job(
                "claims",
                lambda wildcards: {
                    "paper": paper(),
                    "large": ROLES["large"],
                    "protocol": plan.protocol(config, config["tissue"]["protocol"]),
                    **part("case", "survey", of=ROLES),
                    **part("load_set", "tension_only", of=config["tissue"]),
                    **part("claims", "load_sets", "named", "fit"),
                },
            ),
        message:
            "Judging every statement of the paper"
        shell:
            JOB
