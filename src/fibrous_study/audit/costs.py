"""Statements of section 2.5 and Table 2 about time; ours is that of the machine that ran the study."""

from __future__ import annotations

from dataclasses import dataclass

from fibrous_study.audit.finding import Finding, Statement, Thresholds, Verdict, counted, judged, number, percent, say

NETWORKS = 900  # of Table 2
POINTS = 8  # Gauss points of a hexahedron, each with a network of its own in the multiscale run


@dataclass(frozen=True)
class Costs:
    """CPU time of a study, and what it was spent on.

    initial, refit, finite_elements, multiscale : CPU-hours of the tasks of Table 2
    networks : elements of the tissue, each with one network
    loads, steps : of the load set whose constants are fitted first, per network; load_steps : of the tissue
    runs : finite element runs of the hybrid method
    fibers, nodes : medians over the tissue's networks, interior nodes alone
    evaluations, network_evaluations : Gauss points times Newton iterations of a hybrid and of the multiscale run
    law_seconds, networks_seconds : CPU seconds that these spent in the fibre law and in networks
    hybrid_seconds, multiscale_seconds : CPU seconds of these runs as a whole
    origin : where the specimen comes from
    """

    initial: float
    refit: float
    finite_elements: float
    multiscale: float
    networks: int
    loads: int
    steps: int
    load_steps: int
    runs: int
    fibers: float
    nodes: float
    evaluations: int
    network_evaluations: int
    law_seconds: float
    networks_seconds: float
    hybrid_seconds: float
    multiscale_seconds: float
    origin: str

    @property
    def hybrid(self) -> float:
        """CPU-hours of the hybrid method."""
        return self.initial + self.refit + self.finite_elements

    @property
    def initial_words(self) -> str:
        """What `initial` counts."""
        return f"{counted(self.networks, 'network')} under {self.loads} loads of {self.steps} steps, fit of one law"

    @property
    def refit_words(self) -> str:
        """What `refit` counts."""
        return (
            f"{counted(self.networks, 'network')} along their elements' deformation in {self.load_steps} steps, with "
            "the fit of one law"
        )

    @property
    def finite_element_words(self) -> str:
        """What `finite_elements` counts."""
        return f"{counted(self.runs, 'run')}, initial and refitted, of {counted(self.networks, 'element')}"

    @property
    def multiscale_words(self) -> str:
        """What `multiscale` counts."""
        return f"one run of {counted(self.networks, 'element')} with {POINTS} networks each, in {self.load_steps} steps"


def time(statement: Statement, hours: float, words: str, costs: Costs, thresholds: Thresholds) -> Finding:
    """One line of Table 2, `hours`, which counts what `words` say; judged as if there were the paper's networks."""
    (printed,) = statement.value
    as_many = hours * NETWORKS / costs.networks
    ratio = printed / as_many
    factor = max(ratio, 1.0 / ratio)
    if factor <= thresholds.same_time:
        verdict = Verdict.REPRODUCED
    else:
        verdict = Verdict.PARTLY if factor <= thresholds.order_of_time else Verdict.NOT
    scaled = (
        f", scaled from {number(costs.networks)} to the paper's {NETWORKS} networks,"
        if costs.networks != NETWORKS
        else ""
    )
    return Finding(
        f"{say(hours, unit='CPU-hours')} for {words}",
        verdict,
        f"On our machine and with our program this{scaled} is {number(factor)} times "
        f"{'faster' if ratio > 1 else 'slower'} than printed. Specimen: {costs.origin}.",
    )


def total(statement: Statement, costs: Costs, thresholds: Thresholds) -> Finding:
    """Both totals, whose ratio is the gain of the hybrid method."""
    printed = statement.value[0] / statement.value[1]
    found = costs.multiscale / costs.hybrid
    parts = [found > 1.0, found >= printed / thresholds.order_of_time]
    share = (costs.initial + costs.refit) / costs.hybrid
    own_states = costs.networks * (costs.loads * costs.steps + costs.load_steps)
    coupled_states = costs.networks * POINTS * costs.load_steps
    own, coupled = 3600.0 * (costs.initial + costs.refit) / own_states, costs.multiscale_seconds / coupled_states
    return Finding(
        f"{say(costs.multiscale)} against {say(costs.hybrid, unit='CPU-hours')}",
        judged(parts),
        f"The multiscale run takes {number(found)} times the hybrid method, where the paper has {number(printed)}; "
        f"networks and their fits are {percent(share)} of the hybrid's cost. One engine solves all networks: with "
        f"the fits the hybrid's {number(own_states, 4)} states cost {number(1e3 * own)} ms each, and with tangents and "
        f"finite elements the {number(coupled_states, 4)} of the multiscale run {number(1e3 * coupled)} ms; specimen: "
        f"{costs.origin}, {counted(costs.networks, 'element')}.",
    )


def per_gauss_point(costs: Costs) -> Finding:
    """Whether a Gauss point gets cheaper, and by Q + R/2 at the least: stress and tangent alone, then whole runs."""
    wanted = costs.fibers + 0.5 * costs.nodes
    network, law = costs.networks_seconds / costs.network_evaluations, costs.law_seconds / costs.evaluations
    runs = (costs.multiscale_seconds / costs.network_evaluations) / (costs.hybrid_seconds / costs.evaluations)
    return Finding(
        f"a network costs {number(network / law)} times the law an evaluation, a whole run {number(runs)} times; Q + "
        f"R/2 = {number(wanted, 4)}",
        judged([network > law, network / law >= wanted]),
        f"Stress and tangent of a network in equilibrium take {number(1e6 * network)} µs, those of Eq. 10C "
        f"{number(1e6 * law)} µs: {number(network / law)} times as much for {number(costs.fibers)} fibres and "
        f"{number(costs.nodes)} interior nodes. Whole runs, with finite elements, start-up and files, differ by "
        f"{number(runs)} times an evaluation; specimen: {costs.origin}, {counted(costs.networks, 'element')}.",
    )
