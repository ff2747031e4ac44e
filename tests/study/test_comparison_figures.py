"""Figure 9 and the errors of the laws draw what their data files hold."""

import matplotlib
import numpy as np
import pandas as pd
import pytest
import synthetic
import synthetic_tissue
from matplotlib.collections import PolyCollection
from synthetic import whole

from fibrous.deformation import green_lagrange_strain, maximum_shear
from fibrous_study.datasets import read
from fibrous_study.figures import deformed, figure_9
from fibrous_study.figures import figure_comparison as comparison
from fibrous_study.figures.surface_of_mesh import Surface

RUNS = {"multiscale": 1.0, "hgo": 0.9, "hgo_refit": 0.8}
PANELS = [f"{letter}{column}" for letter in "ab" for column in range(1, 6)]
FITTED = {"constants": "fit", "energy": "families"}
LAWS = {
    "matrix": {"law": "matrix"},
    "hgo": {"law": "families", "constants": "fit", "energy": "structure_tensor", "objective": "energy"},
    "stress": {"law": "families", **FITTED, "objective": "stress"},
    "hgo_surface": {"law": "families", "constants": "surface"},
    "multiscale_one_step": {"law": "network"},
}


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    folder = tmp_path_factory.mktemp("figure_9")
    synthetic_tissue.write_specimen(folder / "specimen.nc")
    for name, amount in RUNS.items():
        synthetic_tissue.write_tissue(folder / f"{name}.nc", amount)
    inputs = {"specimen": [folder / "specimen.nc"], "tissue": [folder / f"{name}.nc" for name in RUNS]}
    outputs = {key: folder / f"figure_9.{key}" for key in ("png", "svg", "data")}
    figure_9.run(inputs, outputs, synthetic.params(9))
    return folder


@pytest.fixture(scope="module")
def drawn(study):
    specimen = read(study / "specimen.nc", "specimen")
    runs = [deformed.last_step(study / f"{name}.nc", specimen) for name in RUNS]
    figure = figure_9.draw(specimen, runs)
    axes = {text.get_text(): axes for axes in figure.axes for text in axes.texts if text.get_text() in PANELS}
    return specimen, runs, figure, axes


def fields(study, name):
    last = read(study / f"{name}.nc", "tissue").isel(step=-1)
    strain = green_lagrange_strain(last["deformation_gradient"].values)
    tensors = {"maximum_shear_stress_MPa": last["cauchy_stress"].values, "maximum_shear_strain": strain}
    return {column: maximum_shear(tensor).mean(axis=1) for column, tensor in tensors.items()}


def test_figure_9_writes_fields_and_errors_of_each_element(study):
    data = pd.read_csv(study / "figure_9.data")
    assert data["element"].tolist() == list(range(40))
    reference = fields(study, "multiscale")
    for name in RUNS:
        for column, values in fields(study, name).items():
            np.testing.assert_allclose(data[f"{name}_{column}"], values)
            if name != "multiscale":
                np.testing.assert_allclose(data[f"{name}_error_{column}"], values - reference[column], atol=1e-15)
    assert len(data.columns) == 1 + 2 * (3 + 2)


def test_figure_9_draws_each_run_where_it_is_in_colours_of_its_row(study, drawn):
    specimen, runs, figure, axes = drawn
    data = pd.read_csv(study / "figure_9.data")
    surface = Surface.of(specimen["element_nodes"].values)
    bars = [one for one in figure.axes if one not in axes.values()]
    assert len(axes) == 10
    assert len(bars) == 4
    names = [*RUNS, "hgo", "hgo_refit"]
    for row, column in enumerate(("maximum_shear_stress_MPa", "maximum_shear_strain")):
        shown = [data[f"{name}_{column}"] for name in RUNS] + [data[f"{name}_error_{column}"] for name in names[3:]]
        for number, (name, values) in enumerate(zip(names, shown, strict=True)):
            (faces,) = axes[PANELS[5 * row + number]].findobj(PolyCollection)
            one = next(one for one in runs if one.name == name)
            points, depth = deformed.CAMERA.project(one.position[surface.face_nodes])
            seen = np.flatnonzero(surface.normals(one.position) @ deformed.CAMERA.frame[2] > 0.0)
            order = seen[np.argsort(depth[seen].mean(axis=1), kind="stable")]
            np.testing.assert_allclose([path.vertices[:4] for path in faces.get_paths()], points[order], atol=1e-12)
            together = np.concatenate(shown[:3] if number < 3 else shown[3:])
            values = values.to_numpy()[surface.face_element[order]]
            if number < 3:
                low, high = together.min(), np.quantile(together, 0.99)
                expected = colors("viridis", (values - low) / (high - low))
            else:
                largest = np.quantile(np.abs(together), 0.99)
                expected = colors("RdBu_r", 0.5 + 0.5 * values / largest)
            np.testing.assert_allclose(faces.get_facecolors(), expected)


def colors(name, parts):
    return matplotlib.colormaps[name](np.asarray(parts))


def test_red_is_more_than_the_coupled_simulation_and_white_the_same():
    scale = figure_9.error_scale([np.array([-3.0, 1.0]), np.zeros(98)])
    assert scale(0.0) == 0.5
    assert scale.vmax == -scale.vmin
    assert scale.vmax == pytest.approx(np.quantile([*np.zeros(98), 1.0, 3.0], 0.99))
    red, _, blue, _ = colors(figure_9.ERROR_MAP, float(scale(1.0)))
    assert red > blue


def test_figure_9_shows_rms_errors(study, drawn):
    axes = drawn[3]
    data = pd.read_csv(study / "figure_9.data")
    for panel, name in (("a4", "hgo"), ("a5", "hgo_refit")):
        rms = np.sqrt(np.mean(data[f"{name}_error_maximum_shear_stress_MPa"] ** 2))
        assert axes[panel].get_title().endswith(f"RMS {rms:.2g} MPa")


def tables():
    """A run of each law, one of them refitted, whose errors grow with the step and with its number."""
    runs = [(name, name, 0) for name in LAWS]
    runs.insert(2, ("hgo_refit", "hgo", 1))
    nothing = dict.fromkeys(("constants", "energy", "objective"), "")
    ends = pd.DataFrame([{"run": run, "model": model, "refits": r, **nothing, **LAWS[model]} for run, model, r in runs])
    rows = []
    for number, (run, _, _) in enumerate(runs):
        for step in [3] if LAWS.get(run, {}).get("law") == "network" else [1, 2, 3]:
            size = 1e-10 if step == 3 and run == "multiscale_one_step" else 0.01 * step * (1 + number)
            errors = {quantity: size * (1 + k) for k, quantity in enumerate(comparison.ERRORS)}
            rows.append({"run": run, "step": step, **errors})
    steps = pd.DataFrame(rows)
    last = steps[steps["step"] == 3].drop(columns="step").assign(specimen="synthetic specimen")
    return ends.merge(last, on="run"), steps


def test_errors_are_drawn_as_they_are_written(tmp_path):
    ends, steps = tables()
    paths = {"comparison": tmp_path / "ends.csv", "steps": tmp_path / "steps.csv"}
    whole(ends, "comparison").to_csv(paths["comparison"], index=False)
    whole(steps, "comparison_steps").to_csv(paths["steps"], index=False)
    outputs = {key: tmp_path / f"comparison.{key}" for key in ("png", "svg", "data")}
    comparison.run({name: [path] for name, path in paths.items()}, outputs, synthetic.params("comparison"))
    data = pd.read_csv(outputs["data"])
    assert len(data) == 5 * 3 * 4
    figure = comparison.draw(ends, steps)
    for number, quantity in enumerate(comparison.ERRORS):
        above, below = figure.axes[number], figure.axes[number + 4]
        own = data[data["quantity"] == quantity]
        dots = sorted(line.get_xdata()[0] for line in above.lines if line.get_marker() != "None")
        np.testing.assert_allclose(dots, sorted(100.0 * own[own["step"] == 3]["relative_error"]))
        np.testing.assert_allclose(own[own["step"] == 3]["relative_error"], ends[quantity][:5])
        for line, (run, states) in zip(below.lines, own.groupby("run", sort=False), strict=True):
            np.testing.assert_array_equal(line.get_xdata(), [1, 2, 3])
            np.testing.assert_allclose(line.get_ydata(), 100.0 * states["relative_error"])
            np.testing.assert_allclose(states["relative_error"], steps[steps["run"] == run][quantity])


def test_each_model_has_its_row_its_look_and_open_marks_before_the_refit():
    ends, steps = tables()
    figure = comparison.draw(ends, steps)
    above, below = figure.axes[0], figure.axes[4]
    dots = {(line.get_ydata()[0], line.get_mfc() == "none"): line for line in above.lines if line.get_ls() == "None"}
    refit, initial = dots[1, False], dots[1, True]
    assert refit.get_xdata()[0] > initial.get_xdata()[0]
    lines = list(above.lines)
    assert lines.index(initial) > lines.index(refit)
    assert refit.get_color() == initial.get_color() == below.lines[1].get_color() == below.lines[2].get_color()
    assert len({(line.get_color(), line.get_marker()) for line in below.lines}) == 4
