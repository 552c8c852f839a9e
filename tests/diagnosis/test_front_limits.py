"""Exchange of limits: the optimum over all of them, from programs over few."""

import numpy as np
import pytest
from scipy.optimize import linprog

from workbench.diagnosis.estimation.limits import SLACK, Limits, exchanged

F = 4000
S = np.linspace(0.0, 1.0, F)
A = np.stack([np.ones(F), S, S**2], axis=1).astype(complex)


def least_deviation(limits):
    """The least E of |c - A x| <= b + d E for real data, as a linear program: another method."""
    discs = [one for one in limits if not one.half_plane]
    planes = [one for one in limits if one.half_plane]
    rows, ends = [], []
    for one in discs:
        for sign in (1.0, -1.0):
            rows.append(np.hstack([-sign * one.A.real, np.full((len(one.b), 1), -one.d)]))
            ends.append(one.b - sign * one.c.real)
    for one in planes:
        rows.append(np.hstack([one.A.real, np.zeros((len(one.b), 1))]))
        ends.append(one.c.real - one.b)
    found = linprog(
        [0.0, 0.0, 0.0, 1.0], np.vstack(rows), np.concatenate(ends), bounds=[(None, None)] * 4
    )
    return None if found.x is None else (found.x[:3], float(found.x[3]))


def fitting(target, half_plane=None):
    """The parabola nearest to a target, also below a curve."""
    every = [Limits(A, target.astype(complex), np.zeros(F), 1.0)]
    if half_plane is not None:
        every.append(Limits(A, half_plane.astype(complex), np.zeros(F), half_plane=True))
    return every


@pytest.mark.parametrize("below", [None, 1.2 + 0 * S])
@pytest.mark.parametrize("target", [np.exp(S), np.abs(S - 0.37), np.sin(40 * S)])
def test_few_limits_give_the_optimum_of_all(target, below):
    sizes = []

    def solve(limits):
        sizes.append(sum(len(one.b) for one in limits))
        return least_deviation(limits)

    every = fitting(target, below)
    x, E = exchanged(solve, every)
    _, least = least_deviation(every)
    assert pytest.approx(least, abs=1e-7) == E
    assert max(one.excess(x, E).max() for one in every) <= 10 * SLACK
    assert max(sizes) < 0.1 * sum(len(one.b) for one in every)


def test_what_some_limits_forbid_all_forbid():
    every = fitting(np.exp(S))
    every.append(Limits(A, np.full(F, -1.0 + 0j), np.zeros(F), half_plane=True))  # A x <= -1
    every.append(Limits(-A, np.full(F, 0.0 + 0j), np.zeros(F), half_plane=True))  # A x >= 0
    assert exchanged(least_deviation, every) is None


def test_the_excess_of_a_disc_and_of_a_half_plane():
    one = Limits(np.array([[2.0 + 0j]]), np.array([1.0 + 1j]), np.array([0.5]), 1.0)
    assert one.excess(np.array([0.5]), 0.5) == pytest.approx([0.0])  # |1j| over 0.5 + 0.5
    assert one.excess(np.array([0.5]), 0.0) == pytest.approx([1.0])
    half = one._replace(half_plane=True, d=0.0)
    assert half.excess(np.array([0.0]), 0.0)[0] < 0 < half.excess(np.array([0.5]), 0.0)[0]
    factor = half._replace(d=np.array([1.0]))  # Re(1 + 1j - 2 x) >= 0.5 + 1 / E
    assert factor.excess(np.array([0.0]), 2.0) == pytest.approx([0.0])
    assert factor.excess(np.array([0.0]), 1.0) == pytest.approx([0.5 / 1.5])
    assert factor.rows(np.array([True])).d == np.array([1.0])


def test_a_solver_that_misses_its_limits_does_not_go_round_for_ever():
    """Limits in the program that are violated all the same are no new ones."""
    calls = []

    def careless(limits):
        calls.append(limits)
        return np.zeros(3), 0.0

    assert exchanged(careless, fitting(np.exp(S)))[1] == 0.0
    assert 1 < len(calls) < 5
