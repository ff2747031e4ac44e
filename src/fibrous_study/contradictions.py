"""What is wrong between keys of the config that are each right, in one line each with the key's path."""

from __future__ import annotations

import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from fibrous.deformation import Load, averaged_stretch, largest_principal_stretch
from fibrous.errors import LoadError
from fibrous.materials.hgo import LAWS
from fibrous_study import plan
from fibrous_study.plan import REFIT, Config
from fibrous_study.variants import Variant, factors, varied

SURFACE_TERMS = 9
RESERVED = ("specimen", "table", "comparison")  # names of files beside those of the runs
CLAIMED_LOADS = {"x_uniaxial", "xy_biaxial", "xz_biaxial"}  # by which the statements about network 3 are judged
LARGEST_EXPONENT = 350.0  # exp of it, and the square of that, are finite in double precision
# A Delaunay network needs some ten nodes in the cube before its alignment means anything.
LEAST_FIBER_LENGTH = 40.0
LARGEST_FIBER_LENGTH = 20000.0  # some 90,000 nodes: beyond it the banded factor alone fills the memory of a machine


def contradictions(config: Config) -> Iterator[str]:
    """What is wrong between keys that are each right."""
    yield from _repeated(config)
    yield from _files(config)
    yield from _cube(config)
    if not plan.own_networks(config):
        yield from _alignments(config)
        yield from _ensemble(config)
    yield from _loads(config)
    yield from _load_sets(config)
    yield from _specimen(config)
    if not plan.own_networks(config):
        yield from _tissue(config)
        yield from _microstructure(config)
        yield from _claims(config)
        yield from _sensitivity(config)


def _repeated(config: Config) -> Iterator[str]:
    lists = {key: config[key] for key in ("named", "network_files", "protocols", "load_sets")}
    for key, entries in {**lists, "tissue.models": config["tissue"]["models"]}.items():
        names = [entry["name"] for entry in entries]
        for i, name in enumerate(names):
            if name in names[:i]:
                yield f"{key}[{i}].name is {name}, which {key}[{names.index(name)}] is called already"


def _files(config: Config) -> Iterator[str]:
    entries = config["network_files"]
    if plan.own_networks(config) and not entries:
        yield "network_files is empty, must name your networks for network: file"
    if not plan.own_networks(config) and entries:
        kind = config["network"]
        yield f"network_files names files, but network is {kind}; write network: file or leave the list empty"
    for i, entry in enumerate(entries):
        given = set(entry) - {"name"}
        if given not in ({"nodes", "fibers"}, {"file"}):
            yield f"network_files[{i}] must have nodes and fibers, or file alone"
        for key in sorted(given):
            if not Path(entry[key]).is_file():
                yield f"network_files[{i}].{key} is {entry[key]}, no such file seen from {Path.cwd()}"


def _cube(config: Config) -> Iterator[str]:
    fiber, cube = config["fiber"], config["cube"]
    if fiber["radius_um"] >= cube["edge_length_um"] / 2:
        yield f"fiber.radius_um is {fiber['radius_um']:g}, must be less than half of cube.edge_length_um"
        return
    length = cube["volume_fraction"] * cube["edge_length_um"] ** 2 / (math.pi * fiber["radius_um"] ** 2)
    if not plan.own_networks(config) and length < LEAST_FIBER_LENGTH:
        yield (
            f"cube.volume_fraction is {cube['volume_fraction']:g}, which with this radius and edge leaves {length:.3g} "
            f"edge lengths of fiber in the cube, must be at least {LEAST_FIBER_LENGTH:g}: enlarge cube.edge_length_um"
        )
    if not plan.own_networks(config) and length > LARGEST_FIBER_LENGTH:
        yield (
            f"cube.edge_length_um is {cube['edge_length_um']:g}, which with this radius and volume fraction puts "
            f"{length:.3g} edge lengths of fiber into the cube, must be at most {LARGEST_FIBER_LENGTH:g}"
        )
    largest = min(config["principal_stretch_limit"], fiber["linear_beyond_stretch"] or math.inf)
    if fiber["nonlinearity"] * (largest**2 - 1) / 2 > LARGEST_EXPONENT:
        yield (
            f"fiber.nonlinearity is {fiber['nonlinearity']:g}, which makes a fiber's force overflow at the stretch "
            f"{largest:g}: lower it, principal_stretch_limit or fiber.linear_beyond_stretch"
        )


def _alignments(config: Config) -> Iterator[str]:
    least, largest = config["delaunay"]["H11"]
    smallest = config["delaunay"]["smallest_H"]
    if least >= largest:
        yield f"delaunay.H11 is [{least:g}, {largest:g}], must rise"
    if 1 - largest < 2 * smallest:
        yield (
            f"delaunay.H11 reaches {largest:g}, which leaves no room for H22 and H33 of at least delaunay.smallest_H "
            f"= {smallest:g}: the components add up to 1"
        )
    for i, entry in enumerate(config["named"]):
        if entry["H11"] + entry["H22"] >= 1:
            yield f"named[{i}] has H11 + H22 = {entry['H11'] + entry['H22']:g}, must be less than 1, the trace of H"
    names = {entry["name"] for entry in config["named"]}
    roles = config["roles"]
    survey = ((f"survey[{i}]", name) for i, name in enumerate(roles["survey"]))
    for key, name in (("case", roles["case"]), *survey):
        if name not in names:
            yield f"roles.{key} is {name}, which named lacks"


def _ensemble(config: Config) -> Iterator[str]:
    networks, batches = config["delaunay"]["networks"], config["delaunay"]["batches"]
    folds = config["surface"]["cross_validation_folds"]
    if batches > networks:
        yield f"delaunay.batches is {batches}, must be at most delaunay.networks = {networks}"
    replicates = config["replicates"]["seeds"] * len(config["named"])
    if config["replicates"]["batches"] > replicates:
        yield f"replicates.batches is {config['replicates']['batches']}, must be at most the {replicates} replicates"
    if folds > networks:
        yield f"surface.cross_validation_folds is {folds}, must be at most delaunay.networks = {networks}"
    elif networks - math.ceil(networks / folds) <= SURFACE_TERMS:
        yield (
            f"delaunay.networks is {networks}, too few for the {SURFACE_TERMS} coefficients of Eq. 11 "
            f"with surface.cross_validation_folds = {folds}"
        )


def _loads(config: Config) -> Iterator[str]:
    yield from _wanted_protocols(config)
    for i, protocol in enumerate(config["protocols"]):
        if protocol["name"].startswith(REFIT):
            yield f"protocols[{i}].name is {protocol['name']}, must not begin with {REFIT}, as those of the refits do"
        names = [entry["load"] for entry in protocol["loads"]]
        followed = not all({"magnitude", "deformation_gradient"} & set(entry) for entry in protocol["loads"][1:])
        leads = followed or protocol["name"] in (config["roles"]["large"], config["roles"]["small"])
        for j, entry in enumerate(protocol["loads"]):
            path = f"protocols[{i}].loads[{j}]"
            if entry["load"] in names[:j]:
                yield f"{path}.load is {entry['load']}, which the protocol has already"
            yield from _load(config, entry, path, first=j == 0, leads=leads)


def _wanted_protocols(config: Config) -> Iterator[str]:
    """Protocols that tables and figures need, with the ensembles that they must load."""
    if plan.own_networks(config):
        return
    roles, ensembles = config["roles"], {entry["name"]: entry["ensembles"] for entry in config["protocols"]}
    for role in ("large", "small", "case_study", "path"):
        if roles[role] not in ensembles:
            yield f"roles.{role} is {roles[role]}, must be one of {', '.join(ensembles)}"
            continue
        # Table 1 and Fig. 6 need the 750; Figures 3, 5 and 8 the named networks; the claims replicates of these.
        for ensemble in ("delaunay", "named", "replicates") if role in ("large", "small") else ("named", "replicates"):
            if ensemble not in ensembles[roles[role]]:
                yield f"roles.{role} is {roles[role]}, whose ensembles lack {ensemble}"
    for entry in config["protocols"]:
        if entry["name"] == roles["path"] and len(entry["loads"]) != 1:
            yield f"roles.path is {roles['path']}, which has {len(entry['loads'])} loads, must have one"


def _load(config: Config, entry: Config, path: str, first: bool, leads: bool) -> Iterator[str]:
    """What is wrong with a load; `leads` where the first of its protocol says how far others go or are compared."""
    gradient, said = None, f"{path}.deformation_gradient"
    if "deformation_gradient" in entry:
        gradient = np.array(entry["deformation_gradient"])
        if Load.kind_of(entry["load"]) is not None:
            yield f"{path}.load is {entry['load']}, whose deformation gradient is known: give yours another name"
        if "magnitude" in entry:
            yield f"{path} has a magnitude and a deformation_gradient, must have one of them"
        if not np.linalg.det(gradient) > 0:
            yield f"{said} has the determinant {np.linalg.det(gradient):.4g}, must be greater than 0"
            return
        at_rest, said = bool((gradient == np.eye(3)).all()), f"{said} is given"
    else:
        try:
            load = Load.parse(entry["load"])
        except LoadError:
            yield (
                f"{path}.load is {entry['load']}, must be x_uniaxial, xy_biaxial or xy_shear, with the axes you need, "
                "or come with its deformation_gradient"
            )
            return
        if "magnitude" not in entry:
            if first:
                yield f"{path}.magnitude is missing: the first load gives the averaged stretch of the others"
            return
        gradient = load.deformation_gradient(entry["magnitude"])
        at_rest, said = entry["magnitude"] == load.rest, f"{path}.magnitude is {entry['magnitude']:g}"
    stretch, limit = float(largest_principal_stretch(gradient)), config["principal_stretch_limit"]
    if at_rest:
        yield f"{said}, which deforms nothing"
    elif stretch > limit:
        yield f"{said}, a principal stretch of {stretch:.4g}, must stay within principal_stretch_limit = {limit:g}"
    elif first and leads:
        yield from _unstretched(config, gradient, said)


def _unstretched(config: Config, gradient: Any, said: str) -> Iterator[str]:
    """λ_f² = H:C is linear in H, so the corners of the region of alignments speak for all of it."""
    if plan.own_networks(config):
        return
    smallest = config["delaunay"]["smallest_H"]
    corners = [(H11, H22) for H11 in config["delaunay"]["H11"] for H22 in (smallest, 1 - H11 - smallest)]
    corners += [(entry["H11"], entry["H22"]) for entry in config["named"]]
    for H11, H22 in corners:
        stretch = float(averaged_stretch(gradient, np.diag([H11, H22, 1 - H11 - H22])))
        if stretch <= 1:
            yield (
                f"{said}, which gives a network of H = ({H11:.3g}, {H22:.3g}, {1 - H11 - H22:.3g}) the averaged "
                f"stretch {stretch:.4g}; must exceed 1 for every network: other loads end, or are compared, there"
            )
            return


def _load_sets(config: Config) -> Iterator[str]:
    available = {protocol["name"]: {entry["load"] for entry in protocol["loads"]} for protocol in config["protocols"]}
    for i, load_set in enumerate(config["load_sets"]):
        for j, load in enumerate(load_set["loads"]):
            path = f"load_sets[{i}].loads[{j}]"
            if load in load_set["loads"][:j]:
                yield f"{path} is {load}, which the set has already"
            if not any(load in loads for loads in available.values()):
                yield f"{path} is {load}, which no protocol has"
                continue
            for name in (config["roles"]["large"], config["roles"]["small"]):
                if not plan.own_networks(config) and load not in available.get(name, {load}):
                    yield f"{path} is {load}, which protocol {name} lacks, so that Table 1 cannot be made"


def _specimen(config: Config) -> Iterator[str]:
    files, slab = config["specimen_files"], config["synthetic_specimen"]
    if plan.own_networks(config) and plan.own_specimen(config):
        yield "specimen is file, which says nothing with network: file: networks of your own have no tissue around them"
    if not plan.own_specimen(config) and files:
        yield "specimen_files names files, but specimen is synthetic; write specimen: file or leave them out"
    if plan.own_specimen(config):
        for key in ("mesh", "motion", "fibers"):
            if key not in files:
                yield f"specimen_files.{key} is missing, must name a file for specimen: file"
            elif not Path(files[key]).is_file():
                yield f"specimen_files.{key} is {files[key]}, no such file seen from {Path.cwd()}"
        return
    for key in ("H11", "in_plane_share"):
        least, largest = slab[key]
        if least >= largest:
            yield f"synthetic_specimen.{key} is [{least:g}, {largest:g}], must rise"
    if slab["length_mm"] >= math.pi * slab["radius_mm"]:
        yield (
            f"synthetic_specimen.length_mm is {slab['length_mm']:g}, which bent to radius_mm = {slab['radius_mm']:g} "
            "makes more than half a turn; enlarge synthetic_specimen.radius_mm"
        )
    if slab["thickness_mm"] >= 2 * slab["radius_mm"]:
        yield (
            f"synthetic_specimen.thickness_mm is {slab['thickness_mm']:g}, must be less than twice radius_mm = "
            f"{slab['radius_mm']:g}, the middle of the bend"
        )
    if slab["gap_mm"] <= -slab["length_mm"]:
        yield f"synthetic_specimen.gap_mm is {slab['gap_mm']:g}, which pushes one bone through the other"


def _tissue(config: Config) -> Iterator[str]:
    tissue, load_sets = config["tissue"], {entry["name"]: entry for entry in config["load_sets"]}
    protocols = {entry["name"]: entry for entry in config["protocols"]}
    load_set, name = tissue["load_set"], tissue["protocol"]
    if load_set not in load_sets:
        yield f"tissue.load_set is {load_set}, must be one of {', '.join(load_sets)}"
        return
    wanted = set(load_sets[load_set]["loads"])
    for path, protocol in (("tissue.protocol", name), ("roles.case_study", config["roles"]["case_study"])):
        missing = wanted - plan.loads(protocols[protocol]) if protocol in protocols else set()
        if missing:
            yield f"{path} is {protocol}, which lacks {min(missing)}, which tissue.load_set = {load_set} asks for"
    if name not in protocols:
        yield f"tissue.protocol is {name}, must be one of {', '.join(protocols)}"
    elif "tissue" not in protocols[name]["ensembles"]:
        yield f"tissue.protocol is {name}, whose ensembles lack tissue"
    for i, model in enumerate(tissue["models"]):
        yield from _model(config, model, f"tissue.models[{i}]")
        if model["name"] in RESERVED or model["name"].endswith("_febio"):
            yield f"tissue.models[{i}].name is {model['name']}, which names a file of another rule"
    yield from _surface_range(config)
    names = [run.name for run in plan.runs(config)]
    for name in dict.fromkeys(name for i, name in enumerate(names) if name in names[:i]):
        models = [model["name"] for model in tissue["models"]]
        if models.count(name) < 2:
            yield f"tissue.models: {name} is the name of a model and of another one's refit"


def _surface_range(config: Config) -> Iterator[str]:
    """The surface of Eq. 11 answers inside the alignments of the ensemble that it was fitted to, and nowhere else."""
    models = [model["name"] for model in config["tissue"]["models"] if model.get("constants") == "surface"]
    if not models:
        return
    least, largest = config["delaunay"]["H11"]
    smallest = config["delaunay"]["smallest_H"]
    remedy = f"leave {', '.join(models)} out of tissue.models, or widen delaunay"
    if not plan.own_specimen(config):
        aligned, (thin, wide) = config["synthetic_specimen"]["H11"], config["synthetic_specimen"]["in_plane_share"]
        across = (1 - aligned[1]) * min(thin, 1 - wide)
        if aligned[0] < least or aligned[1] > largest or across < smallest:
            yield (
                f"synthetic_specimen reaches H11 = {aligned[0]:g} and {aligned[1]:g} with an H33 of {across:.3g}, "
                f"beyond delaunay.H11 or delaunay.smallest_H, where the surface of Eq. 11 says nothing: {remedy}"
            )
        return
    for element, tensor in enumerate(plan.fiber_eigenvalues(config)):
        first, _, third = sorted(tensor, reverse=True)
        if not least <= first <= largest or third < smallest:
            yield (
                f"specimen_files.fibers: element {element} has eigenvalues of H from {third:.3g} to {first:.3g}, "
                f"beyond delaunay.H11 or delaunay.smallest_H, where the surface of Eq. 11 says nothing: {remedy}"
            )
            return


def _microstructure(config: Config) -> Iterator[str]:
    names, elements = [run.name for run in plan.runs(config)], math.prod(config["synthetic_specimen"]["elements"])
    for i, name in enumerate(config["microstructure"]["runs"]):
        if name not in names:
            yield f"microstructure.runs[{i}] is {name}, must be one of {', '.join(names)}"
    for i, element in enumerate(config["microstructure"]["elements"]):
        if not plan.own_specimen(config) and element >= elements:
            yield f"microstructure.elements[{i}] is {element}, must be less than the specimen's {elements} elements"


def _claims(config: Config) -> Iterator[str]:
    """Loads without which statements about network 3 cannot be judged."""
    large = config["roles"]["large"]
    for entry in config["protocols"]:
        for load in sorted(CLAIMED_LOADS - plan.loads(entry)) if entry["name"] == large else ():
            yield f"roles.large is {large}, which lacks {load}, which the claims need"


def _sensitivity(config: Config) -> Iterator[str]:
    """Networks that are not there, values given twice, and values that would contradict the rest of the config."""
    part, names = config["sensitivity"], [entry["name"] for entry in config["named"]]
    for i, name in enumerate(part["networks"]):
        if name not in names:
            yield f"sensitivity.networks[{i}] is {name}, must be one of {', '.join(names)}"
        if name in part["networks"][:i]:
            yield f"sensitivity.networks[{i}] is {name}, which the list has already"
    if config["roles"]["large"] not in plan.protocols(config):
        return
    known = {*_cube(config), *_loads(config)}
    for factor in factors(config):
        variants = [Variant(factor, value) for value in part[factor]]
        for i, variant in enumerate(variants):
            path = f"sensitivity.{factor}[{i}] is {variant.value:g}"
            if variant.name in [other.name for other in variants[:i]]:
                yield f"{path}, which the list has already"
            changed = varied(config, variant)
            for problem in (*_cube(changed), *_loads(changed)):
                if problem not in known:
                    yield f"{path}, with which {problem}"


def _model(config: Config, model: Config, path: str) -> Iterator[str]:
    """Keys that a model needs, and those that say nothing in it."""
    needed = set()
    if model["law"] in LAWS:
        needed = {"constants"}
        if model.get("constants") == "fit":
            needed |= {"energy", "objective"}
    for key in sorted(needed - set(model)):
        yield f"{path}.{key} is missing, must be given for {model['name']}"
    extra = set(model) - needed - {"name", "law"}
    if model.get("constants") == "fit":
        extra -= {"refit"}
    if model["law"] == "network":
        extra -= {"load_steps"}
    for key in sorted(extra - {"refit"} if not model.get("refit") else extra):
        yield f"{path}.{key} says nothing about {model['name']}: leave it out"
    steps, wanted = config["synthetic_specimen"]["load_steps"], model.get("load_steps", 1)
    if not plan.own_specimen(config) and steps % wanted:
        yield f"{path}.load_steps is {wanted}, must divide synthetic_specimen.load_steps = {steps}"
    surface = config["tissue"]["surface_protocol"]
    if model.get("constants") == "surface" and surface not in plan.compared_protocols(config):
        yield f"tissue.surface_protocol is {surface}, of which there is no surface, must be one of those in Table 1"
