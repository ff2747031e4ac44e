"""The figure of the sensitivities draws medians of its data, and the same bytes twice."""

import matplotlib
import numpy as np
import pandas as pd
import pytest
import synthetic
from matplotlib.text import Text
from test_figures import visible_texts

from fibrous_study.datasets import write_table
from fibrous_study.figures import figure_sensitivity as sensitivity
from fibrous_study.sensitivity.summary import QUANTITIES, completed

OWN = {"edge_length_um": 20.0, "volume_fraction": 0.04, "nonlinearity": 2.5, "amplitude": 1.8, "steps": 20.0}
CONFIG = {
    "factors": [{"name": name, "unit": "1", "own_value": own} for name, own in OWN.items()],
    "load_sets": synthetic.LOAD_SETS,
}


def trials(factor: str, value: float) -> pd.DataFrame:
    """Three networks each of two alignments under two load sets, numbers at random."""
    rng = np.random.default_rng(int(100 * value) if value == value else 0)
    cases = [(name, entry["name"], k) for name in ("near", "far") for entry in synthetic.LOAD_SETS for k in range(3)]
    table = pd.DataFrame(cases, columns=["network", "load_set", "replicate"])
    numbers = {name: rng.uniform(0.1, 1.0, len(table)) for name in QUANTITIES}
    counts = dict.fromkeys(("states_failed", "judged_states_failed", "loads_limited"), 0)
    return table.assign(factor=factor, value=value, **numbers, **counts)


def tables() -> list[pd.DataFrame]:
    return [trials("base", np.nan), *(trials(name, share * own) for name, own in OWN.items() for share in (0.5, 2.0))]


@pytest.fixture(scope="module")
def drawn():
    table = completed(tables(), OWN)
    figure = sensitivity.draw(table, synthetic.LOAD_SETS)
    figure.canvas.draw()
    return table, figure


def test_lines_are_medians_over_the_networks(drawn):
    table, figure = drawn
    for panel, axes in enumerate(figure.axes):
        row, column = divmod(panel, len(sensitivity.COLUMNS))
        quantity, factor = list(sensitivity.ROWS)[row], list(sensitivity.COLUMNS)[column]
        own = table[table["factor"] == factor].groupby(["network", "load_set"], sort=False)
        lines = [line for line in axes.lines if line.get_linestyle() != "None" and len(line.get_xdata()) == 3]
        for line, (_, case) in zip(lines, own, strict=True):
            values = np.sort(case["value"].unique())
            medians = [np.median(case.loc[case["value"] == value, quantity]) for value in values]
            np.testing.assert_allclose(line.get_xdata(), values)
            np.testing.assert_allclose(line.get_ydata(), sensitivity.ROWS[quantity][1] * np.array(medians))
        points = sum(len(line.get_xdata()) for line in axes.lines if line.get_linestyle() == "None")
        assert points == 4 * 9


def test_a_factor_that_is_not_varied_has_no_column():
    own = {name: value for name, value in OWN.items() if name != "amplitude"}
    figure = sensitivity.draw(completed(tables(), own), synthetic.LOAD_SETS)
    assert len(figure.axes) == len(sensitivity.ROWS) * len(own)


def test_every_text_is_legible_and_inside(drawn):
    _, figure = drawn
    renderer = figure.canvas.get_renderer()
    assert all(text.get_fontsize() >= 6.0 for text in figure.findobj(Text) if text.get_text())
    boxes = [text.get_window_extent(renderer) for text in visible_texts(figure)]
    assert all(box.x0 >= 0.0 and box.y0 >= 0.0 for box in boxes)
    assert all(box.x1 <= figure.bbox.width and box.y1 <= figure.bbox.height for box in boxes)


def test_two_runs_give_the_same_bytes(tmp_path):
    paths = []
    for number, table in enumerate(tables()):
        paths.append(tmp_path / f"{number}.csv")
        trials = synthetic.whole(table, "sensitivity_trials")
        write_table(trials, paths[-1], synthetic.params("sensitivity"), "sensitivity_trials")
    params = synthetic.params("sensitivity", **CONFIG)
    first, second = ({kind: tmp_path / f"{n}.{kind}" for kind in ("png", "svg", "data")} for n in ("one", "two"))
    with matplotlib.rc_context({"font.size": 30.0}):
        sensitivity.run({"trials": paths}, first, params)
    sensitivity.run({"trials": paths}, second, params)
    assert all(first[kind].read_bytes() == second[kind].read_bytes() for kind in first)
