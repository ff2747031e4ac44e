"""Statements of section 2.5 and Table 2 about time; ours is that of the machine that ran the study."""

from __future__ import annotations

from collections.abc import Mapping

from fibrous_study.audit.evidence import Evidence
from fibrous_study.audit.verdict import Finding, Verdict, judged, judges, numbers

POINTS = 8  # Gauss points of a hexahedron, each with a network of its own in the multiscale run


@judges("time-ensemble", task="initial")
@judges("time-refit", task="refit")
@judges("time-fe", task="finite_elements")
@judges("time-multiscale", task="multiscale")
def time(evidence: Evidence, printed: Mapping[str, float], task: str) -> Finding:
    """CPU-hours of a task of Table 2; judged as if there were the paper's networks."""
    costs, thresholds, networks = evidence.costs, evidence.thresholds, evidence.paper["table_2"]["networks"]
    hours = getattr(costs, task)
    ratio = printed["cpu_hours"] / (hours * networks / costs.networks)
    factor = max(ratio, 1.0 / ratio)
    found = numbers(unit="CPU-hour", cpu_hours=hours, printed=printed)
    found += numbers(factor=factor, faster=ratio > 1.0, networks_printed=networks)
    if factor <= thresholds.same_time:
        return Finding(Verdict.REPRODUCED, [*found, *costs.size()])
    return Finding(Verdict.PARTLY if factor <= thresholds.order_of_time else Verdict.NOT, [*found, *costs.size()])


@judges("time-total")
def total(evidence: Evidence, printed: Mapping[str, float]) -> Finding:
    """Both totals, whose ratio is the gain of the hybrid method."""
    costs = evidence.costs
    wanted, ratio = printed["multiscale"] / printed["hybrid"], costs.multiscale / costs.hybrid
    of_networks = costs.initial + costs.refit
    states = costs.networks * (costs.loads * costs.steps + costs.load_steps)
    coupled_states = costs.networks * POINTS * costs.load_steps
    return Finding(
        judged([ratio > 1.0, ratio >= wanted / evidence.thresholds.order_of_time]),
        [
            *numbers(unit="CPU-hour", multiscale=costs.multiscale, hybrid=costs.hybrid, printed=printed),
            *numbers(times_hybrid=ratio, printed={"times_hybrid": wanted}),
            *numbers(networks_of_hybrid=of_networks / costs.hybrid, states=states, coupled_states=coupled_states),
            *numbers(unit="ms", state=3.6e6 * of_networks / states),
            *numbers(unit="ms", coupled_state=1e3 * costs.multiscale_seconds / coupled_states),
            *costs.size(),
        ],
    )


@judges("cost-estimate")
def per_gauss_point(evidence: Evidence, _: Mapping[str, float]) -> Finding:
    """Whether a Gauss point gets cheaper, and by Q + R/2 at the least: stress and tangent alone, then whole runs."""
    costs = evidence.costs
    wanted = costs.fibers + 0.5 * costs.nodes
    network, law = costs.networks_seconds / costs.network_evaluations, costs.law_seconds / costs.evaluations
    runs = (costs.multiscale_seconds / costs.network_evaluations) / (costs.hybrid_seconds / costs.evaluations)
    return Finding(
        judged([network > law, network / law >= wanted]),
        [
            *numbers(times_law=network / law, times_run=runs, printed={"times_law": wanted}),
            *numbers(fibers=costs.fibers, nodes=costs.nodes),
            *numbers(unit="µs", network=1e6 * network, law=1e6 * law),
            *costs.size(),
        ],
    )
