# Table 1 and the figures of the paper; they draw its own networks, so a study of a user's networks has none of them.


rule table_1:
    input:
        unpack(inputs("surface")),
    output:
        **outputs("surface"),
    log:
        "logs/surface.log",
    threads: 1
    resources:
        mem_mb=1000,
        config=CONFIG,
    params:
        job=job("surface"),
    message:
        "Fitting the surface of Eq. 11 and setting it beside Table 1"
    shell:
        JOB


rule figure_3:
    input:
        unpack(inputs("figure_3")),
    output:
        **outputs("figure_3"),
    log:
        "logs/figures/figure_3.log",
    threads: 1
    resources:
        mem_mb=1500,
        config=CONFIG,
    params:
        job=job("figure_3"),
    message:
        "Drawing Figure 3: the case-study network deformed, and its realignment"
    shell:
        JOB


rule figure_5:
    input:
        unpack(inputs("figure_5")),
    output:
        **outputs("figure_5"),
    log:
        "logs/figures/figure_5.log",
    threads: 1
    resources:
        mem_mb=1000,
        config=CONFIG,
    params:
        job=job("figure_5"),
    message:
        "Drawing Figure 5: curves of the case-study network with their fits"
    shell:
        JOB


rule figure_6:
    input:
        unpack(inputs("figure_6")),
    output:
        **outputs("figure_6"),
    log:
        "logs/figures/figure_6.log",
    threads: 1
    resources:
        mem_mb=1500,
        config=CONFIG,
    params:
        job=job("figure_6"),
    message:
        "Drawing Figure 6: five networks with their curves, and the surface over alignment"
    shell:
        JOB


rule figure_7:
    output:
        **outputs("figure_7"),
    log:
        "logs/figures/figure_7.log",
    threads: 1
    resources:
        mem_mb=1000,
        config=CONFIG,
    params:
        job=job("figure_7"),
    message:
        "Drawing Figure 7: the three-fibre example, computed"
    shell:
        JOB


rule figure_8:
    input:
        unpack(inputs("figure_8")),
    output:
        **outputs("figure_8"),
    log:
        "logs/figures/figure_8.log",
    threads: 1
    resources:
        mem_mb=1000,
        config=CONFIG,
    params:
        job=job("figure_8"),
    message:
        "Drawing Figure 8: stresses of the network and of the laws under Eq. 9"
    shell:
        JOB


rule figure_specimen:
    input:
        unpack(inputs("figure_specimen")),
    output:
        **outputs("figure_specimen"),
    log:
        "logs/figures/specimen.log",
    threads: 1
    resources:
        mem_mb=1500,
        config=CONFIG,
    params:
        job=job("figure_specimen"),
    message:
        "Drawing the specimen, its constants and its deformation"
    shell:
        JOB
