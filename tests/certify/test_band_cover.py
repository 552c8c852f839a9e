"""A band of frequencies, the intervals taken off it, and multipliers between their ends."""

import math

import control
import numpy as np
import pytest

from workbench.certify.band_cover import (
    BandCover,
    CertifiedInterval,
    FrequencyBounds,
    parts_left_open,
)
from workbench.certify.stable_system import stable_system

ONE = np.ones((1, 1))
LAG = stable_system(control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]]))


def bounds_at(omega):
    """|1 / (1 + j omega)| with multipliers of 1."""
    M = LAG.response(omega)
    ones = np.ones_like(M.real)
    return FrequencyBounds(omega, M, np.abs(M)[:, 0, 0], ones, ones, 0 * ones)


def lying(omega):
    """Bounds that are half as large as they should be: they prove nothing."""
    found = bounds_at(omega)
    return FrequencyBounds(omega, found.M, found.upper / 2, found.D_left, found.D_right, found.G)


GRID = np.array([0.0, 0.1, 1.0, 10.0, math.inf])


@pytest.mark.parametrize(
    ("ends", "left"),
    [
        ((2.0, 5.0), [(1.0, 2.0), (5.0, 9.0)]),
        ((0.0, 5.0), [(5.0, 9.0)]),
        ((2.0, math.inf), [(1.0, 2.0)]),
        ((0.0, math.inf), []),
        ((0.0, 0.5), [(1.0, 9.0)]),
        ((9.5, 10.0), [(1.0, 9.0)]),
    ],
)
def test_what_an_interval_leaves_of_a_gap(ends, left):
    assert parts_left_open((1.0, 9.0), ends) == left


def test_linear_multipliers_follow_their_slopes():
    one = CertifiedInterval(1.0, 3.0, 2.0, ONE, 2 * ONE, 0 * ONE, (0.5 * ONE, -ONE, 1j * ONE))
    assert [complex(part[0, 0]) for part in one.multipliers(3.0)] == [1.5, 1.0, 1j]
    assert [complex(part[0, 0]) for part in one.multipliers(1.0)] == [0.5, 3.0, -1j]


def test_a_band_is_proven_once_no_gap_is_open():
    band = BandCover(LAG, bounds_at, 1e-3, bounds_at(GRID))
    assert band.open == [(0.0, math.inf)] and band.proven == math.inf
    band.complete(50)
    assert not band.open and 1.0 <= band.proven <= 1.002
    assert min(one.low for one in band.intervals) == 0.0
    assert max(one.high for one in band.intervals) == math.inf


def test_bounds_that_are_too_small_raise_the_level_until_it_is_proven():
    band = BandCover(LAG, lying, 1e-3, lying(GRID))
    band.complete(50)
    assert 1.0 <= band.proven < 1.1


def test_every_interval_holds_with_the_multipliers_that_it_keeps():
    """Of a kept interval with slopes, the slopes are kept too: at its ends D is positive."""
    A, B = [[-0.01, 1.0], [-1.0, -0.01]], np.eye(2)
    system = stable_system(control.ss(A, B, [[1.0, 0.2], [-0.3, 0.05]], np.zeros((2, 2))))

    def scaled_at(omega):
        M = system.response(omega)
        ratio = np.sqrt((np.abs(M[:, 1, 0]) + 1e-3) / (np.abs(M[:, 0, 1]) + 1e-3))
        D = np.zeros_like(M.real)
        D[:, 0, 0], D[:, 1, 1] = ratio, 1 / ratio
        scaled = np.sqrt(D) @ M @ np.linalg.inv(np.sqrt(D))
        upper = np.linalg.norm(scaled, 2, axis=(1, 2))
        return FrequencyBounds(omega, M, upper, D, D, 0 * D)

    band = BandCover(system, scaled_at, 1e-3, scaled_at(np.geomspace(0.5, 2.0, 5)))
    band.complete(200)
    assert not band.open
    for one in band.intervals:
        for omega in np.geomspace(max(one.low, 1e-6), min(one.high, 1e6), 7):
            D_left, D_right, _ = one.multipliers(omega)
            M = system.response(np.array([omega]))[0]
            left = band.proven**2 * D_right - M.conj().T @ D_left @ M
            assert np.linalg.eigvalsh(left)[0] > 0
