"""The problem for FEBio: a reader of its own finds the mesh, constants, directions, motion and units that went in."""

import numpy as np
import pytest
from feb_reader import Feb

from fibrous.fe.mesh import Mesh
from fibrous.fe.solver import LoadStepper
from fibrous.io.febio import feb
from fibrous.materials.contract import Material, MaterialError, Mixture
from fibrous.materials.hgo import HGOFamilies
from fibrous.materials.neo_hookean import NeoHookean
from fibrous.materials.registry import LAWS, WITH_CONSTANTS
from fibrous.specimen import Slab, Specimen

C1, LAME_LAMBDA = 0.025, 0.417
STEPS = 3


@pytest.fixture(scope="module")
def problem() -> tuple[Specimen, np.ndarray, np.ndarray, Feb]:
    specimen = Slab(elements=(3, 4, 2)).specimen(STEPS)
    elements = len(specimen.mesh.element_nodes)
    C2, C3 = np.linspace(0.1, 0.3, elements), np.linspace(0.0, 1.0, elements)
    return specimen, C2, C3, Feb(feb(specimen, material(specimen, C2, C3)))


def material(specimen: Specimen, C2: np.ndarray, C3: np.ndarray, tension_only: bool = True) -> Material:
    fibers = HGOFamilies.of_structure_tensor(specimen.structure_tensor[:, None], C2[:, None], C3[:, None], tension_only)
    return NeoHookean(C1, LAME_LAMBDA) + fibers


def test_the_file_is_of_format_4_for_solids_in_mm_n_and_s(problem):
    root = problem[-1].root
    assert root.tag == "febio_spec"
    assert root.get("version") == "4.0"
    assert root[0].tag == "Module"
    assert root[0].get("type") == "solid"
    assert root.find("Module/units").text == "mm-N-s"  # N/mm² is MPa
    sections = [section.tag for section in root]
    assert sections == [
        "Module",
        "Control",
        "Material",
        "Mesh",
        "MeshDomains",
        "MeshData",
        "Boundary",
        "LoadData",
        "Output",
    ]


def test_mesh_and_nodes_are_those_of_the_specimen(problem):
    specimen, _, _, found = problem
    assert found.element_type == "hex8"
    assert list(found.place) == [str(number) for number in range(1, len(found.place) + 1)]
    np.testing.assert_array_equal(found.node_position, specimen.mesh.node_position)
    np.testing.assert_array_equal(found.element_nodes, specimen.mesh.element_nodes)


def test_the_matrix_is_the_neo_hookean_solid(problem):
    found = problem[-1]
    assert found.material.get("type") == "solid mixture"
    (matrix,) = [solid for solid in found.material.findall("solid") if solid.get("type") == "coupled Mooney-Rivlin"]
    values = {parameter.tag: float(parameter.text) for parameter in matrix}
    assert values == {"c1": C1, "c2": 0.0, "k": LAME_LAMBDA}
    assert len(found.material) == 4


def test_families_have_the_energy_of_eq_10c(problem, rng):
    # FEBio's manual: Ψ = ξ/(α β) (exp(α (I − 1)^β) − 1) for I > 1, ξ/β (I − 1)^β for α = 0.
    specimen, C2, C3, found = problem
    F = np.eye(3) + 0.3 * rng.normal(size=(len(C2), 3, 3))
    energy = np.zeros(len(C2))
    for ksi, alpha, beta, direction in found.families():
        excess = np.maximum((np.einsum("eiJ,eJ->ei", F, direction) ** 2).sum(axis=1) - 1.0, 0.0) ** beta
        scaled = np.where(alpha > 0.0, np.expm1(alpha * excess) / np.where(alpha > 0.0, alpha, 1.0), excess)
        energy += ksi / beta * scaled
    ours = HGOFamilies.of_structure_tensor(specimen.structure_tensor[:, None], C2[:, None], C3[:, None])
    np.testing.assert_allclose(energy, ours.energy(F[:, None])[:, 0], rtol=1e-10)
    total = sum(ksi[:, None, None] * n[:, :, None] * n[:, None, :] for ksi, _, _, n in found.families())
    np.testing.assert_allclose(total, C2[:, None, None] * specimen.structure_tensor, atol=1e-14)
    first, second, third = (family[0] for family in found.families())
    assert ((first > second) & (second > third)).all()


def test_prescribed_displacements_are_those_of_every_step(problem):
    specimen, _, _, found = problem
    assert float(found.root.find("Control/time_steps").text) == STEPS
    prescribed = found.prescribed(STEPS)
    full = np.full_like(specimen.prescribed_displacement, np.nan)
    full[:, prescribed.nodes, prescribed.axes] = prescribed.values
    np.testing.assert_array_equal(full, specimen.prescribed_displacement)


def test_the_log_has_displacements_and_reactions_of_all_nodes(problem):
    log = problem[-1].root.find("Output/logfile/node_data")
    assert log.get("data") == "ux;uy;uz;Rx;Ry;Rz"
    assert log.text is None, "no list of nodes means all of them"


def test_what_is_read_back_has_the_same_solution(problem):
    specimen, C2, C3, found = problem

    def solution(mesh, families, prescribed):
        material = Mixture((NeoHookean(C1, LAME_LAMBDA), families))
        return LoadStepper.of(mesh, material, prescribed, tolerance=1e-12).follow(prescribed.values).displacement

    ours = HGOFamilies.of_structure_tensor(specimen.structure_tensor[:, None], C2[:, None], C3[:, None])
    read = found.families()
    ksi, directions = np.stack([one[0] for one in read], axis=-1), np.stack([one[3] for one in read], axis=-2)
    theirs = HGOFamilies(1.0, read[0][1][:, None], ksi[:, None], directions[:, None])
    np.testing.assert_allclose(
        solution(Mesh(found.node_position, found.element_nodes), theirs, found.prescribed(STEPS)),
        solution(specimen.mesh, ours, specimen.prescribed),
        atol=1e-10,
    )


def test_any_origin_makes_a_file_that_can_be_read(problem):
    specimen, C2, C3, _ = problem
    parts = {name: getattr(specimen, name) for name in Specimen.__dataclass_fields__}
    odd = Specimen(**parts | {"origin": "mesh of a--b---c<&>.vtu-"})
    content = feb(odd, material(specimen, C2, C3))
    assert len(Feb(content).element_nodes) == len(C2)
    assert "synthetic specimen; mm, N, MPa" in feb(specimen, material(specimen, C2, C3)).decode()


def test_what_febio_does_not_have_is_refused_and_the_registry_knows_it(problem):
    specimen, C2, C3, _ = problem
    H = specimen.structure_tensor[:, None]
    for name in WITH_CONSTANTS:
        law = LAWS[name].material.of_structure_tensor(H, C2[:, None], C3[:, None])
        if LAWS[name].in_febio:
            assert feb(specimen, NeoHookean(C1, LAME_LAMBDA) + law)
        else:
            with pytest.raises(MaterialError, match="FEBio has no"):
                feb(specimen, NeoHookean(C1, LAME_LAMBDA) + law)
    with pytest.raises(MaterialError, match="in tension alone"):
        feb(specimen, material(specimen, C2, C3, tension_only=False))
