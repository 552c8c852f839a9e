"""Residual evaluation and thresholds: streaming steps against formulas, and their guarantees."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from timing import least_seconds

from workbench.diagnosis import (
    adaptive_alarm,
    bounded_threshold,
    cusum,
    glr,
    hysteresis,
    moving_rms,
    quantile_threshold,
)
from workbench.diagnosis.evaluation.thresholds import above_noise
from workbench.errors import InputError
from workbench.simulation import play

seeds = st.integers(0, 2**32 - 1)


@pytest.mark.cases(0)
@settings(max_examples=40, deadline=None)
@given(seeds, st.integers(1, 40), st.integers(1, 90))
def test_the_moving_rms_is_its_definition(seed, window, samples):
    r = np.random.default_rng(seed).standard_normal((samples, 3))
    streamed = play(moving_rms(window, signals=(0, 2)), r)[:, 0]
    square = r[:, 0] ** 2 + r[:, 2] ** 2
    direct = [np.sqrt(square[max(0, k - window + 1) : k + 1].mean()) for k in range(samples)]
    assert streamed == pytest.approx(np.array(direct), rel=1e-9, abs=1e-12)


def test_the_moving_rms_forgets_a_giant():
    r = np.concatenate([[1e9], np.full(60, 1e-3)])[:, None]
    assert play(moving_rms(20), r)[-1, 0] == pytest.approx(1e-3, rel=1e-12)


def test_the_interval_of_the_rate_holds_as_often_as_it_says():
    rng = np.random.default_rng(3)
    held, shares = 0, []
    for _ in range(400):
        found = quantile_threshold(rng.exponential(size=200), 0.05, confidence=0.9)
        share = np.exp(-found.level)  # of new values above the level
        shares.append(share)
        held += found.interval[0] <= share <= found.interval[1]
    assert abs(held / 400 - 0.9) < 0.05
    assert np.mean(shares) == pytest.approx(found.rate, abs=0.002)
    assert found.rate <= 0.05


def test_blocks_count_by_their_largest():
    values = np.arange(400.0)
    found = quantile_threshold(values, 0.2, block=20)
    assert found.samples == 20
    assert (found.level + 1) % 20 == 0


def test_too_few_samples_for_the_rate_are_named():
    with pytest.raises(InputError, match=r"98 fault-free values .* at least 99 needed"):
        quantile_threshold(np.arange(98.0), 0.01)
    assert quantile_threshold(np.arange(99.0), 0.01).level == 98.0


@pytest.mark.parametrize("values", [[], [1.0, np.nan], np.ones((3, 2))])
def test_records_without_values(values):
    with pytest.raises(InputError, match="clean"):
        quantile_threshold(values, 0.5)


def test_a_level_below_the_noise_names_both():
    with pytest.raises(InputError, match=r"threshold 0.1 is not above the noise of 0.2 rms"):
        bounded_threshold([0.5], [0.2], noise=0.2)
    with pytest.raises(InputError, match=r"threshold 0.01 is not above the noise of 0.2"):
        above_noise(0.01, 0.2)
    with pytest.raises(InputError, match="equally many"):
        bounded_threshold([1.0, 2.0], [1.0])


@settings(max_examples=30, deadline=None)
@given(seeds, st.floats(0.0, 0.95), st.floats(0.01, 3.0))
def test_the_bounds_cover_every_model_error_below_them(seed, decay, gain):
    """A residual of a model error within its bound passes neither threshold."""
    rng = np.random.default_rng(seed)
    v, samples = rng.standard_normal(120), 120
    h = gain * decay ** np.arange(samples) * rng.uniform(-1, 1, samples)
    r = np.convolve(h, v)[:samples] + rng.uniform(-0.1, 0.1, samples)
    alarm, level = play(adaptive_alarm(0.1 + 1e-9, gain, decay), np.column_stack([r, v])).T
    assert not alarm.any()
    fixed = bounded_threshold([np.abs(h).sum(), 1.0], [np.abs(v).max(), 0.1])
    assert np.abs(r).max() <= fixed
    direct = 0.1 + gain * np.convolve(decay ** np.arange(samples), abs(v))[:samples]
    assert level == pytest.approx(direct, rel=1e-6)


def test_the_adaptive_threshold_finds_what_a_fixed_one_must_overlook():
    rng = np.random.default_rng(5)
    v = np.concatenate([rng.uniform(-5, 5, 300), np.zeros(300)])
    r = np.convolve(0.2 * 0.5 ** np.arange(20), v)[:600]
    r[500:] += 0.3
    alarm, level = play(adaptive_alarm(0.1, 0.2, 0.5), np.column_stack([r, v])).T
    assert not alarm[:500].any()
    assert alarm[500:].all()
    assert abs(r[:300]).max() > 0.3 > level[500]


@pytest.mark.parametrize("wrong", [(0.0, 1.0, 0.5), (1.0, -1.0, 0.5), (1.0, 1.0, 1.0)])
def test_adaptive_thresholds_that_are_none(wrong):
    with pytest.raises(InputError, match="need base > 0"):
        adaptive_alarm(*wrong)


def test_a_window_without_samples():
    with pytest.raises(InputError, match="window 0"):
        moving_rms(0)


@pytest.mark.parametrize(
    "detector",
    [moving_rms(64), adaptive_alarm(1, 1, 0.9), hysteresis(1, 0), cusum(0.1), glr(64, 1.0)],
    ids=["rms", "adaptive", "hysteresis", "cusum", "glr"],
)
def test_streaming_keeps_up_with_35_khz_fifty_times(detector):
    record = np.random.default_rng(0).standard_normal((35_000, 2))
    play(detector, record)  # compiled
    assert least_seconds(lambda: play(detector, record)) < 1 / 50
