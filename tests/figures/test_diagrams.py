"""Block diagrams: every wire ends at a block or outside, names stand where they can be read."""

from typing import get_args

import control
import numpy as np
import pytest

from workbench.errors import InputError
from workbench.figures.diagrams import DiagramKind, loop_diagram
from workbench.figures.formats import png
from workbench.structure import Complex, Structure
from workbench.uncertainty import GeneralisedPlant


def plant(inputs, outputs, structure=None):
    D = np.zeros((len(outputs), len(inputs)))
    system = control.ss([], [], [], D, inputs=inputs, outputs=outputs)
    return GeneralisedPlant(system, structure, controls=1, measurements=1)


def words(figure):
    (panel,) = figure.axes
    return [text for text in panel.texts if text.get_text()]


def overlapping(figure):
    """Pairs of texts that cover each other, as drawn."""
    png(figure)
    boxes = [(text.get_text(), text.get_window_extent()) for text in words(figure)]
    return [
        (one, other)
        for k, (one, box) in enumerate(boxes)
        for other, beside in boxes[:k]
        if box.overlaps(beside)
    ]


@pytest.mark.parametrize("kind", get_args(DiagramKind))
def test_words_of_a_diagram_are_apart_and_inside(kind):
    figure = loop_diagram(kind)
    assert not overlapping(figure)
    edge = figure.bbox
    for text in words(figure):
        box = text.get_window_extent()
        assert edge.x0 <= box.x0 and box.x1 <= edge.x1 and edge.y0 <= box.y0 and box.y1 <= edge.y1


def test_a_plant_shows_its_signals():
    small = plant(["p", "r", "d", "u"], ["q", "z_e", "y"], Structure([Complex(1)]))
    shown = [text.get_text() for text in words(small.diagram())]
    assert shown == ["$P$", "r, d", "z_e", "$K$", "u", "y", r"$\Delta$"]
    nominal = [text.get_text() for text in words(small.nominal().diagram())]
    assert r"$\Delta$" not in nominal and "r, d" in nominal


def test_many_and_long_names_do_not_cover_others():
    many = [f"disturbance_{k}" for k in range(12)]
    large = plant([*many, "u"], ["z_1", "weighted control", "weighted error", "y"])
    figure = large.diagram()
    shown = [text.get_text() for text in words(figure)]
    assert "disturbance_0, ...,\ndisturbance_11" in shown
    assert not overlapping(figure)


def test_another_kind_is_refused():
    with pytest.raises(InputError, match="kind"):
        loop_diagram("Smith predictor")
