"""Records of millions of samples: minutes, little memory, and the models of the whole record."""

import time
import tracemalloc

import numpy as np
import pytest
from scipy.signal import lfilter

from workbench import solve
from workbench.identification import StateSpaceFit
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations import prediction_error
from workbench.identification.innovations.criterion import Criterion
from workbench.identification.innovations.prediction_error import refine
from workbench.identification.innovations.scaling import Scaling
from workbench.identification.state_space import question
from workbench.identification.state_space.subspace import best_subspace_of

POLES = np.roots([1, -1.5, 0.7])
MEMORY = 1.5e9
"""Most bytes that a fit of a million samples may hold beside its record."""
PROCESSOR_TIME = 900.0
"""Most seconds of one processor for a million samples; some minutes are usual."""


def long_record(samples, noise=0.1, kind=float, units=(1.0, 1.0)):
    rng = np.random.default_rng(0)
    u = rng.standard_normal((samples, 1))
    e = rng.standard_normal(samples)
    y = lfilter([0, 0.5, 0.3], [1, -1.5, 0.7], u[:, 0]) + noise * lfilter([1, 0.5], [1, -0.8], e)
    return (units[0] * u).astype(kind), (units[1] * y[:, None]).astype(kind)


@pytest.fixture
def short_limits(monkeypatch):
    """A record of some thousand samples is long."""
    monkeypatch.setattr(prediction_error, "COARSE_SAMPLES", 400)
    monkeypatch.setattr(question, "MOST_VALIDATED", 1500)
    monkeypatch.setattr(question, "MOST_LINES", 100)


def criterion_of(model, record):
    scaling = Scaling.of(record)
    unit = Experiments(*scaling.scaled(record.u, record.y))
    value = Criterion(scaling.applied(model), unit, 1.0)
    return value(value.start(scaling.applied(model)))


def test_iterations_that_begin_on_a_part_end_where_those_on_the_whole_do(monkeypatch):
    record = Experiments(*long_record(4000))
    start = best_subspace_of(record.part(0, 300), 3)
    whole = criterion_of(refine(start, record, 1.0)[0], record)
    monkeypatch.setattr(prediction_error, "COARSE_SAMPLES", 400)
    parted = criterion_of(refine(start, record, 1.0)[0], record)
    assert parted < criterion_of(start, record) - 10
    assert abs(parted - whole) < 2 * prediction_error.MIN_LIKELIHOOD_GAIN


def test_a_model_of_many_states_is_refined_on_what_it_can_afford(monkeypatch):
    record = Experiments(*long_record(4000))
    start = best_subspace_of(record, 3)
    monkeypatch.setattr(prediction_error, "COARSE_SAMPLES", 400)
    monkeypatch.setattr(prediction_error, "MOST_PRODUCTS", 27 * 5 * 1000)
    found = refine(start, record, 1.0)[0]
    part = refine(start, record.part(0, 1000), 1.0)[0]
    np.testing.assert_allclose(found.A, part.A, rtol=1e-12)


def test_a_long_record_whose_input_moves_late_is_refined_and_divided_as_a_whole(short_limits):
    u, y = long_record(9000)
    u[:1600] = 0.0
    y[:, 0] = lfilter([0, 0.5, 0.3], [1, -1.5, 0.7], u[:, 0])
    y += 0.1 * np.random.default_rng(1).standard_normal(y.shape)
    program = StateSpaceFit(u, y, orders=(2,))
    assert sum(map(len, program.folds[0])) == len(program.estimation_record)
    solution = solve(program)
    assert solution.certificate.holds
    assert_poles(solution.answer, 0.02)


def test_folds_of_a_long_record_come_from_its_first_part(short_limits):
    program = StateSpaceFit(*long_record(9000), orders=(2,))
    assert [sum(map(len, fold)) for fold in program.folds] == [1500, 1500]
    assert len(program.nonparametric.cycles_per_sample) == 100
    assert program.nonparametric.cycles_per_sample[-1] > 0.499


@pytest.mark.cases(1)
@pytest.mark.parametrize("given", [{"noise": 0.0}, {"kind": "f4"}, {"units": (1e-6, 1e6)}], ids=str)
@pytest.mark.parametrize("method", ["subspace", "prediction-error"])
def test_long_records_without_noise_in_single_precision_and_of_far_units(
    short_limits, method, given
):
    solution = solve(StateSpaceFit(*long_record(6000, **given), orders=(2, 3)), method=method)
    assert solution.certificate.holds, solution.certificate.failures
    assert_poles(solution.answer, 1e-4 if given.get("noise") == 0.0 else 0.02)


def assert_poles(answer, atol):
    for model in (answer.predictor, answer.simulator):
        values = np.linalg.eigvals(model.A)
        for pole in POLES:
            assert np.abs(values - pole).min() < atol


@pytest.mark.slow
@pytest.mark.parametrize("method", ["subspace", "prediction-error"])
def test_a_million_samples_in_minutes(method):
    u, y = long_record(1_000_000, kind="f4")
    tracemalloc.start()
    begun = time.process_time()
    try:
        solution = solve(StateSpaceFit(u, y), method=method)
        peak = tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()
    assert solution.certificate.holds, solution.certificate.failures
    assert_poles(solution.answer, 2e-3)
    assert peak < MEMORY
    assert time.process_time() - begun < PROCESSOR_TIME
