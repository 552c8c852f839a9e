"""Polynomial models on records of known truth, and the choice among all kinds."""

import numpy as np
import pytest
from scipy.signal import lfilter

from workbench import solve
from workbench.errors import InputError
from workbench.identification import Experiments, StateSpaceFit, arx, impulse_response
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.polynomials.structures import polynomial_start
from workbench.identification.state_space.candidates import compared_candidates

F, G = np.array([1.0, -1.5, 0.7]), np.array([0.0, 1.0, 0.5])
FREQUENCY = np.linspace(0.01, 0.49, 30)


def record(kind, samples=3000, noise=0.3, seed=0):
    """A record of y = B/F u and the noise of a kind."""
    rng = np.random.default_rng(seed)
    u, e = rng.standard_normal(samples), noise * rng.standard_normal(samples)
    shaped = {
        "arx": ([1.0], F),
        "armax": ([1.0, 0.6, 0.2], F),
        "output-error": ([1.0], [1.0]),
        "box-jenkins": ([1.0, 0.5], [1.0, -0.9]),
    }[kind]
    y = lfilter(G, F, u) + lfilter(*shaped, e)
    return u[:, None], y[:, None]


def truth(frequency=FREQUENCY):
    z = np.exp(-2j * np.pi * frequency)
    return np.polyval(G[::-1], z) / np.polyval(F[::-1], z)


@pytest.mark.cases(2)
@pytest.mark.parametrize("kind", ["arx", "armax", "output-error", "box-jenkins"])
def test_each_kind_finds_its_own_truth(kind):
    program = StateSpaceFit(*record(kind), orders=(2,))
    solution = solve(program, method=kind)
    assert solution.certificate.holds, solution.certificate.failures
    found = solution.answer.simulator.response(FREQUENCY)[:, 0, 0]
    assert np.max(np.abs(found - truth()) / np.abs(truth()).max()) < 0.03
    # Nothing is left to predict: the errors are as large as the noise, and white.
    u, y = record(kind, seed=1)
    errors = (y - solution.answer.predictor.one_step(u, y, 50))[50:]
    assert errors.std() == pytest.approx(0.3, rel=0.04)


def test_arx_solves_the_normal_equations_of_its_own_regression():
    u, y = record("arx", 500)
    model = arx(Experiments(u, y), 3)
    rows = np.column_stack(
        [np.ones(497), *(-y[3 - k : 500 - k, 0] for k in (1, 2, 3)),
         *(u[3 - k : 500 - k, 0] for k in range(4))]
    )  # fmt: skip
    theta = np.linalg.lstsq(rows, y[3:, 0], rcond=None)[0]
    np.testing.assert_allclose(np.poly(model.A), [1.0, *theta[1:4]], rtol=1e-8, atol=1e-10)
    np.testing.assert_allclose(model.A[:, 0], model.K[:, 0] * model.C[0, 0], rtol=1e-12)
    predicted = model.one_step(u, y, 100)[100:, 0]
    np.testing.assert_allclose(predicted, (rows @ theta)[97:], atol=1e-8)


def test_arx_of_several_outputs_is_exact_without_noise():
    rng = np.random.default_rng(2)
    u, y = rng.standard_normal((400, 2)), np.zeros((400, 2))
    lag = np.array([[0.5, 0.2], [-0.3, 0.6]])
    for t in range(1, 400):
        y[t] = lag @ y[t - 1] + u[t - 1]
    model = arx(Experiments(u, y), 1)
    np.testing.assert_allclose(model.C @ model.A @ np.linalg.inv(model.C), lag, atol=1e-10)
    np.testing.assert_allclose(model.C @ model.B, np.eye(2), atol=1e-10)


def test_regularisation_helps_a_short_record():
    u, y = record("output-error", 250, noise=2.0)
    model = impulse_response(Experiments(u, y))
    count = model.order + 1
    shifted = [np.concatenate([np.zeros(k), u[: len(u) - k, 0]]) for k in range(count)]
    plain = np.linalg.lstsq(np.column_stack([*shifted, np.ones(len(u))]), y[:, 0], rcond=None)[0]
    true = lfilter(G, F, np.eye(1, count)[0])
    own = np.concatenate([[model.D[0, 0]], model.C[0]])
    assert np.linalg.norm(own - true) < 0.6 * np.linalg.norm(plain[:-1] - true)


def test_an_impulse_response_may_not_act_at_once_or_late():
    u, y = record("output-error", 600)
    assert not impulse_response(Experiments(u, y), direct=False).D.any()
    late = np.roll(u, -4, axis=0)[:590]
    model = impulse_response(Experiments(late, y[:590]), delay_samples=(4,))
    assert model.delay_samples == (4,)
    response = model.response(FREQUENCY)[:, 0, 0] * np.exp(8j * np.pi * FREQUENCY)
    assert np.abs(response - truth()).max() < 0.1 * np.abs(truth()).max()


@pytest.mark.parametrize("kind", ["armax", "output-error", "box-jenkins"])
def test_canonical_blocks_answer_as_the_model_they_start_from(kind):
    rng = np.random.default_rng(3)
    A = np.array([[0.5, 0.3, 0.0], [-0.3, 0.5, 0.1], [0.0, 0.0, 0.2]])
    B, C, K = (rng.standard_normal(shape) for shape in ((3, 2), (2, 3), (3, 2)))
    model = InnovationsModel(A, B, C, np.zeros((2, 2)), 0.1 * K, np.zeros(2), np.zeros(2))
    found, entries = polynomial_start(model, kind)
    np.testing.assert_allclose(
        found.response(FREQUENCY), model.response(FREQUENCY), rtol=1e-8, atol=1e-8
    )
    blocks = {"armax": 2, "output-error": 4, "box-jenkins": 6}[kind]
    assert found.order == 3 * blocks
    assert entries.sum() == {"armax": 6 + 12 + 6, "output-error": 24, "box-jenkins": 36}[kind] + 4
    assert found.K.any() == (kind != "output-error")


@pytest.mark.cases(0)
def test_the_best_kind_is_chosen_and_the_runner_up_is_named():
    program = StateSpaceFit(*record("box-jenkins", 2000), orders=(1, 2, 3))
    solution = solve(program, method="best")
    assert solution.certificate.holds, solution.certificate.failures
    plain = solve(program, method="output-error")
    own, other = (program.metrics(each.answer) for each in (solution, plain))
    assert own["fit_one_step_y1"] > other["fit_one_step_y1"] + 1
    assert own["fit_free_run_y1"] > other["fit_free_run_y1"] - 0.5
    facts = " ".join(solution.certificate.facts)
    assert "runner-up" in facts and "+-" in facts
    back = program.from_dataset(program.to_dataset(solution.answer))
    assert back.candidates.labels == solution.answer.candidates.labels
    assert program.metrics(back) == own
    assert "Box-Jenkins 2" in program.tables(solution.answer)["candidates"]


def test_a_difference_has_the_standard_error_of_its_blocks():
    rng = np.random.default_rng(4)
    scale = np.array([1.0, 1.02])
    lost, told = [], []
    for _ in range(300):
        errors = rng.chisquare(40, size=(2, 2, 2, 10, 1)) / 40 * scale[:, None, None, None, None]
        found = compared_candidates(("a 1", "b 1"), errors, np.full((2, 1), 4.0))
        lost.append(found.fits[0, 0] - found.fits[0, 1])
        told.append(found.deviation[0, 1 - found.best(0)])
    assert np.mean(lost) == pytest.approx(50 * (np.sqrt(1.02) - 1), abs=0.2)
    assert np.mean(told) == pytest.approx(np.std(lost), rel=0.15)


@pytest.mark.parametrize(
    ("order", "words"),
    [("2", "order is '2'; it must be a whole number"), (1.5, "order is 1.5"), (-1, "order is -1")],
)
def test_an_order_that_is_none_is_named(order, words):
    u = np.random.default_rng(0).standard_normal((200, 1))
    with pytest.raises(InputError, match=words):
        arx(Experiments(u, 0.5 * u), order)
    with pytest.raises(InputError, match="record must be a Experiments, not ndarray"):
        arx(u, 1)
