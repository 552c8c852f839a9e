"""Periodic excitation by local polynomials: transients off, variances right, distortion told."""

import tracemalloc

import numpy as np
import pytest
from scipy.signal import lfilter

from workbench.errors import InputError
from workbench.identification import (
    IdentificationWarning,
    PeriodicStream,
    best_linear_approximation,
    fit_rational_model,
    local_polynomial,
    odd_lines,
    periodic_local_polynomial,
    periodic_response,
)

PERIOD = 256
POLES = 0.97 * np.exp(1j * np.array([0.3, -0.3]))
DENOMINATOR = np.poly(POLES).real
LINES = np.arange(2, 100)


def multisine(lines, rng, inputs=1):
    """One period (PERIOD, inputs) of unit amplitudes and random phases."""
    spectrum = np.zeros((PERIOD // 2 + 1, inputs), complex)
    spectrum[lines] = np.exp(2j * np.pi * rng.random((len(lines), inputs)))
    return np.fft.irfft(spectrum, PERIOD, axis=0) * PERIOD / 2


def plant(frequency):
    z = np.exp(2j * np.pi * np.asarray(frequency))
    return (0.1 + 0.05 / z) / np.polyval(DENOMINATOR, z) * z**2


def answer(u):
    return lfilter([0.1, 0.05], DENOMINATOR, u, axis=0)


def record(periods, rng, noise=0.3, lines=LINES):
    u = np.tile(multisine(lines, rng), (periods, 1))
    return u, answer(u) + noise * lfilter([1.0], [1.0, -0.7], rng.normal(size=u.shape), axis=0)


def test_the_transient_is_taken_off():
    u, y = record(4, np.random.default_rng(0), noise=0.0)
    found = periodic_local_polynomial(u, y, PERIOD, lines=LINES)
    truth = plant(found.frequency_hz)
    error = np.abs(found.response[:, 0, 0] - truth) / np.abs(truth)
    spectra = [np.fft.rfft(x.reshape(4, PERIOD)).T[LINES] for x in (u, y)]
    plain = periodic_response(found.frequency_hz, *spectra).response[:, 0, 0]
    assert np.median(error) < 0.03 * np.median(np.abs(plain - truth) / np.abs(truth))
    assert found.transient.max() > 1e-4


@pytest.mark.parametrize("periods", [2, 3, 8])
def test_variance_is_the_spread_of_the_errors(periods):
    rng = np.random.default_rng(1)
    ratios = []
    for _ in range(40):
        found = periodic_local_polynomial(*record(periods, rng), PERIOD, lines=LINES)
        ratios.append(
            np.abs(found.response[:, 0, 0] - plant(found.frequency_hz)) ** 2
            / found.variance[:, 0, 0]
        )
    # The variance has eight to ten complex degrees of freedom, fewer at the ends of the spectrum.
    assert np.mean(ratios) == pytest.approx(1.13, rel=0.06)


def test_the_method_for_arbitrary_records_says_that_it_is_none():
    u, y = record(8, np.random.default_rng(2))
    with pytest.warns(IdentificationWarning, match="periodic_local_polynomial"):
        found = local_polynomial(u, y, at=LINES * 8)
    assert np.isnan(found.response).all() and np.isnan(found.variance).all()


def test_noise_of_the_input_counts():
    rng = np.random.default_rng(3)
    ratios = []
    for _ in range(40):
        u, y = record(4, rng, noise=0.0)
        shared = rng.normal(size=u.shape)
        found = periodic_local_polynomial(u + 0.3 * shared, y + 0.2 * shared, PERIOD, lines=LINES)
        ratios.append(
            np.abs(found.response[:, 0, 0] - plant(found.frequency_hz)) ** 2
            / found.variance[:, 0, 0]
        )
    assert np.mean(ratios) == pytest.approx(found.degrees / (found.degrees - 2), rel=0.08)


def test_two_inputs_in_two_experiments():
    rng = np.random.default_rng(4)
    whitened = []
    for _ in range(30):
        u = np.tile(multisine(LINES, rng, 4), (3, 1)).reshape(-1, 2, 2)
        clean = np.stack([answer(u[:, 0]) + 0.4 * u[:, 1], 0.2 * u[:, 0]], axis=1)
        noise = 0.3 * rng.normal(size=u.shape)
        noise[:, 1] += 0.7 * noise[:, 0]
        found = periodic_local_polynomial(u, clean + noise, PERIOD, lines=LINES)
        truth = np.zeros((LINES.size, 2, 2), complex)
        truth[:, 0, 0], truth[:, 0, 1], truth[:, 1, 0] = plant(found.frequency_hz), 0.4, 0.2
        error = (found.response - truth).reshape(-1, 4, 1)
        square = error.conj().swapaxes(1, 2) @ np.linalg.solve(found.covariance, error)
        whitened.append(square.real.ravel())
    m = found.degrees / 2
    assert np.mean(whitened) == pytest.approx(4 * m / (m - 2), rel=0.06)
    np.testing.assert_allclose(
        np.einsum("fii->fi", found.covariance).real.reshape(-1, 2, 2), found.variance
    )


def nonlinear(u):
    """A plant with an odd and a smaller even distortion in front."""
    return answer(u + 0.004 * u**3 + 0.003 * u**2)


def test_distortion_shows_at_silent_harmonics():
    rng = np.random.default_rng(5)
    lines = odd_lines(3, 99, 4, rng)[0]
    u = np.tile(multisine(lines, rng), (4, 1))
    noise = 0.05 * rng.normal(size=u.shape)
    clean = periodic_local_polynomial(u, answer(u) + noise, PERIOD, lines=lines)
    assert not clean.distortion[0].detected()
    assert np.median(clean.distorted_variance / clean.variance) < 3
    found = periodic_local_polynomial(u, nonlinear(u) + noise, PERIOD, lines=lines)
    assert found.distortion[0].odd_p < 1e-6 and found.distortion[0].even_p < 1e-6
    assert np.median(found.distorted_variance / found.variance) > 5
    dense = periodic_local_polynomial(*record(3, rng), PERIOD, lines=LINES)
    assert dense.distortion is None and np.isnan(dense.distorted_variance).all()


def test_the_best_linear_approximation_has_its_own_variance():
    rng = np.random.default_rng(6)
    lines = odd_lines(3, 99, 4, rng)[0]
    responses = []
    for _ in range(60):
        u = np.tile(multisine(lines, rng), (3, 1))
        y = nonlinear(u) + 0.05 * rng.normal(size=u.shape)
        responses.append(periodic_local_polynomial(u, y, PERIOD, lines=lines))
    truth = np.mean([each.response for each in responses], axis=0)
    ratios = []
    for start in range(0, 60, 6):
        some = best_linear_approximation(responses[start : start + 6])
        ratios.append(np.abs(some.response - truth) ** 2 / some.variance)
    # The mean over all sixty is not exact either: 6 of them are in each group of it.
    assert np.mean(ratios) == pytest.approx(10 / 8 * 0.9, rel=0.15)
    every = best_linear_approximation(responses)
    assert every.realisations == 60 and every.degrees == 118
    assert np.median(every.noise_variance / every.variance) < 0.2
    # One realisation tells the same distortion by its silent harmonics.
    one = np.mean([each.distorted_variance - each.variance for each in responses], axis=0)
    assert np.median(one / every.distortion_variance) == pytest.approx(1.0, abs=0.35)
    np.testing.assert_allclose(np.einsum("fii->fi", every.covariance).real, every.variance[:, :, 0])


def test_a_linear_plant_has_no_distortion_variance():
    rng = np.random.default_rng(7)
    responses = [periodic_local_polynomial(*record(3, rng), PERIOD, lines=LINES) for _ in range(20)]
    found = best_linear_approximation(responses)
    share = found.distortion_variance / (20 * found.noise_variance)
    assert abs(np.mean(share)) < 0.1 and (share < 0).any()


@pytest.mark.cases(0)
def test_a_rational_model_of_it():
    u, y = record(6, np.random.default_rng(8))
    found = periodic_local_polynomial(u, y, PERIOD, lines=LINES, dt=1 / 1000.0)
    model = fit_rational_model(found, orders=(1, 2, 3), dt=1e-3)
    assert model.model.order == 2 and model.tests.accepted
    np.testing.assert_allclose(
        np.sort_complex(model.model.poles), np.sort_complex(POLES), atol=0.01
    )


def test_pieces_make_the_whole():
    rng = np.random.default_rng(9)
    u, y = record(5, rng)
    whole = periodic_local_polynomial(u, y, PERIOD, lines=LINES)
    stream = PeriodicStream(PERIOD, 5, lines=LINES)
    ends = np.sort(rng.integers(0, len(u), 12))
    for a, b in zip([0, *ends], [*ends, len(u)], strict=True):
        stream.add(u[a:b], y[a:b])
    found = stream.response()
    for name in ("response", "covariance", "variance", "transient"):
        np.testing.assert_allclose(
            getattr(found, name), getattr(whole, name), rtol=1e-9, atol=1e-12
        )


def stream_of(samples, rng):
    """Response and most memory of a stream of so many samples."""
    period = 4000
    spectrum = np.zeros(period // 2 + 1, complex)
    spectrum[5:200] = np.exp(2j * np.pi * rng.random(195))
    wave = np.fft.irfft(spectrum)[:, None] * period / 2
    tracemalloc.start()
    stream = PeriodicStream(period, samples // period, lines=np.arange(5, 200))
    for _ in range(samples // period):
        stream.add(wave, 0.5 * wave + rng.normal(size=wave.shape))
    found = stream.response()
    most = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    return found, most


def test_memory_of_a_stream_does_not_grow():
    rng = np.random.default_rng(10)
    sizes = [stream_of(samples, rng)[1] for samples in (100_000, 400_000)]
    assert sizes[1] < 1.1 * sizes[0]


@pytest.mark.slow
def test_ten_million_samples():
    found, most = stream_of(10_000_000, np.random.default_rng(11))
    assert most < 1e7  # bytes; the record itself takes 1.6e8
    ratio = np.abs(found.response[:, 0, 0] - 0.5) ** 2 / found.variance[:, 0, 0]
    assert np.mean(ratio) == pytest.approx(found.degrees / (found.degrees - 2), rel=0.25)


U, Y = record(3, np.random.default_rng(12))


@pytest.mark.parametrize(
    ("record", "options", "words"),
    [
        ((U[:PERIOD], Y[:PERIOD], PERIOD), {}, "two periods"),
        ((U, Y[:-1], PERIOD), {}, "do not belong"),
        ((U[:, 0], Y, PERIOD), {}, "shape"),
        ((U, Y, 2.5), {}, "period"),
        ((U, Y, PERIOD), {"lines": [3, 2]}, "harmonics"),
        ((U, Y, PERIOD), {"lines": [1, 128]}, "harmonics"),
        ((U, Y, PERIOD), {"lines": LINES, "degree": -1}, "degree"),
        ((U, Y, PERIOD), {"lines": [2, 120]}, "do not excite harmonic 120"),
        ((np.hstack([U, U]), Y, PERIOD), {}, "as many experiments"),
        ((0 * U, Y, PERIOD), {}, "never changes"),
    ],
)
def test_bad_records_are_named(record, options, words):
    with pytest.raises(InputError, match=words):
        periodic_local_polynomial(*record, **options)


def test_a_stream_says_what_is_missing():
    stream = PeriodicStream(PERIOD, 3, lines=LINES)
    stream.add(U[:300], Y[:300])
    with pytest.raises(InputError, match="1 of 3 periods"):
        stream.response()
    with pytest.raises(InputError, match="missing"):
        stream.add(U, Y)
    with pytest.raises(InputError, match="experiment 2"):
        stream.add(U[:5], Y[:5], experiment=2)
    with pytest.raises(InputError, match=r"\(N, nu\)"):
        stream.add(U[:5], Y[:4])


def test_realisations_must_belong_together():
    one = periodic_local_polynomial(U, Y, PERIOD, lines=LINES)
    other = periodic_local_polynomial(U, Y, PERIOD, lines=LINES[:-1])
    with pytest.raises(InputError, match="two are needed"):
        best_linear_approximation([one])
    with pytest.raises(InputError, match="realisation 2"):
        best_linear_approximation([one, other])
