"""Statements of section 2.5 and Table 2 about time; ours is that of the machine that ran the study."""

from __future__ import annotations

from dataclasses import dataclass

from fibrous.audit.finding import Finding, Statement, Thresholds, Verdict, judged, percent, say


@dataclass(frozen=True)
class Costs:
    """CPU-hours of a study, and what the finite element runs consist of.

    initial, refit, finite_elements, multiscale : CPU-hours of the tasks of Table 2
    fibers, nodes : medians over the tissue's networks, interior nodes alone
    evaluations, network_evaluations : Gauss points times Newton iterations of a hybrid and of the multiscale run
    hybrid_seconds, network_seconds : CPU seconds of these runs
    network_share : share of the multiscale run spent in networks
    origin : where the specimen comes from
    """

    initial: float
    refit: float
    finite_elements: float
    multiscale: float
    fibers: float
    nodes: float
    evaluations: int
    network_evaluations: int
    hybrid_seconds: float
    network_seconds: float
    network_share: float
    origin: str

    @property
    def hybrid(self) -> float:
        """CPU-hours of the hybrid method."""
        return self.initial + self.refit + self.finite_elements


def time(statement: Statement, hours: float, origin: str, thresholds: Thresholds) -> Finding:
    """One line of Table 2; `origin` says where the specimen comes from."""
    (printed,) = statement.value
    ratio = printed / hours
    factor = max(ratio, 1.0 / ratio)
    if factor <= thresholds.same_time:
        verdict = Verdict.REPRODUCED
    else:
        verdict = Verdict.PARTLY if factor <= thresholds.order_of_time else Verdict.NOT
    return Finding(
        say(hours, unit="CPU-hours"),
        verdict,
        f"Here it takes {say(factor)} times {'less' if ratio > 1 else 'more'}, on another machine and for other "
        f"elements. Specimen: {origin}.",
    )


def total(statement: Statement, costs: Costs, thresholds: Thresholds) -> Finding:
    """Both totals, whose ratio is the gain of the hybrid method."""
    printed = statement.value[0] / statement.value[1]
    found = costs.multiscale / costs.hybrid
    parts = [found > 1.0, found >= printed / thresholds.order_of_time]
    return Finding(
        say(costs.multiscale, costs.hybrid, unit="CPU-hours"),
        judged(parts),
        f"The multiscale run costs {say(found)} times the hybrid method, where the paper has {say(printed)}: networks "
        "in compiled code, with their consistent tangent and states that are followed from step to step, are no "
        f"longer what is expensive. Specimen: {costs.origin}.",
    )


def per_gauss_point(costs: Costs) -> Finding:
    """Whether a Gauss point gets cheaper, and by Q + R/2 at the least."""
    wanted = costs.fibers + 0.5 * costs.nodes
    networks = costs.network_share * costs.network_seconds / costs.network_evaluations
    law = costs.hybrid_seconds / costs.evaluations
    return Finding(
        f"{say(networks / law)} times, where Q + R/2 = {wanted:.0f}",
        judged([networks > law, networks / law >= wanted]),
        f"A network costs {say(1e6 * networks)} µs an evaluation ({percent(costs.network_share)} of the multiscale "
        f"run), the whole hybrid run {say(1e6 * law)} µs: what a law costs is the finite elements around it, which "
        f"the count of operations leaves out. Specimen: {costs.origin}.",
    )
