"""Bounds on the T that a level allows, against random T and their mu."""

from dataclasses import replace

import numpy as np
import pytest

from workbench.synthesis import LoopWeights, least_mu
from workbench.synthesis.limits.allowed_sets import allowed_points, largest_projections
from workbench.synthesis.limits.intervals import ComplexInterval, Interval
from workbench.synthesis.limits.loop_functions import LeastWeights

COUNT = 60
SLACK = np.full(COUNT, 1e-4)


@pytest.fixture(scope="module")
def weights():
    rng = np.random.default_rng(8)
    sizes = 10 ** rng.uniform(-1.5, 1.0, (4, COUNT))
    return LoopWeights(*sizes[:3], sizes[3] * np.exp(2j * np.pi * rng.uniform(size=COUNT)))


def as_least(weights, turned=0.0):
    """Weights as bounds that are exact, or hold every W_r turned by so much."""
    size = np.abs(weights.real)
    along = np.divide(weights.real, size, out=np.ones(size.shape, complex), where=size > 0)
    parts = (Interval(each - 1e-15, each + 1e-15) for each in (along.real, along.imag))
    sizes = (weights.performance, weights.control, weights.circular, size)
    return LeastWeights(*sizes, ComplexInterval(*parts), np.full(size.shape, turned))


def plane():
    """T (N, 1) all over the plane, dense about 0 and 1."""
    rng = np.random.default_rng(9)
    away = 10 ** rng.uniform(-3, 0.5, 20_000) * np.exp(2j * np.pi * rng.uniform(size=20_000))
    return np.concatenate([away, 1 + away])[:, None]


DIRECTIONS = np.exp(2j * np.pi * np.arange(8) / 8)


@pytest.mark.parametrize("factor", [1.001, 1.05, 1.5, 4.0])
@pytest.mark.slow
def test_every_allowed_T_is_held_and_the_bound_is_reached(weights, factor):
    """Each weight's own level: frequencies one by one, with its T among those searched."""
    least = least_mu(weights, tolerance=1e-6)
    for i in range(0, COUNT, 6):
        one, level = weights.at(np.array([i])), factor * least.upper[i]
        T = np.concatenate([plane(), [[least.T[i]]], least.T[i] + 0.1 * plane()])[:, 0]
        T = T[one.mu(T[:, None])[:, 0] <= level]
        bound = largest_projections(as_least(one), level, DIRECTIONS[None], SLACK[:1])[0]
        # Edges by bisection from the T of least mu: nearly the largest.
        ray = np.exp(2j * np.pi * np.arange(720) / 720)
        low, high = np.zeros(720), np.full(720, 2.0 + 2.0 * level / one.performance[0])
        for _ in range(40):
            r = (low + high) / 2
            inside = one.mu((least.T[i] + r * ray)[:, None])[:, 0] <= level
            low, high = np.where(inside, r, low), np.where(inside, high, r)
        edge = least.T[i] + low * ray
        size = np.hypot(one.performance[0], one.control[0])
        for direction, most in zip(DIRECTIONS, bound, strict=True):
            reached = max((T * direction).real.max(), (edge * direction).real.max())
            assert reached <= most + 1e-12
            if factor > 2.0 and abs(one.real[0]) < 0.3 * size:  # else narrowing leaves room
                assert most <= reached + 0.2 * level / size


@pytest.mark.slow
def test_nothing_is_allowed_below_the_least_mu_and_something_above(weights):
    least = least_mu(weights, tolerance=1e-4)
    for i in range(COUNT):
        one = as_least(weights.at(np.array([i])))
        h = DIRECTIONS[None, :1]
        assert largest_projections(one, 0.999 * least.lower[i], h, SLACK[:1])[0, 0] == -np.inf
        assert largest_projections(one, 1.001 * least.upper[i], h, SLACK[:1])[0, 0] > -np.inf


@pytest.mark.cases(0)
def test_sets_of_turned_real_weights_are_held(weights):
    level = 1.3 * least_mu(weights).upper.max()
    h = np.tile(DIRECTIONS, (COUNT, 1))
    turned = replace(weights, real=weights.real * np.exp(0.3j))
    held = largest_projections(as_least(weights, 0.3), level, h, 0 * SLACK)
    for each in (weights, turned):
        T = allowed_points(as_least(each), level)
        inside = np.isfinite(T) & (level >= each.mu(np.nan_to_num(T).T).T)
        along = np.where(inside, T, np.nan)[:, :, None] * DIRECTIONS
        assert (np.nan_to_num(along.real, nan=-np.inf).max(axis=1) <= held + 1e-12).all()


def test_weights_that_are_no_numbers_hold_every_T():
    nan, one = np.full(1, np.nan), np.ones(1)
    whole = Interval(-np.full(1, np.inf), np.full(1, np.inf))
    lost = LeastWeights(0 * one, 0 * one, 0 * one, one, ComplexInterval(whole, whole), nan)
    assert largest_projections(lost, 1.0, np.ones((1, 1), complex), SLACK[:1])[0, 0] == np.inf
