"""Transients that outlive the record: followed by rational functions where there are any."""

import numpy as np
import pytest
from scipy.signal import lfilter

from workbench.errors import InputError
from workbench.identification import (
    PeriodicStream,
    periodic_local_polynomial,
    periodic_local_rational,
)

PERIOD, LINES = 256, np.arange(1, 60)


def denominator(radius):
    return [1.0, -2 * radius * np.cos(0.5), radius**2]


def plant(radius):
    z = np.exp(2j * np.pi * LINES / PERIOD)
    return (z + 0.3) / np.polyval(denominator(radius), z)


def record(radius, noise, rng, periods=4, inputs=1):
    time = np.arange(periods * PERIOD)
    phases = rng.uniform(0, 2 * np.pi, (LINES.size, inputs))
    angles = 2 * np.pi * np.outer(time, LINES) / PERIOD
    u = np.stack([np.cos(angles + phase).sum(axis=1) for phase in phases.T], axis=1)
    y = lfilter([0.0, 1.0, 0.3], denominator(radius), u, axis=0)
    return u, y + noise * y.std() * rng.standard_normal(y.shape)


def errors(way, radius, noise, rng, records):
    """Squares of relative errors (records, F), and of errors over the stated variance."""
    squares, ratios = [], []
    for _ in range(records):
        found = way(*record(radius, noise, rng), PERIOD, lines=LINES)
        square = np.abs(found.response[:, 0, 0] - plant(radius)) ** 2
        squares.append(square / np.abs(plant(radius)) ** 2)
        ratios.append(square / found.variance[:, 0, 0])
    return np.array(squares), np.array(ratios)


@pytest.mark.parametrize("radius", [0.99, 0.999, 0.9999])
def test_without_noise_a_light_mode_is_exact(radius):
    rng = np.random.default_rng(0)
    u, y = record(radius, 0.0, rng)
    exact = plant(radius)
    blurred, followed = (
        np.abs(way(u, y, PERIOD, lines=LINES).response[:, 0, 0] / exact - 1).max()
        for way in (periodic_local_polynomial, periodic_local_rational)
    )
    assert blurred > 0.02
    assert followed < 1e-6


@pytest.mark.cases(1)
@pytest.mark.parametrize("radius", [0.999, 0.9995])
def test_with_noise_it_errs_much_less_and_says_by_how_much(radius):
    rng = np.random.default_rng(1)
    blurred, _ = errors(periodic_local_polynomial, radius, 1e-3, rng, 15)
    followed, ratios = errors(periodic_local_rational, radius, 1e-3, rng, 15)
    assert followed.mean() < blurred.mean() / 25
    assert followed.max() < blurred.max() / 25
    assert np.mean(ratios) == pytest.approx(1.13, abs=0.12)


@pytest.mark.cases(0)
def test_where_no_mode_is_light_it_is_as_good_as_polynomials():
    """Wider bands have a little less variance; a pole is hardly ever seen in noise."""
    rng = np.random.default_rng(2)
    smooth, _ = errors(periodic_local_polynomial, 0.8, 0.3, rng, 30)
    rational, ratios = errors(periodic_local_rational, 0.8, 0.3, rng, 30)
    assert np.sqrt(rational.mean() / smooth.mean()) < 1.05
    assert np.mean(ratios) == pytest.approx(1.13, abs=0.12)


def test_two_experiments_in_pieces_make_the_same():
    rng = np.random.default_rng(3)
    mixing = np.array([[1.0, 1.0], [1.0, -1.0]])
    u, y = record(0.999, 1e-3, rng)
    whole_u = u[:, :1, None] * mixing
    whole_y = y[:, :, None] * mixing[:1] + 0.5 * y[:, :, None] * mixing[1:]
    found = periodic_local_rational(whole_u, whole_y, PERIOD, lines=LINES)
    stream = PeriodicStream(PERIOD, 4, lines=LINES, rational=True)
    for experiment in range(2):
        for start in range(0, len(u), 300):
            part = slice(start, start + 300)
            stream.add(
                whole_u[part, :, experiment], whole_y[part, :, experiment], experiment=experiment
            )
    assert np.allclose(stream.response().response, found.response, rtol=1e-9)
    exact = plant(0.999)[:, None] * np.array([1.0, 0.5])
    assert np.abs(found.response[:, 0] / exact - 1).max() < 0.05


@pytest.mark.parametrize("scale", [1e-150, 1e150])
def test_units_make_no_difference(scale):
    u, y = record(0.999, 1e-3, np.random.default_rng(4))
    found = periodic_local_rational(u, y, PERIOD, lines=LINES)
    scaled = periodic_local_rational(u, scale * y, PERIOD, lines=LINES)
    assert np.allclose(scaled.response / scale, found.response, rtol=1e-6)


def test_a_silent_output_at_a_line_and_a_narrow_band():
    u, y = record(0.9, 0.0, np.random.default_rng(5))
    quiet = np.cos(2 * np.pi * 3 * np.arange(len(u)) / PERIOD)[:, None]
    found = periodic_local_rational(u, quiet, PERIOD, lines=LINES)
    assert np.isfinite(found.response).all() and np.isfinite(found.variance).all()
    with pytest.raises(InputError, match="take more periods, a lower degree, or higher lines"):
        periodic_local_rational(u, y, PERIOD, lines=LINES, degree=9)
