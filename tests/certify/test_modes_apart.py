"""Gains of differences of systems with nearly the same poles, against values in 50 digits."""

import math

import mpmath
import numpy as np
import pytest
from scipy.linalg import block_diag

from workbench.certify.realisations.modes_apart import gain_by_modes


def resonances(frequencies, damping, sizes):
    """Lightly damped pairs, each from its own input to its own output."""
    A = block_diag(
        *([[-z * w, w], [-w, -z * w]] for w, z in zip(frequencies, damping, strict=True))
    )
    n = len(frequencies)
    B, C = np.zeros((2 * n, n)), np.zeros((n, 2 * n))
    B[1::2], C[:, ::2] = np.diag(sizes), np.eye(n)
    return A, B, C, np.zeros((n, n))


def largest(one, other, k, w, z):
    """The gain of the difference of resonance k about its peak, in 50 digits."""
    with mpmath.workdps(50):
        found = []
        for step in np.linspace(-3, 3, 601):
            s = mpmath.mpc(0, mpmath.mpf(w) * (1 + mpmath.mpf(step * z)))
            values = []
            for A, B, C, _ in (one, other):
                a, b, c, d = (
                    mpmath.mpf(x) for x in A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2].ravel()
                )
                det = (s - a) * (s - d) - b * c
                values.append(mpmath.mpf(C[k, 2 * k]) * b * mpmath.mpf(B[2 * k + 1, k]) / det)
            found.append(abs(values[0] - values[1]))
        return float(max(found))


@pytest.mark.parametrize("z", [1e-6, 1e-9, 1e-11])
def test_pairs_that_differ_by_rounding(z):
    w, sizes = np.array([1.0, 2.5]), np.array([0.5, 1.0])
    one = resonances(w, [z, 10 * z], sizes)
    other = resonances(w * (1 + np.array([3e-17, 4e-16])), [z * (1 + 1e-9), 10 * z], sizes)
    bound = gain_by_modes(one, other, False)
    truth = max(largest(one, other, k, w[k], [z, 10 * z][k]) for k in range(2))
    assert truth <= bound <= 8 * truth


def test_a_mode_that_the_other_lacks_counts_whole():
    one = resonances([1.0, 2.0], [0.1, 0.1], [1.0, 1.0])
    A, B, C, D = one
    other = A[:2, :2], B[:2], C[:, :2], D
    truth = np.abs(2.0 / ((1j * np.linspace(1.5, 2.5, 4001) + 0.2) ** 2 + 4.0)).max()
    assert truth <= gain_by_modes(one, other, False) <= 2.1 * truth
    assert gain_by_modes(one, one, False) < 1e-60


def test_sampled_poles_and_direct_terms():
    one = np.array([[0.5]]), np.array([[1.0]]), np.array([[1.0]]), np.array([[0.25]])
    other = np.array([[0.6]]), np.array([[1.0]]), np.array([[1.0]]), np.array([[0.0]])
    z = np.exp(1j * np.linspace(0, np.pi, 1001))
    truth = np.abs(1 / (z - 0.5) + 0.25 - 1 / (z - 0.6)).max()
    assert truth <= gain_by_modes(one, other, True) <= 2 * truth


def test_repeated_poles_and_those_on_the_boundary_are_not_bounded():
    jordan = np.array([[-1.0, 1.0], [0.0, -1.0]]), np.eye(2), np.eye(2), np.zeros((2, 2))
    assert math.isinf(gain_by_modes(jordan, jordan, False))
    idle = np.array([[0.0]]), np.eye(1), np.eye(1), np.zeros((1, 1))
    still = np.array([[-1.0]]), np.eye(1), np.eye(1), np.zeros((1, 1))
    assert math.isinf(gain_by_modes(idle, still, False))
