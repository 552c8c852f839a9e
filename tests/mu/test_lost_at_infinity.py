"""Margins at which a loop loses its only pole's speed, or is no longer well posed."""

import control
import numpy as np
import pytest

from workbench.mu import loop_margins, peak, robust_stability
from workbench.second_opinion.peaks import nearly_singular, one_unstable
from workbench.second_opinion.responses import plain_response, precise_response
from workbench.structure import Full, Structure
from workbench.uncertainty import dynamics, feedback, real, tf


@pytest.mark.parametrize(("k", "w"), [(1.75, 0.28125), (3.5, 0.3), (2.0, 0.25)])
def test_an_integrator_whose_gain_is_lost(k, w):
    """The worst loop has a pole near 0 and no other, by which to tell that it is slow."""
    margin = robust_stability(feedback(tf([k], [1, 0]) * (1 + w * dynamics("d", 1, 1)), 1))
    assert margin.holds, margin.certificate.failures
    assert margin.lower <= 1 / w <= margin.upper * (1 + 1e-12)


def test_a_member_with_decay_is_not_unstable():
    fast, slow = (control.ss([[-x]], [[1.0]], [[1.0]], 0.0) for x in (1.0, 1e-3))
    assert not one_unstable([slow], [fast]).holds
    assert one_unstable([control.ss([[-1e-9]], [[1.0]], [[1.0]], 0.0)], [fast]).holds


@pytest.mark.cases(1)
@pytest.mark.parametrize("k", [1.0, 2.0, 3.5])
def test_a_margin_at_which_the_loop_divides_by_zero(k):
    """1 + k (s + 1) (1 + d / 2) / (s + 2) has no direct term at d = -2 (1 + k) / k."""
    margin = robust_stability(feedback(tf([k, k], [1, 2]) * (1 + 0.5 * dynamics("d", 1, 1)), 1))
    assert margin.holds and margin.omega == np.inf
    assert margin.upper == pytest.approx(2 * (1 + k) / k)
    a = real("a", 0.0, plus_minus=0.25)
    static = robust_stability(1 / (1 - a))
    assert static.holds and static.upper == pytest.approx(4.0)


def test_a_light_resonance_is_no_distance_from_singular():
    """Doubles of the response and of its frequency tell little where damping is 2^-38."""
    system = control.ss([[0.0, 1.0], [-5.0, -(2.0**-38)]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0)
    found = peak(system, Structure([Full(1, 1)]))
    assert found.holds, found.certificate.failures
    assert not nearly_singular(system, 0.9 * found.Delta, found.omega).holds


def test_a_response_where_doubles_see_a_pole():
    A = np.array([[1.0, 3.0], [0.0, 1.0]]) - 2.0**-45 * np.eye(2)
    T = np.array([[2.0, 3.0], [1.0, 2.0]])
    system = control.ss(T @ A @ np.array([[2, -3], [-1, 2]]), T[:, 1:], [[2, -3]], 0.0, 1.0)
    exact = precise_response(system, 0.1)
    assert plain_response(system, np.array([0.1]))[0] == pytest.approx(exact, rel=1e-9)
    pole = control.ss([[0.0]], [[1.0]], [[1.0]], 0.0)
    assert np.isinf(plain_response(pole, np.array([0.0]))[0]).all()


@pytest.mark.cases(0)
def test_ends_that_are_lost_are_lost():
    """5 / (s - p), p to 0.75: the gain falls to 0.15, and poles were found in doubles."""
    loop = tf([5.0], [1, -1 * real("p", 0.0, plus_minus=0.75)])
    found = loop_margins(loop, tolerance=0.1, parts=60).every_plant["loop"]
    phase = np.arccos(0.15)
    assert found.gain_lost[0] <= 0.15 <= found.gain[0]
    assert found.phase_deg <= np.degrees(phase) <= found.phase_lost_deg
    assert found.delay <= phase / np.sqrt(25 - 0.75**2) <= found.delay_lost
