"""Rounding by converters that repeats itself with the periods: regions count it."""

import numpy as np
import pytest
from scipy.signal import lfilter

from workbench.identification import periodic_local_polynomial
from workbench.identification.responses.of_records import record_responses
from workbench.identification.responses.repeated_rounding import repeated_rounding

PERIOD, PERIODS = 200, 8
STEP = 2.0**-10


def rounded(x, step=STEP):
    return np.round(x / step) * step


@pytest.mark.parametrize("noise", [0.0, 0.1, 0.3, 0.5, 1.0])
def test_the_mean_of_many_periods_keeps_so_much_rounding(noise):
    rng = np.random.default_rng(0)
    one = rng.standard_normal(PERIOD)
    x = np.tile(one, 400) + noise * STEP * rng.standard_normal(400 * PERIOD)
    left = rounded(x).reshape(400, PERIOD).mean(axis=0) - one
    chance = noise**2 * STEP**2 / 400 + STEP**2 / 12 / 400
    said = repeated_rounding(rounded(x), PERIOD)
    assert said <= STEP**2 / 12 * 1.01
    assert left.var() - chance <= said * 1.3 + 0.01 * STEP**2 / 12
    if noise == 0.0:
        assert left.var() == pytest.approx(said, rel=0.3)


@pytest.mark.parametrize("noise", [0.0, 0.2, 5.0])
def test_regions_of_equal_periods_hold_the_plant(noise):
    """Periods that are equal after the converter scatter by nothing: all regions were points."""
    held = [[], []]
    for seed in range(12):
        rng = np.random.default_rng(seed)
        u = np.tile(rng.standard_normal(PERIOD), PERIODS + 1)
        y = lfilter([0, 0.1], [1, -0.9], u) + noise * STEP * rng.standard_normal(len(u))
        u, y = rounded(u[PERIOD:]), rounded(y[PERIOD:])
        estimates, _ = record_responses([(u, y)], 1.0, 60)
        at = np.arange(1, PERIOD // 2, 3)
        local = periodic_local_polynomial(u[:, None], y[:, None], PERIOD, lines=at)
        for kept, found in zip(held, (estimates[0], local), strict=True):
            exact = 0.1 / (np.exp(1j * found.omega) - 0.9)
            away = np.abs(found.response[:, 0, 0] - exact)
            kept.append(away <= found.radius(confidence=0.95)[:, 0, 0])
    assert all(np.mean(kept) >= 0.93 for kept in held)


def test_an_input_of_few_levels_is_exact():
    u = np.tile(np.sign(np.random.default_rng(0).standard_normal(PERIOD)), PERIODS)
    assert repeated_rounding(u, PERIOD, 64) == 0.0
    assert repeated_rounding(np.random.default_rng(0).standard_normal(1600), PERIOD) == 0.0
