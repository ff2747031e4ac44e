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
    params:
        params("surface"),
    message:
        "Fitting the surface of Eq. 11 and setting it beside Table 1"
    shell:
        'exec "$PYTHON" -m fibrous.study.job --params {params:q} --input fits {input.fits:q}'
        " --output surface {output.surface:q} --output table_1 {output.table_1:q}"
        " --output surface_over_triangle {output.surface_over_triangle:q} > {log:q} 2>&1"


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
    params:
        params("figure_3"),
    message:
        "Drawing Figure 3: the case-study network deformed, and its realignment"
    shell:
        'exec "$PYTHON" -m fibrous.study.job --params {params:q} --input states {input.states:q} --input curves {input.curves:q}'
        " --output png {output.png:q} --output svg {output.svg:q}"
        " --output data {output.data:q} > {log:q} 2>&1"


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
    params:
        params("figure_5"),
    message:
        "Drawing Figure 5: curves of the case-study network with their fits"
    shell:
        'exec "$PYTHON" -m fibrous.study.job --params {params:q} --input curves {input.curves:q} --input fits {input.fits:q}'
        " --output png {output.png:q} --output svg {output.svg:q}"
        " --output data {output.data:q} > {log:q} 2>&1"


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
    params:
        params("figure_6"),
    message:
        "Drawing Figure 6: five networks with their curves, and the surface over alignment"
    shell:
        'exec "$PYTHON" -m fibrous.study.job --params {params:q} --input networks {input.networks:q} --input curves {input.curves:q}'
        " --input fits {input.fits:q} --input surface {input.surface:q}"
        " --output png {output.png:q} --output svg {output.svg:q}"
        " --output curves {output.curves:q} --output constants {output.constants:q}"
        " --output surface {output.surface:q} > {log:q} 2>&1"


rule figure_7:
    output:
        **outputs("figure_7"),
    log:
        "logs/figures/figure_7.log",
    threads: 1
    resources:
        mem_mb=1000,
    params:
        params("figure_7"),
    message:
        "Drawing Figure 7: the three-fibre example, computed"
    shell:
        'exec "$PYTHON" -m fibrous.study.job --params {params:q} --output png {output.png:q} --output svg {output.svg:q}'
        " --output data {output.data:q} > {log:q} 2>&1"


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
    params:
        params("figure_8"),
    message:
        "Drawing Figure 8: stresses of the network and of the laws under Eq. 9"
    shell:
        'exec "$PYTHON" -m fibrous.study.job --params {params:q} --input stresses {input.stresses:q}'
        " --output png {output.png:q} --output svg {output.svg:q}"
        " --output data {output.data:q} > {log:q} 2>&1"


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
    params:
        params("figure_specimen"),
    message:
        "Drawing the specimen, its constants and its deformation"
    shell:
        'exec "$PYTHON" -m fibrous.study.job --params {params:q} --input specimen {input.specimen:q} --input tissue {input.tissue:q}'
        " --output png {output.png:q} --output svg {output.svg:q}"
        " --output data {output.data:q} > {log:q} 2>&1"
