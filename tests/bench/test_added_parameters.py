"""A problem gets another parameter, and the results stored before stay valid."""

import numpy as np
import pytest

import workbench as wb
from workbench.errors import RegistryError

BEFORE = """
import numpy as np

from workbench import problem
from workbench.geometry import SmallestCircle


@problem("circle")
def circle(width: float = 2.0):
    '''Three points.'''
    return SmallestCircle(np.array([0, width, 1j]))
"""
AFTER = (
    BEFORE.replace('"circle"', '"circle", added=("height",)')
    .replace("2.0):", "2.0, height: float = 1.0):")
    .replace("1j]", "1j * height]")
)


@pytest.fixture
def stored(project):
    project.write("plants/added/problems.py", BEFORE)
    run = wb.run("circle")
    project.restart()
    project.write("plants/added/problems.py", AFTER)
    return run


def test_the_default_asks_the_question_of_before(stored):
    assert wb.verify(stored.path).holds
    again = wb.run("circle", height=1.0)
    assert again.key == stored.key
    assert again.info["parameters"] == stored.info["parameters"]


def test_another_value_asks_another_question(stored):
    run = wb.run("circle", height=3.0)
    assert run.key != stored.key
    assert run.info["parameters"] == {"width": 2.0, "height": 3.0}
    assert wb.verify(run.path).holds and run.value > stored.value


def test_the_default_may_be_one_point_of_a_sweep(stored):
    swept = wb.sweep("circle", over={"height": [1.0, 3.0]})
    assert np.ptp(swept.data["radius_peak"].values) > 0


def test_what_is_added_must_have_a_default(project):
    project.write("plants/added/problems.py", BEFORE.replace('"circle"', '"circle", added=("x",)'))
    with pytest.raises(RegistryError, match="added='x'; a parameter with a default"):
        wb.run("circle")
