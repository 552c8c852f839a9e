"""Logarithmic axes whose data leaves Matplotlib without limits."""

import numpy as np
import pytest

from workbench import figures
from workbench.figures.formats import pdf, png, svg
from workbench.figures.limits import mend_limits


@pytest.mark.cases(2)
@pytest.mark.parametrize("values", [[np.nan, 3.0], [np.nan, np.nan], [np.inf, 2.0], [0.0, 5.0]])
@pytest.mark.parametrize("write", [png, svg, pdf])
@pytest.mark.filterwarnings("ignore:invalid value encountered in dot")  # of a bar without end
def test_bars_on_a_logarithmic_axis_are_drawn_whatever_they_are(values, write):
    figure, (panel,) = figures.axes(1, 1)
    panel.barh([0, 1], values)
    figures.label(panel, x="ratio [1]", log="x")
    assert write(figure)
    low, high = panel.get_xlim()
    assert 0 < low < high < np.inf
    finite = [value for value in values if 0 < value < np.inf]
    assert all(low <= value <= high for value in finite)


def test_limits_that_are_there_stay():
    _, (panel,) = figures.axes(1, 1)
    panel.plot([1.0, 10.0], [2.0, 300.0])
    figures.label(panel, log="xy")
    before = panel.get_xlim(), panel.get_ylim()
    mend_limits(panel)
    assert (panel.get_xlim(), panel.get_ylim()) == before


@pytest.mark.parametrize("end", [np.nan, np.inf, -np.inf, None])
def test_a_limit_that_is_none_leaves_the_axis_as_it_was(end):
    _, (panel,) = figures.axes(1, 1)
    panel.set_ylim(-2.0, 3.0)
    panel.set_ylim(-1.0, end)
    panel.set_xlim((0.25, end))
    assert panel.get_ylim() == (-1.0, 3.0) and panel.get_xlim() == (0.25, 1.0)


def test_a_mean_outside_its_interval_has_no_bar_on_that_side():
    figure, (panel,) = figures.axes(1, 1)
    panel.errorbar([0, 1], [1.0, 2.0], [[0.5, -0.1], [0.2, 0.3]])
    panel.errorbar([0, 1], [1.0, np.inf], [[0.5, np.nan], [0.2, -np.inf]])
    first = panel.containers[0][2][0].get_segments()
    assert [tuple(part[:, 1]) for part in first] == [(0.5, 1.2), (2.0, 2.3)]
    assert png(figure)


def test_polar_axes_are_drawn(tmp_path):
    figure, (panel,) = figures.axes(1, 1, subplot_kw={"projection": "polar"})
    panel.plot([0.0, 1.0], [1.0, 2.0])
    figure.savefig(tmp_path / "polar.png")
    assert panel.name == "polar"
