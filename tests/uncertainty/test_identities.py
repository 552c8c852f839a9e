"""Elements that cancel in products that commute are seen to be without effect."""

import math

import numpy as np
import pytest

from workbench.mu import robust_stability, worst_case_gain
from workbench.uncertainty import append, complex_scalar, dynamics, feedback, real, ss, tf

K, J, M = real("k", 2.3, percent=20), real("j", 1.7, percent=20), real("m", 1, percent=30)
LAG = tf([1], [1, 1])
CANCELLING = {
    "commuting": (K * J - J * K, {"k", "j"}),
    "associating": ((K * J) * M - K * (J * M), {"k", "j", "m"}),
    "a square": ((K + J) ** 2 - K**2 - 2 * K * J - J**2 + M, {"k", "j"}),
    "a factor of nothing": (M * (K * J - J * K) + J, {"k", "m"}),
    "its own reciprocal": (K / K * M, {"k"}),
    "complex": (complex_scalar("c", 2.0, 0.3) * K - K * complex_scalar("c", 2.0, 0.3), {"c", "k"}),
    "dynamics": (dynamics("d", 1, 1) * K - K * dynamics("d", 1, 1), {"d", "k"}),
    "once": (K * J, set()),
    "repeated": (K * J - K, set()),
    "beside what is large": (1e6 * (K * J - J * K) + M + 1e-3 * J, {"k"}),
}


@pytest.mark.parametrize("name", CANCELLING)
def test_what_cancels_is_named(name):
    given, names = CANCELLING[name]
    assert set(given.cancelling) == names
    assert set((given * LAG).cancelling) == names
    values = {"k": 2.6, "j": 1.5} if {"k", "j"} <= set(given.elements) else {}
    less = given.reduced()
    assert not names & set(less.elements)
    left = {one: value for one, value in values.items() if one in less.elements}
    np.testing.assert_allclose(less.at(**left).D, given.at(**values).D, rtol=1e-6, atol=1e-6)


@pytest.mark.parametrize("gain", [K * J - J * K, M + K * J - J * K])
def test_they_cost_nothing(gain):
    """Half a minute, and a ZeroDivisionError, for k * j - j * k."""
    loop = feedback(LAG * gain, 1)
    found = robust_stability(loop)
    assert set(found.idle_elements) == {"k", "j"} and found.holds
    assert (found.upper == math.inf) == ("m" not in gain.elements)
    worst = worst_case_gain(loop)
    largest = 0.0 if "m" not in gain.elements else 1.3 / 2.3
    assert worst.lower == pytest.approx(largest, abs=1e-6) and worst.upper <= 1.01 * largest
    assert worst.holds and worst.Delta.shape == (loop.structure.rows, loop.structure.columns)


def test_states_count_as_signals():
    """Both move the poles, though not the response."""
    system = ss([[-1, K], [0, J * K - K * M]], [[1], [0]], [[1, 0]], 0)
    assert not system.cancelling and not system.without_effect


D, FAST = dynamics("d", 1, 1), tf([1], [1, 3, 2])
BEHIND_STATES = {
    "after a lag": (LAG * D - LAG * D, {"d"}, 0.0),
    "on either side of it": (LAG * K - K * LAG, {"k"}, 0.0),
    "up to rounding": (FAST * D - LAG * tf([1], [1, 2]) * D, {"d"}, 0.0),
    "in a loop": (feedback(LAG * D - D * LAG + LAG, M), {"d"}, 1 / 1.7),
    "beside what counts": (LAG * D - LAG * D + M * LAG, {"d"}, 1.3),
    "in time that is short": (tf([1], [1e-6, 1]) * D - tf([1], [1e-6, 1]) * D, {"d"}, 0.0),
    "once": (LAG * D, set(), 1.0),
    "with another sign": (LAG * D + LAG * D, set(), 2.0),
}


@pytest.mark.parametrize("name", BEHIND_STATES)
def test_what_cancels_behind_states_costs_nothing(name):
    """The search for the worst L d - L d did not end."""
    given, names, gain = BEHIND_STATES[name]
    assert set(given.without_effect) == names and not given.cancelling
    found = worst_case_gain(given)
    assert found.lower <= gain * (1 + 1e-9) and gain * (1 - 1e-9) <= found.upper
    assert found.upper <= 1.011 * gain + 1e-15
    assert found.holds and found.Delta.shape == (given.structure.rows, given.structure.columns)


def test_what_moves_a_hidden_pole_is_not_without_effect():
    """Where k is -1, a state that the output does not see is unstable."""
    hidden = append(LAG, feedback(LAG, real("k", 0, plus_minus=2)))
    assert not (np.array([[1.0, 0.0]]) @ hidden).without_effect
