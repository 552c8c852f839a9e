"""Logarithmic axes whose data leaves Matplotlib without limits."""

import numpy as np
import pytest

from workbench import figures
from workbench.figures.formats import pdf, png, svg
from workbench.figures.limits import mend_limits


@pytest.mark.parametrize("values", [[np.nan, 3.0], [np.nan, np.nan], [np.inf, 2.0], [0.0, 5.0]])
@pytest.mark.parametrize("write", [png, svg, pdf])
@pytest.mark.filterwarnings("ignore:invalid value encountered in dot")  # of a bar without end
def test_bars_on_a_logarithmic_axis_are_drawn_whatever_they_are(values, write):
    figure, (panel,) = figures.axes()
    panel.barh([0, 1], values)
    figures.label(panel, "ratio [1]", log="x")
    assert write(figure)
    low, high = panel.get_xlim()
    assert 0 < low < high < np.inf
    finite = [value for value in values if 0 < value < np.inf]
    assert all(low <= value <= high for value in finite)


def test_limits_that_are_there_stay():
    _, (panel,) = figures.axes()
    panel.plot([1.0, 10.0], [2.0, 300.0])
    figures.label(panel, log="xy")
    before = panel.get_xlim(), panel.get_ylim()
    mend_limits(panel)
    assert (panel.get_xlim(), panel.get_ylim()) == before
