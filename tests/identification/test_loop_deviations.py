"""Standard deviations of models of closed loops, beside the scatter from record to record."""

import control
import numpy as np
import pytest
import test_periodic_loops
from lanes import thinned
from scipy.signal import lfilter
from test_periodic_loops import LINES, PERIOD, fit, plant

from workbench import solve
from workbench.errors import InputError
from workbench.identification import (
    ClosedLoopFit,
    closed_loop_covariance,
    closed_loop_deviations,
)
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.innovations.uncertainty import response_slopes

METHODS = ("two-stage", "direct", "instrumental-variables", "indirect")
AT = np.array([0.01, 0.05, 0.1, 0.2, 0.35])
GAIN = control.ss([], [], [], [[0.4]], 1.0)
BETWEEN = (0.7, 1.4)
"""Stated deviations over the scatter of 60 records, in the median over frequencies."""
COVERED = (0.90, 0.98)
"""Share of records and frequencies at which a 95 % band of the magnitude holds the true one."""


def exact(frequency):
    z = np.exp(2j * np.pi * frequency)
    return 0.3 / (z - 1.2 + 0.5 / z)


def program(seed, method, samples=2000):
    """A second-order plant with slow coloured noise, in a loop driven by white noise."""
    r, e = np.random.default_rng(seed).standard_normal((2, samples))
    y, u, v, x = np.zeros(samples), np.zeros(samples), 0.0, np.zeros(2)
    for t in range(samples):
        v = 0.8 * v + 0.3 * e[t]
        y[t] = x[0] + v
        u[t] = r[t] - 0.4 * y[t]
        x = np.array([1.2 * x[0] - 0.5 * x[1] + 0.3 * u[t], x[0]])
    orders = (3,) if method == "direct" else (2,)
    return ClosedLoopFit(u, y, orders=orders, direct=False, excitation=r, controller=GAIN)


def told(question, method, at):
    """Response (F,) of a method's model, and its stated covariance (F, 2, 2)."""
    answer = solve(question, method=method).answer
    model = answer.predictor if method == "direct" else answer.simulator
    covariance = closed_loop_covariance(question, method, model, at)
    return model.response(at)[:, 0, 0], covariance[:, 0, 0]


def ratios(pairs):
    """Stated deviations over the scatter, at each frequency."""
    found, said = (np.array(part) for part in zip(*pairs, strict=True))
    power = np.trace(said, axis1=-2, axis2=-1).mean(axis=0)
    return np.sqrt(power / found.var(axis=0, ddof=1))


def covered(pairs, truth):
    """Share at which the magnitude is within 1.96 of its standard deviations of the true one."""
    found, said = (np.array(part) for part in zip(*pairs, strict=True))
    outward = np.stack([found.real, found.imag], axis=-1) / np.abs(found)[..., None]
    deviation = np.sqrt(np.einsum("nfa,nfab,nfb->nf", outward, said, outward))
    return np.mean(np.abs(np.abs(found) - np.abs(truth)) < 1.96 * deviation)


@pytest.mark.cases(0)
@pytest.mark.parametrize("method", thinned(METHODS, 2))
def test_errors_are_of_the_stated_size(method):
    pairs = [told(program(seed, method, 1000), method, AT) for seed in range(4)]
    share = [
        np.abs(found - exact(AT)) ** 2 / np.trace(said, axis1=1, axis2=2) for found, said in pairs
    ]
    assert 0.3 < np.mean(share) < 2.5


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_sixty_records_scatter_as_each_says(method):
    """The noise is coloured; two-stage and indirect methods have no model of it."""
    pairs = [told(program(seed, method), method, AT) for seed in range(60)]
    assert BETWEEN[0] < np.median(ratios(pairs)) < BETWEEN[1]
    assert COVERED[0] < covered(pairs, exact(AT)) < COVERED[1]


@pytest.mark.slow
@pytest.mark.parametrize("method", [one for one in METHODS if one != "direct"])
def test_records_of_a_periodic_excitation_scatter_as_each_says(method):
    at = LINES / PERIOD
    pairs = [told(fit(0.05, seed), method, at) for seed in range(60)]
    assert BETWEEN[0] < np.median(ratios(pairs)) < BETWEEN[1]
    assert COVERED[0] < covered(pairs, plant(at)) < COVERED[1]


@pytest.mark.slow
def test_direct_method_says_nothing_where_its_model_cannot_hold_the_noise():
    """Two states do not hold the noise, so the model is biased; bands would hold 87 %."""
    at = LINES / PERIOD
    said = [told(fit(0.05, seed), "direct", at)[1] for seed in range(20)]
    assert np.mean([np.isinf(np.trace(one, axis1=1, axis2=2)).all() for one in said]) >= 0.9


@pytest.mark.cases(0)
def test_a_mode_that_no_line_excites_does_not_swell_deviations(monkeypatch):
    """Its poles are poorly known; the response at the lines is not."""
    lines = LINES[LINES > 8]  # a period of the mode is 300 samples
    monkeypatch.setattr(test_periodic_loops, "LINES", lines)
    pairs = [told(fit(0.05, seed), "two-stage", lines / PERIOD) for seed in range(8)]
    assert 0.4 < np.median(ratios(pairs)) < 2.5


def test_certificates_tell_where_deviations_are():
    """Those of white prediction errors do not hold for every method."""
    facts = " ".join(solve(program(0, "two-stage", 300), method="two-stage").certificate.facts)
    assert "closed_loop_deviations" in facts and "+-" not in facts


@pytest.mark.parametrize("period", [None, 100])
def test_an_excitation_weaker_than_the_noise_tells_nothing(period):
    """The noise that is fed back by u = r - 2 y leans the model to -1/2; it said -0.48 +- 0.08."""
    rng, samples = np.random.default_rng([1, 9]), 3000
    steps = rng.choice([-1.0, 1.0], samples // 20).repeat(20)
    steps = steps if period is None else np.resize(steps[:period], samples)
    noise = lfilter([0.3], [1.0, -0.95], rng.standard_normal(samples))
    for size, told in ((0.1, False), (10.0, True)):
        r, u, y, x = size * steps, np.zeros(samples), np.zeros(samples), 0.0
        for t in range(samples):
            y[t] = x + noise[t]
            u[t] = r[t] - 2 * y[t]
            x = 0.8 * x + 0.2 * u[t]
        question = ClosedLoopFit(
            u, y, orders=(1,), direct=False, excitation=r, period_samples=period
        )
        for method in ("two-stage", "instrumental-variables"):
            model = solve(question, method=method).answer.simulator
            found = closed_loop_deviations(question, method, model, [0.02])
            assert np.isfinite(found).all() == told
            doubts = " ".join(question.doubts(model, method))
            assert ("which the controller fed back" in doubts) != told
        if told:
            truth = abs(0.2 / (np.exp(0.04j * np.pi) - 0.8))
            assert abs(abs(model.response([0.02])) - truth) < 4 * found < 0.2


def test_slopes_of_a_response_are_those_of_differences():
    rng = np.random.default_rng(0)
    shapes = {"A": (3, 3), "B": (3, 2), "C": (2, 3), "D": (2, 2)}
    parts = {name: 0.3 * rng.standard_normal(shape) for name, shape in shapes.items()}
    rest = {"K": np.zeros((3, 2)), "u_offset": np.zeros(2), "y_offset": np.zeros(2)}

    def response(moved):
        return InnovationsModel(**moved, **rest, delay_samples=(1, 0)).response(AT)

    step, column = 1e-6, 0
    slopes = response_slopes(InnovationsModel(**parts, **rest, delay_samples=(1, 0)), AT)
    for name, part in parts.items():
        for place in np.ndindex(part.shape):
            ahead, behind = (part.copy() for _ in range(2))
            ahead[place] += step
            behind[place] -= step
            change = response(parts | {name: ahead}) - response(parts | {name: behind})
            np.testing.assert_allclose(slopes[..., column], change / (2 * step), atol=1e-8)
            column += 1
    assert column == slopes.shape[-1]


@pytest.mark.cases(0)
def test_instruments_do_not_wait_for_the_filter_to_settle():
    """The filter's poles are those of the plant, which takes a period to settle."""
    at = LINES / PERIOD
    errors = {
        method: [
            np.sqrt(np.mean(np.abs(told(fit(0.05, seed), method, at)[0] / plant(at) - 1) ** 2))
            for seed in range(3)
        ]
        for method in ("instrumental-variables", "two-stage")
    }
    assert np.median(errors["instrumental-variables"]) < 1.5 * np.median(errors["two-stage"])


def test_another_method_is_refused():
    question = program(0, "two-stage", 300)
    model = solve(question, method="two-stage").answer.simulator
    with pytest.raises(InputError, match="method is 'output-error'; it must be one of direct"):
        closed_loop_deviations(question, "output-error", model, AT)
