"""What the report tells, in order: sections with their figures and tables.

The statements that belong to each say so in config/paper.yaml (`under`).

The rules ask here, too, under which heading Snakemake's own report lists a figure.
"""

from __future__ import annotations

from dataclasses import dataclass

from fibrous_study.audit.verdict import Verdict


@dataclass(frozen=True)
class Exhibit:
    """A figure or a table of the report.

    stage : that draws the figure, or nothing; table : name of a view in fibrous_study.report.tables, or nothing
    title
    """

    title: str
    stage: str = ""
    table: str = ""

    @property
    def name(self) -> str:
        """By which statements say that they belong to it."""
        return self.stage or self.table


@dataclass(frozen=True)
class Section:
    """A heading, a few sentences, and the exhibits below them."""

    title: str
    text: str
    exhibits: tuple[Exhibit, ...]


SECTIONS = (
    Section(
        "The method in pictures",
        "The tissue's collagen is a random network of fibres whose nodes find their own equilibrium. The hybrid method "
        "of the paper loads each network in a few ways, keeps only the curve of its energy against an averaged "
        "stretch, and fits to it the two constants of a continuum law that finite elements can run. With the "
        "deformation that they find, the constants are fitted once more. The yardstick is the coupled simulation, with "
        "a network in equilibrium at every Gauss point. Figure 1 of the paper shows experiments and has no counterpart "
        "here.",
        (
            Exhibit("Figure 2. From fibres to two constants", "figure_2"),
            Exhibit("Figure 4. The hybrid method, and the stages of this study", "figure_4"),
        ),
    ),
    Section(
        "One network under many loads",
        "Sections 2.3 and 3.1 of the paper: a network of H = (0.69, 0.21, 0.10) under loads that end at the same "
        "averaged stretch. The paper names two sets of five loads, with xz-shear (section 3.1) and with yz-shear "
        "(section 2.3); here six loads are run and both sets are fitted.",
        (
            Exhibit(
                "Figure 3. The network deformed, and how its fibres turn",
                "figure_3",
            ),
            Exhibit(
                "Figure 5. Energy against averaged stretch, with the fits",
                "figure_5",
            ),
        ),
    ),
    Section(
        "Constants over alignment",
        "Sections 2.4 and 3.2: 750 networks over the admissible alignments, the same loads, two constants each, and a "
        "surface over (H11, H22) through them (Eq. 11).",
        (
            Exhibit(
                "Figure 6. Five networks, their curves, and the constants over alignment",
                "figure_6",
            ),
            Exhibit(
                "Table 1. Coefficients of Eq. 11, ours and the paper's",
                table="table_1",
            ),
            Exhibit(
                "What both surfaces give where the networks are",
                table="surface_over_triangle",
            ),
            Exhibit(
                "Figure 7. The three-fibre example, computed",
                "figure_7",
            ),
        ),
    ),
    Section(
        "A deformation that was not fitted",
        "Sections 2.6 and 3.3: constants from five loads are tried on the deformation gradient of Eq. 9, then fitted "
        "to it. The paper fits Eq. 2 and runs Eq. 10C, another law; here both are run with both kinds of constants.",
        (
            Exhibit(
                "Figure 8. Stress of the network and of the laws fitted to it",
                "figure_8",
            ),
            Exhibit("Errors of the laws under Eq. 9", table="section_2_6_errors"),
        ),
    ),
    Section(
        "The tissue",
        "Sections 2.7 and 3.4: finite elements with a network for every element. The paper's mesh and motion are not "
        "public: figures and tables say what stands in for them.",
        (
            Exhibit(
                "The specimen, its constants and its motion",
                "figure_specimen",
            ),
            Exhibit(
                "Figure 9. Maximum shear of the coupled simulation and of the hybrid method",
                "figure_9",
            ),
            Exhibit("Errors of every law against the coupled simulation", "figure_comparison"),
            Exhibit("The same as a table", table="comparison"),
        ),
    ),
    Section(
        "What it costs",
        "Table 2 of the paper counts CPU-hours on a supercomputer; ours are those that every process of this run "
        "counted of itself.",
        (
            Exhibit(
                "Table 2. CPU-hours",
                table="table_2",
            ),
            Exhibit("Where the time of the coupled simulation goes", table="table_2_parts"),
        ),
    ),
)


# What a verdict means.
MEANINGS = {
    Verdict.REPRODUCED: "every part of the statement holds here, for most networks where it is about networks",
    Verdict.PARTLY: "some of its parts, load sets or ranges hold, or a time is of the same order",
    Verdict.NOT: "no part of it holds here",
    Verdict.CONTRADICTED: "another passage, equation or number of the paper says or implies something else",
    Verdict.UNKNOWN: "only the authors' own specimen could tell; what ours gives stands beside it",
}
# Words that figures and tables use.
WORDS = {
    "W": "strain energy density of the fibres (MPa).",
    "λ_f": "averaged fibre stretch √(H:C) of Eq. 2, H the structure tensor, C the right Cauchy–Green tensor.",
    "Load set": "five loads fitted together: section 3.1's have xz-shear (the default), section 2.3's yz-shear.",
    "Coupled or multiscale": "the finite element run with a network in equilibrium at every Gauss point.",
    "Hybrid": "the paper's method, with constants fitted to networks: Eq. 2 fitted, Eq. 10C run (called hgo in files).",
    "Initial, refit": "constants from the load set, and from the deformation that the initial run found.",
    "Replicates": "further random networks of one H. The network shown is none of them and may lie outside.",
}
# Targets of the workflow: section of the paper, and what each makes.
TARGETS = {
    "networks": (
        "2.3, 2.4",
        "750 Delaunay networks over the admissible alignments, six named ones, eight replicates of each",
    ),
    "curves": ("2.3, 3.1", "strain energy against averaged stretch: six loads, two ranges, 20 steps"),
    "fits": ("2.3, 2.5", "(C2, C3) of Eq. 2 a network, for both load sets and for every load alone"),
    "table_1": ("3.2", "the surface of Eq. 11 beside Table 1, and what both do over the triangle of alignments"),
    "figure_2": ("2.2", "the way from fibres to two constants, in pictures"),
    "figure_3": ("3.1", "the case-study network deformed, and its realignment"),
    "figure_4": ("2.5", "the hybrid method followed through one element, and the stages of this study"),
    "figure_5": ("3.1", "its curves with the fit, at 112 % and 10 % Green strain"),
    "figure_6": ("3.2", "five networks with their curves; contours of data and surface"),
    "figure_7": ("3.2", "the three-fibre example, computed"),
    "case_study": ("2.6, 3.3", "the laws tried on Eq. 9: stresses and errors as tables"),
    "figure_8": (
        "2.6, 3.3",
        "stresses under Eq. 9: network, laws fitted to it before and after the refit, its fibres alone",
    ),
    "specimen": ("2.7", "the tissue: mesh, fibres, entheses and their motion"),
    "tissue": ("2.5, 2.7", "finite element runs for every law, refits, a table of all; for ParaView and FEBio, too"),
    "figure_specimen": ("2.7", "the specimen with its constants, at rest and deformed"),
    "comparison": ("3.4", "errors of every run against the one with a network at every Gauss point"),
    "figure_comparison": ("3.4", "the same as a picture, and how errors grow with the load"),
    "figure_9": ("3.4", "maximum shear stress and strain of multiscale, initial and refit, with the error maps"),
    "table_2": ("3.4", "CPU-hours of every stage beside the paper's, and where those of the multiscale run go"),
    "claims": ("all", "every checkable statement of the paper: what came out here, verdict and reason"),
    "all": ("all", "all of this, and the report"),
}


def exhibits() -> tuple[Exhibit, ...]:
    """All figures and tables in their order."""
    return tuple(exhibit for section in SECTIONS for exhibit in section.exhibits)
