"""Every key of the config: its type, range and meaning, and what keys say together (docs/config.md is made from here).

The unit of a number is the ending of its key; one without such an ending is dimensionless. Ranges exclude impossible
physics.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal, Self, TypeVar

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from fibrous import deformation
from fibrous.materials.registry import LAWS, WITH_CONSTANTS
from fibrous.networks import GENERATORS
from fibrous_study import plan

UNITS = {"um": "µm", "mm": "mm", "MPa": "MPa", "degrees": "degrees"}
SURFACE_TERMS = 9
RESERVED = ("specimen", "table", "comparison")  # names of files beside those of the runs
CLAIMED_LOADS = {"x_uniaxial", "xy_biaxial", "xz_biaxial"}  # by which the statements about network 3 are judged
LARGEST_EXPONENT = 350.0  # exp of it, and the square of that, are finite in double precision
# A Delaunay network needs some ten nodes in the cube before its alignment means anything.
LEAST_FIBER_LENGTH = 40.0
LARGEST_FIBER_LENGTH = 20000.0  # some 90,000 nodes: beyond it the banded factor alone fills the memory of a machine


class Contradiction(ValueError):
    """What is wrong between keys, or entries of a list: lines that begin with the key's path from where it was seen."""

    def __init__(self, lines: list[str]) -> None:
        super().__init__("; ".join(lines))
        self.lines = lines


T = TypeVar("T")


def _distinct(entries: list[T]) -> list[T]:
    """Refuses entries of the same name, load or value; numbers are those of file names, with six digits."""
    inner = next((inner for inner in ("name", "load") if entries and hasattr(entries[0], inner)), "")
    values = [getattr(entry, inner) if inner else entry for entry in entries]
    shown = [f"{value:.6g}" if isinstance(value, float) else str(value) for value in values]
    dot = "." if inner else ""
    lines = [
        f"[{i}]{dot}{inner} is {text}, which the list has already" for i, text in enumerate(shown) if text in shown[:i]
    ]
    if lines:
        raise Contradiction(lines)
    return entries


def _rising(ends: list[float]) -> list[float]:
    if ends[0] >= ends[1]:
        raise Contradiction([f" is [{ends[0]:g}, {ends[1]:g}], must rise"])
    return ends


if TYPE_CHECKING:  # names of registries, which are texts to a type checker
    Generator = str
    Law = str
    LawWithConstants = str
else:
    Generator = Literal[(*GENERATORS, "file")]
    Law = Literal[tuple(LAWS)]
    LawWithConstants = Literal[tuple(WITH_CONSTANTS)]

Name = Annotated[str, Field(pattern="^[A-Za-z0-9_]+$")]  # becomes part of a file name
File = Annotated[str, Field(min_length=1)]
Count = Annotated[int, Field(ge=1, le=1000)]
Steps = Annotated[int, Field(ge=2, le=1000)]
Share = Annotated[float, Field(ge=0, le=1)]
Factor = Annotated[float, Field(ge=1, le=1000)]
Component = Annotated[float, Field(gt=0, lt=1)]
Range = Annotated[list[Component], Field(min_length=2, max_length=2), AfterValidator(_rising)]
EdgeLength = Annotated[float, Field(gt=0, le=1000)]
VolumeFraction = Annotated[float, Field(gt=0, le=0.5)]
Nonlinearity = Annotated[float, Field(ge=0.1, le=50)]
Magnitude = Annotated[float, Field(gt=0, le=10)]
Length = Annotated[float, Field(gt=0, le=1000)]
LargeLength = Annotated[float, Field(gt=0, le=1e6)]
Distance = Annotated[float, Field(ge=-1000, le=1000)]
Spread = Annotated[float, Field(ge=0, le=45)]
Row = Annotated[list[Annotated[float, Field(ge=-10, le=10)]], Field(min_length=3, max_length=3)]
Ensemble = Literal["delaunay", "named", "replicates", "tissue"]
Many = Annotated[list[T], AfterValidator(_distinct)]
Some = Annotated[list[T], Field(min_length=1), AfterValidator(_distinct)]


def key(meaning: str, **limits: Any) -> Any:
    """A key that must be given, within its limits."""
    return Field(description=meaning, **limits)


def optional(meaning: str, **limits: Any) -> Any:
    """A key that may be left out, but not be null."""
    return Field(None, description=meaning, **limits)


class Section(BaseModel):
    """Keys that belong together: all of them known, of the very type, and not at odds with each other."""

    model_config = ConfigDict(extra="forbid", strict=True, allow_inf_nan=False)

    @model_validator(mode="after")
    def _consistent(self) -> Self:
        if lines := list(self._contradictions()):
            raise Contradiction(lines)
        return self

    def _contradictions(self) -> Iterator[str]:
        """What is wrong between keys that are each right, in lines that begin with the path from this section."""
        yield from ()


class NetworkFile(Section):
    """A network of your own: two tables, nodes and fibers, or one NetCDF file."""

    name: Name = key("its name")
    nodes: File = optional("table of the nodes")
    fibers: File = optional("table of the fibers")
    file: File = optional("NetCDF file")

    def _contradictions(self) -> Iterator[str]:
        given = self.model_fields_set - {"name"}
        if given not in ({"nodes", "fibers"}, {"file"}):
            yield " must have nodes and fibers, or file alone"


class Fiber(Section):
    """The law of a fiber, Eq. 6."""

    modulus_MPa: float = key("modulus k", gt=0, le=1e6)
    nonlinearity: Nonlinearity = key("nonlinearity B")
    radius_um: Length = key("radius R")
    linear_beyond_stretch: float | None = key("where the force begins to grow linearly; null for never", gt=1, le=10)


class Cube(Section):
    """The cube that a network fills, Eq. 5."""

    edge_length_um: EdgeLength = key("edge length χ")
    volume_fraction: VolumeFraction = key("fiber volume fraction φ")
    alignment_tolerance: float = key("largest difference between a component of H and its target", gt=0, le=0.05)


class Delaunay(Section):
    """The networks behind Table 1."""

    networks: int = key("number of networks", ge=1, le=100_000)
    batches: Count = key("parts of the ensemble that run side by side")
    H11: Range = key("least and largest component H11 of the structure tensor, whose trace is 1")
    smallest_H: float = key("least component H22 and H33", gt=0, le=0.33)

    def _contradictions(self) -> Iterator[str]:
        if 1 - self.H11[1] < 2 * self.smallest_H:
            yield f"H11 reaches {self.H11[1]:g}, must leave H22 and H33 at least smallest_H = {self.smallest_H:g} of 1"
        if self.batches > self.networks:
            yield f"batches is {self.batches}, must be at most delaunay.networks = {self.networks}"


class NamedNetwork(Section):
    """A network with H = diag(H11, H22, 1 − H11 − H22), which figures draw by itself."""

    name: Name = key("its name")
    H11: Component = key("component of the structure tensor, whose trace is 1")
    H22: Component = key("component of the structure tensor")

    def _contradictions(self) -> Iterator[str]:
        if self.H11 + self.H22 >= 1:
            yield f" has H11 + H22 = {self.H11 + self.H22:g}, must be less than 1, the trace of H"


class Roles(Section):
    """Which of the networks and protocols the figures, tables and statements of the paper are about."""

    case: Name = key("network of `named` of §2.3: Figures 2, 3, 5 and 8")
    survey: Many[Name] = key("networks of `named` that are networks 1 to 5 of Fig. 6", min_length=5, max_length=5)
    large: Name = key("protocol to 112 % Green strain: Figures 3, 5 and 6, Table 1")
    small: Name = key("protocol to 10 % Green strain: Figures 3 and 5")
    case_study: Name = key("protocol behind the constants of §2.6: Figure 8")
    path: Name = key("protocol of the one deformation on which these constants are tried: Figure 8")


class Replicates(Section):
    """Further networks of each named one's alignment."""

    seeds: Count = key("networks of each alignment")
    batches: Count = key("parts of the ensemble that run side by side")


class Load(Section):
    """A load; without a magnitude it ends at the averaged stretch at which the first of its protocol ends."""

    load: Name = key("{axes}_{uniaxial, biaxial or shear}, or a name of your own for a deformation_gradient")
    magnitude: Magnitude = optional("stretch of a uniaxial or biaxial load, amount of shear of a shear")
    deformation_gradient: list[Row] = optional("F at the end, in rows", min_length=3, max_length=3)

    def _contradictions(self) -> Iterator[str]:
        with_own_gradient, F = self.deformation_gradient is not None, self.end()
        if with_own_gradient == (deformation.Load.kind_of(self.load) is not None):
            yield f"load is {self.load}, must be like x_uniaxial, xy_biaxial or xy_shear, or else have a gradient"
        elif with_own_gradient and self.magnitude is not None:
            yield " has a magnitude and a deformation_gradient, must have one of them"
        elif F is not None and not np.linalg.det(F) > 0:
            yield f"deformation_gradient has the determinant {np.linalg.det(F):.4g}, must be greater than 0"
        elif F is not None and np.array_equal(F, np.eye(3)):
            yield f"{self.given()}, which deforms nothing"

    def end(self) -> NDArray[np.float64] | None:
        """F at the end, shape (3, 3); None where it follows from the first load of the protocol."""
        if self.deformation_gradient is not None:
            return np.array(self.deformation_gradient)
        if self.magnitude is None or deformation.Load.kind_of(self.load) is None:
            return None
        return deformation.Load.parse(self.load).deformation_gradient(self.magnitude)

    def given(self) -> str:
        """The key that gives the end, as the beginning of a line."""
        return "deformation_gradient is given" if self.magnitude is None else f"magnitude is {self.magnitude:g}"


class Protocol(Section):
    """Loads in equal steps from rest to their ends."""

    name: Name = key("its name")
    ensembles: Some[Ensemble] = key("networks that are loaded; your own take every protocol")
    steps: Steps = key("number of steps of every load")
    loads: Some[Load] = key("the loads; the first gives the averaged stretch of those without a magnitude")

    def _contradictions(self) -> Iterator[str]:
        if self.name.startswith(plan.REFIT):
            yield f"name is {self.name}, must not begin with {plan.REFIT}, as those of the refits do"
        if self.loads[0].end() is None:
            yield "loads[0].magnitude is missing: the first load gives the averaged stretch of the others"


class Equilibrium(Section):
    """When a network is in equilibrium, and how hard to try."""

    residual_tolerance: float = key("norm of the residual force over the fibers' forces", ge=1e-13, le=1e-4)
    largest_number_of_iterations: int = key("Newton iterations after which a step has failed", ge=1, le=10_000)
    largest_number_of_cuts: int = key("times a step may be halved before its state counts as failed", ge=0, le=30)


class LoadSet(Section):
    """Loads that are fitted together."""

    name: Name = key("its name")
    loads: Some[Name] = key("loads of the protocols")


class Fit(Section):
    """The fit of Eq. 2."""

    largest_C3: float = key("upper bound of C3", gt=0, le=1000)
    slope_fit_below_r_squared: Share = key("R² of a fit to one load below which its slope is fitted instead")


class Surface(Section):
    """The surface of Eq. 11."""

    cross_validation_folds: Steps = key("parts of the ensemble that are held out one after the other")


class SpecimenFiles(Section):
    """The tissue of your own, for `specimen: file`."""

    mesh: File = optional("hexahedra, in any format that meshio reads")
    motion: File = optional("table of the motion of the nodes (CSV)")
    fibers: File = optional("table of the structure tensors of the elements (CSV)")


class SyntheticSpecimen(Section):
    """A curved slab between two bones, its fibers and its motion."""

    elements: list[Count] = key("elements between the bones, along the joint, through it", min_length=3, max_length=3)
    length_mm: Length = key("from bone to bone")
    height_mm: Length = key("along the joint")
    thickness_mm: Length = key("through the thickness")
    radius_mm: LargeLength = key("of the bend of the middle surface")
    lowest_row_degrees: float = key("angle of the mean fiber in the lowest row", ge=-90, le=90)
    deviation_degrees: Spread = key("standard deviation of the angle in the plane")
    tilt_degrees: Spread = key("standard deviation of the angle out of the plane")
    H11: Range = key("least and largest alignment along the local fiber")
    in_plane_share: Range = key("least and largest share of 1 − H11 in the plane")
    correlation_length_mm: LargeLength = key("length over which the random fields change")
    gap_mm: Distance = key("motion of the bone away from the other bone")
    slide_mm: Distance = key("motion of the bone along the joint")
    rotation_degrees: float = key("turn of the bone about x", ge=-180, le=180)
    load_steps: Steps = key("equal steps of the motion")

    def _contradictions(self) -> Iterator[str]:
        if self.length_mm >= math.pi * self.radius_mm:
            yield f"length_mm is {self.length_mm:g}, more than half a turn: enlarge radius_mm = {self.radius_mm:g}"
        if self.thickness_mm >= 2 * self.radius_mm:
            yield f"thickness_mm is {self.thickness_mm:g}, must be less than twice radius_mm = {self.radius_mm:g}"
        if self.gap_mm <= -self.length_mm:
            yield f"gap_mm is {self.gap_mm:g}, which pushes one bone through the other"


class Matrix(Section):
    """The matrix of the tissue, Eq. 10B."""

    C1_MPa: float = key("half the second Lamé parameter", gt=0, le=1e6)
    lame_lambda_MPa: float = key("first Lamé parameter", ge=0, le=1e6)


class Model(Section):
    """What the fibers of the tissue do, and where the constants of a law come from."""

    name: Name = key("its name")
    law: Law = key("; ".join(f"{name}: {law.label}" for name, law in LAWS.items()))
    constants: Literal["fit", "surface"] = optional("source of C2 and C3: fits to networks, or Eq. 11")
    energy: LawWithConstants = optional("law that is fitted")
    objective: Literal["energy", "stress"] = optional("what the fit compares with the networks'")
    refit: bool = optional("whether the constants are fitted anew to the tissue's deformation")
    load_steps: Count = optional("load steps of a run with networks, if not those of the specimen")

    def _contradictions(self) -> Iterator[str]:
        needed = {"constants"} if LAWS[self.law].has_constants else set()
        allowed = {"load_steps"} if LAWS[self.law].is_solved else set()
        if needed and self.constants == "fit":
            needed, allowed = needed | {"energy", "objective"}, {"refit"}
        given = self.model_fields_set - {"name", "law"} - (set() if self.refit else {"refit"})
        for name in sorted(needed - given):
            yield f"{name} is missing, must be given for {self.name}"
        for name in sorted(given - needed - allowed):
            yield f"{name} says nothing about {self.name}: leave it out"
        if self.name in RESERVED or self.name.endswith("_febio"):
            yield f"name is {self.name}, which names a file of another rule"


class Tissue(Section):
    """The finite element runs, Eq. 10."""

    batches: Count = key("parts of the element networks that run side by side")
    protocol: Name = key("protocol of the initial fits")
    load_set: Name = key("load set of the initial fits")
    surface_protocol: Name = key("protocol of the surface of Eq. 11 that gives constants")
    update: Literal["rounds", "lagged"] = key(
        "constants are fitted anew between runs (rounds) or after each load step (lagged)"
    )
    refit_rounds: int = key("times the constants are fitted anew; if lagged, in the last step", ge=1, le=20)
    tension_only: bool = key("whether fibers of a law carry nothing in compression")
    linear_solver: Literal["auto", "direct", "cg", "pardiso"] = key("how linear systems are solved")
    models: Some[Model] = key("the laws that are run")


class Microstructure(Section):
    """Elements whose networks are looked at one by one, §2.5."""

    runs: Many[Name] = key("runs of the tissue whose deformation the networks follow")
    elements: Many[Annotated[int, Field(ge=0, le=1_000_000)]] = key("numbers of elements")


class Sensitivity(Section):
    """What is varied, one key at a time, to see how the constants of Eq. 2 move."""

    networks: Some[Name] = key("networks of `named` whose alignment is tried")
    seeds: Steps = key("networks of each alignment")
    edge_length_um: Some[EdgeLength] = key("edge lengths χ")
    volume_fraction: Some[VolumeFraction] = key("fiber volume fractions φ")
    nonlinearity: Some[Nonlinearity] = key("nonlinearities B")
    amplitude: Some[Magnitude] = key("magnitudes of the first load of protocol roles.large")
    steps: Some[Steps] = key("numbers of steps of that protocol")


class Claims(Section):
    """From when on a statement of the paper counts as true."""

    printed_digits: Share = key("relative difference from a printed number")
    most: float = key("share for which a statement must hold", ge=0.5, le=1)
    trend: Share = key("rank correlation from which on a trend is one")
    change: Share = key("relative change of an error or of a mean that counts")
    same_magnitude: Factor = key("factor within which numbers are of a similar magnitude")
    surface_error: Share = key("relative difference up to which two surfaces are the same")
    shape_error: Share = key("error after scaling from which on curves differ in shape")
    correction: Share = key("part of an error that a correction may leave")
    confident_r_squared: Share = key("R² of a fit with high confidence")
    r_squared: Share = key("difference of two R² that are the same")
    orientation: Share = key("difference of the largest eigenvalue of h that counts")
    peak_overlap: Share = key("share of the peaks that must be found")
    same_time: Factor = key("factor between CPU times that are the same")
    order_of_time: float = key("factor between CPU times of one order", ge=1, le=1e6)


class Study(Section):
    """The whole config."""

    seed: int = key("number that decides every random choice", ge=0, le=2**32 - 1)
    network: Generator = key("where the networks come from: a generator, or files of your own")
    network_files: Many[NetworkFile] = key("networks of your own, for `network: file`")
    fiber: Fiber
    cube: Cube
    delaunay: Delaunay
    named: Some[NamedNetwork] = key("networks that figures draw one by one")
    roles: Roles
    replicates: Replicates
    protocols: Some[Protocol] = key("ranges of deformation, each with its loads")
    principal_stretch_limit: float = key("largest principal stretch of F, at which a load ends", gt=1, le=10)
    equilibrium: Equilibrium
    load_sets: Some[LoadSet] = key("loads that are fitted together")
    fit: Fit
    surface: Surface
    specimen: Literal["synthetic", "file"] = key("where the tissue comes from: the slab, or files of your own")
    specimen_files: SpecimenFiles
    synthetic_specimen: SyntheticSpecimen
    matrix: Matrix
    tissue: Tissue
    microstructure: Microstructure
    sensitivity: Sensitivity
    claims: Claims

    def _contradictions(self) -> Iterator[str]:
        yield from self._files()
        yield from self._cube()
        yield from self._ends_of_loads()
        known = {load.load for protocol in self.protocols for load in protocol.loads}
        for i, load_set in enumerate(self.load_sets):
            for load in sorted(set(load_set.loads) - known):
                yield f"load_sets[{i}].loads has {load}, which no protocol has"
        if self.network != "file":
            yield from self._ensembles()
            yield from self._names()
            yield from self._protocols()
            yield from self._tissue()
            yield from self._surface_range()

    def _files(self) -> Iterator[str]:
        files = self.specimen_files
        if (self.network == "file") != bool(self.network_files):
            has = "names files" if self.network_files else "is empty"
            yield f"network_files {has}, but network is {self.network}: your own networks need both"
        for i, network in enumerate(self.network_files):
            for name in sorted(network.model_fields_set - {"name"}):
                yield from _missing_file(f"network_files[{i}].{name}", getattr(network, name))
        if self.network == "file" and self.specimen == "file":
            yield "specimen is file, which says nothing with network: file: no tissue is run with your own networks"
        if self.specimen != "file" and files.model_fields_set:
            yield f"specimen_files names files, but specimen is {self.specimen}: your own specimen needs both"
        for name in SpecimenFiles.model_fields if self.specimen == "file" else ():
            if name not in files.model_fields_set:
                yield f"specimen_files.{name} is missing, must name a file for specimen: file"
            else:
                yield from _missing_file(f"specimen_files.{name}", getattr(files, name))

    def _cube(self) -> Iterator[str]:
        fiber, edge, share = self.fiber, self.cube.edge_length_um, self.cube.volume_fraction
        length = share * edge**2 / (math.pi * fiber.radius_um**2)
        if fiber.radius_um >= edge / 2:
            yield f"fiber.radius_um is {fiber.radius_um:g}, must be less than half of cube.edge_length_um = {edge:g}"
        elif self.network != "file" and not LEAST_FIBER_LENGTH <= length <= LARGEST_FIBER_LENGTH:
            yield (
                f"cube.edge_length_um is {edge:g}, which with cube.volume_fraction = {share:g} and fiber.radius_um = "
                f"{fiber.radius_um:g} puts {length:.3g} edge lengths of fiber into the cube, must be at least "
                f"{LEAST_FIBER_LENGTH:g} and at most {LARGEST_FIBER_LENGTH:g}"
            )
        largest = min(self.principal_stretch_limit, fiber.linear_beyond_stretch or math.inf)
        if fiber.nonlinearity * (largest**2 - 1) / 2 > LARGEST_EXPONENT:
            yield (
                f"fiber.nonlinearity is {fiber.nonlinearity:g}, which makes a fiber's force overflow at the stretch "
                f"{largest:g}: lower it, principal_stretch_limit or fiber.linear_beyond_stretch"
            )

    def _ends_of_loads(self) -> Iterator[str]:
        limit = self.principal_stretch_limit
        for i, protocol in enumerate(self.protocols):
            leads = protocol.name in (self.roles.large, self.roles.small)
            leads |= any(load.end() is None for load in protocol.loads)
            for j, load in enumerate(protocol.loads):
                F, line = load.end(), f"protocols[{i}].loads[{j}].{load.given()}"
                if F is None:
                    continue
                if (stretch := float(deformation.largest_principal_stretch(F))) > limit:
                    yield f"{line}, a principal stretch of {stretch:.4g}, beyond principal_stretch_limit = {limit:g}"
                elif j == 0 and leads and self.network != "file":
                    yield from self._unstretched(line, F)

    def _unstretched(self, line: str, F: NDArray[np.float64]) -> Iterator[str]:
        """λ_f² = H:C is linear in H, so the corners of the region of alignments speak for all of it."""
        smallest = self.delaunay.smallest_H
        corners = [(H11, H22) for H11 in self.delaunay.H11 for H22 in (smallest, 1 - H11 - smallest)]
        for H11, H22 in corners + [(network.H11, network.H22) for network in self.named]:
            H = np.diag([H11, H22, 1 - H11 - H22])
            if (stretch := float(deformation.averaged_stretch(F, H))) <= 1:
                yield (
                    f"{line}, which gives a network of H11, H22 = {H11:.3g}, {H22:.3g} the averaged stretch "
                    f"{stretch:.4g}, must exceed 1 for every network: other loads end, or are compared, there"
                )
                return

    def _ensembles(self) -> Iterator[str]:
        networks, folds = self.delaunay.networks, self.surface.cross_validation_folds
        replicates = self.replicates.seeds * len(self.named)
        if self.replicates.batches > replicates:
            yield f"replicates.batches is {self.replicates.batches}, must be at most the {replicates} replicates"
        if networks - math.ceil(networks / folds) <= SURFACE_TERMS or folds > networks:
            yield (
                f"delaunay.networks is {networks}, too few for surface.cross_validation_folds = {folds} and the "
                f"{SURFACE_TERMS} coefficients of Eq. 11"
            )

    def _names(self) -> Iterator[str]:
        """Names of what is not there."""
        networks, runs = [network.name for network in self.named], [run.name for run in plan.runs(self.plain())]
        yield from _unknown("roles.case", [self.roles.case], networks)
        yield from _unknown("roles.survey", self.roles.survey, networks)
        yield from _unknown("sensitivity.networks", self.sensitivity.networks, networks)
        yield from _unknown("microstructure.runs", self.microstructure.runs, runs)
        yield from _unknown("tissue.load_set", [self.tissue.load_set], [load_set.name for load_set in self.load_sets])
        if any(model.constants == "surface" for model in self.tissue.models):
            compared = plan.compared_protocols(self.plain())
            yield from _unknown("tissue.surface_protocol", [self.tissue.surface_protocol], compared)
        for name in sorted({name for name in runs if runs.count(name) > 1}):
            yield f"tissue.models: {name} is the name of a model and of another model's refit"

    def _protocols(self) -> Iterator[str]:
        """What each protocol must load, and how, for those that use it."""
        roles, tissue = self.roles, self.tissue
        compared = {load for load_set in self.load_sets for load in load_set.loads}
        fitted = {load for load_set in self.load_sets if load_set.name == tissue.load_set for load in load_set.loads}
        every, drawn = ["delaunay", "named", "replicates"], ["named", "replicates"]
        protocols = {protocol.name: protocol for protocol in self.protocols}
        for path, name, ensembles, loads in (
            ("roles.large", roles.large, every, compared | CLAIMED_LOADS),
            ("roles.small", roles.small, every, compared),
            ("roles.case_study", roles.case_study, drawn, fitted),
            ("roles.path", roles.path, drawn, set()),
            ("tissue.protocol", tissue.protocol, ["tissue"], fitted),
        ):
            yield from _unknown(path, [name], protocols)
            if name in protocols:
                for ensemble in ensembles:
                    if ensemble not in protocols[name].ensembles:
                        yield f"{path} is {name}, whose ensembles lack {ensemble}"
                for load in sorted(loads - {load.load for load in protocols[name].loads}):
                    yield f"{path} is {name}, whose loads lack {load}, which load sets or claims need"
        if roles.path in protocols and (count := len(protocols[roles.path].loads)) != 1:
            yield f"roles.path is {roles.path}, which has {count} loads, must have one"

    def _tissue(self) -> Iterator[str]:
        if self.specimen == "file":
            return
        steps, count = self.synthetic_specimen.load_steps, math.prod(self.synthetic_specimen.elements)
        for i, model in enumerate(self.tissue.models):
            if steps % (model.load_steps or 1):
                path = f"tissue.models[{i}].load_steps"
                yield f"{path} is {model.load_steps}, must divide synthetic_specimen.load_steps = {steps}"
        for i, element in enumerate(self.microstructure.elements):
            if element >= count:
                yield f"microstructure.elements[{i}] is {element}, must be less than the specimen's {count} elements"

    def _surface_range(self) -> Iterator[str]:
        """The surface of Eq. 11 answers inside the alignments of the ensemble it was fitted to, and nowhere else."""
        if not (models := [model.name for model in self.tissue.models if model.constants == "surface"]):
            return
        if self.specimen == "file":
            sorted_H = [sorted(H) for H in plan.fiber_eigenvalues(self.plain())]
            path, extremes = "specimen_files.fibers", [(H[0], H[-1]) for H in sorted_H]
        else:
            (least, largest), shares = self.synthetic_specimen.H11, self.synthetic_specimen.in_plane_share
            across = (1 - largest) * min(shares[0], 1 - shares[1])
            path, extremes = "synthetic_specimen.H11", [(across, least), (across, largest)]
        least, largest = self.delaunay.H11
        for smallest_H, H11 in extremes:
            if not least <= H11 <= largest or smallest_H < self.delaunay.smallest_H:
                yield (
                    f"{path} reaches {H11:.3g}, with a smallest eigenvalue of H of {smallest_H:.3g}, beyond "
                    "delaunay.H11 or delaunay.smallest_H, where the surface of Eq. 11 says nothing: widen them, or "
                    f"leave {', '.join(models)} out of tissue.models"
                )
                return

    def plain(self) -> dict[str, Any]:
        """Dictionaries and lists, with the keys that were given."""
        return self.model_dump(exclude_unset=True)


def _unknown(path: str, names: list[str], known: Collection[str]) -> Iterator[str]:
    for name in names:
        if name not in known:
            yield f"{path} is {name}, must be one of {', '.join(known) or '(none)'}"


def _missing_file(path: str, file: str) -> Iterator[str]:
    if not Path(file).is_file():
        yield f"{path} is {file}, no such file seen from {Path.cwd()}"
