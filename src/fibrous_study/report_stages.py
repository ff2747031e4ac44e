"""Stages that tell the study: the method in pictures, what every stage cost, tables as pages, the report."""

from __future__ import annotations

import subprocess
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import yaml

from fibrous_study import plan
from fibrous_study.config import PROJECT, TEMPLATES, caption, loaded
from fibrous_study.jobs import jobs
from fibrous_study.network_stages import SPECIMEN, contents, curves_of, figure, once
from fibrous_study.paper import section
from fibrous_study.plan import FIGURE_NETWORK, FIGURE_PROTOCOLS, REFIT, Config, Stage
from fibrous_study.report.outline import TARGETS, exhibits
from fibrous_study.report.tables import VIEWS
from fibrous_study.tissue_stages import TISSUE, networks_of_elements

# Of the checkout; any other commit would make the report again and change nothing in it.
SOURCES = ("Snakefile", "config", "src", "workflow")
COSTS, TARGET_COSTS = "results/tables/stages.csv", "results/tables/targets.csv"
# Targets that gather the files of several stages, or of one with another name; any other is the stage of its name.
GATHERING = {
    "curves": ("curves", "refit_curves", "convergence"),
    "fits": ("fits", "refits", "convergence"),
    "table_1": ("surface",),
    "tissue": ("specimen", "tissue", "lagged", "multiscale", "febio", "tissue_table", "convergence"),
}


def report_stages(stages: Mapping[str, Stage]) -> dict[str, Stage]:
    """The stages of this module, which tell a study of these other stages."""
    figures = {
        "figure_2": figure(
            "figure_2",
            {"data": ".csv"},
            inputs=lambda _: {
                "networks": ["results/networks/named/00.nc"],
                "states": [f"results/states/named/{FIGURE_NETWORK}_{FIGURE_PROTOCOLS[0]}.nc"],
                "curves": [f"results/curves/named/{FIGURE_PROTOCOLS[0]}/00.nc"],
                "fits": [f"results/fits/named/{FIGURE_PROTOCOLS[0]}.csv"],
            },
            config=lambda config: {
                "network": FIGURE_NETWORK,
                "load_set": config["load_sets"][0],
                "jobs": {name: len(stages[name].instances(config)) for name in ("networks", "curves", "fits")},
            },
        ),
        "figure_4": figure(
            "figure_4",
            {"data": ".csv"},
            inputs=_figure_4_inputs,
            config=lambda config: {
                "load_set": next(one for one in config["load_sets"] if one["name"] == config["tissue"]["load_set"]),
                "stages": flow(stages, config),
            },
            instances=_refitted_between_runs,
        ),
    }
    told = {**stages, **figures}
    return {
        **figures,
        "stage_costs": Stage(
            module="fibrous_study.steps.stage_costs",
            outputs={"stages": COSTS, "targets": TARGET_COSTS},
            inputs=lambda config, _: {"files": [job.accounted for job in jobs(told, config)]},
            config=lambda config, _: _costs_config(told, config),
            instances=once,
        ),
        "table_pages": Stage(
            module="fibrous_study.steps.table_pages",
            outputs={"page": "results/report/{each}.html"},
            inputs=lambda config, _: {"tables": [VIEWS[name].path for name in _tables(told, config)]},
            config=lambda config, _: {"tables": _tables(told, config), "templates": _templates()},
            instances=once,
            each=lambda config, _: _tables(told, config),
        ),
        "report": Stage(
            module="fibrous_study.steps.report",
            outputs={"page": "results/report.html"},
            inputs=lambda config, _: _report_inputs(told, config),
            config=lambda config, _: _report_config(told, config),
            instances=once,
        ),
    }


def flow(stages: Mapping[str, Stage], config: Config) -> list[dict[str, Any]]:
    """Stages that write data: `stage`, the stages that it `reads`, its number of `jobs`, and the figures `drawn` of it.

    A stage reads itself where one of its jobs reads what another one writes.
    """
    every = jobs(stages, config)
    producer = {path: job.stage for job in every for path in job.outputs}
    reads: dict[str, set[str]] = {}
    for job in every:
        reads.setdefault(job.stage, set()).update(producer[path] for path in job.inputs if path in producer)
    return [
        {
            "stage": name,
            "reads": sorted(reads[name]),
            "jobs": sum(job.stage == name for job in every),
            "drawn": [other for other in reads if other.startswith("figure_") and name in reads[other]],
        }
        for name in reads
        if not name.startswith("figure_")
    ]


def target_stages(target: str) -> tuple[str, ...]:
    """The stages whose files a target makes."""
    return GATHERING.get(target, (target,))


def _costs_config(stages: Mapping[str, Stage], config: Config) -> dict[str, Any]:
    """Per job its stage and the numbers of the jobs whose files it reads, and per target its stages."""
    every = jobs(stages, config)
    number = {path: i for i, job in enumerate(every) for path in job.outputs}
    there = {job.stage for job in every}
    targets = {target: [name for name in target_stages(target) if name in there] for target in TARGETS}
    return {
        "stages": [job.stage for job in every],
        "reads": [sorted({number[path] for path in job.inputs if path in number}) for job in every],
        "targets": {target: names for target, names in targets.items() if names},
    }


def _refitted_between_runs(config: Config) -> list[dict[str, str]]:
    """One instance, where constants are fitted anew between two runs."""
    return once(config) if any(run.refits and not plan.is_lagged(config, run) for run in plan.runs(config)) else []


def _figure_4_inputs(config: Config) -> dict[str, list[str]]:
    initial, refit = plan.drawn_runs(config)
    protocol, again = config["tissue"]["protocol"], f"{REFIT}{plan.run_called(config, refit).source}"
    return {
        "specimen": [SPECIMEN],
        "networks": networks_of_elements(config),
        "curves": curves_of(config, "tissue", protocol),
        "fits": [f"results/fits/tissue/{protocol}.csv"],
        "refit_curves": curves_of(config, "tissue", again),
        "refits": [f"results/fits/tissue/{again}.csv"],
        "tissue": [TISSUE.format(run=name) for name in (initial, refit)],
    }


def _figures(stages: Mapping[str, Stage], config: Config) -> list[str]:
    """Stages of the figures of the report, in its order."""
    drawn = {job.stage for job in jobs(stages, config)}
    return [one.stage for one in exhibits() if one.stage in drawn]


def _tables(stages: Mapping[str, Stage], config: Config) -> list[str]:
    """Tables that the study makes, as the report calls them, in its order."""
    written = {path for job in jobs(stages, config) for path in job.outputs} | {COSTS, TARGET_COSTS}
    return [name for name, view in VIEWS.items() if view.path in written]


def _report_inputs(stages: Mapping[str, Stage], config: Config) -> dict[str, list[str]]:
    return {
        "figures": [stages[name].outputs["svg"] for name in _figures(stages, config)],
        "tables": [VIEWS[name].path for name in _tables(stages, config)],
    }


def _templates() -> list[str]:
    """What the pages' templates hold: they are code that no import reaches."""
    return contents([str(path) for path in sorted(TEMPLATES.iterdir()) if path.suffix in (".html", ".css")])


def _report_config(stages: Mapping[str, Stage], config: Config) -> dict[str, Any]:
    default, on_demand = loaded(), {"microstructure", "sensitivity"}  # says nothing of what the report tells
    study = {key: value for key, value in config.items() if key not in on_demand}
    return {
        "figures": [{"stage": name, "caption": caption(name)} for name in _figures(stages, config)],
        "tables": _tables(stages, config),
        "templates": _templates(),
        "paper": {name: section(name) for name in ("statements", "contradictions")},
        "other_than_default": [key for key in default if key in study and study[key] != default[key]],
        "seed": config["seed"],
        "commit": commit(PROJECT),
        # As text, since JSON with sorted keys would lose the order of a mapping.
        "study": yaml.safe_dump(in_order_of(default, study), sort_keys=False, allow_unicode=True, width=110),
    }


def in_order_of(default: Any, value: Any) -> Any:
    """A config with its keys in the order of the default one's; those that it lacks come last.

    >>> in_order_of({"b": 1, "a": {"d": 1, "c": 1}}, {"a": {"c": 2, "d": 3}, "b": 4, "e": 5})
    {'b': 4, 'a': {'d': 3, 'c': 2}, 'e': 5}
    """
    if isinstance(value, dict) and isinstance(default, dict):
        keys = [key for key in default if key in value] + [key for key in value if key not in default]
        return {key: in_order_of(default.get(key), value[key]) for key in keys}
    if isinstance(value, list) and isinstance(default, list) and default:
        return [in_order_of(default[0], one) for one in value]
    return value


def commit(checkout: Path) -> str:
    """The last commit of `checkout` that touched what results are made of, and whether that has changed since.

    Says so where it is no git checkout, as in an archive of the sources.
    """
    try:
        found = _git(checkout, "log", "-1", "--format=%H", "--", *SOURCES)
        changed = _git(checkout, "status", "--porcelain", "-uno", "--", *SOURCES)
    except (OSError, subprocess.CalledProcessError):
        found, changed = "", ""
    return (found or "not a git checkout") + (" with changes since" if changed else "")


def _git(checkout: Path, *words: str) -> str:
    done = subprocess.run(["git", "-C", str(checkout), *words], capture_output=True, text=True, check=True)
    return done.stdout.strip()
