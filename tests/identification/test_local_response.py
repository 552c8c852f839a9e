"""Local models of several widths, averaged: regions that hold the truth, bias included."""

import warnings

import numpy as np
import pytest
from scipy.signal import freqz, lfilter

from workbench.errors import InputError
from workbench.identification import local_polynomial, local_rational, local_response
from workbench.identification.responses.bands import fitted_bands
from workbench.identification.responses.local_polynomial import spectrum

LAG = [0.0, 0.03], [1.0, -0.97]
SHARP = [0.0, 0.0, 0.02], [1.0, -2 * 0.999 * np.cos(0.5), 0.998]
FREQUENCY = np.geomspace(2e-3, 0.3, 40)


def steps(rng, samples):
    return np.repeat(rng.choice([-1.0, 1.0], samples // 20 + 1), 20)[:samples]


def noise(rng, samples):
    return rng.standard_normal(samples)


def record(plant, excitation, rng, samples, decibels):
    """Input and output (N, 1) of a plant that runs when the record begins."""
    u = excitation(rng, 2 * samples)
    y = lfilter(*plant, u)[samples:]
    size = y.std() * 10 ** (-decibels / 20)
    return u[samples:, None], (y + 3.0 + size * rng.standard_normal(samples))[:, None]


def truth(plant, frequency):
    return freqz(*plant, worN=2 * np.pi * frequency)[1]


@pytest.mark.cases(0)
@pytest.mark.parametrize("excitation", [steps, noise])
@pytest.mark.parametrize("plant", [LAG, SHARP], ids=["lag", "sharp resonance"])
def test_regions_hold_the_truth_in_every_third_of_the_band(plant, excitation):
    """Records of some 25 time constants; resonances narrower than the distance of lines."""
    inside = []
    for seed in range(10):
        rng = np.random.default_rng(seed)
        found = local_response(
            *record(plant, excitation, rng, 800, 40), 1.0, frequency_hz=FREQUENCY
        )
        away = np.abs(found.response[:, 0, 0] - truth(plant, FREQUENCY))
        inside.append(away <= found.radius(confidence=0.95)[:, 0, 0])
    thirds = [np.mean(part) for part in np.array_split(np.array(inside), 3, axis=1)]
    assert np.mean(inside) > 0.93 and min(thirds) > 0.85


@pytest.mark.cases(2)
@pytest.mark.parametrize("samples", [1000, 2000, 4000])
@pytest.mark.parametrize("between", ["held", "straight"])
def test_a_record_without_noise_keeps_its_lines(between, samples):
    """The largest models are open there: common factors of theirs leave nothing that counts."""
    u = np.random.default_rng(0).standard_normal(samples)
    plant = LAG if between == "held" else ([0.5, 0.5], [1.0, -0.97])
    y = lfilter(*plant, u)
    found = local_response(u[:, None], y[:, None], 1.0, frequency_hz=FREQUENCY)
    away = np.abs(found.response[:, 0, 0] - truth(plant, FREQUENCY))
    radius = found.radius(confidence=0.95)[:, 0, 0]
    assert (radius < 1e-3 * np.abs(truth(plant, FREQUENCY))).all()
    assert (away <= radius).mean() > 0.93


def test_regions_of_polynomials_in_narrow_bands_lose_it():
    """The reason for all this: bias that residuals do not show."""
    lines = np.arange(2, 60)
    u, y = record(LAG, steps, np.random.default_rng(0), 800, 60)
    old = local_polynomial(u, y, lines=14, at=lines)
    new = local_response(u, y, 1.0, frequency_hz=lines / 800)
    exact = truth(LAG, lines / 800)
    lost = np.abs(old.response[:, 0, 0] - exact) > np.sqrt(3.6 * old.variance[:, 0, 0])
    kept = np.abs(new.response[:, 0, 0] - exact) <= new.radius(confidence=0.95)[:, 0, 0]
    assert lost.mean() > 0.2 and kept.mean() > 0.93
    assert np.median(new.variance) < np.median(old.variance)


@pytest.mark.cases(1)
@pytest.mark.parametrize("seed", range(4))
def test_a_dead_time_does_not_widen_regions(seed):
    """In the widest band its phase turns five times, which no model follows and none contradicts.

    The yardstick is a setting chosen with the truth, of a width in which the phase turns little.
    """
    rng, lines = np.random.default_rng(seed), np.arange(11, 80)
    late = lfilter([1.0], [1.0, -0.85], rng.standard_normal(3000))
    y = lfilter([0.0, 0.08], [1.0, -0.92], np.roll(late, 45))[1500:, None]
    u, y = late[1500:, None], y + 0.1 * y.std() * rng.standard_normal((1500, 1))
    exact = truth(([0.0] * 46 + [0.08], [1.0, -0.92]), lines / 1500)
    found = local_response(u, y, 1.0, frequency_hz=lines / 1500)
    narrow = local_rational(u, y, lines=14, at=lines)
    radius = found.radius(confidence=0.95)[:, 0, 0]
    assert (np.abs(found.response[:, 0, 0] - exact) <= radius).mean() > 0.93
    narrow_radius = np.sqrt(3.89 * narrow.variance[:, 0, 0])  # 95 %, 6 degrees of freedom
    assert np.median(radius / narrow_radius) < 1.5


def test_the_line_at_frequency_0_has_no_influence():
    """The mean has been removed there, so it says nothing of the response."""
    u, y = (spectrum(x) for x in record(LAG, noise, np.random.default_rng(7), 400, 30))
    places, model = np.array([1.0, 9.0, 9.5, 10.0, 10.6, 11.0]), [(2, 1)]
    found = fitted_bands(u, y[:, 0], 400, places, 20, model)[0]
    u[0], y[0] = 1e3, 1e4
    other = fitted_bands(u, y[:, 0], 400, places, 20, model)[0]
    assert (found.lines != 0).all() and (np.diff(found.lines, axis=1) > 0).all()
    np.testing.assert_array_equal(other.response, found.response)
    np.testing.assert_array_equal(other.left, found.left)


@pytest.mark.cases(0)
def test_two_inputs_and_two_outputs_are_told_apart():
    rng = np.random.default_rng(1)
    u = rng.standard_normal((2000, 2))
    pairs = [[LAG, SHARP], [SHARP, LAG]]
    y = np.stack([sum(lfilter(*p, x) for p, x in zip(row, u.T, strict=True)) for row in pairs], 1)
    found = local_response(u, y + 0.01 * rng.standard_normal(y.shape), 0.1)
    assert found.response.shape == (found.frequency_hz.size, 2, 2)
    assert found.frequency_hz[0] == pytest.approx(1 / 200.0) and found.frequency_hz.size <= 200
    exact = np.array([[truth(p, found.frequency_hz / 10) for p in row] for row in pairs])
    away = np.abs(found.response - exact.transpose(2, 0, 1))
    assert (away <= found.radius(confidence=0.95)).mean() > 0.93


def test_records_without_noise_are_followed_closely():
    """In 12 bits and in full: no warning, no error in the latter but what smoothing leaves."""
    rng = np.random.default_rng(2)
    u = rng.standard_normal((600, 1))
    y = lfilter(*LAG, u, axis=0)
    exact = truth(LAG, FREQUENCY)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        found = local_response(u, y, 1.0, frequency_hz=FREQUENCY)
        coarse = local_response(u, np.round(y * 1000) / 1000, 1.0, frequency_hz=FREQUENCY)
    assert (np.abs(found.response[:, 0, 0] - exact) < 1e-5 * np.abs(exact)).all()
    away = np.abs(coarse.response[:, 0, 0] - exact)
    assert (away <= coarse.radius(confidence=0.95)[:, 0, 0]).mean() > 0.93


def test_what_an_input_does_not_excite_is_not_told():
    t = np.arange(4000)
    u = np.cos(2 * np.pi * 0.1 * t)[:, None]
    y = lfilter(*LAG, u, axis=0) + 0.01 * np.random.default_rng(3).standard_normal((4000, 1))
    found = local_response(u, y, 1.0, frequency_hz=[0.02, 0.3])
    assert not np.isfinite(found.variance).any() and np.isfinite(found.response).all()


def test_units_of_the_signals_do_not_matter():
    u, y = record(LAG, noise, np.random.default_rng(4), 500, 30)
    one = local_response(u, y, 1.0, frequency_hz=FREQUENCY)
    other = local_response(1e6 * u, 1e-3 * y, 1e-3, frequency_hz=1e3 * FREQUENCY)
    np.testing.assert_allclose(other.response, 1e-9 * one.response, rtol=1e-6)
    np.testing.assert_allclose(other.variance, 1e-18 * one.variance, rtol=1e-6)


@pytest.mark.parametrize(
    ("frequency_hz", "samples", "words"),
    [
        ([0.2, 0.1], 500, "rising numbers"),
        ([0.1, 0.6], 500, "to 0.498 Hz"),
        ([1e-4], 500, "from 0.002"),
        ("low", 500, "rising numbers"),
        ([], 500, "rising numbers"),
        (None, 20, "25 samples or more"),
    ],
)
def test_bad_questions_are_refused(frequency_hz, samples, words):
    u, y = record(LAG, noise, np.random.default_rng(5), samples, 30)
    with pytest.raises(InputError, match=words):
        local_response(u, y, 1.0, frequency_hz=frequency_hz)


@pytest.mark.parametrize("samples", [25, 30, 41, 64, 101])
def test_short_records_have_regions(samples):
    u, y = record(([0.0, 0.5], [1.0, -0.5]), noise, np.random.default_rng(6), samples, 30)
    found = local_response(u, y, 1.0)
    assert np.isfinite(found.variance).all() and (found.variance > 0).all()


@pytest.mark.parametrize("estimate", [local_polynomial, local_rational, local_response])
def test_one_channel_may_be_given_without_a_second_axis(estimate):
    u = np.random.default_rng(3).standard_normal(300)
    y = lfilter([0.0, 0.5], [1.0, -0.7], u)
    more = (0.1,) if estimate is local_response else ()
    plain, columns = estimate(u, y, *more), estimate(u[:, None], y[:, None], *more)
    np.testing.assert_array_equal(plain.response, columns.response)
    np.testing.assert_array_equal(estimate(u[:, None], list(y), *more).response, columns.response)
