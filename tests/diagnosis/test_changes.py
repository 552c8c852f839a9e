"""CUSUM and GLR against their definitions, and Siegmund's run length against a simulation."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.diagnosis import cusum, cusum_threshold, glr, hysteresis
from workbench.errors import InputError
from workbench.simulation import play

seeds = st.integers(0, 2**32 - 1)


@settings(max_examples=40, deadline=None)
@given(seeds, st.floats(0.0, 1.0), st.floats(-1.0, 1.0), st.integers(1, 80))
def test_cusum_is_the_height_above_the_lowest_point(seed, drift, mean, samples):
    r = np.random.default_rng(seed).standard_normal(samples)
    up, down = play(cusum(drift, mean=mean), r[:, None]).T
    for found, sign in ((up, 1.0), (down, -1.0)):
        walk = np.concatenate([[0.0], np.cumsum(sign * (r - mean) - drift)])
        assert found == pytest.approx((walk - np.minimum.accumulate(walk))[1:], abs=1e-10)


def test_a_ceiling_lets_the_sum_fall_back():
    r = np.concatenate([np.ones(100), np.zeros(30)])
    free, capped = (
        play(cusum(0.1, mean=0.0, ceiling=top), r[:, None])[:, 0] for top in (np.inf, 2.0)
    )
    assert free[-1] > 80.0
    assert capped.max() == 2.0
    assert capped[-1] == 0.0


def test_run_lengths_of_white_noise():
    """The mean time to a false alarm of one sum, simulated, against the approximation."""
    rng, drift, wanted = np.random.default_rng(7), 0.5, 200.0
    h = cusum_threshold(wanted, drift, 1.0)
    lengths = []
    for _ in range(400):
        up = play(cusum(drift), rng.standard_normal((2500, 1)))[:, 0]
        hits = np.flatnonzero(up > h)
        lengths.append(hits[0] + 1 if hits.size else len(up))
    assert np.mean(lengths) == pytest.approx(wanted, rel=0.15)


def test_run_lengths_scale_with_the_noise():
    one = cusum_threshold(1e6, 0.1, 1.0)
    assert cusum_threshold(1e6, 0.3, 3.0) == pytest.approx(3.0 * one)
    assert cusum_threshold(1e12, 5.0, 1.0) > cusum_threshold(1e9, 5.0, 1.0) > 0.0
    with pytest.raises(InputError, match="below that of a threshold of 0"):
        cusum_threshold(1.0, 0.5, 1.0)


@settings(max_examples=30, deadline=None)
@given(seeds, st.integers(1, 20), st.integers(1, 50))
def test_glr_is_its_definition(seed, window, samples):
    r = np.random.default_rng(seed).standard_normal(samples)
    ratio, age, change = play(glr(window, 0.7, mean=0.2), r[:, None]).T
    for k in range(samples):
        tails = [r[k - j + 1 : k + 1] - 0.2 for j in range(1, min(window, k + 1) + 1)]
        each = [tail.sum() ** 2 / (2 * 0.7**2 * len(tail)) for tail in tails]
        assert ratio[k] == pytest.approx(max(each), abs=1e-12)
        assert change[k] == pytest.approx(tails[int(age[k]) - 1].mean(), abs=1e-12)


def test_slow_drifts_are_found_by_cusum_before_a_level_that_never_alarms_falsely():
    rng = np.random.default_rng(11)
    noise = rng.standard_normal(20_000)
    drifting = noise.copy()
    drifting[10_000:] += np.minimum(np.arange(10_000) * 2e-4, 2.0)
    sums = play(cusum(0.25), drifting[:, None])[:, 0]
    level, top = abs(noise).max(), play(cusum(0.25), noise[:, None]).max()
    by_sum = np.flatnonzero(sums[10_000:] > top)[0]
    above = np.flatnonzero(drifting[10_000:] > level)
    assert by_sum < 3500
    assert by_sum < 0.8 * (above[0] if above.size else 10_000)


def test_hysteresis_holds_between_its_levels():
    r = np.array([0.0, 1.0, 1.1, 0.7, 0.5, 0.49, 0.7, 1.2])
    alarm = play(hysteresis(1.0, 0.5), r[:, None])[:, 0]
    assert alarm.tolist() == [0, 0, 1, 1, 1, 0, 0, 1]
    fall = play(hysteresis(-1.0, -0.5, falling=True), -r[:, None])[:, 0]
    assert (fall == alarm).all()


@pytest.mark.parametrize(
    "make",
    [
        lambda: hysteresis(0.5, 0.6),
        lambda: hysteresis(0.6, 0.5, falling=True),
        lambda: hysteresis(np.nan, 0.6),
        lambda: cusum(-0.1),
        lambda: cusum(0.1, ceiling=0.0),
        lambda: glr(0, 1.0),
        lambda: glr(5, 0.0),
        lambda: cusum_threshold(1e4, 0.0, 1.0),
    ],
)
def test_detectors_that_are_none(make):
    with pytest.raises(InputError, match=r"need|positive"):
        make()
