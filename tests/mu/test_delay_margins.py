"""Margins of uncertain delays in seconds, against closed forms of first-order loops."""

import math

import control
import numpy as np
import pytest

from workbench.mu import robust_stability
from workbench.mu.robust import delay_margins
from workbench.mu.robust.delay_margins import delay_is_lost
from workbench.mu.robust.lone_delay import first_delay, loop_about
from workbench.uncertainty import delay, feedback, real, tf


def longest(gain, lag):
    """The delay [s] at which gain / (lag s + 1) with unit feedback is on the border."""
    omega = math.sqrt(gain**2 - 1) / lag
    return (math.pi - math.atan(omega * lag)) / omega


@pytest.mark.parametrize(("gain", "lag", "high"), [(5, 1, 10), (2, 5, 100), (5, 1, 0.01)])
def test_a_delay_is_told_in_seconds(gain, lag, high):
    margin = robust_stability(feedback(tf([gain], [lag, 1]) * delay("tau", 0, high), 1))
    borne, lost = margin.delays["tau"]
    truth = longest(gain, lag)
    assert (1 - 2e-6) * truth < borne < truth < lost < (1 + 2e-6) * truth
    assert f"any delay up to {borne:.5g} s, unstable with {lost:.5g} s" in repr(margin)
    assert "none of seconds" in repr(margin)
    assert margin.holds, margin.certificate.failures


def test_the_unit_of_time_changes_nothing_else():
    slow, fast = (
        robust_stability(feedback(tf([5], [unit, 1]) * delay("tau", 0, unit), 1)).delays["tau"]
        for unit in (1.0, 1e-6)
    )
    np.testing.assert_allclose(np.multiply(fast, 1e6), slow, rtol=1e-6)


def test_a_loop_that_bears_every_delay_loses_none():
    margin = robust_stability(feedback(tf([0.5], [1, 1]) * delay("tau", 0, 1), 1))
    borne, lost = margin.delays["tau"]
    assert borne == lost == math.inf
    assert margin.holds, margin.certificate.failures
    assert "no longer one found" in repr(margin)


def test_what_only_rounding_makes_unstable_is_not_lost(monkeypatch):
    """The poles of a loop with a delay of 1e6 s and a lag of 1 s, moved as rounding moves them."""
    monkeypatch.setattr(delay_margins, "loop_about", lambda found, name: None)  # by Pade
    found = feedback(tf([0.5], [1, 1]) * delay("tau", 0, 1), 1)
    poles = control.StateSpace.poles
    with monkeypatch.context() as moved:
        moved.setattr(control.StateSpace, "poles", lambda system: poles(system) + 2e-6)
        assert not delay_is_lost(found, "tau", 9e5)
    longer = feedback(tf([5], [1, 1]) * delay("tau", 0, 1), 1)
    assert delay_is_lost(longer, "tau", 0.4) and not delay_is_lost(longer, "tau", 0.3)


CONTROLLER = control.tf([1, 0.5], [1, 0])
PLANT = control.tf([2], [3, 1])
LATE = delay("tau", 0, 10)
PLACES = {
    "before": lambda: feedback(LATE * tf([2], [3, 1]) * CONTROLLER, 1),
    "between": lambda: feedback(tf([2], [3, 1]) * LATE * CONTROLLER, 1),
    "on the way back": lambda: feedback(tf([2], [3, 1]) * CONTROLLER, LATE),
    "of a sensitivity": lambda: feedback(1, tf([2], [3, 1]) * LATE * CONTROLLER),
    "of a controller": lambda: feedback(tf([2], [3, 1]), LATE * CONTROLLER),
}


@pytest.mark.parametrize("place", PLACES)
def test_the_loop_about_a_delay_is_seen_wherever_it_stands(place):
    L = loop_about(PLACES[place](), "tau")
    omega = np.geomspace(0.01, 10, 50)
    np.testing.assert_allclose(L(1j * omega), (PLANT * CONTROLLER)(1j * omega), rtol=1e-12)


@pytest.mark.parametrize("seed", range(24))
def test_random_loops_lose_the_delay_of_their_crossovers(seed):
    """Least of the delays at which exp(-j w tau) L is -1, where |L| is 1 on a fine grid."""
    rng = np.random.default_rng(seed)
    lags = 10 ** rng.uniform(-1, 1, 3)
    gain = 10 ** rng.uniform(0.2, 0.6)
    den = np.polymul(np.polymul([lags[0], 1], [lags[1], 1]), [lags[2], 1])
    loop = tf([gain], list(den))
    closed = feedback(loop * delay("tau", 0, 10 ** rng.uniform(-2, 2)), 1)
    if closed.nominal.poles().real.max() >= -1e-3:
        return
    omega = np.linspace(1e-3, 20.0, 400_001)
    L = gain / np.polyval(den, 1j * omega)
    k = np.flatnonzero(np.diff(np.sign(np.abs(L) - 1)))
    truth = (np.mod(np.angle(-L[k]), 2 * math.pi) / omega[k]).min()
    borne, lost = robust_stability(closed, tolerance=1e-2).delays["tau"]
    assert borne == pytest.approx(truth, rel=1e-3) and borne < lost < 1.00001 * borne


@pytest.mark.cases(1)
@pytest.mark.parametrize("loop", [5 * LATE, tf([5, 1], [1, 1]) * LATE])
def test_a_loop_that_does_not_roll_off_bears_no_delay(loop):
    closed = feedback(loop, 1)
    assert first_delay(loop_about(closed, "tau")) is None
    assert robust_stability(closed).delays["tau"][0] == 0.0


@pytest.mark.cases(0)
def test_a_delay_that_occurs_twice_is_proven_by_its_cover():
    loop = tf([2], [1, 1]) * LATE
    closed = feedback(loop * loop, 1)
    assert loop_about(closed, "tau") is None
    borne, lost = robust_stability(closed).delays["tau"]
    assert 0 < borne < lost


def test_other_elements_count_with_their_whole_set():
    k = real("k", 5, percent=20)
    margin = robust_stability(feedback(k * tf([1], [1, 1]) * delay("tau", 0, 1), 1))
    borne, lost = margin.delays["tau"]
    assert 0.8 * longest(6, 1) < borne < longest(6, 1) < lost
    assert lost == pytest.approx(longest(5, 1), rel=2e-6)


@pytest.mark.parametrize("place", [0, 1])
def test_a_claim_that_is_too_good_fails(place):
    from dataclasses import replace

    margin = robust_stability(feedback(tf([5], [1, 1]) * delay("tau", 0, 10), 1))
    claimed = list(margin.delays["tau"])
    claimed[place] *= 1.0001 if place == 0 else 0.9999
    wrong = replace(margin, delays={"tau": tuple(claimed)}).with_checker(margin._checked_by[0])
    assert not wrong.holds


def test_systems_without_delays_have_none():
    closed = feedback(tf([18], [1, 1.8, real("k", 10, percent=40)]) * control.tf([1], [1]), 1)
    margin = robust_stability(closed)
    assert margin.delays == {} and "seconds" not in repr(margin)
