"""Errors of linear models tell distortion of a plant, and what too low an order lacks."""

import numpy as np
import pytest
from scipy.signal import lfilter

from workbench import solve
from workbench.identification import StateSpaceFit, arx, as_experiments, response_deviations
from workbench.identification.innovations.distortion import PARTS, distortion_of

AT = np.array([0.0, 0.01, 0.1, 0.3])


def record(seed, bend=0.0, above=(0.0, 0.2), below=(1.0, -0.8), samples=900):
    """A plant and a sensor that is bent by a square and a cube, with the noise of an ARX model."""
    u, e = np.random.default_rng([seed, 17]).standard_normal((2, samples))
    x = lfilter(above, below, u)
    return as_experiments(u, x + bend * (x**2 + x**3) + 0.05 * lfilter([1.0], below, e))


def found_in(told, order=1):
    return distortion_of(arx(told, order, direct=False), told, False, None)


def test_a_bent_sensor_is_seen_and_a_straight_one_is_not():
    bent, straight = found_in(record(0, 0.3)), found_in(record(0))
    assert bent.found and bent.powers_chance < 1e-10 and bent.share > 0.1
    assert not straight.found
    assert "is not linear" in bent.words


def test_a_model_that_lacks_a_pole_is_told_by_past_inputs():
    told = record(1, above=(0.0, 0.1, 0.05), below=np.convolve([1.0, -0.8], [1.0, -0.95]))
    found = found_in(told)
    assert found.inputs_chance < 1e-10
    assert not found_in(told, order=2).found


def test_deviations_count_what_the_larger_model_would_change():
    told = record(2, 0.3)
    model = arx(told, 1, direct=False)
    moves = distortion_of(model, told, False, None).moves(AT)
    assert moves.shape == (1 + PARTS, len(AT), 1, 1)
    total = np.sqrt(np.sum(np.abs(moves) ** 2, axis=0))
    assert (response_deviations(model, told, AT, direct=False) >= total * (1 - 1e-9)).all()


def test_a_change_to_the_larger_model_is_that_of_its_fit():
    """The errors of a model without a pole are the missing part of the plant, as inputs tell it."""
    missing = ((0.0, 0.02), (1.0, -0.5))
    u, e = np.random.default_rng(5).standard_normal((2, 4000))
    y = lfilter([0.0, 0.2], [1.0, -0.8], u) + lfilter(*missing, u) + 1e-3 * e
    told = as_experiments(u, y)
    model = arx(told, 1, direct=False)
    z = np.exp(2j * np.pi * AT[1:])
    exact = 0.2 / (z - 0.8) + 0.02 / (z - 0.5)
    change = distortion_of(model, told, False, None).moves(AT[1:])[0, :, 0, 0]
    before = np.abs(model.response(AT[1:])[:, 0, 0] - exact)
    after = np.abs(model.response(AT[1:])[:, 0, 0] + change - exact)
    assert after.max() < 0.1 * before.max()


@pytest.mark.parametrize("unit", [1e-6, 1e5])
def test_units_change_nothing(unit):
    told = record(3, 0.1)
    scaled = as_experiments(told.u / unit, told.y * unit)
    first, second = (found_in(one) for one in (told, scaled))
    assert second.share == pytest.approx(first.share, rel=1e-5)
    np.testing.assert_allclose(
        np.abs(second.moves(AT)[0]), unit**2 * np.abs(first.moves(AT)[0]), rtol=1e-3
    )


def test_several_channels_delays_experiments_and_missing_samples():
    rng = np.random.default_rng(6)
    u, e = rng.standard_normal((500, 2)), rng.standard_normal((500, 2))
    above = ([0.0, 0.0, 0.5], [0.0, 0.5])
    y = np.stack([lfilter(b, [1.0, -0.5], v) for b, v in zip(above, u.T, strict=True)], 1) + 0.1 * e
    y[100:120] = np.nan
    told = as_experiments([u[:300], u[300:]], [y[:300], y[300:]])
    model = arx(told, 2, direct=False, delay_samples=(1, 0))
    found = distortion_of(model, told, False, None)
    assert np.isfinite(found.moves(AT)).all()
    assert distortion_of(model, told.part(0, 100), False, None) is None


@pytest.mark.cases(0)
def test_answers_say_what_their_deviations_count():
    for bend, words in (
        (0.3, "the plant is not linear; deviations count this"),
        (0.0, "no distort"),
    ):
        told = record(4, bend)
        program = StateSpaceFit(told.u, told.y, orders=(1,), direct=False)
        facts = " ".join(solve(program, method="prediction-error").certificate.facts)
        assert words in facts
