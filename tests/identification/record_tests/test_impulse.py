"""Impulse responses of records against plain least squares, and their covariance against draws."""

import numpy as np
import pytest
from scipy.signal import lfilter

from workbench.identification.record_tests.impulse import (
    blocks,
    busiest,
    gaps_filled,
    impulse,
)
from workbench.identification.record_tests.record import RecordData


def test_the_fit_is_that_of_least_squares():
    rng = np.random.default_rng(0)
    u, y = rng.standard_normal((90, 2)) + 3.0, rng.standard_normal(90)
    found = impulse(u, y)
    lags = found.response.shape[1]
    rows = np.arange(lags - 1, 90)
    lagged = np.array([[u[t - k, j] for j in range(2) for k in range(lags)] for t in rows])
    trend = np.polynomial.legendre.legvander(np.linspace(-1, 1, len(rows)), 3)
    plain = np.linalg.lstsq(np.hstack([lagged, trend]), y[rows], rcond=None)[0][: 2 * lags]
    assert found.response.ravel() == pytest.approx(plain, abs=1e-6)


@pytest.mark.cases(0)
@pytest.mark.parametrize("pole", [0.0, 0.95])
def test_deviations_hold_whatever_the_colour_of_the_noise(pole):
    rng = np.random.default_rng(1)
    errors = []
    for _ in range(30):
        u = rng.standard_normal(3000)
        noise = lfilter([0.1], [1, -pole], rng.standard_normal(3000))
        found = impulse(u[:, None], lfilter([0, 0.2], [1, -0.8], u) + noise)
        truth = lfilter([0, 0.2], [1, -0.8], np.eye(1, found.response.shape[1])[0])
        spread = np.cumsum(np.cumsum(found.covariance, axis=0), axis=1)
        steps = np.cumsum(found.response[0] - truth) / np.sqrt(np.diag(spread))
        errors.append(steps[[5, 50, 150]])
    assert 0.7 < np.std(errors) < 1.4


def test_what_the_input_leaves_open_is_uncertain():
    u = np.zeros((800, 1))
    u[:20, 0] = np.random.default_rng(2).standard_normal(20)
    y = lfilter([0, 0.2], [1, -0.8], u[:, 0]) + 1e-3 * np.random.default_rng(3).standard_normal(800)
    found = impulse(u, y)
    assert np.sqrt(found.covariance[0, 0]) > 100 * np.abs(found.response[0, 0])


def test_too_short_or_dead_records_give_none():
    assert impulse(np.ones((10, 1)), np.arange(10.0)) is None
    assert impulse(np.ones((400, 1)), np.arange(400.0)) is None
    assert impulse(np.arange(400.0)[:, None], np.ones(400)) is None


def test_blocks_and_gaps():
    assert blocks(np.arange(7.0), 3).tolist() == [1.0, 4.0]
    assert gaps_filled(np.array([np.nan, 1.0, np.nan, 3.0])).tolist() == [1.0, 1.0, 2.0, 3.0]
    assert gaps_filled(np.full(3, np.nan)).tolist() == [0.0, 0.0, 0.0]


def test_the_busiest_part_of_the_longest_experiment_is_taken():
    u = np.zeros((1000, 1))
    u[700:800, 0] = np.random.default_rng(4).standard_normal(100)
    record = RecordData(u, u, None, (0, 100), 1.0, ("u",), ("y",))
    part = busiest(record, 200)
    assert part.stop - part.start == 200
    assert part.start <= 700 and part.stop >= 800
