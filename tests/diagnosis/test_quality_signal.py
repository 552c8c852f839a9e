"""Quality of two signals and drop detector: formulas, extinction, bad parameters, speed."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from timing import least_seconds

from workbench.diagnosis import (
    clean_level,
    drop_detector,
    events,
    hysteresis,
    intervals,
    matched_events,
    quality_signal,
)
from workbench.diagnosis.evaluation.quality import EXTINCT, FARTHEST, quality
from workbench.errors import InputError
from workbench.simulation import play

LEVEL = 4.2
"""Sum of two flow meters behind a branch [l/s]."""
A, B, TOTAL, COUNT = 3, 0, 1, 4


def measured(a, b):
    """Measurements (N, COUNT) with the two signals, their sum, and one that is neither."""
    record = np.zeros((len(a), COUNT))
    record[:, A], record[:, B], record[:, TOTAL] = a, b, np.add(a, b)
    return record


def watched(level, *limits, **options):
    return quality_signal(level, *limits, signals=(A, B), **options)


def dropping(level, **options):
    return drop_detector(level, signal=TOTAL, **options)


positive = st.floats(1e-3, 1.0)
limits = st.tuples(positive, positive).filter(lambda pair: pair[0] < pair[1])


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(0.0, 2.0), min_size=2, max_size=20), limits, st.floats(0.1, 5.0))
def test_quality_is_a_falling_share(dists, ends, alpha):
    found = np.array([quality(dist, *ends, alpha) for dist in sorted(dists)])
    assert ((found >= 0.0) & (found <= 1.0)).all()
    assert (np.diff(found) <= 0.0).all()
    assert quality(ends[0], *ends, alpha) == 1.0
    assert quality(ends[1], *ends, alpha) == 0.0


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(0.2, 3.0))
def test_the_stream_is_the_equations_all_at_once(seed, alpha):
    rng = np.random.default_rng(seed)
    d1, d2 = rng.uniform(0.03, 0.8, (2, 50)) * LEVEL
    found = play(watched(LEVEL, 0.1, 0.5, alpha=alpha), measured(d1, d2))
    dist = abs(1.0 - d1 / LEVEL - d2 / LEVEL) / np.sqrt(2.0)
    ramp = np.clip((0.5 - dist) / 0.4, 0.0, 1.0) ** alpha
    assert found[:, 0] == pytest.approx(ramp, abs=1e-9)
    assert found[:, 1] == pytest.approx(dist, abs=1e-12)
    assert found[:, 2] == pytest.approx((d1 - d2) / (d1 + d2), abs=1e-12)


def test_movement_along_the_linear_area_keeps_the_quality():
    share = np.linspace(0.1, 0.9, 20) * LEVEL
    found = play(watched(LEVEL, 0.05, 0.5), measured(share, LEVEL - share))
    assert (found[:, 0] == 1.0).all()
    assert found[:, 1] == pytest.approx(np.zeros(20), abs=1e-12)


@pytest.mark.parametrize("dark", [0.0, -1e-4, 0.9 * EXTINCT])
def test_that_is_not_positive_the_quality_is_zero_and_the_error_is_held(dark):
    d1 = np.array([0.6, dark / 2, -dark, 0.2]) * LEVEL
    d2 = np.array([0.4, dark / 2, dark, 0.8]) * LEVEL
    # Even where dist_max is beyond darkness, whose distance is FARTHEST.
    found = play(watched(LEVEL, 0.1, 5.0 * FARTHEST), measured(d1, d2))
    assert found[:, 0] == pytest.approx([1.0, 0.0, 0.0, 1.0])
    assert found[:, 2] == pytest.approx([0.2, 0.2, 0.2, -0.6])
    assert np.isfinite(found).all()


def test_darkness_from_the_start_gives_no_error():
    found = play(watched(LEVEL, 0.1, 0.5), measured(np.zeros(3), np.zeros(3)))
    assert found[:, 2].tolist() == [0.0, 0.0, 0.0]
    assert found[:, 1] == pytest.approx(np.full(3, FARTHEST))


def test_the_drop_detector_by_hand():
    total = np.array([1.0, 0.75, 0.69, 0.75, 0.79, 0.81, 0.75]) * LEVEL
    alarm = play(dropping(LEVEL, below=0.7, release=0.8), measured(total / 2, total / 2))[:, 0]
    assert alarm.tolist() == [0, 0, 1, 1, 1, 0, 0]


@pytest.mark.parametrize(
    ("wrong", "words"),
    [
        ({"dist_min": 0.5, "dist_max": 0.5}, "0 <= dist_min < dist_max"),
        ({"dist_min": 0.6}, "0 <= dist_min < dist_max"),
        ({"dist_min": -0.1}, "0 <= dist_min < dist_max"),
        ({"dist_max": np.nan}, "0 <= dist_min < dist_max"),
        ({"alpha": 0.0}, "alpha is 0.0"),
        ({"alpha": -1.0}, "alpha is -1.0"),
        ({"level": 0.0}, "level is 0.0;"),
        ({"noise": 0.2}, "threshold 0.1 is not above the noise of 0.2 rms"),
    ],
)
def test_parameters_that_are_out_of_order(wrong, words):
    with pytest.raises(InputError, match=words):
        watched(**({"level": LEVEL, "dist_min": 0.1, "dist_max": 0.5} | wrong))


def test_binary_parameters_that_are_out_of_order():
    with pytest.raises(InputError, match="0 < below <= release < 1"):
        dropping(LEVEL, below=0.8, release=0.7)
    with pytest.raises(InputError, match=r"threshold 0\.2 is not above the noise of 0\.3"):
        dropping(LEVEL, below=0.7, release=0.8, noise=0.3)


@pytest.mark.parametrize("record", [[], [1.0, np.nan], np.ones((2, 2))])
def test_no_level_without_a_record(record):
    with pytest.raises(InputError, match="the record has shape"):
        clean_level(record)


def test_no_level_that_is_not_positive():
    with pytest.raises(InputError, match="a clean level is positive"):
        clean_level(np.zeros(10))


def test_records_that_are_not_finite_are_refused():
    with pytest.raises(InputError, match="first in row 1"):
        play(watched(LEVEL, 0.1, 0.5), measured([1.0, np.nan], [1.0, 1.0]))


@pytest.mark.parametrize("law", [watched(LEVEL, 0.1, 0.5, alpha=1.5), dropping(LEVEL)])
def test_streaming_keeps_up_with_35_khz_fifty_times(law):
    rng = np.random.default_rng(0)
    record = measured(*(rng.uniform(0.1, 0.5, (2, 35_000)) * LEVEL))
    play(law, record)  # compiled
    assert least_seconds(lambda: play(law, record)) < 1 / 50


@settings(max_examples=50, deadline=None)
@given(st.lists(st.floats(0.0, 1.0), min_size=1, max_size=60), st.integers(0, 6))
def test_events_are_stretches_of_the_alarm_joined(values, apart):
    """Brute force: the alarm's samples, and gaps shorter than `apart` filled."""
    alarm = play(hysteresis(0.7, 0.3), np.array(values)[:, None])[:, 0] > 0.0
    for start, end in intervals(~alarm):
        if start > 0 and end < len(values) and end - start < apart:
            alarm[start:end] = True
    assert events(values, 0.7, 0.3, apart=apart) == intervals(alarm)


@settings(max_examples=50, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(0, 5))
def test_faults_are_matched_with_the_first_event_that_touches_them(seed, tail):
    rng = np.random.default_rng(seed)
    found, faults = (
        [(int(a), int(a + n)) for a, n in rng.integers([0, 1], [60, 8], (6, 2))] for _ in range(2)
    )
    expected = [
        next((i for i, (a, b) in enumerate(found) if set(range(a, b)) & set(range(*fault))), -1)
        for fault in [(start, end + tail) for start, end in faults]
    ]
    assert matched_events(found, faults, tail=tail) == expected


def test_wrong_events_are_named():
    with pytest.raises(InputError, match="apart is -1"):
        events([1.0], 0.5, 0.2, apart=-1)
    with pytest.raises(InputError, match="tail is -2"):
        matched_events([], [], tail=-2)
    with pytest.raises(InputError, match="need off <= on"):
        events([1.0], 0.2, 0.5)
    with pytest.raises(InputError, match="extinct is 1"):
        quality_signal(1.0, 0.1, 0.5, extinct=1.0)
