"""The style of figures: labels, units and ticks."""

import numpy as np
import pytest
import xarray as xr

from workbench import figures
from workbench.figures import formats


def ticks(axis):
    axis.figure.canvas.draw()
    every = [*axis.get_ticklabels(), *axis.get_ticklabels(minor=True)]
    low, high = axis.get_view_interval()
    places = [*axis.get_majorticklocs(), *axis.get_minorticklocs()]
    return {one.get_text() for one, at in zip(every, places, strict=True) if low <= at <= high} - {
        ""
    }


@pytest.mark.parametrize(
    ("range_", "expected"),
    [
        ((0.1, 1e4), {"0.1", "1", "10", "100", "1000", "10000"}),
        ((20.0, 300.0), {"20", "50", "100", "200"}),
        ((1e5, 1e7), {"$10^{5}$", "$10^{6}$", "$10^{7}$"}),
        ((0.9e-5, 1.1e-2), {"$10^{-5}$", "$10^{-4}$", "$10^{-3}$", "$10^{-2}$"}),
        ((0.7, 1.0), {"0.7", "0.8", "0.9", "1"}),
        ((11.0, 48.0), {"20", "30", "40"}),
    ],
)
def test_ticks_of_logarithmic_axes_are_readable(range_, expected):
    _, (panel,) = figures.axes(1, 1)
    panel.plot(np.geomspace(*range_, 20), np.linspace(0, 1, 20))
    figures.label(panel, x="frequency [Hz]", y="size [1]", title="a title", log="x")
    panel.set_xlim(range_)
    assert panel.get_xscale() == "log" and panel.get_yscale() == "linear"
    assert panel.get_title() == "a title" and panel.get_xlabel() == "frequency [Hz]"
    assert ticks(panel.xaxis) == expected


def test_ticks_are_the_houses_where_nobody_labelled_the_axes():
    figure, (panel,) = figures.axes(1, 1)
    panel.loglog([0.02, 300.0], [1e-5, 1.0])
    formats.svg(figure)
    assert {"0.1", "1", "10", "100"} <= ticks(panel.xaxis)
    assert {"$10^{-4}$", "$10^{0}$"} <= ticks(panel.yaxis)


def test_a_figure_that_is_saved_by_hand_has_them_too(tmp_path):
    figure, (panel,) = figures.axes(1, 1)
    panel.loglog([0.02, 300.0], [0.4, 7.0])
    assert any("mathdefault" in one for one in ticks(panel.xaxis))
    figure.savefig(tmp_path / "figure.png")
    assert {"0.1", "1", "10", "100"} <= ticks(panel.xaxis)
    assert {"0.5", "1", "2", "5"} <= ticks(panel.yaxis)


def test_the_label_of_an_array_has_its_unit():
    gain = xr.DataArray(1.0, attrs={"units": "V/m", "long_name": "optical gain"})
    assert figures.axis_label(gain, "K_opt") == "optical gain [V/m]"
    assert figures.axis_label(xr.DataArray(1.0), "peak_mu") == "peak mu"


def test_the_number_in_a_figures_name_is_its_caption():
    assert figures.numbers_in("figure-8-7") == ["8.7"]
    assert figures.numbers_in("figure-7-5-7-10") == ["7.5", "7.10"]
    assert figures.numbers_in("figure-A-1") == ["A.1"]
    for plain in ("bode", "figure-8", "figure-8-7-drives", "my-figure-8-7"):
        assert figures.numbers_in(plain) == []
    drawn, _ = figures.axes(1, 1)
    assert figures.with_figure_numbers(drawn).get_suptitle() == ""
    assert figures.with_figure_numbers(drawn, "8.7").get_suptitle() == "Figure 8.7"
    assert figures.with_figure_numbers(drawn, "8.7").get_suptitle() == "Figure 8.7"
    titled, _ = figures.axes(1, 1)
    titled.suptitle("one record")
    assert (
        figures.with_figure_numbers(titled, "8.7", "A.1").get_suptitle()
        == "Figures 8.7, A.1\none record"
    )
    assert figures.with_figure_numbers(titled, "8.70").get_suptitle().startswith("Figure 8.70")


def test_a_legend_is_no_wider_than_its_figure():
    figure, (panel,) = figures.axes(1, 1, size=(4.0, 3.0))
    for k in range(6):
        panel.plot([0, 1], [0, k], label=f"a controller with a long name, {k}")
    figures.legend_below(figure, panel, columns=6)
    (legend,) = figure.legends
    assert legend.get_window_extent().width <= figure.bbox.width
