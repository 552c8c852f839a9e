"""Standard deviations of models of closed loops, beside the scatter from record to record."""

import control
import numpy as np
import pytest
from lanes import thinned
from test_periodic_loops import LINES, PERIOD, fit, plant

from workbench import solve
from workbench.errors import InputError
from workbench.identification import ClosedLoopFit, closed_loop_deviations

METHODS = ("two-stage", "direct", "instrumental-variables", "indirect")
AT = np.array([0.01, 0.05, 0.1, 0.2, 0.35])
GAIN = control.ss([], [], [], [[0.4]], 1.0)
BETWEEN = (0.7, 1.4)
"""Stated deviations over the scatter of 60 records, in the median over frequencies."""


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
    """Response of a method's model, and its stated deviation."""
    answer = solve(question, method).answer
    model = answer.predictor if method == "direct" else answer.simulator
    deviation = closed_loop_deviations(question, method, model, at)
    return model.response(at)[:, 0, 0], deviation[:, 0, 0]


def ratios(pairs):
    """Stated deviations over the scatter, at each frequency."""
    found, said = (np.array(part) for part in zip(*pairs, strict=True))
    return np.sqrt((said**2).mean(axis=0) / found.var(axis=0, ddof=1))


@pytest.mark.parametrize("method", thinned(METHODS, 2))
def test_errors_are_of_the_stated_size(method):
    pairs = [told(program(seed, method, 1000), method, AT) for seed in range(4)]
    share = [np.abs(found - exact(AT)) ** 2 / said**2 for found, said in pairs]
    assert 0.3 < np.mean(share) < 2.5


@pytest.mark.slow
@pytest.mark.parametrize("method", METHODS)
def test_sixty_records_scatter_as_each_says(method):
    """The noise is coloured; two-stage and indirect methods have no model of it."""
    pairs = [told(program(seed, method), method, AT) for seed in range(60)]
    assert BETWEEN[0] < np.median(ratios(pairs)) < BETWEEN[1]
    inside = np.mean([np.abs(found - exact(AT)) < 2 * said for found, said in pairs])
    assert inside > 0.9


@pytest.mark.slow
@pytest.mark.parametrize("method", sorted(set(METHODS) - {"direct"}))
def test_records_of_a_periodic_excitation_scatter_as_each_says(method):
    at = LINES / PERIOD
    pairs = [told(fit(0.05, seed), method, at) for seed in range(60)]
    assert BETWEEN[0] < np.median(ratios(pairs)) < BETWEEN[1]


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
    model = solve(question, "two-stage").answer.simulator
    with pytest.raises(InputError, match="method is 'output-error'; it must be one of direct"):
        closed_loop_deviations(question, "output-error", model, AT)
