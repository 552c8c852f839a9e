"""Margins: reciprocals of peaks, and what they say of a system with its uncertainty enlarged."""

import math

import control
import numpy as np
import pytest

from workbench.mu.frequency.peak import peak
from workbench.mu.frequency.peak_bounds import Peak
from workbench.mu.robust.conditions import Conditions
from workbench.structure import Full, Structure


def made(lower, upper):
    return Peak(lower, upper, 1.0, np.zeros((1, 1)), (), "")


@pytest.mark.parametrize(
    ("lower", "upper", "expected"),
    [
        (0.5, 0.8, (1.25, 2.0)),
        (0.0, 0.5, (2.0, math.inf)),
        (0.5, math.inf, (0.0, 2.0)),
        (0.0, 0.0, (math.inf, math.inf)),
    ],
)
def test_are_reciprocals(lower, upper, expected):
    asked = Conditions(-1, None, made(lower, upper), None)
    assert asked.stability_margin == expected
    assert asked.performance_margin is None
    asked = Conditions(-1, None, None, made(lower, upper))
    assert asked.performance_margin == expected
    assert asked.stability_margin is None


def test_hold_what_they_promise():
    rng = np.random.default_rng(0)
    A = np.array([[-0.1, 3.0], [-3.0, -0.2]])
    system = control.ss(
        A, rng.standard_normal((2, 2)), rng.standard_normal((2, 2)), np.zeros((2, 2))
    )
    found = peak(system, Structure([Full(2, 2)]))
    low, high = Conditions(-1, None, found, None).stability_margin
    assert low <= high <= low * 1.003
    closest = found.Delta  # of size `high`; nothing smaller closes the loop on the axis
    assert np.linalg.norm(closest, 2) == pytest.approx(high)
    assert (
        control.linfnorm(low * 0.9999 * system)[0] < 1 < control.linfnorm(high * 1.0001 * system)[0]
    )
