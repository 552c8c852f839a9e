"""Responses from periods: known answers, coverage of their regions, tests of their assumptions."""

import numpy as np
import pytest
from scipy import stats

from workbench.errors import InputError
from workbench.identification import IdentificationWarning, periodic_response, sine_fit

RUNS = 500


def within_binomial_limits(hits, runs, share):
    low, high = stats.binom.interval(1 - 1e-4, runs, share)
    return low <= hits <= high


def noise(rng, *shape, size=1.0):
    return size * (rng.normal(size=shape) + 1j * rng.normal(size=shape)) / np.sqrt(2)


def experiment(rng, gain, periods, sizes=(0.01, 0.02), shared=0.0):
    """A response measured with noise on input and output, partly the same noise."""
    count = len(gain)
    common = noise(rng, count, periods, size=shared)
    u = 1 + noise(rng, count, periods, size=sizes[0]) + common
    y = gain[:, None] + noise(rng, count, periods, size=sizes[1]) + 3j * common
    return periodic_response(np.arange(1.0, count + 1), u, y)


@pytest.mark.parametrize("confidence", [0.9, 0.99])
@pytest.mark.parametrize("periods", [2, 4, 10])
def test_the_regions_cover_as_they_say(confidence, periods):
    rng = np.random.default_rng(periods)
    gain = 5 * np.exp(1j * rng.uniform(0, 7, RUNS))
    estimate = experiment(rng, gain, periods, shared=0.01)
    error = estimate.response[:, 0, 0] - gain
    inside = np.abs(error) <= estimate.radius(confidence=confidence)[:, 0, 0]
    half = estimate.half_width(confidence=confidence)[:, 0, 0]
    for hits in (inside, np.abs(error.real) <= half, np.abs(error.imag) <= half):
        assert within_binomial_limits(hits.sum(), RUNS, confidence)


def test_the_regions_of_several_inputs_cover():
    rng = np.random.default_rng(5)
    gain = noise(rng, RUNS, 2, 2)
    u0 = np.array([[1, 1], [1, -1]]) * np.array([2.0, 0.5])[:, None]
    periods = 6
    u = u0 + noise(rng, RUNS, periods, 2, 2, size=0.003)
    y = (gain @ u0)[:, None] + noise(rng, RUNS, periods, 2, 2, size=0.01)
    estimate = periodic_response(np.arange(1.0, RUNS + 1), u, y)
    assert estimate.response.shape == (RUNS, 2, 2)
    inside = np.abs(estimate.response - gain) <= estimate.radius(confidence=0.95)
    for i, j in np.ndindex(2, 2):
        assert within_binomial_limits(inside[:, i, j].sum(), RUNS, 0.95)


def test_variance_has_the_cross_terms():
    """Noise that acts on the input before it is measured cancels from Y - G U."""
    rng = np.random.default_rng(2)
    gain = np.full(400, 3j)
    estimate = experiment(rng, gain, 10, sizes=(0, 0.001), shared=0.1)
    # The common noise is 1 on u and 3j on y: just what G = 3j passes.
    assert np.mean(estimate.variance) == pytest.approx(0.001**2 / 10, rel=0.05)
    assert np.mean(estimate.input_covariance.real) == pytest.approx(0.01, rel=0.1)
    assert np.mean(estimate.output_covariance.real) == pytest.approx(0.09, rel=0.1)
    assert np.mean(estimate.cross_covariance.imag) == pytest.approx(0.03, rel=0.1)


def test_closed_loop_is_consistent():
    """Output noise fed back to the input biases spectral estimates, not this one."""
    rng = np.random.default_rng(3)
    gain, controller, periods = 2 - 1j, 0.5 + 0.2j, 400
    disturbance = noise(rng, 200, periods, size=0.5)
    loop = 1 + gain * controller
    y, u = (gain + disturbance) / loop, (1 - controller * disturbance) / loop
    estimate = periodic_response(np.arange(1.0, 201), u, y)
    error = estimate.response[:, 0, 0] - gain
    assert abs(error.mean()) < 4 * np.sqrt(estimate.variance.mean() / 200)


def test_thesis_interval_is_wider():
    radius = np.sqrt(stats.f.ppf(0.99, 2, 18))
    assert stats.t.ppf(0.995, 9) / radius == pytest.approx(1.33, abs=0.01)


def test_transients_are_discarded():
    u = np.ones((3, 20), dtype=complex)
    y = 2 + np.exp(-np.arange(20.0)) * np.ones((3, 1))
    kept = periodic_response([1, 2, 3], u, y, transients=10)
    assert kept.periods == 10
    assert np.abs(kept.response - 2).max() < 1e-4
    assert not kept.assumptions.holds()


def test_assumptions_are_calibrated():
    rng = np.random.default_rng(8)
    tests = [experiment(rng, np.full(60, 2j), 10).assumptions for _ in range(200)]
    for name in ("circular", "normal", "independent"):
        p = np.array([getattr(t, name) for t in tests])
        assert within_binomial_limits(np.sum(p < 0.05), 200, 0.05), name
        assert stats.kstest(p, "uniform").pvalue > 1e-3, name


@pytest.mark.parametrize("broken", ["circular", "normal", "independent"])
def test_broken_assumptions_are_found(broken):
    rng = np.random.default_rng(9)
    scatter = noise(rng, 300, 10)
    if broken == "circular":
        scatter.imag *= 2
    elif broken == "normal":
        scatter *= rng.standard_t(3, size=scatter.shape) / np.abs(noise(rng, 300, 10))
    else:
        scatter += np.linspace(-1, 1, 10)
    result = periodic_response(
        np.arange(1.0, 301), np.ones((300, 10)), 3 + 0.1 * scatter
    ).assumptions
    assert getattr(result, broken) < 1e-3
    assert not result.holds()


def test_without_noise_nothing_is_said_of_it():
    result = periodic_response([1.0], np.ones((1, 5)), np.full((1, 5), 2.0))
    assert result.response[0, 0, 0] == 2
    assert result.radius()[0, 0, 0] == 0
    assert np.isnan(result.assumptions.circular)
    assert result.assumptions.holds()


def test_a_stepped_sine_gives_the_response():
    rate, gain = 1e3, 0.5 * np.exp(-0.7j)
    time = np.arange(4000) / rate
    wave = np.exp(2j * np.pi * 10.1 * time)
    u, y = sine_fit(np.stack([wave.real, (gain * wave).real + 3]), 1 / rate, 10.1)[..., 0]
    estimate = periodic_response([10.1], u[None], y[None])
    assert estimate.response[0, 0, 0] == pytest.approx(gain, rel=1e-9)
    assert estimate.omega[0] == pytest.approx(2 * np.pi * 10.1)
    assert estimate.to_dataset()["response"].dims == ("frequency", "output", "input")


def test_weak_excitation_is_warned_of():
    rng = np.random.default_rng(0)
    u = noise(rng, 2, 10) + np.array([[10.0], [0.2]])
    with pytest.warns(IdentificationWarning, match=r"worst at 2 Hz"):
        periodic_response([1.0, 2.0], u, u + 1)


@pytest.mark.parametrize(
    ("u", "y", "transients", "message"),
    [
        (np.ones((1, 1)), np.ones((1, 1)), 0, "two are needed"),
        (np.ones((1, 5)), np.ones((1, 5)), 4, "1 periods are left"),
        (np.zeros((1, 5)), np.ones((1, 5)), 0, "input 0 is dead"),
        (np.ones((1, 5)), np.zeros((1, 5)), 0, "output 0 is dead"),
        (np.full((1, 5), np.nan), np.ones((1, 5)), 0, "u is not finite at 7 Hz"),
        (np.ones((2, 5)), np.ones((1, 5)), 0, "u needs shape"),
        (np.ones((1, 5)), np.ones((1, 4)), 0, "same periods"),
        (np.ones((1, 5, 2, 1)), np.ones((1, 5, 1, 1)), 0, "2 inputs need 2 experiments"),
        (np.ones((1, 5, 2, 2)), np.ones((1, 5, 1, 2)), 0, "tell the inputs apart at 7 Hz"),
    ],
)
def test_bad_input(u, y, transients, message):
    with pytest.raises(InputError, match=message):
        periodic_response([7.0], u, y, transients=transients)
