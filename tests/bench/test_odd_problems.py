"""Problems that raise, never end or say odd things: no raw traceback, and nothing is lost."""

import math

import numpy as np
import pytest

import workbench as wb
from workbench.certificate import Check
from workbench.errors import RegistryError

SOURCE = """
import numpy as np

from workbench import Check, problem, ref
from workbench.geometry import SmallestCircle

POINTS = np.array([0, 1, 1j])


@problem("growing", needs=lambda n=0, **_: {"before": ref("growing", n=n + 1)})
def growing(before=None, n: int = 0):
    '''Needs itself with another parameter.'''
    return SmallestCircle(POINTS)


class Raises(SmallestCircle):
    def metrics(self, answer):
        raise RuntimeError("no metrics today")


@problem("raises")
def raises():
    '''Metrics that raise.'''
    return Raises(POINTS)


class Odd(SmallestCircle):
    def checks(self, answer, tolerance):
        return [Check("one", "an array of one number", np.array([0.0]), np.float32(1.0))]


@problem("odd")
def odd():
    '''A check whose value is an array.'''
    return Odd(POINTS)


class Surrogate(SmallestCircle):
    def checks(self, answer, tolerance):
        raise ValueError("bad \\ud800 text")


@problem("surrogate")
def surrogate():
    '''Words that no file can hold.'''
    return Surrogate(POINTS)
"""


@pytest.fixture
def odd(project):
    project.write("plants/odd/problems.py", SOURCE)
    return project


@pytest.mark.cases(0)
def test_needs_that_grow_for_ever_are_named(odd):
    with pytest.raises(RegistryError, match=r"needs that do not end.*'n': 100"):
        wb.run("growing")


def test_metrics_that_raise_cost_the_metrics_and_not_the_answer(odd):
    run = wb.run("raises")
    assert not run.holds and run.path.name.endswith(".failed")
    assert "metrics" in run.certificate.failures[0]
    assert "no metrics today" in run.info["message"]
    assert run.data["radius"].size == 1


def test_a_check_takes_whatever_is_one_number(odd):
    run = wb.run("odd")
    assert run.certificate.checks[0].value == 0.0 and run.holds
    assert Check("a", "", np.array([[2]]), 3).margin == 1.0
    with pytest.raises(ValueError, match=r"array|size"):
        Check("a", "", np.zeros(2), 1.0)
    assert math.isnan(Check("a", "", np.float32("nan"), 1.0).value)


def test_words_that_no_file_can_hold_are_escaped(odd):
    run = wb.run("surrogate")
    assert not run.holds and "\\ud800" in run.certificate.failures[0]
    assert "\\ud800" in (run.path / "log.txt").read_text("utf-8")
