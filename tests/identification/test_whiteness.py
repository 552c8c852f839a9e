"""Errors of a model that lacks a part of the noise are found not to be white."""

import numpy as np
import pytest
from scipy.signal import lfilter

from workbench import solve
from workbench.identification import StateSpaceFit, arx, as_experiments
from workbench.identification.innovations.criterion import Criterion
from workbench.identification.innovations.pole_limits import PoleLimits
from workbench.identification.innovations.prediction_error import refine
from workbench.identification.innovations.whiteness import (
    CHANCE,
    model_whiteness,
    whiteness_of_errors,
)


def record(seed, above=(1.0,), below=(1.0, -0.8), samples=600):
    """A lag of pole 0.8 with white input, and noise through above / below."""
    u, e = np.random.default_rng(seed).standard_normal((2, samples))
    y = lfilter([0.0, 1.0], [1.0, -0.8], u) + 0.5 * lfilter(above, below, e)
    return as_experiments(u, y)


def test_errors_of_the_right_model_are_white_as_often_as_chance_says():
    """Of 60 records one in twenty has a chance below 0.05, within four standard deviations."""
    found = [
        model_whiteness(arx(told, 1, direct=False), told, False).chance
        for told in (record([seed, 1]) for seed in range(60))
    ]
    assert np.mean(np.array(found) < 0.05) <= 0.05 + 4 * np.sqrt(0.05 * 0.95 / 60)
    assert 0.35 < np.mean(found) < 0.65


def test_errors_of_a_model_that_lacks_the_noise_are_not_white():
    told = record([0, 2], above=(1.0, 0.9))
    found = model_whiteness(arx(told, 1, direct=False), told, False)
    assert found.chance < CHANCE and found.share > 0.1


def test_scales_of_signals_do_not_change_the_chance():
    told = record([0, 3])
    large = as_experiments(1e-3 * told.u, 1e6 * told.y)
    plain, scaled = (
        model_whiteness(arx(one, 1, direct=False), one, False) for one in (told, large)
    )
    assert scaled.chance == pytest.approx(plain.chance, rel=1e-4)


def test_freed_noise_moves_a_plant_whose_pole_the_noise_took():
    """The model has one pole for plant and noise; the noise's is 0.5, and the plant's 0.8."""
    found = []
    for seed in range(6):
        u, e = np.random.default_rng([seed, 7]).standard_normal((2, 2000))
        noise = lfilter([1.0], [1.0, -0.5], e)
        told = as_experiments(u, lfilter([0.0, 0.2], [1.0, -0.8], u) + noise)
        model = refine(arx(told, 1, direct=False), told, 0.0, direct=False)[0]
        criterion = Criterion(model, told, 0.0, False)
        theta = criterion.start(model)
        first, *chance = whiteness_of_errors(criterion, theta, np.eye(len(theta))).moves.T
        pole = model.A[0, 0]
        moved = criterion.model(theta + first).A[0, 0]
        spread = np.linalg.norm([criterion.model(theta + one).A[0, 0] - pole for one in chance])
        found.append([abs(pole - 0.8), abs(moved - 0.8), spread])
    before, after, spread = np.mean(found, axis=0)
    assert after < before and 0 < spread < 0.2


@pytest.mark.cases(0)
def test_answers_say_that_errors_are_not_white():
    told = record([0, 4], above=(1.0, 0.9, 0.5), below=(1.0, -0.3, 0.6))
    program = StateSpaceFit(told.u, told.y, orders=(1,), direct=False)
    facts = " ".join(solve(program, method="prediction-error").certificate.facts)
    assert "predictor: one-step errors are not white" in facts


def test_a_search_goes_on_along_the_limit_of_a_pole():
    """White noise at the output of an integrator: its predictor's pole is on the unit circle."""
    u, e = np.random.default_rng([0, 5]).standard_normal((2, 1000))
    told = as_experiments(u, lfilter([0.0, 0.1], [1.0, -1.0], u) + e)
    start = arx(told, 1, direct=False)
    found, _ = refine(start, told, 0.0, direct=False, largest_radius=1.001, least_gain=1e-3)
    again, _ = refine(found, told, 0.0, direct=False, largest_radius=1.001, least_gain=1e-3)

    def value(model):
        criterion = Criterion(model, told, 0.0, False)
        return criterion(criterion.start(model))

    assert value(found) - value(again) < 0.5
    assert found.predictor_radius < 1 and abs(found.B[0, 0] * found.C[0, 0] - 0.1) < 0.005


def test_steps_are_projected_onto_limits_in_the_metric_of_their_covariance():
    told = record([0, 6])
    criterion = Criterion(arx(told, 2, direct=False), told, 0.0, False)
    limits = PoleLimits(criterion, 0.7)
    theta = criterion.start(arx(told, 2, direct=False))
    projected = limits.projected(theta, np.eye(len(theta)))
    assert not limits.hold(criterion.model(theta)) and limits.hold(criterion.model(projected))
    assert criterion.model(projected).radius > 0.65
