"""Margins of loops with known dead time, against closed forms and 50 digits."""

import math
from dataclasses import replace
from itertools import product

import control
import mpmath
import numpy as np
import pytest
from delayed_loops import DIGITS, DelayedLoop, crossings, is_stable, loop_of
from flint import acb_poly, arb, ctx
from lanes import thinned

from workbench.errors import InputError
from workbench.mu import loop_margins, robust_performance, worst_case_gain
from workbench.mu.loops.delayed_modulus import Bands
from workbench.mu.margins.classical import classical_margins, late_loop
from workbench.second_opinion.margins.dead_times import counted_poles
from workbench.uncertainty import dead_time_approximation, delay, feedback, real, tf
from workbench.uncertainty.algebra.dead_time import pade, pade_corner, pade_error


def late(T, name="tau"):
    return delay(name, T, T)


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
def test_an_integrator_with_dead_time(unit):
    k, T = 0.7 / unit, 0.9 * unit
    found = classical_margins(tf([k], [1, 0]) * late(T))
    assert found.stable
    assert found.gain == (0.0, pytest.approx(math.pi / 2 / (k * T), rel=1e-13))
    assert found.phase_deg == pytest.approx(90 - math.degrees(k * T), rel=1e-13)
    assert found.delay == pytest.approx((math.pi / 2 - k * T) / k, rel=1e-13)
    assert found.holds, found.certificate.failures


@pytest.mark.parametrize(("gain", "T", "stable"), [(5, 0.3617, True), (5, 0.3618, False)])
def test_a_lag_is_lost_at_its_delay(gain, T, stable):
    """The border is (pi - atan(omega)) / omega with omega = sqrt(24): 0.361741 s."""
    found = classical_margins(tf([gain], [1, 1]) * late(T))
    assert found.stable is stable
    assert found.holds, found.certificate.failures


def test_a_loop_may_be_stable_again_with_more_delay():
    """Of s^2 + 0.1 s + 2 + exp(-s T) pairs of poles cross the axis to and fro."""
    states = [
        classical_margins(tf([1], [1, 0.1, 2]) * late(T)).stable
        for T in (0.05, 1.0, 3.7, 5.5, 60.0)
    ]
    rates = [_rightmost(T) < 0 for T in (0.05, 1.0, 3.7, 5.5, 60.0)]
    assert states == rates and len(set(states)) == 2


def _rightmost(T):
    """By Chebyshev collocation of x'' + 0.1 x' + 2 x + x(t - T) = 0 (Breda, Maset, Vermiglio)."""
    n = max(40, int(8 * T))
    points = np.cos(np.pi * np.arange(n + 1) / n)
    c = np.r_[2, np.ones(n - 1), 2] * (-1) ** np.arange(n + 1)
    away = points[:, None] - points[None] + np.eye(n + 1)
    D = np.outer(c, 1 / c) / away
    D = (D - np.diag(D.sum(axis=1))) * 2 / T
    A0, A1 = np.array([[0, 1], [-2, -0.1]]), np.array([[0, 0], [-1, 0]])
    whole = np.kron(D, np.eye(2))
    whole[:2] = 0
    whole[:2, :2], whole[:2, -2:] = A0, A1
    return np.linalg.eigvals(whole).real.max()


@pytest.mark.parametrize("seed", range(128))
def test_random_loops_in_50_digits(seed):
    loop = loop_of(seed)
    found = classical_margins(loop.system)
    unit, real_ones = crossings(loop)
    assert found.stable == is_stable(loop)
    np.testing.assert_allclose(found.phases_deg[:, 1], [float(w) for w in unit], rtol=1e-12)
    with mpmath.workdps(DIGITS):
        phases = [float(mpmath.degrees(mpmath.arg(-loop(w)))) for w in unit]
        factors = [float(-1 / mpmath.re(loop(w))) for w in real_ones]
    np.testing.assert_allclose(found.phases_deg[:, 0], phases, rtol=1e-11, atol=1e-11)
    limit = abs(loop.num[0] / loop.den[0]) if len(loop.num) == len(loop.den) else 0.0
    start = loop.num[-1] / loop.den[-1] if loop.den[-1] else 0.0
    factors += [-1 / one for one in (start, -limit) if one < 0]
    assert found.gain[0] == pytest.approx(max([f for f in factors if f < 1], default=0.0), 1e-11)
    assert found.gain[1] == pytest.approx(min(f for f in factors if f > 1), 1e-11)
    if found.stable:
        sizes = [found.phases_deg[:, 1].max(initial=1 / loop.T), *found.gains[:-1, 1]]
        omega = np.linspace(0, 2 * max(sizes), 400_001)[1:]
        nearest = np.abs(1 + loop.values(omega)).min()
        assert nearest * (1 - 2e-3) <= found.modulus <= min(nearest, 1 - limit) * (1 + 1e-9)
    assert found.holds, found.certificate.failures


def test_a_loop_that_turns_thousands_of_times_below_1_keeps_its_distance():
    """0.9 / (s + 1) with 1e5 s turns 14,000 times where |L| is above 0.9 / sqrt(2)."""
    found = classical_margins(tf([0.9], [1, 1]) * late(1e5))
    assert found.modulus == pytest.approx(0.1, rel=1e-4)
    assert found.gain[1] == pytest.approx(1 / 0.9, rel=1e-6)
    assert found.holds, found.certificate.failures


@pytest.mark.parametrize(
    ("den", "T", "stable"),
    [
        ([1, 0, 3.0, 0], 1.99, True),  # to first order a pole moves by exp(-j omega T) / 12
        ([1, 0, 3.0, 0], 0.3, False),
        ([1, 0, 4.0], 2.3, True),  # and by j exp(-2j T) / 8
        ([1, 0, 4.0], 1.0, False),
    ],
)
def test_poles_on_the_axis_are_moved_by_the_dead_time(den, T, stable):
    loop = DelayedLoop((0.5,), tuple(den), T)
    found = classical_margins(loop.system)
    assert found.stable is stable is is_stable(loop)
    assert found.holds, found.certificate.failures


def test_dead_times_in_series_add_up():
    one = classical_margins(tf([2], [1, 1]) * late(0.75))
    two = classical_margins(late(0.5, "a") * control.tf([2], [1, 1]) * late(0.25, "b"))
    np.testing.assert_allclose(two.gains, one.gains, rtol=1e-14)


def test_what_has_no_margins_is_refused_by_name():
    with pytest.raises(InputError, match=r"\|L\| is 5 at infinity"):
        classical_margins(tf([5, 1], [1, 1]) * late(1))


@pytest.mark.parametrize(
    "loop",
    [
        tf([1], [1, 1]) * late(1) + 0.4,
        tf([1], [1, 1]) * late(1) + 3.0,
        feedback(tf([0.5], [1, 1]) * late(1)),
    ],
    ids=["a way round it", "a large one", "a way back"],
)
def test_dead_time_that_some_path_goes_round_counts_too(loop):
    found = classical_margins(loop)
    L = loop.response(np.linspace(1e-3, 30, 300_000))[:, 0, 0]
    assert found.stable and found.modulus == pytest.approx(np.abs(1 + L).min(), rel=1e-3)
    assert found.holds, found.certificate.failures


def test_an_unstable_loop_is_said_first_and_has_no_disks():
    found = loop_margins(tf([5], [1, 1]) * late(0.4))
    assert found.stable is False and repr(found).startswith("LoopMargins: the closed loop is UNSTA")
    with pytest.raises(InputError, match="unstable at the nominal with its dead time tau"):
        _ = found.disks
    assert found.holds, found.certificate.failures


def least_sizes(loop, skew, omega):
    """The least |delta| over frequencies: in one channel, and in plant and controller at once."""
    L = loop.response(omega)[:, 0, 0]
    S, shift = 1 / (1 + L), (skew + 1) / 2
    alone = 1 / np.abs(S + shift - 1)
    M = np.array([[shift - L * S, -S], [L * S, shift - L * S]]).transpose(2, 0, 1)
    turns = np.exp(2j * np.pi * np.arange(256) / 256)  # mu is the largest spectral radius of these
    turned = M[:, None] * np.stack([np.ones(256), turns], -1)[:, None, :]
    return alone, 1 / np.abs(np.linalg.eigvals(turned)).max(axis=(1, 2))


DISKED = {
    "no roll-off": 0.5 * late(1.0),
    "a limit": tf([1, 3], [2, 5]) * late(1.0),
    "an integrator": tf([1], [1, 0]) * late(1.0),
    "a lag": tf([2], [3, 1]) * late(0.05),
    "many turns": tf([0.105, 0], [1, 0.1, 1]) * late(20 * math.pi),
    "of the other sign": tf([-0.9], [1, 1]) * late(2.0),
}


@pytest.mark.cases(0)
@pytest.mark.parametrize("case", thinned(product(DISKED, (0.0, 1.0, -1.0, 0.4)), 3), ids=str)
def test_disks_are_those_of_the_dead_time_itself(case):
    name, skew = case
    loop = DISKED[name]
    found = loop_margins(loop, control.ss(control.tf([1.0], [1e-9, 1.0])), skew=skew)
    found = loop_margins(loop, skew=skew) if name in ("no roll-off", "a limit") else found
    grids = (
        np.geomspace(1e-3, 1e3, 1000),
        np.linspace(1e-3, 13.0, 2000),
        np.linspace(0.9, 1.2, 2000),
    )
    alone, pair = least_sizes(loop, skew, np.unique(np.concatenate(grids)))
    (disk, *_) = found.disks.values()
    assert alone.min() * (1 - 2e-3) < disk.lower <= alone.min() * (1 + 1e-6)
    assert disk.lower <= disk.upper <= disk.lower * (1 + 2e-3)
    if found.multiloop:
        every = found.multiloop["all"]
        assert pair.min() * (1 - 2e-3) < every.lower <= pair.min() * (1 + 1e-6)
    assert found.holds, found.certificate.failures


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_disks_do_not_depend_on_the_unit_of_time(unit):
    here, there = (
        loop_margins(tf([2], [3 * one, 1]) * late(0.5 * one), tf([one, 0.5], [one, 0]))
        for one in (1.0, unit)
    )
    for one, other in zip(here.disks.values(), there.disks.values(), strict=True):
        assert other.lower == pytest.approx(one.lower, rel=1e-3)
        assert other.omega * unit == pytest.approx(one.omega, rel=1e-2)


@pytest.mark.parametrize("field", ["lower", "upper"])
def test_a_disk_with_dead_time_that_is_too_good_fails(field):
    disk = loop_margins(tf([5], [1, 1]) * late(0.3)).least_disk
    factor = 1.002 if field == "lower" else 0.998
    proof = {"lower": "upper", "upper": "lower"}[field]
    wrong = replace(disk, **{field: factor * getattr(disk, field)})
    assert not wrong.with_checker(disk._checked_by[0]).holds
    spoilt = replace(disk.proof, **{proof: getattr(disk.proof, proof) / factor})
    assert not spoilt.with_checker(disk.proof._checked_by[0]).holds


def test_other_worst_factors_do_not_break_the_loop():
    disk = loop_margins(tf([5], [1, 1]) * late(0.3)).least_disk
    (name, factor), *_ = disk.worst.items()
    wrong = replace(disk, worst={name: 1.001 * factor}).with_checker(disk._checked_by[0])
    assert not wrong.holds


def resonant(T):
    """A gain above 1 about 1 rad/s only, where the phase is -T rad."""
    return tf([0.105, 0], [1, 0.1, 1]) * late(T)


def test_dead_time_that_turns_far_has_an_approximation_of_higher_order_in_sets():
    """At 6.25 rad the loop is stable, which a Pade approximation of order 6 still tells."""
    k = real("k", 1, percent=1)
    found = loop_margins(k * resonant(2 * math.pi))
    omega = np.linspace(0.5, 2, 200_001)
    truth = 1 / np.abs(1 / (1 + resonant(2 * math.pi).response(omega)[:, 0, 0]) - 0.5).max()
    assert 0.8 * truth < found.least_disk.lower <= truth


def test_dead_time_that_turns_too_far_for_disks_of_a_set_is_refused_by_name():
    found = loop_margins(real("k", 1, percent=1) * resonant(20 * math.pi))
    assert found.stable and found.nominal_disks["loop"].lower > 0.1
    with pytest.raises(InputError, match=r"tau turns the loop by .* rad"):
        _ = found.disks
    assert "no disk margins: the dead time tau turns" in repr(found)
    assert found.holds


def test_a_set_without_roll_off_is_refused_for_disks():
    """They told a disk of 0, with a plant of the approximation that no dead time is."""
    found = loop_margins(real("k", 1, percent=1) * 0.5 * late(1.0))
    with pytest.raises(InputError, match="does not fall to 0 at infinite"):
        _ = found.disks


def test_disks_of_a_set_hold_with_dead_time():
    plant = tf([real("k", 2, percent=20)], [3, 1]) * late(0.5)
    found = loop_margins(plant, control.tf([1, 0.5], [1, 0]))
    nominal = loop_margins(tf([2], [3, 1]) * late(0.5), control.tf([1, 0.5], [1, 0]))
    assert found.least_disk.lower < nominal.least_disk.lower
    assert found.classical["input"].phase_deg == pytest.approx(nominal.classical["input"].phase_deg)


@pytest.mark.cases(0)
def test_every_plant_of_a_set_keeps_its_margins_with_the_dead_time_itself():
    C = control.tf([1, 0.5], [1, 0])
    found = loop_margins(tf([real("k", 2, percent=20)], [3, 1]) * late(0.5), C, tolerance=0.05)
    every, worst = found.every_plant["input"], loop_margins(tf([2.4], [3, 1]) * late(0.5), C)
    for kept, truth in (
        (every.gain[1], worst.gain[1]),
        (every.phase_deg, worst.phase_deg),
        (every.delay, worst.delay),
    ):
        assert 0.95 * truth < kept < truth
    assert every.delay_lost == pytest.approx(worst.delay, rel=1e-5)
    assert found.phase_deg == every.phase_deg


@pytest.mark.parametrize("field", ["gains", "phases_deg", "delays", "modulus", "stable"])
def test_a_claim_that_is_too_good_fails(field):
    found = classical_margins(tf([5], [1, 1]) * late(0.3))
    value = getattr(found, field)
    wrong = (not value) if field == "stable" else value * 1.001
    claimed = replace(found, **{field: wrong}).with_checker(found._checked_by[0])
    assert not claimed.holds


def test_a_crossing_that_is_left_out_is_missed():
    found = classical_margins(tf([5], [1, 1]) * late(0.3))
    claimed = replace(found, phases_deg=found.phases_deg[:0], delays=found.delays[:0])
    assert not claimed.with_checker(found._checked_by[0]).holds


def test_a_nearest_gain_that_is_left_out_is_found_by_encirclements():
    found = classical_margins(tf([5], [1, 1]) * late(0.3))
    claimed = replace(found, gains=found.gains[1:]).with_checker(found._checked_by[0])
    assert "encirclements" in " ".join(claimed.certificate.failures)


@pytest.mark.parametrize("gain", [1.0, 1.3, 4.0, 12.0])
def test_poles_are_counted_as_they_are(gain):
    """Pairs of 1 + 5 gain exp(-0.3 s) / (s + 1) to the right: one more with each crossing."""
    loop = late_loop(tf([5], [1, 1]) * late(0.3))
    factors = [1.178, 5.2651, 9.441, 13.6248]
    right = 2 * sum(gain > one for one in factors)
    assert counted_poles(loop.rational.system, 0.3, gain) == right
    again = late_loop(tf([5 * gain], [1, 1]) * late(0.3))
    assert again.unstable_poles() == right


@pytest.mark.cases(1)
@pytest.mark.parametrize("order", [1, 2, 4, 6, 8, 10, 14])
def test_the_bound_of_a_pade_approximation_holds_at_all_frequencies(order):
    """Against 50 digits, as the error is far below what doubles tell at low frequencies."""
    delay_ = 2.0
    P, W = pade(delay_, order), pade_error(delay_, order)
    omega = np.geomspace(1e-3, 1e4, 2000)
    assert np.abs(np.abs(P(1j * omega)) - 1).max() < 1e-9
    n = order
    with mpmath.workdps(DIGITS):
        q = [
            mpmath.binomial(n, k) * mpmath.fac(2 * n - k) / mpmath.fac(2 * n) for k in range(n + 1)
        ]
        for w in omega:
            s = mpmath.mpc(0, mpmath.mpf(w) * delay_)
            exact = mpmath.polyval(q[::-1], -s) / mpmath.polyval(q[::-1], s)
            error = abs(mpmath.exp(-s) / exact - 1)
            y = mpmath.mpf(w) * delay_ / mpmath.mpf(pade_corner(n))
            bound = 2 * mpmath.sqrt(2) * y**n / mpmath.sqrt(1 + y ** (2 * n))
            assert error <= bound + mpmath.mpf(10) ** (5 - DIGITS)
            if bound > 1e-6:
                assert abs(W(1j * w)) == pytest.approx(float(bound), rel=1e-6)


@pytest.mark.parametrize("seed", range(8))
def test_a_lower_bound_of_a_band_holds_on_all_of_it(seed):
    loop = loop_of(seed)
    exact = late_loop(loop.system)
    with ctx.workprec(128):
        T = arb(loop.T)
        bands = Bands(acb_poly(exact._numerator), acb_poly(exact._denominator), T)
        for low in np.geomspace(0.01, 10, 25) / loop.T:
            for width in (0.5, 0.05, 0.002):
                high = low * (1 + width)
                inside = np.abs(1 + loop.values(np.linspace(low, high, 500))).min()
                assert bands.below(low, high) <= inside * (1 + 1e-12)


def test_what_needs_states_refuses_dead_time_by_name():
    closed = feedback(tf([real("k", 2, percent=20)], [1, 1]) * late(0.2))
    for call in (lambda one: one.nominal, lambda one: one.sample(2)):
        with pytest.raises(InputError, match=r"dead time tau of 0\.2 s"):
            call(closed)
    assert "DeadTime(name='tau', delay=0.2)" in repr(closed)


@pytest.mark.cases(1)
@pytest.mark.parametrize("function", [worst_case_gain, robust_performance])
def test_a_gain_is_told_the_call_that_bounds_it(function):
    """What that call proves is compared with responses of members, with the dead time itself."""
    k = real("k", 2, percent=20)
    closed = feedback(tf([k], [1, 1]) * late(0.2))
    name = function.__name__
    with pytest.raises(InputError, match=rf"call `{name}\(dead_time_approximation\(system\)\)`"):
        function(closed)
    omega = np.geomspace(1e-2, 1e2, 4001)
    turned = np.exp(-0.2j * omega)
    gains = [
        np.abs(value * turned / (1j * omega + 1 + value * turned)).max()
        for value in np.linspace(1.6, 2.4, 9)
    ]
    if function is worst_case_gain:
        found = worst_case_gain(dead_time_approximation(closed, order=10))
        assert max(gains) <= found.upper <= 1.02 * max(gains)
    else:
        found = robust_performance(
            dead_time_approximation(closed, order=10), gain=1.05 * max(gains), tolerance=1e-2
        )
        assert found.lower >= 1.0


@pytest.mark.parametrize("ends", [(0, 0), (2, 1), (-1, 1), (1, math.inf), (math.nan, 1)])
def test_delays_that_are_none_are_refused(ends):
    with pytest.raises(InputError, match=r"tau|number"):
        delay("tau", *ends)


def test_responses_take_dead_time_as_it_is_inside_loops_too():
    """A Smith predictor: its own loop has the dead time inside."""
    G, C = tf([2], [3, 1]), tf([1, 0.5], [1, 0])
    predictor = feedback(C, G * (1 - late(4.0)))
    omega = np.geomspace(0.01, 10, 50)
    s = 1j * omega
    g, c, e = 2 / (3 * s + 1), (s + 0.5) / s, np.exp(-4 * s)
    found = feedback(G * late(4.0), predictor).response(omega)[:, 0, 0]
    K = c / (1 + c * g * (1 - e))
    np.testing.assert_allclose(found, g * e / (1 + g * e * K), rtol=1e-12)


def test_a_sampled_system_has_no_dead_time_in_seconds():
    with pytest.raises(InputError, match="sampling times"):
        tf([1], [1, -0.5], 0.1) * late(1)
