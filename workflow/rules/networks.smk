# Sections 2.3, 2.4, 3.1: random networks, in batches that run side by side, their curves, and constants fitted to them.

NETWORKS = [path for ensemble in plan.networks(config) for path in networks_of(ensemble)]
INITIAL_CURVES = [path for ensemble, protocol in plan.loaded(config) for path in curves_of(ensemble, protocol)]
INITIAL_FITS = [f"results/fits/{ensemble}/{protocol}.csv" for ensemble, protocol in plan.loaded(config)]
REFITTED = [run.source for run in plan.refitted(config)]
CURVES = INITIAL_CURVES + [path for run in REFITTED for path in curves_of("tissue", f"refit_{run}")]
FITS = INITIAL_FITS + expand("results/fits/tissue/refit_{run}.csv", run=REFITTED)
STUDY += NETWORKS + INITIAL_CURVES + INITIAL_FITS


rule networks:
    input:
        NETWORKS,
    message:
        "All networks of the study"


rule curves:
    input:
        CURVES,
        "results/tables/convergence.csv",
    message:
        "All curves of the study, and the list of states that found no equilibrium"


rule fits:
    input:
        FITS,
        "results/tables/convergence.csv",
    message:
        "All fits of the study, and the list of states that found no equilibrium"


rule network_ensemble:
    input:
        files=source_of_networks,
    output:
        networks="results/networks/{ensemble}/{batch}.nc",
    log:
        "logs/network_ensemble/{ensemble}/{batch}.log",
    resources:
        mem_mb=1000,
    params:
        **job("network_ensemble", part_of_networks),
    message:
        "Making batch {wildcards.batch} of the {wildcards.ensemble} networks"
    shell:
        JOB


rule network_curves:
    input:
        networks="results/networks/{ensemble}/{batch}.nc",
    output:
        curves="results/curves/{ensemble}/{protocol}/{batch}.nc",
    log:
        "logs/network_curves/{ensemble}/{protocol}/{batch}.log",
    wildcard_constraints:
        protocol="|".join(plan.protocols(config)),
    resources:
        mem_mb=1500,
    params:
        **job("network_curves", part_of_load),
    message:
        "Deforming batch {wildcards.batch} of the {wildcards.ensemble} networks by the loads of protocol {wildcards.protocol}"
    shell:
        JOB


rule network_states:
    input:
        networks="results/networks/named/00.nc",
    output:
        **{protocol: f"results/states/named/{ROLES['case']}_{protocol}.nc" for protocol in RANGES},
    log:
        "logs/network_states.log",
    resources:
        mem_mb=1500,
    params:
        **job(
            "network_states",
            lambda wildcards: {
                "network": ROLES["case"],
                "protocols": [plan.protocol(config, protocol) for protocol in RANGES],
                **part("principal_stretch_limit", "equilibrium"),
            },
        ),
    message:
        "Recording every deformed state of the case-study network"
    shell:
        JOB


rule hgo_fits:
    input:
        curves=lambda wildcards: curves_of(wildcards.ensemble, wildcards.protocol),
    output:
        fits="results/fits/{ensemble}/{protocol}.csv",
    log:
        "logs/hgo_fits/{ensemble}/{protocol}.log",
    wildcard_constraints:
        protocol="|".join([*plan.protocols(config), *(f"refit_{run}" for run in REFITTED)]),
    resources:
        mem_mb=1500,
    params:
        **job("hgo_fits", part_of_fits),
    message:
        "Fitting constants to the curves of the {wildcards.ensemble} networks under protocol {wildcards.protocol}"
    shell:
        JOB


rule convergence:
    input:
        curves=CURVES,
    output:
        convergence="results/tables/convergence.csv",
    log:
        "logs/convergence.log",
    resources:
        mem_mb=1000,
    params:
        **job("convergence"),
    message:
        "Listing the states that found no equilibrium"
    shell:
        JOB


STUDY += rules.convergence.output
