"""Margins of uncertain delays in seconds, against closed forms of first-order loops."""

import math

import control
import numpy as np
import pytest

from workbench.mu import robust_stability
from workbench.mu.robust.delay_margins import delay_is_lost
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
    assert 0.85 * truth < borne < truth
    assert lost == pytest.approx(truth, rel=1e-4) and lost > borne
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
    assert borne > 1e5 and lost == math.inf
    assert "no longer one found" in repr(margin)


def test_what_only_rounding_makes_unstable_is_not_lost(monkeypatch):
    """The poles of a loop with a delay of 1e6 s and a lag of 1 s, moved as rounding moves them."""
    found = feedback(tf([0.5], [1, 1]) * delay("tau", 0, 1), 1)
    poles = control.StateSpace.poles
    with monkeypatch.context() as moved:
        moved.setattr(control.StateSpace, "poles", lambda system: poles(system) + 2e-6)
        assert not delay_is_lost(found, "tau", 9e5)
    longer = feedback(tf([5], [1, 1]) * delay("tau", 0, 1), 1)
    assert delay_is_lost(longer, "tau", 0.4) and not delay_is_lost(longer, "tau", 0.3)


def test_other_elements_count_with_their_whole_set():
    k = real("k", 5, percent=20)
    margin = robust_stability(feedback(k * tf([1], [1, 1]) * delay("tau", 0, 1), 1))
    borne, lost = margin.delays["tau"]
    assert 0.8 * longest(6, 1) < borne < longest(6, 1) < lost
    assert lost == pytest.approx(longest(5, 1), rel=1e-4)


@pytest.mark.parametrize("place", [0, 1])
def test_a_claim_that_is_too_good_fails(place):
    from dataclasses import replace

    margin = robust_stability(feedback(tf([5], [1, 1]) * delay("tau", 0, 10), 1))
    claimed = list(margin.delays["tau"])
    claimed[place] *= 1.05 if place == 0 else 0.95
    wrong = replace(margin, delays={"tau": tuple(claimed)}).checked_by(margin._checked_by[0])
    assert not wrong.holds


def test_systems_without_delays_have_none():
    closed = feedback(tf([18], [1, 1.8, real("k", 10, percent=40)]) * control.tf([1], [1]), 1)
    margin = robust_stability(closed)
    assert margin.delays == {} and "seconds" not in repr(margin)
