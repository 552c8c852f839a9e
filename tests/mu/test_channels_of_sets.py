"""Gain, phase and delay as perturbations of a channel, and checks of what is claimed of a set."""

import math
from dataclasses import replace
from functools import partial
from types import SimpleNamespace

import control
import numpy as np
import pytest

from workbench.mu.boxes.margin import BoxMargin, LastGrowing
from workbench.mu.boxes.recentred import RealParameters, real_perturbation
from workbench.mu.frequency.channels import even_channels
from workbench.mu.margins import channel_factors, of_sets
from workbench.mu.margins.classical import classical_margins
from workbench.mu.margins.closed_loop import ClosedLoop
from workbench.mu.margins.of_sets import SetChecker, SetMargins, margins_of_channel
from workbench.mu.margins.set_delay import DelayBounds, _DelaySearch, delay_bounds
from workbench.uncertainty import real, tf

THIRD = tf([real("k", 4, percent=10)], [1, 3, 3, 1])
"""k / (s + 1)^3 with a gain margin of 2 at sqrt(3) rad/s."""
CROSSOVER = math.sqrt(4 ** (2 / 3) - 1)
PHASE = math.pi - 3 * math.atan(CROSSOVER)
FALLING = tf([real("k", 2, percent=10)], [1, -1])
"""k / (s - 1), lost where the gain falls to one half."""


def loop_of(plant):
    asked = ClosedLoop(plant, 1.0, 0.0, 1e-4, None, None)
    return asked.stable_loop, asked.channels


def regular(whole, structure, t, omega):
    """The least singular value of I - M Delta at a frequency, for the plant's nominal."""
    A, B, C, D = control.ssdata(whole)
    M = C @ np.linalg.solve(1j * omega * np.eye(len(A)) - A, B) + D
    Delta = real_perturbation(structure, np.array([0.0, t]))
    return np.linalg.svd(np.eye(len(M)) - M @ Delta, compute_uv=False)[-1]


CASES = {
    "rise": (THIRD, channel_factors.with_rise, 1.0, math.sqrt(3)),
    "fall": (FALLING, channel_factors.with_fall, 1.0, 0.0),
    "phase": (THIRD, channel_factors.with_phase, math.tan(PHASE / 2), CROSSOVER),
    "lead": (THIRD, channel_factors.with_phase, -math.tan(PHASE / 2), CROSSOVER),
    "delay": (THIRD, channel_factors.with_delay, math.tan(PHASE / 4), CROSSOVER),
}


@pytest.mark.parametrize("kind", CASES)
def test_the_loop_is_lost_where_the_factor_turns_it_to_minus_one(kind):
    plant, change, t, omega = CASES[kind]
    loop, channels = loop_of(plant)
    for channel in channels:
        whole, structure = change(loop, channel)
        assert regular(whole, structure, t, omega) < 1e-9
        for other in (0.5 * t, 1.5 * t):
            assert regular(whole, structure, other, omega) > 1e-3


def test_bounds_of_factors_are_told_as_gains_and_degrees(monkeypatch):
    loop, channels = loop_of(THIRD)
    found = iter([1.0, 3.0, math.tan(math.radians(15.0))])
    monkeypatch.setattr(
        of_sets, "box_margin", lambda *given: BoxMargin(t := next(found), 1.1 * t, None, 1)
    )
    monkeypatch.setattr(of_sets, "delay_bounds", lambda *given: DelayBounds(0.2, 0.3, None))
    told = margins_of_channel(loop, next(iter(channels)), 0.1, 10)
    assert told.gain == pytest.approx((0.25, 2.0))
    assert told.phase_deg == pytest.approx(30.0)
    assert (told.delay, told.delay_lost) == (0.2, pytest.approx(0.3))


HONEST = SetMargins((0.5, 2.0), 30.0, (0.49, 2.1), 31.0, 0.2, 0.21, {})
BETTER = {
    "least gain": {"gain": (0.4, 2.0)},
    "largest gain": {"gain": (0.5, 2.5)},
    "phase": {"phase_deg": 40.0},
    "delay": {"delay": 0.3},
}
WORSE = {
    "least gain": {"gain": (0.6, 2.0)},
    "largest gain": {"gain": (0.5, 1.9)},
    "phase": {"phase_deg": 20.0},
    "delay": {"delay": 0.1},
}


@pytest.mark.parametrize("name", BETTER)
def test_a_margin_may_be_claimed_too_small_and_not_too_large(monkeypatch, name):
    loop, channels = loop_of(THIRD)
    checker = SetChecker(loop, next(iter(channels)), 0.1, 10)
    monkeypatch.setattr(of_sets, "proven_again", lambda *given: HONEST)
    assert all(check.holds for check in checker.checks(replace(HONEST, **WORSE[name]), 1e-6))
    found = checker.checks(replace(HONEST, **BETTER[name]), 1e-6)
    assert [check.name for check in found if not check.holds] == [name]


@pytest.mark.parametrize("name", BETTER)
def test_the_worst_plant_that_is_drawn_counts(monkeypatch, name):
    """Two plants by turns, of which one keeps only what is honest."""
    loop, channels = loop_of(THIRD)
    checker = SetChecker(loop, next(iter(channels)), 0.1, 10)
    tight = SimpleNamespace(gain=(0.5, 2.0), phase_deg=30.0, delay=0.2)
    wide = SimpleNamespace(gain=(0.1, 9.0), phase_deg=90.0, delay=2.0)
    turns = iter([tight, wide] * of_sets.DRAWN_PLANTS)
    monkeypatch.setattr(SetChecker, "_crossings", lambda self, member: next(turns))
    assert all(check.holds for check in checker.second_opinion(HONEST))
    found = checker.second_opinion(replace(HONEST, **BETTER[name]))
    assert [check.name for check in found if not check.holds] == [f"drawn: {name}"]


def test_what_does_not_grow_has_its_own_size():
    boxes = LastGrowing(2)
    assert boxes.others(7.0) == 1.0
    part = boxes.box(7.0)
    assert part.low.tolist() == [-1.0, 0.0] and part.high.tolist() == [1.0, 7.0]


@pytest.mark.cases(1)
@pytest.mark.parametrize("share", [0.8, 1.05])
def test_a_delay_is_proven_up_to_the_margin_of_the_worst_plant(share):
    """Of K / (s + 1)^2 for K from 1.5 to 3: no member tells the search its margin."""
    K = real("K", 2.25, low=1.5, high=3.0)
    plant = tf([K], [1, 2, 1])
    loop, channels = loop_of(plant)
    channel = next(iter(channels))
    worst = classical_margins(control.ss(plant.at(K=3.0))).delay
    whole, structure = channel_factors.with_delay(loop, channel)
    given = RealParameters(even_channels(whole, structure)[0], structure)
    search = _DelaySearch(given, lambda values: math.inf, 0.2, 240)
    assert search.decide(share * worst, search.region()) is (share < 1)


def test_members_bound_the_delay_from_above():
    loop, channels = loop_of(THIRD)
    channel = next(iter(channels))
    delays = [of_sets._delay_of(loop, channel, np.array([v])) for v in (-1.0, 0.0, 1.0)]
    exact = [classical_margins(control.ss(THIRD.at(k=k))).delay for k in (3.6, 4.0, 4.4)]
    assert delays == pytest.approx(exact)
    assert delays[1] == pytest.approx(PHASE / CROSSOVER)


def delay_search(K, most=240):
    """The search of the delay of K / (s + 1)^2, and its loop's channel."""
    loop, channels = loop_of(tf([K], [1, 2, 1]))
    whole, structure = channel_factors.with_delay(loop, next(iter(channels)))
    given = RealParameters(even_channels(whole, structure)[0], structure)
    return _DelaySearch(given, lambda values: math.inf, 0.2, most)


def test_the_region_holds_every_crossover_whatever_its_phase():
    """At a gain of 1.1 the loop must be turned by 145 degrees, at 0.32 rad/s."""
    region = delay_search(real("K", 1.1, percent=5)).region()
    for K in (1.05, 1.1, 1.15):
        crossover = math.sqrt(K - 1)
        assert any(low <= crossover <= high for low, high in region)


@pytest.mark.parametrize("delay", [0.05, 0.5, 5.0])
def test_a_band_is_turned_as_far_as_its_highest_frequency(monkeypatch, delay):
    """Parts that are closed at once, and such as are cut to the third generation, cover all."""
    search, parts = delay_search(real("K", 2.25, low=1.5, high=3.0)), []

    def examined(part):
        parts.append(part)
        wide = part.bands[0][1] > 1.2 * part.bands[0][0] and len(parts) < 40
        return (part, np.ones(2)) if wide else None

    monkeypatch.setattr(search, "_examined", examined)
    monkeypatch.setattr(search, "share", 10**6)
    search.decide(delay, [(0.1, 10.0), (20.0, math.inf)])
    rng = np.random.default_rng(1)
    for omega in [*np.geomspace(0.1, 10.0, 23), 20.0, 300.0]:
        K, share = rng.uniform(-1, 1), rng.uniform(0, 1)
        t = math.tan(min(omega * share * delay, math.pi) / 4)
        assert any(
            part.low[0] <= K <= part.high[0]
            and part.low[1] <= t <= part.high[1] * (1 + 1e-12)
            and part.bands[0][0] <= omega <= part.bands[0][1]
            for part in parts
        )


def test_crossovers_that_go_to_zero_cost_no_more():
    """(s + z) / (s^2 + 3 s + 2) crosses from omega = 0 on where z > 2; 4,000 parts proved 0 s."""
    z = real("z", 2, percent=20)
    loop, channels = loop_of(tf([1, z], [1, 3, 2]))
    channel = next(iter(channels))
    whole, structure = channel_factors.with_delay(loop, channel)
    given = RealParameters(even_channels(whole, structure)[0], structure)
    found = delay_bounds(given, partial(of_sets._delay_of, loop, channel), 1e-2, 300)
    # |L|^2 = 1 with z = 2.4: w^4 + 4 w^2 = z^2 - 4.
    omega = math.sqrt(-2 + math.sqrt(2.4**2))
    phase = math.pi + math.atan(omega / 2.4) - math.atan(omega) - math.atan(omega / 2)
    assert 0.99 * phase / omega < found.lower < phase / omega <= found.upper * (1 + 1e-9)
