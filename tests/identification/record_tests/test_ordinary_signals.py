"""Ordinary signals that look like a fault at first sight, and are none."""

import numpy as np
import pytest
from scipy.signal import lfilter

from workbench.identification.record_tests.record import RecordData
from workbench.identification.record_tests.report import reported

N = 3000
RNG_SEED = 17


def record(u, y, **given):
    names = tuple(f"u{j}" for j in range(u.reshape(len(u), -1).shape[1]))
    columns = (each.reshape(len(each), -1).astype(float) for each in (u, y))
    return RecordData(*columns, None, (0,), 1.0, names, ("y",), **given)


def kinds(u, y, **given):
    return {finding.kind for finding in reported(record(u, y, **given)).findings}


def lag(u, pole=0.8):
    return lfilter([0, 1 - pole], [1, -pole], u)


@pytest.fixture
def rng():
    return np.random.default_rng(RNG_SEED)


def binary(rng, clock=10):
    return np.repeat(rng.choice([-1.0, 1.0], N // clock + 1), clock)[:N]


def test_a_binary_input_that_a_fast_plant_follows_is_neither_clipped_nor_stuck(rng):
    u = binary(rng)
    assert kinds(u, 2.0 * u) == set()
    assert kinds(u, lag(u, 0.1)) == set()


def test_a_square_wave_whose_answer_settles_in_coarse_steps_is_not_clipped():
    u = np.tile(np.repeat([0.0, 1.0], 60), N // 120)
    assert kinds(u, np.round(40 * lag(u)) / 40) == set()


def test_an_input_at_its_limits_by_design_is_not_clipped(rng):
    u = np.clip(3 * lag(rng.standard_normal(N), 0.95) * 4, -1, 1)
    assert kinds(u, lag(u) + 0.01 * rng.standard_normal(N)) == set()


def test_the_crest_of_a_multisine_is_no_spike(rng):
    lines = np.cos(2 * np.pi * np.outer(np.arange(500), np.arange(1, 120)) / 500).sum(axis=1)
    u = np.tile(lines, N // 500)
    y = lag(u, 0.3)
    assert kinds(u, y + 0.01 * y.std() * rng.standard_normal(N)) == set()


def test_an_impulse_test_has_no_spikes_and_no_flags(rng):
    u = np.zeros(N)
    u[300::400] = 1.0
    y = np.round(500 * u) / 500  # a plant that answers at once, in steps
    noise = 0.001 * rng.standard_normal(N)
    for answer in (y, y + noise, lag(u) + noise):
        assert kinds(u, answer) <= {"excitation", "coarse steps"}


def test_heavy_tails_are_no_spikes(rng):
    u = binary(rng)
    assert kinds(u, lag(u) + 0.1 * rng.standard_t(3, N)) == set()
    assert kinds(u, lag(u) + 0.1 * rng.laplace(size=N)) == set()


def test_a_step_after_rest_is_no_fault_but_one_move(rng):
    u = (np.arange(N) >= N // 2).astype(float)
    for noise in (0.0, 0.01):
        assert kinds(u, lag(u) + noise * rng.standard_normal(N)) <= {"excitation"}


@pytest.mark.parametrize("bits", [8, 10, 12])
def test_converters_are_no_fault(rng, bits):
    u = rng.standard_normal(N)
    y = lag(u) + 0.01 * rng.standard_normal(N)
    step = 2 * np.abs(y).max() / 2**bits
    assert kinds(u, step * np.round(y / step)) == set()


def test_counts_of_an_encoder_are_no_fault(rng):
    u = binary(rng, 20)
    y = np.cumsum(lag(u)) / 4
    # It integrates; that counts tell when a clock moves the input is taken for feedback.
    assert kinds(u, np.round(y)) <= {"short record", "feedback"}


def test_a_slow_sensor_is_not_stuck(rng):
    u = binary(rng, 20)
    y = lag(u, 0.95) + 0.01 * rng.standard_normal(N)
    assert kinds(u, y[np.arange(N) // 7 * 7]) == set()


def test_an_operating_point_from_rest_is_no_flag(rng):
    u = np.where(np.arange(N) < 500, 0.0, 300 + rng.standard_normal(N))
    assert "flags" not in kinds(u, u + 0.01 * rng.standard_normal(N))


def test_a_heater_that_is_off_now_and_then_is_no_flag(rng):
    u = 300 + 5 * rng.standard_normal(N)
    for start in range(200, N - 100, 400):
        u[start : start + 60] = 0.0
    y = lag(u, 0.9) + 0.5 * rng.standard_normal(N)
    assert "flags" not in kinds(u, y)


def test_a_slow_start_is_no_delay(rng):
    u = rng.standard_normal(20_000)
    y = lag(lag(u, 0.98), 0.98)
    assert "delay" not in kinds(u, y + 0.01 * y.std() * rng.standard_normal(len(u)))


def test_rounded_instants_are_even(rng):
    u = rng.standard_normal(N)
    times = np.round(0.0013 * np.arange(N), 3)
    assert kinds(u, lag(u), times=times) == set()
    assert kinds(u, lag(u), times=0.0013 * np.arange(N)) == set()


def test_two_sines_tell_an_order_that_they_determine(rng):
    time = np.arange(N)
    u = np.sin(0.1 * time) + np.sin(0.37 * time)
    y = lag(u) + 0.001 * rng.standard_normal(N)
    assert kinds(u, y, order=1) == set()
    assert kinds(u, y, order=3) == {"excitation"}
