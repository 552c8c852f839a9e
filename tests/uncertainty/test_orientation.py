"""Orientations of stadiums along frequency, against every path there is."""

from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.uncertainty import (
    cheapest_orientation,
    limited_orientation,
    narrowest_angles,
    smooth_orientation,
)
from workbench.uncertainty.covers import orientation

OMEGA = np.array([1.0, 2.0, 3.0, 7.0, 9.0])


def random_deviations(seed, frequencies=5, count=6):
    rng = np.random.default_rng(seed)
    return rng.normal(size=(frequencies, count)) + 1j * rng.normal(size=(frequencies, count))


def half_width(away, angle):
    return np.abs((away * np.exp(-1j * angle)).imag).max()


def apart(one, other):
    """Distance of directions, through doubled angles on the circle."""
    return np.abs(np.angle(np.exp(2j * (np.asarray(one) - np.asarray(other))))) / 2


def total(costs, path, angles, weight, omega=OMEGA):
    turns = apart(angles[path[1:]], angles[path[:-1]]) ** 2
    return costs[np.arange(len(path)), path].sum() + weight * (turns / np.diff(np.log(omega))).sum()


@settings(derandomize=True, deadline=None, max_examples=12)
@given(st.integers(0, 10_000), st.sampled_from([0.0, 0.01, 0.3, 10.0]))
def test_the_cheapest_path_is_found(seed, weight):
    rng = np.random.default_rng(seed)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(orientation, "CANDIDATE_ANGLES", 5)
        costs = rng.exponential(size=(5, 5))
        found = cheapest_orientation(lambda *_: costs, weight)(OMEGA, random_deviations(seed))
    angles = np.arange(5) * np.pi / 5
    path = np.rint(found / (np.pi / 5)).astype(int)
    np.testing.assert_allclose(found, angles[path], atol=1e-12)
    least = min(
        total(costs, np.array(every), angles, weight) for every in product(range(5), repeat=5)
    )
    assert total(costs, path, angles, weight) == pytest.approx(least, rel=1e-12)


def test_the_smooth_path_is_the_cheapest(monkeypatch):
    monkeypatch.setattr(orientation, "CANDIDATE_ANGLES", 5)
    angles = np.arange(5) * np.pi / 5
    for seed in range(4):
        away = random_deviations(seed)
        costs = np.log([[half_width(sets, angle) for angle in angles] for sets in away])
        found = smooth_orientation(weight=0.2)(OMEGA, away)
        path = np.rint(found / (np.pi / 5)).astype(int)
        every = product(range(5), repeat=5)
        least = min(total(costs, np.array(each), angles, 0.2) for each in every)
        assert total(costs, path, angles, 0.2) == pytest.approx(least)


def test_what_a_cost_is_given(monkeypatch):
    monkeypatch.setattr(orientation, "CANDIDATE_ANGLES", 8)
    away = random_deviations(1)

    def cost(omega, angle, radius, half_length):
        assert omega is OMEGA
        for k, i in product(range(5), range(8)):
            assert radius[k, i] == pytest.approx(half_width(away[k], angle[i]))
        reach = np.abs(away).max(axis=1, keepdims=True)
        assert np.all(half_length <= reach)
        assert np.all(radius + half_length >= reach * (1 - 1e-12))
        return np.where(np.arange(8) == 3, 0.0, 1.0) * np.ones((5, 1))

    np.testing.assert_allclose(cheapest_orientation(cost, 0.0)(OMEGA, away), 3 * np.pi / 8)


def test_without_weight_every_frequency_stands_alone():
    away = random_deviations(2, 5)
    together = smooth_orientation(weight=0.0)(OMEGA, away)
    angles = np.arange(360) * np.pi / 360
    for k in range(5):
        alone = angles[np.argmin([half_width(away[k], angle) for angle in angles])]
        assert together[k] == pytest.approx(alone)
        assert apart(together[k], narrowest_angles(OMEGA[k : k + 1], away[k : k + 1])[0]) < 2


def test_the_narrowest_angle():
    away = random_deviations(3, 20)
    angle = narrowest_angles(np.arange(1.0, 21.0), away)
    every = np.linspace(0, np.pi, 2000)
    for sets, found in zip(away, angle, strict=True):
        assert half_width(sets, found) <= min(half_width(sets, a) for a in every) * (1 + 1e-9)


def test_smooth_jumps_less():
    omega = np.geomspace(1, 100, 60)
    away = random_deviations(4, 60)
    jumps = [
        np.sum(apart(angle[1:], angle[:-1]) > 0.3)
        for angle in (
            found(omega, away)
            for found in (narrowest_angles, smooth_orientation(), smooth_orientation(weight=3.0))
        )
    ]
    assert jumps[0] > jumps[1] >= jumps[2]


def test_limited_forces_where_it_strays():
    omega, away = np.arange(1.0, 31.0), random_deviations(5, 30)
    nominal = np.linspace(0, 6, 30)  # beyond pi: directions have a period
    free = narrowest_angles(omega, away)
    found = limited_orientation(limit=0.4, nominal=nominal)(omega, away)
    strays = apart(free, nominal) > 0.4
    assert 0 < strays.sum() < 30
    np.testing.assert_allclose(apart(found[strays], nominal[strays]), 0, atol=1e-7)
    np.testing.assert_allclose(found[~strays], free[~strays])


def test_limited_by_a_number_and_by_the_smooth_one():
    omega, away = np.arange(1.0, 31.0), random_deviations(6, 30)
    np.testing.assert_allclose(
        limited_orientation(limit=np.pi / 2, nominal=0.1)(omega, away),
        narrowest_angles(omega, away),
    )
    assert np.all(
        apart(limited_orientation(limit=0.2, nominal=0.7)(omega, away), 0.7) <= 0.2 + 1e-9
    )
    reference = smooth_orientation()(omega, away)
    assert np.all(apart(limited_orientation(limit=0.2)(omega, away), reference) <= 0.2 + 1e-9)


def test_a_line_of_plants_has_its_own_direction():
    """Sets of no width at all do not upset the path."""
    away = np.outer(np.exp(1j * np.linspace(0.3, 0.6, 5)), np.array([-1, 0.2, 2]))
    for found in (narrowest_angles, smooth_orientation(), limited_orientation()):
        assert np.all(apart(found(OMEGA, away), np.linspace(0.3, 0.6, 5)) < 0.1)
    for found in (narrowest_angles, smooth_orientation(), limited_orientation()):
        assert np.isfinite(found(OMEGA, 0 * away)).all()


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: smooth_orientation(weight=-1), "weight must not be negative, it is -1"),
        (lambda: smooth_orientation(weight=np.nan), "weight must not be negative, it is nan"),
        (lambda: limited_orientation(limit=0.0), r"limit must lie in \(0, pi/2\] rad, it is 0.0"),
        (lambda: limited_orientation(limit=2.0), r"limit must lie in \(0, pi/2\]"),
        (lambda: limited_orientation(limit=np.nan), r"limit must lie in \(0, pi/2\]"),
        (
            lambda: limited_orientation(limit=0.1, nominal=np.zeros(3)),
            r"shape \(3,\) does not fit 5 frequencies",
        ),
        (
            lambda: cheapest_orientation(lambda *_: np.zeros(5), 0.1),
            r"of shape \(5, 360\), without NaN",
        ),
        (lambda: cheapest_orientation(lambda *_: np.full((5, 360), np.nan), 0.1), "without NaN"),
        (
            lambda: limited_orientation(limit=0.1, nominal=np.nan),
            "nominal orientation must be finite, it is nan",
        ),
    ],
)
def test_refused(make, words):
    with pytest.raises(InputError, match=words):
        make()(OMEGA, random_deviations(0))


@pytest.mark.parametrize("seed", range(6))
def test_a_long_path_over_all_angles_is_the_cheapest(seed):
    """Against Bellman's recursion over all pairs of angles; infinite costs shut some out."""
    rng = np.random.default_rng(seed)
    angles, count = (360, 7, 2)[seed % 3], 30
    costs = rng.normal(size=(count, angles)).cumsum(axis=1)
    if seed % 2:
        costs[rng.random(costs.shape) < 0.4] = np.inf
    weights = 10 ** rng.uniform(-4, 4, count - 1) * (rng.random(count - 1) < 0.8)
    index = np.arange(angles)
    way = np.abs(index[:, None] - index)
    turn = np.minimum(way, angles - way) ** 2.0

    def price(path):
        return costs[np.arange(count), path].sum() + weights @ turn[path[1:], path[:-1]]

    ahead = costs[-1]
    for k in range(count - 2, -1, -1):
        ahead = costs[k] + (weights[k] * turn + ahead).min(axis=1)
    found = price(orientation._cheapest_path(costs, weights))
    assert found == pytest.approx(ahead.min(), rel=1e-12)
