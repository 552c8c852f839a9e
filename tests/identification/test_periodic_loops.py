"""Closed loops with a periodic excitation, sampled fast for the plant."""

import control
import numpy as np
import pytest

from workbench import solve
from workbench.errors import InputError
from workbench.identification import ClosedLoopFit, Experiments, arx, response_deviations
from workbench.identification.closed_loop.explained import mean_period, steady_response

PERIOD, PERIODS = 500, 24
LINES = np.unique(np.rint(np.geomspace(2, 100, 20)).astype(int))
POLES = (0.995 * np.exp(0.02j), 0.995 * np.exp(-0.02j))
"""Poles of the plant: a period of the mode is 300 samples."""
A, B, C = np.array([[2 * POLES[0].real, -(abs(POLES[0]) ** 2)], [1, 0]]), np.array([1.0, 0]), 1e-2
FORGETS = 0.8
CONTROLLER = control.ss([[FORGETS]], [[-0.54]], [[1.0]], [[3.0]], 1.0)


def plant(frequency):
    z = np.exp(2j * np.pi * frequency)
    return C / (z**2 - 2 * POLES[0].real * z + abs(POLES[0]) ** 2)


def loop(noise, seed=0, periods=PERIODS):
    """Settled r, u and y of the loop u = r - C y; y has coloured noise."""
    rng = np.random.default_rng(seed)
    phases = rng.uniform(0, 2 * np.pi, len(LINES))
    time = np.arange((periods + 4) * PERIOD) / PERIOD
    r = sum(np.cos(2 * np.pi * k * time + p) for k, p in zip(LINES, phases, strict=True))
    e = noise * rng.standard_normal(len(r))
    x, xc, v = np.zeros(2), 0.0, 0.0
    u, y = np.zeros(len(r)), np.zeros(len(r))
    for t in range(len(r)):
        v = 0.9 * v + e[t]
        y[t] = C * x[1] + v
        u[t] = r[t] - xc - 3.0 * y[t]
        xc = FORGETS * xc - 0.54 * y[t]
        x = A @ x + B * u[t]
    settled = slice(4 * PERIOD, None)
    return r[settled, None], u[settled, None], y[settled, None]


def fit(noise, seed=0, **changed):
    r, u, y = loop(noise, seed)
    common = {"direct": False, "orders": (2,), "excitation": r, "controller": CONTROLLER}
    return ClosedLoopFit(u, y, **(common | {"period_samples": PERIOD} | changed))


def error(model):
    at = LINES / PERIOD
    return float(np.sqrt(np.mean(np.abs(model.response(at)[:, 0, 0] / plant(at) - 1) ** 2)))


def test_the_loop_is_explained_line_by_line():
    quiet, noisy = (Experiments(u, y, excitation=r) for r, u, y in (loop(0.0), loop(0.05)))
    found = mean_period(noisy, PERIOD)
    exact = mean_period(quiet, PERIOD)
    np.testing.assert_allclose(exact.u, quiet.u, atol=1e-6)
    apart = [np.std(a - b) for a, b in ((noisy.u, exact.u), (found.u, exact.u))]
    assert apart[1] < 0.15 * apart[0]  # 20 lines of 250, and the mean of 24 periods


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", ["two-stage", "instrumental-variables", "indirect"])
def test_without_noise_the_plant_is_exact(name):
    solution = solve(fit(0.0), method=name)
    assert solution.certificate.valid, solution.certificate.failures
    assert error(solution.answer.simulator) < 1e-3


@pytest.mark.cases(0)
@pytest.mark.parametrize("name", ["direct", "two-stage", "instrumental-variables", "indirect"])
def test_each_method_finds_a_plant_that_is_sampled_fast(name):
    solution = solve(fit(0.05), method=name)
    assert solution.certificate.valid, solution.certificate.failures
    assert error(solution.answer.simulator) < 0.05


@pytest.mark.cases(0)
def test_orders_are_not_chosen_for_minus_one_over_the_controller():
    """The best run from u to y is that of a model which takes feedback for the plant."""
    program = fit(0.3)
    right = solve(program, method="two-stage").answer.simulator
    at, C = LINES / PERIOD, CONTROLLER
    wrong = arx(Experiments(program.record.u, program.record.y), 6, direct=True)
    size = np.abs(1 / C(np.exp(2j * np.pi * at), squeeze=False)[0, 0])
    assert np.median(np.abs(wrong.response(at)[:, 0, 0]) / size) == pytest.approx(1.0, abs=0.5)
    fits = program.fits_to_choose_by(right, program.judged_record)[1]
    assert fits > 60 > program.fits_to_choose_by(wrong, program.judged_record)[1]


def test_a_steady_response_is_that_of_lines():
    time = 2 * np.pi * 3 * np.arange(PERIOD)[:, None] / PERIOD
    made = steady_response(lambda f: plant(f)[:, None, None], np.cos(time))
    exact = (plant(3 / PERIOD) * np.exp(1j * time)).real
    np.testing.assert_allclose(made, exact, atol=1e-10)


def test_a_wrong_period_is_refused():
    with pytest.raises(InputError, match="differ by"):
        fit(0.0, period_samples=PERIOD - 1)
    with pytest.raises(InputError, match="must hold it twice"):
        fit(0.0, period_samples=PERIODS * PERIOD)
    with pytest.raises(InputError, match="integer of at least 1"):
        fit(0.0, period_samples=0.5)
    with pytest.raises(InputError, match="holds no period"):
        program = fit(0.0)
        program.explained_part(program.record.part(0, PERIOD - 1))


@pytest.mark.cases(0)
def test_deviations_of_a_response_are_those_of_many_records():
    """ARX models of records whose equation errors are white: 200 of them scatter as each says."""
    at, found, said = np.array([0.02, 0.1, 0.3]), [], []
    for seed in range(200):
        rng = np.random.default_rng(seed)
        u, e = rng.standard_normal((2, 400, 1))
        y = np.zeros((400, 1))
        for t in range(1, 400):
            y[t] = 0.8 * y[t - 1] + u[t - 1] + 0.5 * e[t]
        record = Experiments(u, y)
        model = arx(record, 1, direct=False)
        found.append(model.response(at)[:, 0, 0])
        if seed < 20:
            said.append(response_deviations(model, record, at, direct=False)[:, 0, 0])
    truth = 1 / (np.exp(2j * np.pi * at) - 0.8)
    scatter = np.sqrt(np.mean(np.abs(np.array(found) - truth) ** 2, axis=0))
    np.testing.assert_allclose(np.mean(said, axis=0), scatter, rtol=0.15)
