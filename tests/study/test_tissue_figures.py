"""Figure 8 and the specimen draw what their data files hold; surfaces of meshes by geometry."""

from itertools import combinations

import numpy as np
import pandas as pd
import pytest
import synthetic
import synthetic_tissue
import tissues
from matplotlib.cm import ScalarMappable
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import Normalize
from scipy.spatial.transform import Rotation

from fibrous.errors import DatasetError
from fibrous.fe.mesh import box
from fibrous.specimen import Slab
from fibrous_study.datasets import read, write
from fibrous_study.figures import deformed, figure_8, style
from fibrous_study.figures import figure_specimen as specimen
from fibrous_study.figures.projection import XY_VIEW
from fibrous_study.figures.surface_of_mesh import Surface, draw_directions, draw_surface

RUNS = list(synthetic_tissue.RUNS)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return synthetic_tissue.write_study(tmp_path_factory.mktemp("tissue"))


@pytest.fixture(scope="module")
def stresses(study):
    return pd.read_csv(study["stresses"]).fillna("")


@pytest.fixture(scope="module")
def figure(stresses):
    return figure_8.draw(stresses)


@pytest.fixture(scope="module")
def runs(study):
    body = read(study["specimen"], "specimen")
    return body, [deformed.last_step(study[name], body) for name in RUNS]


def axes_of(figure, letter):
    return next(axes for axes in figure.axes if letter in [text.get_text() for text in axes.texts])


def panels(figure):
    """The axes of Figure 8 by letter and row: they are made row by row, a before b."""
    return {(letter, row): figure.axes[2 * row + column] for row in range(4) for column, letter in enumerate("ab")}


def test_figure_8_draws_the_stresses_of_its_panel_in_kPa(figure, stresses):
    shown = {"a": [("network", ""), ("hgo", "initial"), ("stress", "initial"), ("affine", "")]}
    shown["b"] = [("network", ""), ("hgo", "refit"), ("affine", "")]
    for (letter, row), axes in panels(figure).items():
        component = ("xx", "yy", "zz", "xz")[row]
        assert len(axes.lines) == len(shown[letter])
        for line, (model, constants) in zip(axes.lines, shown[letter], strict=True):
            own = stresses[(stresses["model"] == model) & (stresses["constants"] == constants)]
            np.testing.assert_allclose(line.get_xdata(), own["magnitude"])
            np.testing.assert_allclose(line.get_ydata(), 1e3 * own[f"sigma_{component}_MPa"], rtol=1e-12)


def test_figure_8_writes_what_it_draws(study, stresses, tmp_path):
    outputs = {"png": tmp_path / "8.png", "svg": tmp_path / "8.svg", "data": tmp_path / "8.csv"}
    figure_8.run({"stresses": [study["stresses"]]}, outputs, synthetic.params(8))
    data = pd.read_csv(outputs["data"]).fillna("")
    assert len(data) == 4 * 6 * (4 + 3)
    for (model, constants, component), own in data[data["panel"] == "b"].groupby(["model", "constants", "component"]):
        wanted = stresses[(stresses["model"] == model) & (stresses["constants"] == constants)]
        np.testing.assert_array_equal(own["stress_MPa"], wanted[f"sigma_{component}_MPa"])


def test_figure_8_shows_the_largest_shear_of_the_network(stresses):
    assert figure_8.largest_shear(stresses) == "xz"
    turned = stresses.rename(columns={"sigma_xz_MPa": "sigma_yz_MPa", "sigma_yz_MPa": "sigma_xz_MPa"})
    assert figure_8.largest_shear(turned) == "yz"


def test_figure_8_has_one_scale_for_both_panels_and_a_legend_of_what_it_draws(figure):
    axes = panels(figure)
    for row in range(4):
        assert axes["a", row].get_ylim() == axes["b", row].get_ylim()
    colors = [line.get_color() for line in axes["a", 0].lines[1:]]
    assert [line.get_color() for line in figure.legends[0].get_lines()[1:]] == colors
    assert len(set(colors)) == 3


def test_the_surface_of_a_mesh_closes_and_looks_outward():
    for mesh, lengths in (
        (box((2, 3, 4), (1.0, 2.0, 0.5)), (1.0, 2.0, 0.5)),
        (tissues.distorted_box(3), (1.0, 1.0, 1.0)),
    ):
        surface = Surface.of(mesh.element_nodes)
        normals = surface.normals(mesh.node_position)
        np.testing.assert_allclose(normals.sum(axis=0), 0.0, atol=1e-14)
        # The divergence theorem: ∮ x · n = 3 V, and the areas of the sides.
        middles = mesh.node_position[surface.face_nodes].mean(axis=1)
        assert (normals * middles).sum() == pytest.approx(3.0 * np.prod(lengths))
        area = 2.0 * sum(np.prod(lengths) / length for length in lengths)
        assert np.linalg.norm(normals, axis=1).sum() == pytest.approx(area)
    assert len(Surface.of(box((2, 3, 4)).element_nodes).face_nodes) == 2 * (6 + 12 + 8)


def test_faces_belong_to_their_elements():
    mesh = box((2, 3, 4))
    surface = Surface.of(mesh.element_nodes)
    for face, element in zip(surface.face_nodes, surface.face_element, strict=True):
        assert set(face) <= set(mesh.element_nodes[element])


@pytest.mark.parametrize("mesh", [box((2, 3, 4)), Slab(elements=(2, 3, 4)).mesh], ids=["box", "bent slab"])
def test_a_body_is_sharp_along_its_twelve_edges(mesh):
    turned = mesh.node_position @ Rotation.from_euler("xyz", [20.0, 50.0, 70.0], degrees=True).as_matrix().T
    edges = Surface.of(mesh.element_nodes).sharp_edges(turned)
    # Both bodies have the node numbers of a box, in which such an edge leaves two coordinates at an end.
    size = np.array([2.0, 3.0, 4.0])
    flat = box((2, 3, 4), size).node_position
    expected = set()
    for a, b in combinations(range(len(flat)), 2):
        along = flat[a] != flat[b]
        at_an_end = (flat[a] == 0.0) | (flat[a] == size)
        if np.abs(flat[a] - flat[b]).sum() == 1.0 and at_an_end[~along].all():
            expected.add((a, b))
    assert {tuple(edge) for edge in edges} == expected
    assert len(edges) == 4 * (2 + 3 + 4)


def test_only_faces_towards_the_reader_are_drawn_the_nearest_last():
    mesh = box((1, 1, 1))
    position = np.vstack([mesh.node_position + np.array([0.0, 0.0, 5.0]), mesh.node_position])
    surface = Surface.of(np.vstack([mesh.element_nodes, mesh.element_nodes + 8]))
    axes = style.new_figure(50, 50).add_subplot()
    colors = ScalarMappable(Normalize(0.0, 1.0), "viridis")
    faces = draw_surface(axes, XY_VIEW, surface, position, np.array([1.0, 0.0]), colors)
    # Seen along −z: the top of each cube, the lower one first.
    np.testing.assert_allclose(faces.get_facecolors(), colors.to_rgba([0.0, 1.0]))
    for path in faces.get_paths():
        assert {tuple(point) for point in path.vertices} == {(0.0, 0.0), (1.0, 0.0), (1.0, 1.0), (0.0, 1.0)}
    assert faces.get_rasterized()


def test_directions_lie_on_the_faces_of_their_elements():
    mesh = box((2, 1, 1))
    axes = style.new_figure(50, 50).add_subplot()
    surface = Surface.of(mesh.element_nodes)
    directions = np.array([[0.6, 0.8, 0.0], [0.0, 0.0, 1.0]])
    lines = draw_directions(axes, XY_VIEW, surface, mesh.node_position, directions, width=0.5)
    # The second element's fibres leave the face that the reader sees at a right angle.
    ((start, end),) = lines.get_segments()
    np.testing.assert_allclose(0.5 * (start + end), [0.25, 0.5])
    np.testing.assert_allclose((end - start) / np.linalg.norm(end - start), [0.6, 0.8])
    assert np.linalg.norm(end - start) == pytest.approx(0.7 * np.sqrt(0.5))


def test_a_scale_holds_all_panels_but_for_the_largest_hundredth_and_knows_gaps():
    scale = deformed.field_scale([np.linspace(0.0, 1.0, 101), np.array([np.nan])])
    assert (scale.vmin, scale.vmax) == (0.0, 0.99)


def test_specimen_table_holds_means_over_gauss_points_at_the_last_step(runs, study):
    body, drawn = runs
    table = specimen.element_table(body, drawn)
    largest = [np.linalg.svd(H, compute_uv=False)[0] for H in body["structure_tensor"].values]
    np.testing.assert_allclose(table["H_largest"], largest, rtol=1e-12)
    for name in RUNS:
        last = read(study[name], "tissue").isel(step=-1)
        F, stress = last["deformation_gradient"].values, last["cauchy_stress"].values
        stretch = np.linalg.svd(F, compute_uv=False)[..., 0].mean(axis=1)
        np.testing.assert_allclose(table[f"{name}_largest_principal_stretch"], stretch, rtol=1e-12)
        # Tresca's: the largest of the differences of the roots of the characteristic polynomial, halved.
        roots = np.array([[np.roots(np.poly(one)).real for one in element] for element in stress])
        shear = 0.5 * np.ptp(roots, axis=-1).mean(axis=1)
        np.testing.assert_allclose(table[f"{name}_maximum_shear_stress_MPa"], shear, rtol=1e-6)
        np.testing.assert_array_equal(table[f"{name}_C2_MPa"], last["C2"])
        np.testing.assert_array_equal(table[f"{name}_C3"], last["C3"])


def test_specimen_draws_rest_and_last_step_in_common_colors(runs, study):
    body, drawn = runs
    figure = specimen.draw(body, drawn)
    surface = Surface.of(body["element_nodes"].values)
    rest = body["node_position"].values
    for row, name in enumerate(RUNS, start=1):
        moved = rest + read(study[name], "tissue")["displacement"].values[-1]
        for letter, position in (("b", rest), ("c", rest), ("d", moved)):
            (faces,) = axes_of(figure, f"{letter}{row}").findobj(PolyCollection)
            points, depth = deformed.CAMERA.project(position[surface.face_nodes])
            seen = np.flatnonzero(surface.normals(position) @ deformed.CAMERA.frame[2] > 0.0)
            order = seen[np.argsort(depth[seen].mean(axis=1))]
            found = np.array([path.vertices[:4] for path in faces.get_paths()])
            np.testing.assert_allclose(found, points[order], atol=1e-12)
            column, _ = specimen.FIELDS[letter]
            together = np.sort(np.concatenate([one.elements[column] for one in drawn]))
            scale = Normalize(together[0], np.percentile(together, 99.0))
            values = drawn[row - 1].elements[column][surface.face_element[order]]
            expected = ScalarMappable(scale, "viridis").to_rgba(values)
            np.testing.assert_allclose(faces.get_facecolors(), expected)


def test_specimen_shows_its_edges_at_rest_and_its_bones(runs):
    body, drawn = runs
    figure = specimen.draw(body, drawn)
    outlines = axes_of(figure, "d1").findobj(LineCollection)
    edges = Surface.of(body["element_nodes"].values).sharp_edges(body["node_position"].values)
    before, _ = deformed.CAMERA.project(body["node_position"].values[edges])
    np.testing.assert_allclose(np.array(max(outlines, key=lambda one: one.get_zorder()).get_segments()), before)
    texts = {text.get_text(): text for text in axes_of(figure, "a").texts}
    assert texts["fixed\nbone"].xy[0] < texts["moved\nbone"].xy[0]


def test_a_law_without_constants_has_no_panels_of_them(study, tmp_path):
    body, tissue = read(study["specimen"], "specimen"), read(study["hgo"], "tissue")
    tissue["C2"][:], tissue["C3"][:] = np.nan, np.nan
    write(tissue, tmp_path / "matrix.nc", "tissue", synthetic.params(0))
    matrix = deformed.last_step(tmp_path / "matrix.nc", body)
    assert specimen.element_table(body, [matrix])["matrix_C2_MPa"].isna().all()
    letters = [text.get_text() for axes in specimen.draw(body, [matrix]).axes for text in axes.texts]
    assert "d1" in letters
    assert not {"b1", "c1"} & set(letters)


def test_a_run_of_another_specimen_is_refused(study, tmp_path):
    tissue = read(study["hgo"], "tissue").isel(element=slice(1, None))
    write(tissue, tmp_path / "other.nc", "tissue", synthetic.params(0))
    with pytest.raises(DatasetError, match=r"other\.nc: has 39 elements where the specimen has 40"):
        deformed.last_step(tmp_path / "other.nc", read(study["specimen"], "specimen"))
