"""Loops with dead time whose gain does not fall to 0 at infinite frequency, against dense grids."""

import math
from fractions import Fraction

import numpy as np
import pytest
from coupled_loops import late

from workbench.mu.loops.late_pair import late_pair
from workbench.mu.loops.phases import LimitPair, LimitSum, multiples_of
from workbench.mu.margins.classical import margins_of_late
from workbench.uncertainty import block, tf
from workbench.uncertainty.algebra.system import uncertain

GAIN = np.array([[0.2, -0.9], [-0.7, 0.3]])
DIRECT = np.array([[0.2, 0.3], [0.18, -0.28]])
LAG = np.array([[1.3, 0.6], [2.5, 0.4]])


def channel(dead, gain=GAIN, direct=DIRECT):
    """The loop of the first channel, the second one closed, and its response."""
    plant = block(
        [
            [
                tf([float(direct[i, j] * LAG[i, j]), float(gain[i, j])], [float(LAG[i, j]), 1.0])
                * late(float(dead[i][j]), f"t_{i}{j}")
                for j in range(2)
            ]
            for i in range(2)
        ]
    )

    def response(s):
        g = [
            [
                (direct[i, j] * LAG[i, j] * s + gain[i, j])
                / (LAG[i, j] * s + 1)
                * np.exp(-s * dead[i][j])
                for j in range(2)
            ]
            for i in range(2)
        ]
        return g[0][0] - g[0][1] * g[1][0] / (1 + g[1][1])

    return late_pair(uncertain(plant), uncertain(np.eye(2))).loops[0], response


def largest_crossing(L):
    """The largest -L below 1 on the real axis, by linear interpolation between the points."""
    k = np.flatnonzero((np.diff(np.sign(L.imag)) != 0) & (L.real[1:] < 0))
    share = L.imag[k] / (L.imag[k] - L.imag[k + 1])
    x = -(L.real[k] + share * (L.real[k + 1] - L.real[k]))
    return x[x < 1].max()


@pytest.mark.parametrize("dead", [[[0.4, 0.7], [0.4, 0.7]], [[0.25, 0.5], [1.0, 0.75]]])
def test_margins_of_a_coupled_loop_with_a_direct_gain(dead):
    """Crossings between the limit of |L| and 1.5 times it were missed, and sums of sizes of terms
    that cannot be reached stood for the limit.
    """
    loop, response = channel(dead)
    omega = np.arange(0.0, 300.0, 1e-3)
    L = response(1j * omega)
    found = margins_of_late(loop)
    assert found.stable
    assert found.gain[1] == pytest.approx(1 / largest_crossing(L), rel=1e-4)
    nearest = np.abs(1 + L).min()
    assert nearest * (1 - 3e-4) <= found.modulus <= nearest * (1 + 1e-6)
    assert found.holds, found.certificate.failures


def test_what_is_only_approached_is_at_infinite_frequency():
    """L tends to 0.3 exp(-s) + 0.2 exp(-1.4142 s) from below: it comes close to -0.5."""
    plant = tf([0.3, 0.1], [1, 1]) * late(1.0) + tf([0.2, 0.1], [1, 1]) * late(math.sqrt(2), "b")
    found = margins_of_late(late_pair(uncertain(plant), uncertain(1.0)).loops[0])
    omega = np.arange(1e-3, 500.0, 1e-3)
    s = 1j * omega
    L = ((0.3 * s + 0.1) * np.exp(-s) + (0.2 * s + 0.1) * np.exp(-math.sqrt(2) * s)) / (s + 1)
    assert 0.49 < largest_crossing(L) < 0.5
    assert 2 * (1 - 1e-3) <= found.gain[1] <= 2
    assert found.gains[found.gains[:, 0] == found.gain[1], 1].tolist() == [math.inf]
    assert "in the limit of infinite frequency" in repr(found)
    assert found.modulus == pytest.approx(0.5, rel=1e-2)


def test_multiples_of_one_dead_time_turn_together():
    """0.3 exp(-s) + 0.2 exp(-2 s) is at most 0.2 from 0 where it is negative, and not 0.5."""
    plant = 0.3 * late(1.0) + 0.2 * late(2.0, "b")
    found = margins_of_late(late_pair(uncertain(plant), uncertain(1.0)).loops[0])
    assert 5 * (1 - 1e-3) <= found.gain[1] <= 5
    turn = np.exp(-1j * np.linspace(0.0, 2 * np.pi, 10_001))
    nearest = np.abs(1 + 0.3 * turn + 0.2 * turn**2).min()
    assert nearest * (1 - 1e-2) <= found.modulus <= nearest * (1 + 1e-6)


def test_delays_as_multiples():
    exact = [Fraction(one) for one in (0.0, 0.25, 0.75)]
    assert multiples_of(exact, exact[1:]) == {exact[0]: (0,), exact[1]: (1,), exact[2]: (3,)}
    a, b, c = (Fraction(one) for one in (0.1, 0.2**0.5, 0.3**0.5))
    found = multiples_of([Fraction(0), a, b + c], [a, b, c])
    assert found == {Fraction(0): (0, 0), a: (1, 0), b + c: (0, 1)}
    assert multiples_of([Fraction(0)], [a]) == {Fraction(0): ()}


def test_limits_against_a_dense_grid_of_phases():
    rng = np.random.default_rng(0)
    multiples = np.array([[0, 0], [1, 0], [0, 1], [1, 1]], dtype=float)
    f = LimitSum(rng.uniform(-0.2, 0.2, 4), multiples)
    g = LimitSum(np.append(1.0, rng.uniform(-0.2, 0.2, 3)), multiples)
    line = np.linspace(-np.pi, np.pi, 501)
    grid = np.stack(np.meshgrid(line, line), axis=-1).reshape(-1, 2)
    ratio = f.at(grid) / g.at(grid)
    limits = LimitPair(f, g)
    touching = (np.abs(ratio.imag) < 2e-3) & (ratio.real < 0)
    largest = -ratio.real[touching].min(initial=0.0)
    assert limits.largest_crossing() == pytest.approx(largest, abs=4e-3)
    level = limits.largest_crossing() * 1.05 + 0.01
    least = min(np.abs(f.at(grid) + x * g.at(grid)).min() for x in np.linspace(level, 1, 15))
    assert 0.45 * least <= limits.least_size(level) <= least
    swapped = limits.swapped.least_ratio(1e-3)
    exact = np.abs(1 / ratio).min()
    assert swapped[0] <= exact <= swapped[0] * (1 + 2e-3)
