"""Fits and residual tests."""

import numpy as np
import pytest
from scipy.signal import lfilter

from workbench.errors import InputError
from workbench.identification.state_space import validation

RNG = np.random.default_rng(0)


def test_nrmse_fit():
    y = RNG.normal(size=(500, 2))
    assert validation.nrmse_fit(y, y) == pytest.approx([100, 100])
    mean = np.broadcast_to(y.mean(axis=0), y.shape)
    assert validation.nrmse_fit(y, mean) == pytest.approx([0, 0])


def test_white_residuals_pass():
    shares = [
        validation.share_outside(validation.autocorrelation(RNG.normal(size=(500, 2)), 20))
        for _ in range(50)
    ]
    assert np.mean(shares) == pytest.approx(0.01, abs=0.005)


def test_coloured_residuals_fail():
    coloured = lfilter([1.0], [1.0, -0.6], RNG.normal(size=(500, 1)), axis=0)
    assert validation.autocorrelation(coloured, 20)[0, 0] > 8


def test_independent_coloured_signals_pass():
    shares = []
    for _ in range(50):
        e, u = lfilter([1.0], [1.0, -0.8], RNG.normal(size=(2, 1000, 1)), axis=1)
        shares.append(validation.share_outside(validation.cross_correlation(e, u, 20)))
    assert np.mean(shares) < 0.04


def test_missed_dynamics_show_at_their_lag():
    u = RNG.normal(size=(1000, 2))
    e = RNG.normal(size=(1000, 1))
    e[3:, 0] += 0.5 * u[:-3, 1]
    found = abs(validation.cross_correlation(e, u, 10))
    assert np.unravel_index(found.argmax(), found.shape) == (10 + 3, 0, 1)
    assert validation.share_outside(np.delete(found, 13, axis=0)) < 0.1


def test_too_many_lags():
    with pytest.raises(InputError, match="30 lags of 20"):
        validation.autocorrelation(RNG.normal(size=(20, 1)), 30)
