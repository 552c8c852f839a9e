"""Sizes, steps and runs of channels."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.identification.record_tests.excitation import sines
from workbench.identification.record_tests.levels import (
    resolution,
    robust_spread,
    runs,
    told_samples,
)
from workbench.identification.record_tests.spikes import median_of_five, tail_limit

NOISE = np.random.default_rng(0).standard_normal(20_000)


@settings(derandomize=True, deadline=None, max_examples=30)
@given(st.floats(1e-9, 1e9), st.integers(3, 200), st.floats(-1e3, 1e3))
def test_steps_of_a_converter_are_found_in_every_unit(unit, levels, offset):
    step = unit / levels
    column = step * np.round((NOISE + offset) * levels / 8)
    assert resolution(column) == pytest.approx(step, rel=1e-6)


def test_steps_that_were_written_in_few_digits_are_found():
    column = np.round(np.round(NOISE * 100) * 0.0048828, 6)
    assert resolution(column) == pytest.approx(0.0048828, rel=1e-3)


def test_computed_numbers_have_no_steps():
    assert resolution(NOISE) == 0.0
    assert resolution(np.repeat(NOISE[:500], 20)) == 0.0
    assert resolution(np.ones(10)) == 0.0
    assert resolution(np.full(10, np.nan)) == 0.0


def test_the_spread_is_moved_by_no_outlier():
    spiky = np.where(np.arange(20_000) % 1000 == 0, 1e6, NOISE)
    assert robust_spread(spiky) == pytest.approx(1.0, abs=0.03)
    assert robust_spread(np.array([0.0] * 98 + [1.0, 1.0])) == pytest.approx(0.14)
    assert robust_spread(np.full(4, np.nan)) == 0.0


def test_runs_and_words():
    first, length = runs(np.array([True, False, True, True]))
    assert (first.tolist(), length.tolist()) == ([0, 2], [1, 2])
    assert told_samples([4]) == "sample 4"
    assert told_samples(range(9)) == "samples 0, 1, 2, 3, 4, 5, ..."


def test_the_median_of_five_is_that_of_sorting():
    padded = np.pad(NOISE[:500], 2, "edge")
    plain = np.median(np.lib.stride_tricks.sliding_window_view(padded, 5), axis=1)
    assert np.array_equal(median_of_five(NOISE[:500]), plain)


@pytest.mark.parametrize("tail", ["normal", "laplace", "t"])
def test_a_tail_is_told_by_the_bulk(tail):
    rng = np.random.default_rng(3)
    over = 0
    for _ in range(100):
        draw = {
            "normal": rng.standard_normal, "laplace": lambda n: rng.laplace(size=n),
            "t": lambda n: rng.standard_t(3, n),
        }[tail](2000)  # fmt: skip
        over += np.abs(draw).max() > tail_limit(np.abs(draw))
    assert over <= 5


def test_sines_are_counted_and_measured():
    time = np.arange(4000)
    one = np.sin(0.1234 * time + 1.0)
    two = one + 0.3 * np.cos(0.5 * time)
    assert sines(3.0 + 0.01 * one, 2) * 2 * np.pi == pytest.approx([0.1234], abs=1e-7)
    assert sines(two, 2) * 2 * np.pi == pytest.approx([0.1234, 0.5], abs=1e-6)
    assert sines(two, 1).size == 0
    assert sines(one + 0.1 * NOISE[:4000], 2).size == 0
    assert sines(time / 4000.0, 2).size == 0
    assert sines((time > 2000).astype(float), 2).size == 0
