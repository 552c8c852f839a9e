"""The gap of plants: never below the nu-gap, and near it for these."""

from dataclasses import replace

import control
import numpy as np
import pytest

from workbench.errors import InputError
from workbench.mu import nu_gap
from workbench.synthesis import gap_metric
from workbench.systems.bilinear import bilinear_sampled

tf = control.tf


@pytest.mark.parametrize(
    ("first", "second", "least"),
    [
        (tf([1], [1, -0.001]), tf([1], [1, 0.001]), 0.0020),
        (tf([100], [2, 1]), tf([100], [2, -1]), 0.0200),
        (tf([100], [2, 1]), tf([100], [1, 2, 1]), 0.8988),
    ],
)
def test_gaps_near_those_documented(first, second, least):
    found = gap_metric(first, second)
    assert found.lower - 5e-5 <= least <= found.upper
    assert found.upper <= 1.01 * least + 1e-4


@pytest.mark.parametrize("seed", range(6))
def test_the_gap_lies_between_the_nu_gap_and_one(seed):
    rng = np.random.default_rng(seed)
    p, m = int(rng.integers(1, 3)), int(rng.integers(1, 3))
    A = rng.normal(size=(3, 3))
    B, C = rng.normal(size=(3, m)), rng.normal(size=(p, 3))
    P1 = control.ss(A, B, C, 0.0)
    P2 = control.ss(A + 0.1 * rng.normal(size=(3, 3)), B, C, 0.0)
    found, nu = gap_metric(P1, P2), nu_gap(P1, P2)
    assert nu.lower == found.lower <= found.upper <= 1.0
    assert found.upper < 1.0
    assert gap_metric(P2, P1).upper == pytest.approx(found.upper, rel=5e-3)


def test_ends():
    plant = tf([1], [1, 1])
    assert gap_metric(plant, plant).upper < 1e-6
    far = gap_metric(tf([0.1], [1, 1]), tf([0.1], [1, -1]))
    assert far.lower == far.upper == 1.0
    P1, P2 = control.ss(plant), control.ss(tf([1], [1, 2, 1]))
    sampled = gap_metric(bilinear_sampled(P1, 0.1), bilinear_sampled(P2, 0.1))
    assert sampled.upper == pytest.approx(gap_metric(P1, P2).upper, rel=2e-3)


@pytest.mark.parametrize(
    ("first", "second", "words"),
    [
        ("P", tf([1], [1, 1]), "first must be"),
        (tf([1], [1, 1]), np.eye(2), "must be the same"),
        (tf([1], [1, 1]), control.ss(0.5, 1, 1, 0, 0.1), "sampling times"),
    ],
)
def test_bad_plants_of_a_gap(first, second, words):
    with pytest.raises(InputError, match=words):
        gap_metric(first, second)


PAIRS = {
    "above the nu-gap": (tf([1, -3], [1, 1, 1]), tf([1, -2], [1, 1, 1])),
    "sampled": (tf([0.1], [1, -0.9], 0.1), tf([0.1], [1, -0.8], 0.1)),
    "two outputs": [
        control.ss([[a, 1.0], [-0.5, a]], [[1.0], [1.0]], np.eye(2), 0) for a in (0.2, 0.3)
    ],
}


@pytest.mark.parametrize("name", PAIRS)
def test_graphs_in_time_refute_a_gap_that_is_too_small(name):
    """Sequences in time know nothing of coprime factors, of Q and of responses."""
    found = gap_metric(*PAIRS[name])
    assert found.holds, found.certificate.failures
    checker = found._checked_by[0]
    small, large = replace(found, upper=0.98 * found.upper), replace(found, lower=1.02)
    assert not checker.second_opinion(small)[0].holds
    assert not any(check.holds for check in checker.second_opinion(large)[1:])


def test_equal_plants_and_integrators_have_a_second_opinion():
    for first, second in [(tf([1], [1, 0]), tf([1], [1, 0])), (tf([1], [1]), tf([2], [1]))]:
        assert gap_metric(first, second).holds
