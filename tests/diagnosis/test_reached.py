"""What is reached of a demand that cannot be had, on a heater's loop."""

import control
import numpy as np
import pytest

from workbench.diagnosis import (
    DemandReached,
    EstimationDemands,
    FaultFront,
    FaultLoop,
    LaguerreBasis,
    best_design,
    full_order_filter,
    low_order_filter,
)
from workbench.diagnosis.estimation.front import GRID_MARGIN
from workbench.diagnosis.estimation.reached import STABILITY_ROOM, stable_share
from workbench.errors import InputError, SolverError
from workbench.fitting.rational import Rational
from workbench.uncertainty import UncertaintyModel

HZ = 2 * np.pi
GRID = np.unique(np.concatenate([np.geomspace(1e-4, 20.0, 120), [0.05, 0.5, 1.0]]))
COUNT = 8
LIMITS = 0.5, 2e-3
"""Relative error and leakage [K] that the set allows."""
TIGHT = 0.1, 1e-5
"""A demand that it does not allow."""
DEMANDS = EstimationDemands(
    error_above_hz=0.5,
    leakage_below_hz=0.05,
    gain=2.0,
    disturbance=control.ss(-0.1, 0.1, 3e-3, 0.0),
    noise=1e-4,
    noise_band_hz=1.0,
    unit=1e-3,
)


def rational(pole, gain):
    return Rational([], [-pole], gain)


def heater(wider=1.0, real=True):
    """The loop of a heater, its complex weight `wider` times as large."""
    W_r = rational(1.0, 0.15) if real else None
    model = UncertaintyModel(rational(0.2, 0.2), rational(2.0, 0.2 * wider), W_r)
    K, H = control.ss(0.0, 0.1, 1.0, 0.8), control.ss(-30.0, 30.0, 1.0, 0.0)
    return FaultLoop(model, K, H, DEMANDS)


def front_of(loop):
    front = FaultFront(loop, GRID)
    return front, LaguerreBasis(loop, HZ * 0.2).response(front.omega, COUNT)


def reached_by(loop, error, leakage, peak=None, order=None):
    """The best filter of full order, or of few states, for a demand."""

    def limits(reached):
        named = {"error": error, "leakage": leakage, "peak": peak or 0.0}
        return {name: reached.factor * one or None for name, one in named.items()}

    def least_factor(reached):
        front, basis = front_of(loop.within(reached.share))
        return front.least_factor(basis, **limits(reached))

    def designed(reached):
        smaller = loop.within(reached.share)
        try:
            basis = LaguerreBasis(smaller, HZ * 0.2)
            found = full_order_filter(smaller, GRID, basis, COUNT, **limits(reached))
            if order is not None:
                found = low_order_filter(smaller, GRID, found.F, order, **limits(reached))
        except SolverError:
            return None
        return found if found.meets else None

    return best_design([loop], least_factor, designed)


@pytest.mark.cases(1)
@pytest.mark.parametrize("peak", [None, 1.0])
def test_the_least_factor_parts_what_can_be_had_from_what_cannot(peak):
    """By another program: `least` finds a filter above the factor, and none below it."""
    front, basis = front_of(heater())
    asked = {"error": TIGHT[0], "leakage": TIGHT[1], "peak": peak}
    factor = front.least_factor(basis, **asked)
    assert factor > 1.0
    above, below = (
        {name: one and share * factor * one for name, one in asked.items()}
        for share in (1 + 1e-4, 1 - 1e-4)
    )
    point = front.least(basis, **above)
    assert point.error <= above["error"] and point.leakage <= above["leakage"]
    with pytest.raises(SolverError, match="no filter of this basis"):
        front.least(basis, **below)


def test_the_least_factor_is_of_the_limits_and_falls_with_the_set():
    """Limits twice as large have half the factor; the gain's limit does not bind here."""
    front, basis = front_of(heater())
    once, twice = (front.least_factor(basis, *(k * one for one in TIGHT)) for k in (1, 2))
    assert twice == pytest.approx(once / 2, rel=1e-5)
    wide = front_of(heater(1.5))[0].least_factor(basis, *TIGHT)
    nominal = FaultFront(heater(), GRID, nominal=True).least_factor(basis, *TIGHT)
    assert nominal < once < wide


@pytest.mark.cases(0)
@pytest.mark.parametrize("peak", [None, 1.0])
def test_no_leakage_at_all_ends_in_no_filter(peak):
    """T = 0: an error of 1, and the loop as it is; the solver is not asked for the impossible."""
    front, basis = front_of(heater())
    alone = front.removed_peak(np.zeros(len(GRID), complex))
    expected = max(1 / 0.5, 0.0 if peak is None else alone / peak) / (1 - GRID_MARGIN)
    factor = front.least_factor(basis, 0.5, 1e-22, peak=peak)
    assert factor == pytest.approx(expected, rel=1e-6)
    reached, found = reached_by(heater(), 0.5, 1e-22, peak, order=3)
    assert (reached.share, found.F.nstates, found.point.leakage) == (1.0, 0, 0.0)
    assert reached.factor == pytest.approx(expected, rel=2e-3)


def test_a_demand_that_can_be_had_is_met_as_asked():
    reached, found = reached_by(heater(), *LIMITS)
    assert reached == DemandReached(1.0, 1.0) and reached.as_asked
    alone = full_order_filter(heater(), GRID, LaguerreBasis(heater(), HZ * 0.2), COUNT, *LIMITS)
    np.testing.assert_array_equal(found.point.coefficients, alone.point.coefficients)


@pytest.mark.cases(1)
@pytest.mark.parametrize("order", [None, 6])
def test_a_demand_that_cannot_be_had_ends_in_the_least_limits(order):
    """Certified for the limits reached; a hundredth less has none over the full basis."""
    loop = heater()
    reached, found = reached_by(loop, *TIGHT, order=order)
    front, basis = front_of(loop)
    least = front.least_factor(basis, *TIGHT)
    assert reached.share == 1.0 and not reached.as_asked
    assert least < reached.factor <= 1.03 * least
    assert found.meets and found.answer.upper < 1.0
    assert found.point.error <= reached.factor * TIGHT[0]
    assert found.point.leakage <= reached.factor * TIGHT[1]


@pytest.mark.cases(1)
@pytest.mark.parametrize("real", [True, False])
def test_a_set_that_the_loop_does_not_bear_is_made_smaller(real):
    """The share is 1 / mu with room: no filter for the whole set, and one for the share."""
    loop = heater(60.0, real)
    front, basis = front_of(loop)
    with pytest.raises(SolverError, match=r"near .* Hz the set has plants .* not stable"):
        front.least(basis, LIMITS[0], leakage=LIMITS[1])
    with pytest.raises(SolverError, match="not stable"):
        front.least_factor(basis, *LIMITS)
    reached, found = reached_by(loop, *LIMITS)
    assert reached.share == pytest.approx(stable_share(loop))
    assert 0.0 < reached.share < 1.0 and not reached.as_asked
    assert found.meets
    largest = reached.share / (1 - STABILITY_ROOM)
    amplified = [loop.within(k * largest).amplification(front.omega).max() for k in (0.98, 1.02)]
    assert np.isfinite(amplified[0]) and np.isinf(amplified[1])


def test_a_share_of_the_set_is_that_share_of_its_weights():
    loop, omega = heater(), HZ * GRID
    smaller = loop.within(0.25)
    for name in ("W_c", "W_r"):
        sizes = [abs(getattr(one.model, name).response(omega)) for one in (smaller, loop)]
        np.testing.assert_allclose(sizes[0], 0.25 * sizes[1], rtol=1e-12)
    np.testing.assert_array_equal(smaller.open_loop(omega), loop.open_loop(omega))
    assert stable_share(loop) == 1.0


def test_a_few_steps_find_the_least_factor_that_is_met():
    """Of designs that begin at some factor: within a step of it, whatever the start."""
    for needed in (1.0, 1.004, 1.07, 2.5):
        tried = []

        def designed(reached, needed=needed, tried=tried):
            tried.append(reached.factor)
            return "design" if reached.factor >= needed and len(tried) > 1 else None

        reached, found = best_design([heater()], lambda reached: 0.9, designed)
        assert found == "design"
        assert needed <= reached.factor <= max(1.0, 1.0101 * needed)
        assert len(tried) < 20


def test_what_is_never_met_is_named():
    with pytest.raises(SolverError, match="no filter is certified on 1 of the set with limits"):
        best_design([heater()], lambda reached: 2.0, lambda reached: None)


def test_wrong_input_is_named():
    front, basis = front_of(heater())
    for *wrong, peak in (
        (0.0, 1e-3, None),
        (0.5, -1.0, None),
        (0.5, 1e-3, 0.0),
        (np.nan, 1e-3, None),
    ):
        with pytest.raises(InputError, match="must be a number, positive and finite"):
            front.least_factor(basis, *wrong, peak=peak)
    with pytest.raises(InputError, match="share"):
        heater().within(0.0)
