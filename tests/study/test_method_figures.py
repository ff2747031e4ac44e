"""Figures 2 and 4, the method in pictures: they draw the files of the study and the stages of the workflow."""

import importlib
from itertools import combinations

import matplotlib
import numpy as np
import pandas as pd
import pytest
from workflow_runs import job_of, quick_config

from fibrous.errors import DatasetError
from fibrous.fitting.hgo import strain_energy
from fibrous_study.datasets import read
from fibrous_study.figures import figure_2, figure_4

MODULES = {"figure_2": figure_2, "figure_4": figure_4}


@pytest.fixture(scope="module", params=list(MODULES))
def drawn(request, quick, tmp_path_factory):
    """A figure by its stage, with the figure itself and the folder of the quick study."""
    name, found = request.param, {}
    keep = MODULES[name].draw
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(MODULES[name], "draw", lambda *given: found.setdefault("figure", keep(*given)))
        run(name, quick[0], tmp_path_factory.mktemp(name))
    return name, found["figure"], quick[0]


def run(name, folder, target, **changed):
    config = quick_config()
    job = job_of(config, name)
    inputs = {kind: [folder / path for path in paths] for kind, paths in job.content["inputs"].items()}
    outputs = {kind: target / path.split("/")[-1] for kind, path in job.content["outputs"].items()}
    importlib.import_module(job.params["stage"]).run(inputs | changed, outputs, job.params)
    return outputs


def texts_of(figure):
    """Texts with their boxes, without the tick labels, which matplotlib keeps outside the view, too."""
    figure.draw_without_rendering()  # places the labels of axes
    texts = list(figure.texts)
    for axes in figure.axes:
        texts += [*axes.texts, *([axes.xaxis.label, axes.yaxis.label] if axes.axison else [])]
    return {text: text.get_window_extent(figure.canvas.get_renderer()) for text in texts if text.get_text()}


def test_texts_are_legible_inside_and_apart(drawn):
    _, figure, _ = drawn
    boxes = texts_of(figure)
    assert len(boxes) > 15
    for text, box in boxes.items():
        assert text.get_fontsize() >= 6.0, text
        assert min(box.x0, box.y0) >= 0.0, text
        assert max(box.x1 - figure.bbox.width, box.y1 - figure.bbox.height) <= 0.0, text
    for (one, a), (other, b) in combinations(boxes.items(), 2):
        apart = a.x1 <= b.x0 or b.x1 <= a.x0 or a.y1 <= b.y0 or b.y1 <= a.y0
        assert apart, (one, other)


def test_two_runs_give_the_same_bytes(drawn, tmp_path):
    name, _, folder = drawn
    one, other = (run(name, folder, tmp_path / part) for part in ("one", "other"))
    for kind in one:
        assert one[kind].read_bytes() == other[kind].read_bytes()
    assert one["data"].read_bytes() == (folder / f"results/figures/{name}.csv").read_bytes()


def test_figure_2_fits_the_curves_that_it_draws(quick):
    data = pd.read_csv(quick[0] / "results/figures/figure_2.csv")
    fits = pd.read_csv(quick[0] / "results/fits/named/large.csv")
    fit = fits[(fits["name"] == "case") & (fits["load_set"] == "section_3_1")].iloc[0]
    line = data[data["kind"] == "fit"]
    np.testing.assert_allclose(
        line["strain_energy_density_MPa"], strain_energy(fit["C2_MPa"], fit["C3"], line["averaged_stretch"]), rtol=1e-12
    )
    curves = read(quick[0] / "results/curves/named/large/00.nc", "curves")
    case = curves.isel(network=int(np.flatnonzero(curves["name"].values == "case")[0]))
    assert set(data.loc[data["kind"] == "network", "series"]) == set(case["deformation"].values) - {"yz_shear"}
    for load, states in data[data["kind"] == "network"].groupby("series"):
        np.testing.assert_allclose(
            states["strain_energy_density_MPa"], case["strain_energy_density"].sel(deformation=load), rtol=1e-12
        )


def test_figure_4_follows_the_most_stretched_element(quick):
    data = pd.read_csv(quick[0] / "results/figures/figure_4.csv")
    run = read(quick[0] / "results/tissue/hgo.nc", "tissue").isel(step=-1)
    stretch = np.linalg.svd(run["deformation_gradient"].values, compute_uv=False)[..., 0].mean(axis=1)
    (element,) = data["element"].unique()
    assert element == np.argmax(stretch)
    specimen = read(quick[0] / "results/tissue/specimen.nc", "specimen")
    network = int(specimen["element_network"][element])
    for panel, protocol, group in (("a3", "section_2_6", "section_3_1"), ("a5", "refit_hgo", "single")):
        fits = pd.read_csv(quick[0] / f"results/fits/tissue/{protocol}.csv")
        fits = fits[(fits["network"] == network) & (fits["load_set"] == group)]
        fits = fits[(fits["energy"] == "structure_tensor") & (fits["objective"] != "stress")]
        fits = fits[(fits["deformation"] == "all") | (panel == "a5")]
        shown = data[(data["panel"] == panel) & (data["kind"] == "fit")]
        assert shown["C2_MPa"].unique().tolist() == pytest.approx(fits["C2_MPa"].tolist())
        assert shown["C3"].unique().tolist() == pytest.approx(fits["C3"].tolist())
    path = data[(data["panel"] == "a5") & (data["kind"] == "network")]
    mean = run["deformation_gradient"].values[element].mean(axis=0)
    tensor = specimen["structure_tensor"].values[element]
    # The network's own H is that asked for up to the tolerance of the quick study.
    assert path["averaged_stretch"].max() == pytest.approx(np.sqrt(np.sum(tensor * (mean.T @ mean))), rel=0.01)


def test_figure_4_draws_every_stage_with_its_jobs(quick):
    stages = figure_4.stages_of(quick[0] / "results/tables/stages.csv")
    by_name = {stage["stage"]: stage for stage in stages}
    assert by_name["hgo_fits"]["reads"] == ["network_curves", "refit_curves"]
    assert "hgo_fits" in by_name["tissue_run"]["reads"]
    assert by_name["specimen"]["reads"] == []
    assert set(by_name["network_curves"]["drawn"]) >= {"figure_3", "figure_5", "figure_6"}
    assert by_name["network_ensemble"]["jobs"] == 6
    figure = matplotlib.figure.Figure()
    axes = figure.add_subplot()
    figure_4.draw_stages(axes, stages)
    words = [" ".join(text.get_text().split()) for text in axes.texts]
    for stage in stages:
        at = words.index(stage["stage"].replace("_", " "))
        assert words[at + 1].split()[0] == str(stage["jobs"])
    assert words.count("refit") == 1


def test_a_network_without_a_fit_is_named(quick):
    with pytest.raises(DatasetError, match="holds 0 fits of network 77"):
        figure_4._constants(quick[0] / "results/fits/tissue/section_2_6.csv", 77, "section_3_1", "all")
