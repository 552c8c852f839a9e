"""Observer gains place the wanted poles in any scaling; plants that have no gain are named."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm
from scipy.signal import place_poles

from workbench.diagnosis import observer_gain, prototype_poles
from workbench.diagnosis.estimators.observers import placement_residual
from workbench.errors import InputError

PERIOD = 1 / 35e3
"""Sample time [s]."""


def chain(n, rng):
    """A chain of n oscillators and lags, seen at its end."""
    A = np.diag(-rng.uniform(0.1, 3.0, n)) + np.diag(rng.uniform(0.5, 2.0, n - 1), 1)
    A += np.diag(-rng.uniform(0.5, 2.0, n - 1), -1)
    return A, np.eye(n)[:1]


@given(st.integers(1, 7), st.integers(0, 10_000), st.booleans())
@settings(derandomize=True, deadline=None, max_examples=60)
def test_poles_are_where_they_were_wanted(n, seed, discrete):
    rng = np.random.default_rng(seed)
    A, C = chain(n, rng)
    poles, period = prototype_poles("bessel", n, rng.uniform(1.0, 5.0)), None
    if discrete:
        period = 0.1
        A, poles = expm(A * period), np.exp(poles * period)
    scale = 10.0 ** rng.uniform(-6, 6, n)  # micrometres, volts, anything
    gain = observer_gain(A * scale[:, None] / scale, C / scale, poles, dt=period)
    plain = gain / scale[:, None]
    placed = np.linalg.eigvals(A - plain @ C)
    assert abs(placed[:, None] - poles).min(axis=0).max() < 1e-6
    np.testing.assert_allclose(plain, observer_gain(A, C, poles, dt=period), rtol=1e-6, atol=1e-9)


def test_against_another_method():
    A, C = chain(4, np.random.default_rng(5))
    poles = np.array([-2.0, -3.0, -4.0, -5.0])
    other = place_poles(A.T, C.T, poles).gain_matrix.T
    np.testing.assert_allclose(observer_gain(A, C, poles), other, rtol=1e-7)


def test_poles_may_be_multiple_and_outputs_several():
    A, C = chain(4, np.random.default_rng(6))
    poles = np.full(4, -3.0)
    gain = observer_gain(A, C, poles)
    np.testing.assert_allclose(np.poly(A - gain @ C), np.poly(poles), rtol=1e-7)
    two = np.vstack([C, np.eye(4)[3]])
    assert placement_residual(A, two, observer_gain(A, two, poles), poles.astype(complex)) < 1e-9


def test_sampled_fast_all_poles_crowd_about_one():
    """A 30 Hz lens and a 5.5 Hz oscillator at 35 kHz, in metres and volts."""
    A = np.zeros((4, 4))
    A[:2, :2] = [[0.0, 1.0], [-((2 * np.pi * 30) ** 2), -20.0]]
    A[1, 2] = 60.0
    A[2:, 2:] = [[0.0, -35.0], [35.0, 0.0]]
    wanted = np.exp(np.array([-900 + 900j, -900 - 900j, -60 + 35j, -60 - 35j]) * PERIOD)
    phi = expm(A * PERIOD)
    gain = observer_gain(phi, [[1.0, 0, 0, 0]], wanted, dt=PERIOD)
    placed = np.log(np.linalg.eigvals(phi - gain @ [[1.0, 0, 0, 0]])) / PERIOD
    assert abs(placed[:, None] - np.log(wanted) / PERIOD).min(axis=0).max() < 1e-3


def test_a_mode_that_does_not_show_is_named():
    A = np.diag([-1.0, -2.0, -3.0])
    with pytest.raises(InputError, match=r"s = -2.* does not show"):
        observer_gain(A, [[1.0, 0.0, 1.0]], [-4, -5, -6])
    turning = np.array([[0.0, -2 * np.pi * 5.5], [2 * np.pi * 5.5, 0.0]])
    phi = np.eye(3)
    phi[:2, :2] = expm(turning * PERIOD)
    phi[2, 2] = 0.5
    with pytest.raises(InputError, match=r"5\.5 Hz\) does not show"):
        observer_gain(phi, [[0.0, 0.0, 1.0]], [0.1, 0.2, 0.3], dt=PERIOD)


@pytest.mark.parametrize(
    "poles, period, message",
    [
        ([-1.0, 0.0], None, "left half-plane"),
        ([0.5, -1.0], 0.1, "unit circle"),
        ([-1.0], None, r"2 states need \(2,\)"),
        ([-1.0 + 1j, -1.0 + 1j], None, "conjugate"),
        ([-1.0, np.nan], None, "finite"),
        ([0.1, 0.2], 0.0, "dt is 0"),
    ],
)
def test_poles_that_are_none(poles, period, message):
    with pytest.raises(InputError, match=message):
        observer_gain([[0.0, 1.0], [-1.0, 0.0]], [[1.0, 0.0]], poles, dt=period)


def test_matrices_that_do_not_fit():
    with pytest.raises(InputError, match="need"):
        observer_gain(np.eye(2), np.ones((1, 3)), [-1, -2])
    with pytest.raises(InputError, match="need"):
        observer_gain(np.ones(3), np.ones(3), [-1, -2])
