"""Predictors that follow the level of their errors."""

import numpy as np
import pytest
from scipy.signal import lfilter

from workbench.identification import Experiments, arx
from workbench.identification.choice.levels import (
    LEVEL_RATE,
    errors_beside_level,
    level_following,
)


def record(samples, seed, level=0.0):
    rng = np.random.default_rng(seed)
    u, e = rng.standard_normal((samples, 1)), rng.standard_normal((samples, 2))
    y = np.column_stack([lfilter([0, 1], [1, -0.8], u[:, 0] + e[:, 0]), u[:, 0] + e[:, 1]])
    return Experiments(u, y + level)


def test_a_level_that_has_moved_no_longer_counts():
    model, moved = arx(record(2000, 0), 2), record(2000, 1, level=5.0)
    plain = (moved.y - model.one_step(moved.u, moved.y, 50))[200:]
    following = (moved.y - level_following(model).one_step(moved.u, moved.y, 50))[200:]
    assert (np.abs(plain.mean(axis=0)) > 0.9).all()
    assert (np.abs(following.mean(axis=0)) < 0.1).all()


@pytest.mark.cases(0)
def test_white_errors_grow_by_half_the_rate():
    model, judged = arx(record(20_000, 2), 1), record(20_000, 3)
    plain = (judged.y - model.one_step(judged.u, judged.y, 50))[200:]
    following = (judged.y - level_following(model).one_step(judged.u, judged.y, 50))[200:]
    growth = (following**2).mean(axis=0) / (plain**2).mean(axis=0)
    assert growth == pytest.approx(1 + LEVEL_RATE / 2, abs=0.005)


def test_its_errors_are_those_of_the_model_filtered():
    model, judged = arx(record(500, 4), 2), record(500, 5, level=3.0)
    plain = judged.y - model.one_step(judged.u, judged.y, 50)
    following = judged.y - level_following(model).one_step(judged.u, judged.y, 50)
    # The initial states of the models differ at first: levels rest at zero.
    np.testing.assert_allclose(errors_beside_level(plain)[400:], following[400:], atol=0.02)


def test_few_samples_do_not_tell_the_level():
    """With more states than samples of the washout, a level from them would be chance."""
    model, judged = arx(record(500, 6), 8), record(150, 7)
    following = level_following(model)
    errors = [(judged.y - m.one_step(judged.u, judged.y, 5))[20:] for m in (model, following)]
    plain, beside = (float(np.sqrt((e**2).mean())) for e in errors)
    assert beside < 1.03 * plain
    assert following.resting == 2


def test_responses_stay_and_so_does_stability():
    model = arx(record(500, 6), 3)
    found, frequency = level_following(model), np.linspace(0, 0.5, 20)
    np.testing.assert_allclose(found.response(frequency), model.response(frequency), atol=1e-9)
    assert model.radius < found.radius < 1
    assert found.predictor_radius < 1
