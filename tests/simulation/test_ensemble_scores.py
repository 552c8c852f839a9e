"""Scores of an ensemble: counted sample by sample, and intervals that cover as often as said."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.simulation import (
    balloon_size,
    bootstrap_weights,
    error_scores,
    group_means,
    percentile_interval,
)


@given(st.integers(1, 4), st.integers(1, 5))
def test_means_of_groups_and_resampling_keeps_the_groups(groups, each):
    group = np.arange(groups * each) % groups
    out = np.linspace(0.0, 1.0, groups * each)
    arm = group_means(out, group)
    np.testing.assert_allclose(arm, [out[group == g].mean() for g in range(groups)])
    weight = bootstrap_weights(group, np.random.default_rng(0), samples=50)
    for g in range(groups):
        assert (weight[:, group == g].sum(axis=1) == each).all()
    again = group_means(out, group, weight=weight)
    assert again.min() >= 0.0
    assert again.max() <= 1.0
    low, high = percentile_interval(balloon_size(again))
    assert low <= high


@given(st.lists(st.floats(-4.0, 4.0), min_size=1, max_size=50))
def test_error_scores_are_those_counted_one_by_one(values):
    outside = losses = longest = run = 0
    before, square = False, 0.0
    for value in values:
        run = run + 1 if abs(value) > 1.0 else 0
        outside, longest = outside + (run > 0), max(longest, run)
        losses += abs(value) > 3.0 and not before
        before, square = abs(value) > 3.0, square + min(abs(value), 3.0) ** 2
    found = error_scores(np.array(values), 1.0, 3.0)
    assert (found.losses, found.longest) == (losses, longest)
    assert found.outside == pytest.approx(outside / len(values))
    assert found.rms == pytest.approx(np.sqrt(square / len(values)))


def test_an_error_without_samples_is_refused():
    with pytest.raises(InputError, match="no samples"):
        error_scores(np.zeros(0), 1.0, 3.0)


def test_the_size_of_a_balloon_by_hand():
    assert balloon_size([0.0, 1e-4, 1.0]) == pytest.approx(1.1 / 3)
    assert balloon_size([[0.25, 1.0], [0.0, 0.0]], power=0.5) == pytest.approx([0.75, 0.0])


def test_intervals_of_a_mean_cover_it_as_often_as_they_say():
    rng = np.random.default_rng(7)
    group = np.zeros(80, int)
    covered = 0
    for _ in range(300):
        score = 1.0 + rng.standard_normal(80)
        means = group_means(score, group, weight=bootstrap_weights(group, rng, samples=300))
        low, high = percentile_interval(means[:, 0], confidence=0.8)
        covered += low <= 1.0 <= high
    assert covered / 300 == pytest.approx(0.8, abs=0.06)


def test_wrong_ensembles_are_named():
    with pytest.raises(InputError, match="2 or more"):
        bootstrap_weights(np.zeros(3, int), np.random.default_rng(0), samples=1)
    with pytest.raises(InputError, match="confidence is 1"):
        percentile_interval(np.zeros(3), confidence=1.0)
