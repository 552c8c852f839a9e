"""Controllers for a computer: discretised, in sections, in integers; sampled loops' margins."""

import math

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import sosfilt
from workbench.plants.cd_drive.drive import plants as drives

from workbench.errors import InputError
from workbench.simulation import respond, sampled_model
from workbench.synthesis import (
    Sections,
    discretise,
    fixed_point,
    sampled_conditions,
    second_order_sections,
)
from workbench.synthesis.implementation.impulse import absolute_sum, squared_sum
from workbench.systems.realisation import realisation

T = 1 / 35e3
"""Sampling time of the laboratory's computer [s]."""


def focus():
    """The positioning loop of the nominal CD drive, negative feedback."""
    plant = drives.plant(drives.nominal_parameters("focus"), drives.total_gain("focus"))
    return plant, drives.controller("focus")


def random_system(seed, dt=None):
    rng = np.random.default_rng(seed)
    n, m, p = (int(k) for k in (rng.integers(1, 10), *rng.integers(1, 4, 2)))
    A, B, C = rng.normal(size=(n, n)), rng.normal(size=(n, m)), rng.normal(size=(p, n))
    D = rng.normal(size=(p, m)) * rng.choice([0.0, 1.0])
    if dt is None:
        A -= (np.linalg.eigvals(A).real.max() + 0.05) * np.eye(n)
        return control.ss(A, B, C, D)
    A *= rng.uniform(0.3, 0.97) / np.abs(np.linalg.eigvals(A)).max()
    return control.ss(A, B, C, D, dt)


def times(K, gain):
    return realisation((K.A, K.B, gain * K.C, gain * K.D), K.dt)


def stable(plant, K, period, delay=0.0, sign=-1):
    """By python-control's feedback."""
    loop = control.feedback(sampled_model(plant, period, delay_samples=delay), K, sign)
    return bool(np.abs(loop.poles()).max() < 1)


# --- discretisation ---------------------------------------------------------------------------


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000), st.sampled_from(["tustin", "zoh"]))
def test_the_response_is_that_of_python_control(seed, method):
    K = random_system(seed)
    K_d = discretise(K, 0.05, method=method)
    theirs = control.sample_system(K, 0.05, method)
    z = np.exp(1j * np.linspace(0.01, 3.1, 30))
    expected = theirs(z, squeeze=False)
    assert K_d(z, squeeze=False) == pytest.approx(expected, abs=1e-9 * np.abs(expected).max())
    assert K_d.dt == 0.05


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10_000))
def test_blocks_are_of_order_two(seed):
    A = discretise(random_system(seed), 0.05).A
    assert np.count_nonzero(np.triu(A, 2)) == np.count_nonzero(np.tril(A, -2)) == 0
    joined = (np.diag(A, 1) != 0) | (np.diag(A, -1) != 0)
    assert not (joined[1:] & joined[:-1]).any()


def test_poles_that_coincide_stay_in_one_block():
    s = control.tf("s")
    K = control.ss(1 / (s + 1) ** 4)
    K_d = discretise(K, 0.1)
    assert np.abs(K_d.A).max() < 10
    z = np.exp(1j * np.array([0.01, 0.1, 1.0]))
    assert K_d(z) == pytest.approx(K(20 * (z - 1) / (z + 1)), rel=1e-9)


def test_slow_poles_keep_their_digits():
    K = control.zpk([-1.0], [-1e-6, -3e4, -2e4], 5e8)
    K_d = discretise(K, 1e-5)
    slow = K_d.poles().real.max()
    assert (1 - slow) / 1e-5 == pytest.approx(1e-6, rel=1e-4)  # 1 - slow has five digits
    assert K_d(1.0).real == pytest.approx(5e8 / (1e-6 * 6e8), rel=1e-4)


def test_prewarping_keeps_the_response_there():
    _, K = focus()
    omega = 2 * np.pi * 7e3
    plain, warped = (discretise(K, T, prewarp=f)(np.exp(1j * omega * T)) for f in (None, omega))
    assert warped == pytest.approx(K(1j * omega), rel=1e-9)
    assert abs(plain / K(1j * omega) - 1) > 1e-2


# --- the sampled loop -------------------------------------------------------------------------


def test_the_focus_loop_at_35_khz():
    plant, K = focus()
    found = sampled_conditions(plant, discretise(K, T, plant=plant), T)
    (margins,) = found.margins
    assert found.stable
    # Continuous 57.5 degrees; the hold costs half a sample, 3.5 degrees at the crossover.
    crossover = 2 * np.pi * drives.crossover("focus")
    lag = math.degrees(crossover * T / 2)
    assert margins.phase_deg == pytest.approx(drives.phase_margin("focus") - lag, abs=0.1)
    assert margins.phase_at == pytest.approx(crossover, rel=1e-3)
    assert margins.delay_samples == pytest.approx(
        math.radians(margins.phase_deg) / (crossover * T), rel=1e-3
    )


@pytest.mark.parametrize("delay", [0.0, 0.4, 1.0, 2.7])
def test_margins_are_where_the_poles_leave_the_circle(delay):
    plant, K = focus()
    K_d = discretise(K, T)
    (margins,) = sampled_conditions(plant, K_d, T, delay_samples=delay).margins

    def holds(gain=1.0, more=0.0):
        return stable(plant, times(K_d, gain), T, delay + more)

    for factor, inside in zip(margins.gain, (1e-4, -1e-4), strict=True):
        assert holds(factor * (1 + inside)) and not holds(factor * (1 - inside))
    assert holds(more=margins.delay_samples * (1 - 1e-5))
    assert not holds(more=margins.delay_samples * (1 + 1e-5))


def test_a_delay_margin_below_a_sample():
    """Where the gain at the crossover changes with the fraction of the delay."""
    s = control.tf("s")
    plant, period = control.ss(1 / (s * (s + 2))), 0.5
    K = control.ss([], [], [], [[2.2]], period)
    (margins,) = sampled_conditions(plant, K, period, delay_samples=0.3).margins
    assert 0.05 < margins.delay_samples < 1.5
    assert stable(plant, K, period, 0.3 + margins.delay_samples * (1 - 1e-6))
    assert not stable(plant, K, period, 0.3 + margins.delay_samples * (1 + 1e-6))


def test_a_mode_beyond_half_the_sampling_rate_comes_and_goes_with_the_delay():
    """The gain is below 1 at the delay as it is, above 1 with a fraction of a sample more."""
    s = control.tf("s")
    plant = control.ss(1 / (s + 1)) + control.ss(0.4 * 7.3**2 / (s**2 + 0.05 * s + 7.3**2))
    K = control.ss([], [], [], [[0.3]], 0.8)
    hidden = 0
    for delay in (0.0, 0.5, 0.75, 1.25):
        found = sampled_conditions(plant, K, 0.8, delay_samples=delay)
        if found.stable and found.margins[0].delay_samples < 10:
            hidden += found.margins[0].phase_deg == math.inf
            later = [
                stable(plant, K, 0.8, delay + found.margins[0].delay_samples * (1 + e))
                for e in (-0.5, -1e-6, 1e-6)
            ]
            assert later == [True, True, False]
    assert hidden


def test_two_loops_are_broken_one_at_a_time():
    s = control.tf("s")
    plant = control.ss([[-1.0, 0.3], [0.2, -2.0]], np.eye(2), [[1.0, 0.4], [-0.3, 1.0]], 0.0)
    K = discretise(control.append(control.ss(2 / (s + 0.1)), control.ss(3 / (s + 0.2))), 0.1)
    found = sampled_conditions(plant, K, 0.1, delay_samples=0.5)
    assert found.stable and len(found.margins) == 2
    for channel, margins in enumerate(found.margins):
        for e, expected in ((-1e-4, True), (1e-4, False)):
            gain = np.ones(2)
            gain[channel] = margins.gain[1] * (1 + e)
            changed = realisation((K.A, K.B, gain[:, None] * K.C, gain[:, None] * K.D), 0.1)
            assert stable(plant, changed, 0.1, 0.5) == expected
    # A delay of one signal, by states of K before it: the margin lies in that sample.
    z = control.tf([1.0, 0.0], [1.0], 0.1)
    for channel, margins in enumerate(found.margins):
        whole = math.floor(margins.delay_samples)
        for steps, expected in ((whole, True), (whole + 1, False)):
            late = [control.ss([], [], [], [[1.0]], 0.1)] * 2
            late[channel] = control.ss(1 / z**steps) if steps else late[channel]
            changed = control.append(*late) * K
            assert stable(plant, changed, 0.1, 0.5) == expected


def test_the_sign_of_the_feedback():
    plant, K = focus()
    K_d = discretise(K, T)
    assert not sampled_conditions(plant, K_d, T, sign=1).stable
    (one,) = sampled_conditions(plant, times(K_d, -1), T, sign=1).margins
    (other,) = sampled_conditions(plant, K_d, T).margins
    assert one.phase_deg == pytest.approx(other.phase_deg)


def test_a_small_gain_has_endless_margins():
    plant = control.ss(-1.0, 1.0, 1.0, 0.0)
    K = discretise(control.ss(-2.0, 1.0, 0.5, 0.0), 0.1)
    (margins,) = sampled_conditions(plant, K, 0.1).margins
    assert margins.phase_deg == margins.delay_samples == math.inf
    assert margins.gain[0] == 0.0 and margins.gain[1] > 10


def test_the_static_gain_and_integrators():
    """An unstable plant needs a least gain; an integrator has none although Re L < 0 at first."""
    plant = control.ss(1.0, 1.0, 1.0, 0.0)
    K = control.ss([], [], [], [[3.0]], 0.1)
    low, high = sampled_conditions(plant, K, 0.1).margins[0].gain
    assert low == pytest.approx(1 / 3)
    # x+ = e^T x + (e^T - 1) u leaves the circle at -1: k = (e^T + 1) / (e^T - 1).
    assert high == pytest.approx((np.exp(0.1) + 1) / (np.exp(0.1) - 1) / 3)
    s = control.tf("s")
    slow = control.ss(1 / (s * (s + 1)))
    (margins,) = sampled_conditions(slow, control.ss([], [], [], [[0.5]], 0.1), 0.1).margins
    assert margins.gain[0] == 0.0 and margins.gain[1] > 10


def test_no_gain_at_all():
    plant = control.ss(-1.0, 1.0, 1.0, 0.0)
    (margins,) = sampled_conditions(plant, control.ss([], [], [], [[0.0]], 0.1), 0.1).margins
    assert margins.gain == (0.0, math.inf) and margins.delay_samples == math.inf


# --- second-order sections --------------------------------------------------------------------


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000))
def test_cascades_give_the_samples_of_the_controller(seed):
    K = random_system(seed, 0.01)
    sections = second_order_sections(K)
    rng = np.random.default_rng(seed)
    y = rng.normal(size=(200, K.ninputs))
    expected = respond(K, y)
    channels = [
        sum(sosfilt(rows, y[:, j]) for j, rows in enumerate(line)) for line in sections.channels
    ]
    size = np.abs(expected).max() + 1e-12
    assert np.stack(channels, axis=1) == pytest.approx(expected, abs=1e-6 * size)
    assert respond(sections.system, y) == pytest.approx(expected, abs=1e-6 * size)


def test_what_one_channel_hides_is_left_out():
    one, other = control.ss(0.5, 1, 1, 0, 0.1), control.ss(1.0, 1, 1, 0.0, 0.1)
    sections = second_order_sections(control.append(one, other))
    (first, none), (_, second) = sections.channels
    assert first[0] == pytest.approx([0, 1, 0, 1, -0.5, 0])
    assert second[0] == pytest.approx([0, 1, 0, 1, -1, 0])
    assert (none[:, :3].prod() == 0) and none.shape == (1, 6)


# --- fixed point ------------------------------------------------------------------------------


def integer_outputs(cascade, signal_bits, inputs):
    """Outputs of every section (L, N), by whole numbers in direct form I."""
    scale = 1 << (signal_bits - 1)
    signal = [round(x * scale) for x in inputs]
    outputs = []
    for b, eb, a, ea in zip(
        cascade.numerators.tolist(), cascade.numerator_exponents.tolist(),
        cascade.denominators.tolist(), cascade.denominator_exponents.tolist(), strict=True,
    ):  # fmt: skip
        x, y, made = [0, 0, 0], [0, 0], []
        common = max(eb, ea, 0)
        for value in signal:
            x = [value, *x[:2]]
            total = sum(c * v for c, v in zip(b, x, strict=True)) << (common - eb)
            total -= sum(c * v for c, v in zip(a, y, strict=True)) << (common - ea)
            new = (total + (1 << common >> 1)) >> common
            y = [new, y[0]]
            made.append(new)
        signal = made
        outputs.append(made)
    return np.array(outputs, dtype=float) / scale


@pytest.mark.parametrize("seed", range(6))
def test_nothing_overflows_and_the_noise_is_as_foreseen(seed):
    K = random_system(seed, 0.01)
    ((own,),) = second_order_sections(K[0, 0]).channels
    fixed = fixed_point(Sections(((own, own),), 0.01), 24, 20)
    cascade, rows = fixed.cascades[0][0], fixed.quantised.channels[0][0]
    assert fixed.overflow_free
    count = len(rows)
    impulse = np.eye(1, 400)[0]
    for k in range(count):  # the input that is worst for section k
        response = sosfilt(rows[: k + 1], impulse)
        worst = np.sign(response[::-1])
        found = integer_outputs(cascade, 20, worst * (1 - 2.0**-19))
        assert np.abs(found).max() < 1.0
        top = np.abs(found[k]).max()
        assert cascade.largest[k] * 0.9 <= top <= cascade.largest[k]
        assert top > 0.2  # a smaller shift would be too small
    rng = np.random.default_rng(seed)
    u = np.round(rng.uniform(-1, 1, 4000) * 2**19) / 2**19
    exact = sosfilt(rows, u)
    found = integer_outputs(cascade, 20, u)[-1] * 2.0 ** cascade.shifts[-1]
    assert np.std((found - exact)[400:]) == pytest.approx(cascade.noise, rel=0.2)


def test_quantised_controllers_keep_or_lose_the_loop():
    plant, K = focus()
    sections = second_order_sections(discretise(K, T))
    fine, coarse = fixed_point(sections, 32, 40), fixed_point(sections, 16, 16)
    assert fine.overflow_free
    # The integrator's pole is 3e-8 inside the circle, and 16 bits put it beyond: it saturates.
    assert coarse.overflow_free and coarse.cascades[0][0].largest[-1] == 1.0 - 2.0**-15
    ((own,),) = sections.channels
    two = fixed_point(Sections(((own, own),), T), 16, 16)
    assert not two.overflow_free and two.cascades[0][0].largest[-1] == math.inf
    exact = sampled_conditions(plant, sections.system, T).margins[0].phase_deg
    assert fine.conditions(plant).margins[0].phase_deg == pytest.approx(exact, abs=1e-3)
    assert fine.cascades[0][0].moved < 1e-8 < coarse.cascades[0][0].moved < 1e-4
    few = fixed_point(sections, 4, 16)
    assert few.cascades[0][0].moved > 1e-3


@pytest.mark.parametrize("pole", [0.3, 0.99, 0.999999, -0.9999999])
def test_sums_of_one_pole_in_closed_form(pole):
    rows = np.array([[1.0, 0.0, 0.0, 1.0, -pole, 0.0]])
    assert absolute_sum(rows) == pytest.approx(1 / (1 - abs(pole)), rel=1e-6)
    assert squared_sum(rows) == pytest.approx(1 / (1 - pole**2), rel=1e-6)


def test_the_absolute_sum_of_a_double_pole_is_bounded():
    rows = np.tile([1.0, 0.0, 0.0, 1.0, -0.99999, 0.0], (2, 1))
    exact = 1e10
    assert exact * (1 - 1e-4) <= absolute_sum(rows) <= 1.5 * exact


# --- bad input --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (lambda G, K: discretise(K, 0.0), "dt is 0"),
        (lambda G, K: discretise(K, -T), "positive"),
        (lambda G, K: discretise(discretise(K, T), T), "sampled already"),
        (lambda G, K: discretise(K, T, method="euler"), "'euler'"),
        (lambda G, K: discretise(K, T, method="zoh", prewarp=1e3), "prewarp"),
        (lambda G, K: discretise(K, T, prewarp=1.2e5), "prewarp is 120000"),
        (lambda G, K: discretise(K, 1 / 1200, plant=G), "half the sampling rate 3769.91 rad/s"),
        (lambda G, K: discretise(K, 1 / 1600, plant=G), "unstable"),
        (lambda G, K: discretise(control.ss(2.0, 1, 1, 0), 1.0), "pole at 1 /"),
        (lambda G, K: sampled_conditions(G, K, T), "controller has dt = 0"),
        (lambda G, K: sampled_conditions(G, discretise(K, T), 2 * T), "sampled every"),
        (lambda G, K: sampled_conditions(discretise(K, T), K, T), "plant is sampled"),
        (
            lambda G, K: sampled_conditions(G, discretise(K, T), T, delay_samples=-1),
            "delay_samples is -1",
        ),
        (lambda G, K: sampled_conditions(G, discretise(K, T), T, sign=2), "sign is 2"),
        (lambda G, K: second_order_sections(control.ss(K)), "discretise it first"),
        (lambda G, K: fixed_point(Sections(((np.eye(1, 6),),), T), 2, 16), "bits is 2"),
    ],
)
def test_bad_input_is_named(call, words):
    with pytest.raises(InputError, match=words):
        call(*focus())
