"""Figures of covers: labels with units, legends outside, nothing that stops at odd answers."""

import re
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from lanes import thinned
from matplotlib.backends.backend_agg import FigureCanvasAgg

from workbench.geometry import (
    NarrowestStadium,
    SmallestCircle,
    narrowest_stadium,
    smallest_circle,
)

PAIRS = [(SmallestCircle, smallest_circle), (NarrowestStadium, narrowest_stadium)]
FREQUENCY = np.array([10.0, 31.25, 100.0, 400.0])


def response(frequency=FREQUENCY, drives=6, **attributes):
    rng = np.random.default_rng(41)
    shape = (len(frequency), drives)
    return xr.DataArray(
        rng.normal(size=shape) + 1j * rng.normal(size=shape),
        dims=("frequency", "drive"),
        coords={
            "frequency": (
                "frequency",
                frequency,
                {"units": "Hz", "long_name": "frequency"} | attributes,
            )
        },
        attrs={"units": "m/V", "long_name": "response"},
    )


def drawn(figures):
    """The figures, drawn as they would be written."""
    for figure in figures.values():
        FigureCanvasAgg(figure).draw()
    return figures


def no_number(answer):
    """The answer with its first set lost."""
    names = [n for n in ("center", "radius", "half_length", "angle") if n in vars(answer)]
    lost = {name: np.array(getattr(answer, name)) for name in names}
    for values in lost.values():
        values[:1] = np.nan
    return replace(answer, **lost)


@pytest.mark.cases(1)
@pytest.mark.parametrize(("program", "function"), PAIRS)
def test_axes_are_labelled_with_units(program, function):
    points = response()
    figures = drawn(program(points).figures(function(points)))
    assert list(figures) == ["plane", "sizes"]
    plane, bar = figures["plane"].axes
    assert plane.get_xlabel() == "real part of response [m/V]"
    assert plane.get_ylabel() == "imaginary part [m/V]"
    assert bar.get_ylabel() == "frequency [Hz]"
    panels = figures["sizes"].axes
    assert panels[-1].get_xlabel() == "frequency [Hz]"
    assert panels[0].get_ylabel() == "size [m/V]"
    if program is NarrowestStadium:
        assert panels[1].get_ylabel() == "orientation [deg]"
    for figure in figures.values():
        for axes in figure.axes:
            for label in filter(None, (axes.get_xlabel(), axes.get_ylabel())):
                assert re.search(r"\[.+\]$", label) or label.startswith("real part")


@pytest.mark.cases(1)
@pytest.mark.parametrize(("program", "function"), PAIRS)
def test_legends_are_outside_the_axes(program, function):
    points = response()
    figure = drawn(program(points).figures(function(points)))["sizes"]
    assert not any(axes.get_legend() for axes in figure.axes)
    (legend,) = figure.legends
    names = [text.get_text() for text in legend.get_texts()]
    assert names == (["radius"] if program is SmallestCircle else ["radius", "half-length"])
    box = legend.get_window_extent()
    for axes in figure.axes:
        assert not box.overlaps(axes.get_tightbbox())


def test_the_shapes_are_drawn_around_their_points():
    points = response()
    stadium = narrowest_stadium(points)
    plane = NarrowestStadium(points).figures(stadium)["plane"].axes[0]
    outlines = [path.vertices @ [1, 1j] for path in plane.collections[0].get_paths()]
    assert len(outlines) == len(FREQUENCY)
    for k, outline in enumerate(outlines):
        ends = stadium.half_length[k] * np.exp(1j * stadium.angle[k])
        t = np.linspace(-1, 1, 2001)
        segment = stadium.center[k] + t * ends
        away = np.abs(outline[:, None] - segment).min(axis=1)
        np.testing.assert_allclose(away, stadium.radius[k], rtol=1e-5)


def test_the_angle_is_drawn_in_degrees_and_the_frequency_as_decades():
    points = response()
    stadium = narrowest_stadium(points)
    top, below = NarrowestStadium(points).figures(stadium)["sizes"].axes
    np.testing.assert_allclose(below.lines[0].get_ydata(), np.degrees(stadium.angle))
    np.testing.assert_array_equal(top.lines[0].get_ydata(), stadium.radius)
    assert top.get_xscale() == "log"
    linear = response(np.array([10.0, 11, 12, 13]))
    figures = SmallestCircle(linear).figures(smallest_circle(linear))
    assert figures["sizes"].axes[0].get_xscale() == "linear"


@pytest.mark.cases(1)
@pytest.mark.parametrize("pair", thinned(PAIRS, 2))
@pytest.mark.parametrize(
    "points",
    [
        response(FREQUENCY[:1]),
        response(drives=1),
        response(FREQUENCY[:1], drives=1),
        response(np.array([0.0, 1, 100])),
        response()[0],
        response().drop_vars("frequency"),
        response().expand_dims("side"),
        response().values,
        response().values[0],
        response() * 0,
    ],
    ids=[
        "one set", "one point", "one of one", "from zero", "no batch", "no coordinate",
        "three axes", "no labels", "no labels, no batch", "all at the origin",
    ],
)  # fmt: skip
def test_every_shape_of_input_is_drawn(pair, points):
    program, function = pair
    figures = drawn(program(points).figures(function(points)))
    assert figures["plane"].axes[0].get_xlabel().startswith("real part of")


@pytest.mark.parametrize("coordinate", [["a", "b", "c", "d"], np.arange(4).astype("M8[D]")])
def test_axes_that_are_no_numbers_are_drawn(coordinate):
    points = response().assign_coords(frequency=coordinate)
    drawn(SmallestCircle(points).figures(smallest_circle(points)))


@pytest.mark.cases(1)
@pytest.mark.parametrize(("program", "function"), PAIRS)
def test_lost_sets_leave_gaps(program, function):
    points = response()
    answer = no_number(function(points))
    drawn(program(points).figures(answer))
    alone = points[:1]
    drawn(program(alone).figures(no_number(function(alone))))


def test_windows_show_their_range_alone():
    points = response()
    windows = {"Near 30 Hz": (20, 40), "Nothing there": (500, 600)}
    figures = drawn(SmallestCircle(points, windows=windows).figures(smallest_circle(points)))
    assert list(figures) == ["plane", "plane-near-30-hz", "plane-nothing-there", "sizes"]
    shown = figures["plane-near-30-hz"].axes[0]
    assert shown.get_title() == "Near 30 Hz"
    assert len(shown.collections[0].get_paths()) == 1
    assert figures["plane-near-30-hz"].axes[0].get_xlabel().endswith("[m/V]")
