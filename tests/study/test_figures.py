"""Figures draw what their data files hold, mark what is no equilibrium, and come out the same to the byte."""

import base64
import io
import json
import os
import re
import subprocess
import sys
import xml.etree.ElementTree as ElementTree
from functools import cache
from importlib import import_module

import matplotlib
import numpy as np
import pandas as pd
import pytest
import synthetic
import synthetic_tissue
from matplotlib.collections import LineCollection
from matplotlib.colors import to_rgb
from PIL import Image

from fibrous.errors import DatasetError
from fibrous.fitting.surface import TERMS
from fibrous_study.datasets import read, write
from fibrous_study.figures import style
from fibrous_study.figures.curves import curve_table, pooled_fits, stacked
from fibrous_study.figures.projection import CUBE_VIEW, XY_VIEW, XZ_VIEW, Camera, draw_fibers, draw_outline, fit_view
from fibrous_study.paper import section

PROTOCOLS = list(synthetic.PROTOCOLS)
FIGURE_6_NETWORKS = list(synthetic.NAMED)[1:]
DATA = dict.fromkeys((3, 5, 6, 7, 8, "specimen"), ("data",)) | {6: ("curves", "constants", "surface")}


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("study")
    return synthetic.write_study(folder) | synthetic_tissue.write_study(folder)


def inputs_of(number, study):
    if number == 8:
        return {"stresses": [study["stresses"]]}
    if number == "specimen":
        return {"specimen": [study["specimen"]], "tissue": [study["hgo"], study["hgo_refit"]]}
    each = {kind: [study[f"{kind}_{protocol}"] for protocol in PROTOCOLS] for kind in ("states", "curves", "fits")}
    if number == 6:
        fits = [study["fits_large"], study["fits_delaunay"]]
        return {
            "networks": [study["networks"]],
            "curves": [study["curves_large"]],
            "fits": fits,
            "surface": [study["surface"]],
        }
    return {name: each[name] for name in {3: ("states", "curves"), 5: ("curves", "fits"), 7: ()}[number]}


def config_of(number):
    case = {"network": "case", "protocols": PROTOCOLS}
    survey = {"networks": FIGURE_6_NETWORKS, "protocol": "large"}
    load_sets = {"load_sets": synthetic.LOAD_SETS}
    paper = {"paper": section("figure_7")}
    return {3: case, 5: {**case, **load_sets}, 6: {**survey, **load_sets}, 7: paper}.get(number, {})


def run(number, study, folder):
    outputs = {name: folder / f"{number}_{name}.csv" for name in DATA[number]}
    outputs |= {kind: folder / f"{number}.{kind}" for kind in ("png", "svg")}
    params = synthetic.params(number, **config_of(number))
    import_module(params["stage"]).run(inputs_of(number, study), outputs, params)
    return outputs


@pytest.fixture(scope="module")
def files(study, tmp_path_factory):
    """The files of a figure by its number, written when first asked for."""
    return cache(lambda number: run(number, study, tmp_path_factory.mktemp(f"figure_{number}")))


@pytest.fixture(scope="module")
def figure(study):
    """A figure itself by its number, drawn when first asked for."""
    return cache(lambda number: draw(number, study))


NUMBERS = pytest.mark.parametrize("number", DATA)


@NUMBERS
def test_two_runs_give_the_same_bytes(number, files, study, tmp_path):
    second = run(number, study, tmp_path)
    for name, path in files(number).items():
        assert path.read_bytes() == second[name].read_bytes(), name


@NUMBERS
def test_png_has_print_size_resolution_and_provenance(number, files):
    with Image.open(files(number)["png"]) as image:
        image.load()
        assert image.width == int((89 if number == 8 else 183) / 25.4 * 300)
        assert image.info["dpi"] == pytest.approx((300, 300), abs=0.1)
        provenance = json.loads(image.text["fibrous"])
        assert np.asarray(image.convert("L")).std() > 10.0
    assert provenance["stage"] == synthetic.params(number)["stage"]
    assert json.loads(provenance["config"]) == config_of(number)
    assert provenance["code_hash"] == "0" * 16


@NUMBERS
def test_svg_parses_and_holds_no_date(number, files):
    text = files(number)["svg"].read_text(encoding="utf-8")
    root = ElementTree.fromstring(text)
    assert root.tag.endswith("svg")
    assert not re.search(r"<dc:date|\b20\d\d-\d\d-\d\d", text)
    described = root.find(".//{http://purl.org/dc/elements/1.1/}description")
    assert json.loads(described.text)["stage"] == synthetic.params(number)["stage"]


@NUMBERS
def test_text_is_large_enough_in_print_and_inside_the_figure(number, figure):
    figure = figure(number)
    renderer = figure.canvas.get_renderer()
    width, height = figure.bbox.width, figure.bbox.height
    for text in figure.findobj(matplotlib.text.Text):
        if text.get_text() and text.get_visible():
            assert text.get_fontsize() >= 6.0, text
    for text in visible_texts(figure):
        box = text.get_window_extent(renderer)
        assert min(box.x0, box.y0) >= 0.0, text
        assert max(box.x1 - width, box.y1 - height) <= 0.0, text


def visible_texts(figure):
    """Texts of axes and figure without the tick labels, which matplotlib keeps outside the view, too."""
    texts = list(figure.texts)
    for axes in figure.axes:
        texts += [axes.title, *axes.texts]
        texts += [axes.xaxis.label, axes.yaxis.label] if axes.axison else []
        texts += axes.get_legend().get_texts() if axes.get_legend() else []
    return [text for text in texts if text.get_text()]


def draw(number, study):
    """The figure itself, from the same inputs as `run`."""
    params, inputs = synthetic.params(number, **config_of(number)), inputs_of(number, study)
    kept = []
    module = import_module(params["stage"])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module.style, "save", lambda figure, *_: kept.append(figure))
        patch.setattr(module, "write_table", lambda *_: None)
        module.run(inputs, dict.fromkeys((*DATA[number], "png", "svg")), params)
    kept[0].canvas.draw()
    return kept[0]


def axes_of(figure, letter):
    """The axes that carry the panel letter."""
    return next(axes for axes in figure.axes if letter in [text.get_text() for text in axes.texts])


def lines(axes):
    return [line for line in axes.lines if len(line.get_xdata()) > 2]


def test_figure_3_draws_the_eigenvalues_of_its_data(files, figure):
    table = pd.read_csv(files(3)["data"])
    figure = figure(3)
    for letter, protocol in zip("cd", PROTOCOLS, strict=True):
        own = table[(table["protocol"] == protocol) & table["converged"]]
        for line, load in zip(lines(axes_of(figure, letter)), synthetic.LOADS, strict=True):
            states = own[own["deformation"] == load]
            np.testing.assert_allclose(line.get_xdata(), states["averaged_stretch"], rtol=1e-12)
            np.testing.assert_allclose(line.get_ydata(), states["largest_orientation_eigenvalue"], rtol=1e-12)


def test_figure_3_marks_ends_that_are_not_the_target(figure):
    figure = figure(3)
    markers = [line for line in axes_of(figure, "c").lines if len(line.get_xdata()) == 1]
    ends = dict(zip(synthetic.LOADS, markers, strict=True))
    assert ends[synthetic.LOST_LOAD].get_marker() == "x"
    assert ends["yz_shear"].get_markerfacecolor() == "white"
    assert ends["x_uniaxial"].get_markerfacecolor() == "#000000"


def test_figure_3_draws_every_fiber_of_the_last_equilibrium(figure, study):
    figure, states = figure(3), read(study["states_large"], "states")
    for column, load in enumerate(synthetic.LOADS, start=1):
        step = -2 if load == synthetic.LOST_LOAD else -1
        state = states.sel(deformation=load).isel(step=step)
        (fibers,) = axes_of(figure, f"a{column}").findobj(LineCollection)
        ends, depth = CUBE_VIEW.project(state["node_position"].values[states["fiber_nodes"].values])
        order = np.argsort(depth.mean(axis=1))
        np.testing.assert_allclose(np.array(fibers.get_segments()), ends[order], atol=1e-12)
        assert fibers.get_rasterized()


def test_figure_5_draws_states_and_fits_of_its_data(files, figure):
    table = pd.read_csv(files(5)["data"])
    figure = figure(5)
    for letter, protocol in zip("ab", PROTOCOLS, strict=True):
        own = table[(table["protocol"] == protocol) & (table["converged"].fillna(True) == True)]  # noqa: E712
        axes = axes_of(figure, letter)
        scale = 1e3 if "kPa" in axes.get_ylabel() else 1.0
        wanted = [own[own["series"] == series] for series in own["series"].unique()]
        assert len(lines(axes)) == len(wanted) == len(synthetic.LOADS) + len(synthetic.LOAD_SETS)
        for line, series in zip(lines(axes), wanted, strict=True):
            np.testing.assert_allclose(line.get_xdata(), series["averaged_stretch"], rtol=1e-12)
            np.testing.assert_allclose(line.get_ydata(), scale * series["strain_energy_density_MPa"], rtol=1e-12)


def test_figure_5_draws_eq_2_with_the_constants_in_its_legend(files, figure, study):
    table = pd.read_csv(files(5)["data"])
    figure = figure(5)
    fits = pd.read_csv(study["fits_large"])
    fits = fits[(fits["name"] == "case") & (fits["deformation"] == "all")]
    fits = fits[(fits["energy"] == "structure_tensor") & (fits["objective"] == "energy")]
    legend = " ".join(text.get_text() for text in axes_of(figure, "a").get_legend().texts)
    for fit in fits.itertuples():
        own = table[(table["protocol"] == "large") & (table["series"] == fit.load_set)]
        excess = own["averaged_stretch"].to_numpy() ** 2 - 1.0
        energy = fit.C2_MPa / (2.0 * fit.C3) * (np.exp(fit.C3 * excess**2) - 1.0)
        np.testing.assert_allclose(own["strain_energy_density_MPa"], energy, rtol=1e-9, atol=1e-15)
        assert f"$C_2$ = {fit.C2_MPa:.3g} MPa" in legend
        assert f"$C_3$ = {fit.C3:.3g}" in legend
    titles = [axes_of(figure, letter).get_legend().get_title().get_text() for letter in "ab"]
    assert titles[0].startswith("112 % Green strain in x-uniaxial")
    assert titles[1].startswith("10 % Green strain in x-uniaxial")


@pytest.fixture(scope="module")
def own_load(study, tmp_path_factory):
    """The study whose first load has another name, as one with its own deformation gradient."""
    folder, changed = tmp_path_factory.mktemp("own_load"), dict(study)
    for kind in ("states", "curves"):
        for protocol in PROTOCOLS:
            dataset = read(study[f"{kind}_{protocol}"], kind)
            dataset = dataset.assign_coords(deformation=["mine", *synthetic.LOADS[1:]])
            if kind == "curves":
                dataset["magnitude"][:, 0] = np.linspace(0.0, 1.0, dataset.sizes["step"])
            changed[f"{kind}_{protocol}"] = folder / f"{kind}_{protocol}.nc"
            write(dataset, changed[f"{kind}_{protocol}"], kind, synthetic.params(0))
    return changed


@pytest.fixture
def own_load_sets(monkeypatch):
    sets = [{**one, "loads": ["mine", *one["loads"][1:]]} for one in synthetic.LOAD_SETS]
    monkeypatch.setattr(synthetic, "LOAD_SETS", sets)


@pytest.mark.usefixtures("own_load_sets")
def test_a_load_with_its_own_gradient_is_drawn_and_its_range_is_that_of_its_gradient(own_load, figure):
    titles = [axes_of(draw(3, own_load), letter).get_title() for letter in ("a1", "b1", "a2")]
    assert titles[:2] == ["mine\nat 100%"] * 2
    assert titles[2] == axes_of(figure(3), "a2").get_title()
    drawn = draw(5, own_load)
    said = [axes_of(drawn, letter).get_legend().get_title().get_text() for letter in "ab"]
    assert [one.partition(",")[0] for one in said] == [f"{size} % Green strain in mine" for size in (112, 10)]
    assert any("112 % Green strain in mine" in text.get_text() for text in draw(6, own_load).texts)


def test_a_load_has_the_look_of_the_legend_in_every_panel(study, tmp_path):
    """Where one protocol lacks a load of the other, too."""
    changed, others = dict(study), list(synthetic.LOADS[:1] + synthetic.LOADS[2:])
    for kind in ("states", "curves"):
        changed[f"{kind}_small"] = tmp_path / f"{kind}.nc"
        dataset = read(study[f"{kind}_small"], kind).sel(deformation=others)
        write(dataset, changed[f"{kind}_small"], kind, synthetic.params(0))
    for number, letter in ((3, "d"), (5, "b")):
        drawn = draw(number, changed)
        legends = [*drawn.legends, *filter(None, (axes.get_legend() for axes in drawn.axes))]
        keys = [
            (text.get_text(), line) for one in legends for text, line in zip(one.texts, one.get_lines(), strict=False)
        ]
        shown = dict(keys)
        colors = [shown[style.load_label(load)].get_color() for load in others]
        assert [line.get_color() for line in lines(axes_of(drawn, letter))][: len(others)] == colors


def test_no_two_loads_look_alike():
    assert len({tuple(style.load_style(number).values()) for number in range(14)}) == 14


def test_figure_6_draws_the_curves_of_the_default_load_set(files, figure):
    table = pd.read_csv(files(6)["curves"])
    figure = figure(6)
    loads = synthetic.LOAD_SETS[0]["loads"]
    assert set(table.loc[table["kind"] == "network", "series"]) == set(loads)
    for column, name in enumerate(FIGURE_6_NETWORKS, start=1):
        axes, own = axes_of(figure, f"c{column}"), table[table["name"] == name]
        scale = 1e3 if "kPa" in axes.get_ylabel() else 1.0
        for line, series in zip(lines(axes), [*loads, "section_3_1"], strict=True):
            drawn_states = own[own["series"] == series]
            np.testing.assert_allclose(line.get_xdata(), drawn_states["averaged_stretch"], rtol=1e-12)
            np.testing.assert_allclose(line.get_ydata(), scale * drawn_states["strain_energy_density_MPa"], rtol=1e-12)


def test_figure_6_surface_is_eq_11_over_the_fitted_range(files, study):
    outputs = files(6)
    surface, constants = pd.read_csv(outputs["surface"]), pd.read_csv(outputs["constants"])
    H11, H22 = surface["H11"].to_numpy(), surface["H22"].to_numpy()
    for column, coefficient in (("C2_MPa", synthetic.C2_COEFFICIENT), ("C3", synthetic.C3_COEFFICIENT)):
        polynomial = sum(c * H11**i * H22**j for c, (i, j) in zip(coefficient, TERMS, strict=True))
        np.testing.assert_allclose(surface[column], polynomial, rtol=1e-12, atol=1e-14)
    assert (H11.min(), H11.max(), H22.min()) == pytest.approx((0.33, 0.80, 0.05))
    assert (1.0 - H11 - H22).min() == pytest.approx(0.05)
    fits = pd.read_csv(study["fits_delaunay"])
    fits = fits[(fits["load_set"] == "section_3_1") & (fits["deformation"] == "all")]
    fits = fits[(fits["energy"] == "structure_tensor") & (fits["objective"] == "energy")]
    np.testing.assert_array_equal(constants[["C2_MPa", "C3"]], fits[["C2_MPa", "C3"]])


def test_figure_6_places_the_numbers_at_the_networks_alignments(figure):
    figure = figure(6)
    for letter in "defg":
        placed = {text.get_text(): text.get_position() for text in axes_of(figure, letter).texts}
        for number, name in enumerate(FIGURE_6_NETWORKS, start=1):
            assert placed[str(number)] == pytest.approx(synthetic.NAMED[name])


def test_figure_6_draws_each_network_as_it_stands(figure, study):
    figure, networks = figure(6), read(study["networks"], "networks")
    nodes = np.split(networks["node_position"].values, np.cumsum(networks["node_count"].values)[:-1])
    fibers = np.split(networks["fiber_nodes"].values, np.cumsum(networks["fiber_count"].values)[:-1])
    for column in range(1, 6):
        for letter, axes_shown, towards in (("a", [0, 1], 2), ("b", [0, 2], 1)):
            (drawn_fibers,) = axes_of(figure, f"{letter}{column}").findobj(LineCollection)
            wanted = nodes[column][fibers[column]]
            depth = wanted[:, :, towards].mean(axis=1) * (1 if letter == "a" else -1)
            segments = np.array(drawn_fibers.get_segments())
            np.testing.assert_allclose(segments, wanted[np.argsort(depth, kind="stable")][:, :, axes_shown], atol=1e-12)


def test_figure_7_prints_the_numbers_of_its_data_beside_the_papers(files, figure):
    table = pd.read_csv(files(7)["data"]).set_index(["panel", "quantity"])
    described = table[table["paper_describes"].isin(["equilibrium", "affine"])]
    for (panel, quantity), row in described.iterrows():
        decimals = {"theta_deg": 1, "stretch_1": 2, "stretch_2": 2}.get(quantity, 3)
        assert round(row[row["paper_describes"]], decimals) == pytest.approx(round(row["paper"], decimals)), panel
    shown = {text.get_text() for axes in figure(7).axes for text in axes.texts}
    assert {"0.439", "0.456", "47.0", "0.900", "1.284", "1.023", "1.222", "0.433", "1.297"} <= shown


@pytest.mark.parametrize("camera", [XY_VIEW, XZ_VIEW, CUBE_VIEW, Camera.looking_from(10.0, 80.0)])
def test_cameras_turn_space_without_mirroring_it(camera):
    np.testing.assert_allclose(camera.frame @ camera.frame.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(camera.frame) == pytest.approx(1.0)
    assert camera.frame[1, 2] >= 0.0  # z is never drawn downwards


def test_nearer_fibers_cover_farther_ones():
    axes = style.new_figure(50, 50).add_subplot()
    ends = np.array([[[0, 0, z], [1, 0, z]] for z in (0.3, -0.4, 0.1)], dtype=float)
    colors = np.array([to_rgb(name) for name in ("red", "lime", "blue")])
    drawn_fibers = draw_fibers(axes, XY_VIEW, ends, colors, width=1.0, fade=0.5)
    farthest, middle, nearest = drawn_fibers.get_colors()[:, :3]
    np.testing.assert_allclose(nearest, to_rgb("red"))
    np.testing.assert_allclose(farthest, 0.5 + 0.5 * np.array(to_rgb("lime")))
    assert middle[2] == 1.0


def test_outline_hides_the_three_edges_at_the_far_corner():
    axes = style.new_figure(50, 50).add_subplot()
    gradient = np.eye(3)
    gradient[2, 0] = 0.7
    camera = Camera.looking_from(-62.0, 22.0)
    corners = draw_outline(axes, camera, gradient)
    hidden = [line for line in axes.lines if line.get_zorder() == 1]
    assert (len(axes.lines), len(hidden)) == (12, 3)
    shared = set.intersection(*({tuple(point) for point in line.get_xydata().round(9)} for line in hidden))
    cube = np.array([[x, y, z] for x in (-0.5, 0.5) for y in (-0.5, 0.5) for z in (-0.5, 0.5)])
    # The reader is at −y, +x, +z: the corner that no seen face has is at the back, on the left, below.
    back = np.flatnonzero((cube == [-0.5, 0.5, -0.5]).all(axis=1))[0]
    assert shared == {tuple(corners[back].round(9))}


def test_fit_view_keeps_one_scale():
    axes = style.new_figure(90, 40).add_subplot()
    points = np.array([[0.0, 0.0], [3.0, 1.0]])
    fit_view(axes, points)
    box = axes.get_window_extent()
    per_pixel = np.ptp(axes.get_xlim()) / box.width, np.ptp(axes.get_ylim()) / box.height
    assert per_pixel[0] == pytest.approx(per_pixel[1])
    assert axes.get_xlim()[0] < 0.0 < 3.0 < axes.get_xlim()[1]


def test_a_network_that_is_not_there_is_named(study):
    with pytest.raises(DatasetError, match="0 networks named 'nobody'"):
        curve_table(study["curves_large"], "nobody")


def test_only_fits_to_whole_load_sets_are_drawn(study):
    fits = pooled_fits(study["fits_large"])
    assert len(fits) == len(synthetic.NAMED) * len(synthetic.LOAD_SETS)
    assert stacked({"one": fits, "two": fits}, "part")["part"].tolist() == ["one"] * len(fits) + ["two"] * len(fits)


def test_a_figure_appears_whole_or_not_at_all(tmp_path):
    (tmp_path / "figure.svg").mkdir()
    outputs = {kind: tmp_path / f"figure.{kind}" for kind in ("png", "svg")}
    with pytest.raises(DatasetError, match=r"figure\.svg: cannot be written"):
        style.save(style.new_figure(20, 20), outputs, synthetic.params(7))
    assert sorted(os.listdir(tmp_path)) == ["figure.png", "figure.svg"]


def test_figures_leave_matplotlib_as_they_found_it(study):
    before = dict(matplotlib.rcParams)
    draw(7, study)
    assert dict(matplotlib.rcParams) == before
    code = "import sys\nfrom fibrous_study.figures import figure_3, figure_6\nprint('matplotlib.pyplot' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "False"


def test_fibers_are_a_picture_inside_the_vector_file(files):
    text = files(3)["svg"].read_text(encoding="utf-8")
    pictures = re.findall(r"data:image/png;base64,\s*([A-Za-z0-9+/=\s]+)", text)
    assert len(pictures) >= 12
    with Image.open(io.BytesIO(base64.b64decode(pictures[0]))) as image:
        assert image.width > 50
