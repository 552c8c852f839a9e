"""Least squares, instruments and output errors on the benchmark of Rao and Garnier.

G. P. Rao and H. Garnier, "Numerical illustrations of the relevance of direct continuous-time model
identification", IFAC World Congress, 2002: a pseudo-random binary input that is held for seven of
7161 samples, at 100 Hz, and white noise 10 dB below the output. No published estimates are needed:
the least variance of any unbiased estimate is computed from finite differences of SciPy's lsim.
"""

import numpy as np
import pytest
from scipy.signal import lfilter, lsim, max_len_seq

from workbench.errors import InputError, SolverError
from workbench.identification import (
    SampledRecord,
    TransferFunctionEstimate,
    filtered_least_squares,
    output_error,
    refined_instruments,
)
from workbench.identification.transfer_functions import regression
from workbench.identification.transfer_functions.filtered_record import FilteredRecord, solved
from workbench.identification.transfer_functions.filters import DerivativeFilter, mirrored

RATE = 100.0
NUMERATOR, DENOMINATOR = [-6400.0, 1600.0], [1.0, 5.0, 408.0, 416.0, 1600.0]
TRUTH = np.array(NUMERATOR + DENOMINATOR[1:])
FILTER = np.poly([-20.0] * 4)
RUNS = 12


def simulated(values, u):
    """Output of B / A of an input that is held between samples."""
    time = np.arange(len(u)) / RATE
    return lsim((values[:2], np.append(1.0, values[2:])), u, time, interp=False)[1]


@pytest.fixture(scope="module")
def benchmark():
    u = np.repeat(2.0 * max_len_seq(10)[0] - 1.0, 7)
    y = simulated(TRUTH, u)
    return u, y, np.sqrt(np.var(y) / 10)


@pytest.fixture(scope="module")
def runs(benchmark):
    """Estimates by method, of records with independent white noise."""
    u, y, size = benchmark
    rng = np.random.default_rng(1)
    found = {"least squares": [], "instruments": [], "output error": []}
    for _ in range(RUNS):
        record = SampledRecord(u, y + size * rng.standard_normal(len(y)), 1 / RATE)
        start = filtered_least_squares(record, (1, 4), FILTER)
        found["least squares"].append(start)
        found["instruments"].append(refined_instruments(record, start))
        found["output error"].append(output_error(record, start))
    return found


def bias(estimates):
    """Mean error of the coefficients over its own standard deviation."""
    values = np.array([one.values for one in estimates])
    deviation = values.std(axis=0, ddof=1) / np.sqrt(len(values))
    return (values.mean(axis=0) - TRUTH) / deviation


@pytest.mark.cases(0)
def test_least_squares_are_biased_and_instruments_are_not(runs):
    assert abs(bias(runs["least squares"])).max() > 20
    assert runs["least squares"][0].denominator[1] < 0.3 * DENOMINATOR[1]
    assert abs(bias(runs["instruments"])).max() < 4
    assert abs(bias(runs["output error"])).max() < 4


@pytest.mark.cases(0)
def test_the_covariance_is_the_least_one_of_unbiased_estimates(benchmark, runs):
    u, y, size = benchmark
    step = 1e-4 * np.diag(TRUTH)
    gradient = np.array([(simulated(TRUTH + one, u) - y) / one.sum() for one in step]).T
    bound = size * np.sqrt(np.diag(np.linalg.inv(gradient.T @ gradient)))
    for one in runs["instruments"] + runs["output error"]:
        np.testing.assert_allclose(one.deviations, bound, rtol=0.25)
    values = np.array([one.values for one in runs["instruments"]])
    scatter = values.std(axis=0, ddof=1) / bound
    assert scatter.min() > 0.5 and scatter.max() < 1.7


def test_both_consistent_methods_agree_in_white_noise(runs):
    for one, other in zip(runs["instruments"], runs["output error"], strict=True):
        assert abs((one.values - other.values) / one.deviations).max() < 1e-2
        assert one.noise == pytest.approx(other.noise, rel=1e-4)


def test_regions_hold_the_response(runs):
    frequency = np.array([0.1, 0.3, 1.0, 3.0])
    truth = np.polyval(NUMERATOR, 2j * np.pi * frequency) / np.polyval(
        DENOMINATOR, 2j * np.pi * frequency
    )
    distance = np.array([one.distance(frequency, truth) for one in runs["instruments"]])
    assert np.mean(distance < 1) > 0.9
    one = runs["instruments"][0]
    np.testing.assert_allclose(one.response(frequency), one.system()(2j * np.pi * frequency))
    parts = one.response_covariance(frequency)
    moved = TransferFunctionEstimate(
        one.numerator * 1.001, one.denominator, one.covariance, one.noise
    )
    change = moved.response(frequency) - one.response(frequency)
    np.testing.assert_allclose(change, 1e-3 * one.response(frequency))
    assert np.all(np.linalg.eigvalsh(parts) > 0)


@pytest.mark.cases(0)
def test_coloured_noise_needs_no_model(benchmark):
    """The intervals follow the noise's spectrum: slow noise is told from white noise."""
    u, y, size = benchmark
    rng = np.random.default_rng(2)
    errors = []
    for _ in range(RUNS):
        noise = lfilter([np.sqrt(1 - 0.95**2)], [1, -0.95], rng.standard_normal(len(y)))
        record = SampledRecord(u, y + 0.3 * size * noise, 1 / RATE)
        one = refined_instruments(record, filtered_least_squares(record, (1, 4), FILTER))
        errors.append((one.values - TRUTH) / one.deviations)
    rms = np.sqrt(np.mean(np.square(errors), axis=0))
    assert rms.min() > 0.5 and rms.max() < 1.7


def test_without_noise_all_methods_are_exact_for_a_held_input(benchmark):
    u, y, _ = benchmark
    record = SampledRecord(u, y, 1 / RATE)
    start = filtered_least_squares(record, (1, 4), DENOMINATOR)
    for one in (start, refined_instruments(record, start), output_error(record, start)):
        np.testing.assert_allclose(one.values, TRUTH, rtol=1e-9)


@pytest.mark.cases(0)
def test_feedback_needs_instruments_from_outside():
    """An unstable first-order plant in a loop: the excitation, not the input, is free of noise."""
    rng = np.random.default_rng(3)
    samples, rate = 40_000, 100.0
    a, b = np.exp(0.01), np.expm1(0.01)  # of 1 / (s - 1)
    r = np.repeat(rng.choice([-1.0, 1.0], samples // 50), 50)
    noise = 0.3 * lfilter([np.sqrt(1 - 0.95**2)], [1, -0.95], rng.standard_normal(samples))
    u, y, x = np.empty(samples), np.empty(samples), 0.0
    for k in range(samples):
        y[k] = x + noise[k]
        u[k] = r[k] - 3.0 * y[k]
        x = a * x + b * u[k]
    # What a wrong model of the loop, with a plant 1 / s, makes of the excitation is enough.
    clean = lsim(([1.0, 0.0], [1.0, 3.0]), r, np.arange(samples) / rate, interp=False)[1]
    auxiliary = np.array([1.0, 3.0])
    found = {}
    for name, free in (("input", None), ("excitation", clean)):
        record = SampledRecord(u, y, 1 / rate, noise_free_input=free)
        model = FilteredRecord.of(record, (0, 1), [1.0, 3.0])
        z, _ = model.instruments(auxiliary, record.clean_input)
        phi, target = model.regressors()
        found[name] = model.units * solved(z.T @ phi, z.T @ target)
    truth = np.array([1.0, -1.0])
    assert abs(found["excitation"] - truth).max() < 0.5
    assert abs(found["input"] - truth).max() > 2.0


def test_derivatives_are_exact_for_straight_lines():
    time = np.arange(200) / RATE
    signal = np.interp(time, [0.0, 0.5, 1.2, 2.0], [0.0, 1.0, -2.0, 0.5])
    filter_ = DerivativeFilter(np.poly([-3.0, -7.0]), 1 / RATE)
    found = filter_.derivatives(signal, "first-order") * filter_.rate ** np.array([-2, -1, 0])
    for power in range(2):
        numerator = np.zeros(2)
        numerator[1 - power] = 1.0
        expected = lsim((np.trim_zeros(numerator, "f"), filter_.denominator), signal, time)[1]
        np.testing.assert_allclose(found[:, power], expected, atol=1e-12)


def test_unstable_roots_are_mirrored():
    np.testing.assert_allclose(mirrored(np.poly([-1.0, 2.0])), np.poly([-1.0, -2.0]))
    np.testing.assert_allclose(mirrored(np.poly([1 + 2j, 1 - 2j])), [1.0, 2.0, 5.0])


def test_bad_records_and_models():
    u, y = np.random.default_rng(0).standard_normal((2, 100))
    record = SampledRecord(u, y, 1 / RATE)
    with pytest.raises(InputError, match="dt is 0"):
        SampledRecord(u, y, 0)
    with pytest.raises(InputError, match="hold"):
        SampledRecord(u, y, 1 / RATE, hold="linear")
    with pytest.raises(InputError, match="as many samples"):
        SampledRecord(u[1:], y, 1 / RATE)
    with pytest.raises(InputError, match="never changes"):
        SampledRecord(np.ones(100), y, 1 / RATE)
    with pytest.raises(InputError, match="NaN"):
        SampledRecord(u, np.where(np.arange(100) == 5, np.nan, y), 1 / RATE)
    with pytest.raises(InputError, match="degrees"):
        filtered_least_squares(record, (3, 2), [1, 1, 1])
    with pytest.raises(InputError, match="monic"):
        filtered_least_squares(record, (1, 2), [1, 1])
    with pytest.raises(InputError, match="root"):
        filtered_least_squares(record, (0, 1), [1, -1])
    with pytest.raises(InputError, match="cannot tell"):
        filtered_least_squares(SampledRecord(u[:4], y[:4], 1 / RATE), (1, 2), [1, 2, 1])


def test_one_sine_does_not_tell_four_coefficients():
    time = np.arange(2000) / RATE
    u = np.where(time < 10.0, 0.0, np.sin(2 * np.pi * time))
    quiet = SampledRecord(u, 2.0 * u, 1 / RATE)
    with pytest.raises(InputError, match="does not tell"):
        filtered_least_squares(quiet, (1, 2), [1.0, 2.0, 1.0])


def test_iterations_that_do_not_settle_are_an_error(benchmark, monkeypatch):
    u, y, size = benchmark
    noisy = y + size * np.random.default_rng(4).standard_normal(len(y))
    record = SampledRecord(u, noisy, 1 / RATE)
    start = filtered_least_squares(record, (1, 4), FILTER)
    monkeypatch.setattr(regression, "MOST_ITERATIONS", 2)
    with pytest.raises(SolverError, match="do not settle"):
        refined_instruments(record, start)
    with pytest.raises(SolverError, match="still falls"):
        output_error(record, start)


def test_a_record_or_a_start_of_another_kind_is_named():
    u = np.sign(np.sin(np.arange(300) ** 1.3))
    record = SampledRecord(u, 0.5 * u, dt=0.01)
    for call in (refined_instruments, output_error):
        with pytest.raises(InputError, match="start must be a TransferFunctionEstimate, not int"):
            call(record, 2)
    with pytest.raises(InputError, match="record must be a SampledRecord, not ndarray"):
        filtered_least_squares(u, (0, 1), [1.0, 2.0])
    for degrees, words in (
        (2, "degrees must be a list"),
        ((1, 2, 3), "give two"),
        ((0, 1.5), "1.5"),
    ):
        with pytest.raises(InputError, match=words):
            filtered_least_squares(record, degrees, [1.0, 2.0])
