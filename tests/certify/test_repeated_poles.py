"""The Hamiltonian in balls finds the crossings of repeated poles, which have no modes."""

import math
from functools import partial

import numpy as np
import pytest

from workbench.certify.hamiltonian import ball_discs
from workbench.certify.interval import certified_interval
from workbench.certify.stable_system import StableSystem, stable_system

up_to_its_ends = partial(certified_interval, end_margin=0.0)

ONE = (np.eye(1) + 0j, np.eye(1) + 0j, np.zeros((1, 1)) + 0j)


def lags(count: int) -> StableSystem:
    """1 / (s + 1)^count, as a chain: one Jordan block."""
    A = -np.eye(count) + np.diag(np.ones(count - 1), -1)
    B, C = np.eye(count, 1), np.eye(1, count, count - 1)
    given = tuple(np.zeros(part.shape) for part in (A, B, C, np.zeros((1, 1))))
    return StableSystem(A, B, C, np.zeros((1, 1)), -np.ones(count, complex), given)


@pytest.mark.parametrize("count", [2, 4, 8])
@pytest.mark.parametrize("level", [0.5, 0.9])
def test_the_crossing_is_enclosed(count, level):
    crossing = math.sqrt(level ** (-2 / count) - 1)
    discs = ball_discs(lags(count), ONE, level, math.inf)
    assert discs is not None
    meets = np.abs(discs.centre.imag) <= discs.radius
    assert sorted(discs.centre.real[meets]) == pytest.approx([-crossing, crossing], rel=1e-9)


def test_a_level_that_the_response_exceeds_is_not_proven():
    assert ball_discs(lags(4), ONE, 0.5, 0.1) is None


@pytest.mark.parametrize("count", [2, 6])
def test_no_interval_reaches_over_the_crossing(count):
    import control

    given = lags(count)
    system = stable_system(control.ss(given.A, given.B, given.C, given.D))
    low, high = up_to_its_ends(system, *ONE, 0.5, math.inf)
    crossing = math.sqrt(0.5 ** (-2 / count) - 1)
    assert crossing <= low < crossing * 1.001
    assert high == math.inf
