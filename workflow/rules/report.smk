# What a reader gets: what every stage cost, the method in pictures, every table as a page, and the report.


GATHERED = {
    "networks": ["network_ensemble"],
    "curves": ["network_curves", "refit_curves", "convergence"],
    "fits": ["hgo_fits", "convergence"],
    "tissue": ["specimen", "tissue_run", "tissue_lagged", "tissue_coupled", "febio", "tissue_table", "convergence"],
}


rule stage_costs:
    input:
        files=STUDY,
    output:
        stages="results/tables/stages.csv",
        targets="results/tables/targets.csv",
    log:
        "logs/stage_costs.log",
    resources:
        mem_mb=1000,
    params:
        **job(
            "stage_costs",
            lambda wildcards: {"targets": {target: GATHERED.get(target, [target]) for target in TARGETS}},
        ),
    message:
        "Summing up what every stage and every target costs"
    shell:
        JOB


REPORT += rules.stage_costs.output


if HYBRID and not LAGGED:

    rule figure_4:
        input:
            specimen="results/tissue/specimen.nc",
            networks=networks_of("tissue"),
            curves=curves_of("tissue", config["tissue"]["protocol"]),
            fits=f"results/fits/tissue/{config['tissue']['protocol']}.csv",
            refit_curves=curves_of("tissue", f"refit_{HYBRID[-1].source}"),
            refits=f"results/fits/tissue/refit_{HYBRID[-1].source}.csv",
            tissue=expand("results/tissue/{run}.nc", run=[HYBRID[0].name, HYBRID[-1].name]),
            stages="results/tables/stages.csv",
        output:
            png="results/figures/figure_4.png",
            svg=drawn("results/figures/figure_4.svg"),
            data="results/figures/figure_4.csv",
        log:
            "logs/figure_4.log",
        resources:
            mem_mb=3000,
        params:
            **job(
                "figure_4",
                lambda wildcards: {
                    "load_set": next(
                        entry for entry in config["load_sets"] if entry["name"] == config["tissue"]["load_set"]
                    )
                },
            ),
        message:
            "Drawing Figure 4: the hybrid method, and the stages of the study"
        shell:
            JOB

    REPORT += rules.figure_4.output


TABLES = {name: view.path for name, view in VIEWS.items() if view.path in STUDY + REPORT}
PAGES = {name: f"results/report/{name}.html" for name in TABLES}
DRAWN = [name for name in figures() if workflow.is_rule(name) and figure_of(name) in STUDY + REPORT]


rule table_pages:
    input:
        tables=list(TABLES.values()),
    output:
        **{name: report(path, labels={"table": name}, **SHOWN["table"]) for name, path in PAGES.items()},
    log:
        "logs/table_pages.log",
    resources:
        mem_mb=1000,
    params:
        **job("table_pages", lambda wildcards: {"tables": list(TABLES)}),
    message:
        "Writing every table as a page"
    shell:
        JOB


# What is made on demand is no part of what the report tells.
TOLD = {key: value for key, value in config.items() if key not in ("microstructure", "sensitivity")}


rule report:
    input:
        figures=[figure_of(name) for name in DRAWN],
        tables=list(TABLES.values()),
    output:
        page="results/report.html",
    log:
        "logs/report.log",
    resources:
        mem_mb=1000,
    params:
        **job(
            "report",
            lambda wildcards: {
                "figures": DRAWN,
                "tables": list(TABLES),
                "paper": {name: section(name) for name in ("statements", "contradictions")},
                "other_than_default": [key for key, value in loaded().items() if TOLD.get(key, value) != value],
                "seed": config["seed"],
                "commit": commit(PROJECT),
                # As text, since JSON with sorted keys would lose the order of a mapping.
                "study": yaml.safe_dump(TOLD, sort_keys=False, allow_unicode=True, width=110),
            },
        ),
    message:
        "Writing the report"
    shell:
        JOB


REPORT += [*PAGES.values(), *rules.report.output]
