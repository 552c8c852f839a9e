"""State-space identification on simulated records whose truth is known."""

from dataclasses import replace

import numpy as np
import pytest

from workbench import Options, Outcome, solve
from workbench.errors import InputError
from workbench.executor import Context
from workbench.identification.experiments.several import Experiments
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.innovations.prediction_error import Criterion, refine
from workbench.identification.state_space.identified import IdentifiedModels
from workbench.identification.state_space.methods import identify
from workbench.identification.state_space.program import StateSpaceFit
from workbench.identification.state_space.subspace import best_subspace, subspace

TRUTH = InnovationsModel(
    A=np.array([[0.8, 0.4, 0.0], [-0.4, 0.8, 0.0], [0.0, 0.0, 0.5]]),
    B=np.array([[1.0, 0.0], [0.0, 1.0], [1.0, -1.0]]),
    C=np.array([[1.0, 0.0, 1.0], [0.0, 2.0, 0.0]]),
    D=np.array([[0.1, 0.0], [0.0, 0.0]]),
    K=np.array([[0.3, 0.0], [0.0, 0.2], [0.1, 0.0]]),
    u_offset=np.array([1.0, -2.0]),
    y_offset=np.array([5.0, 0.0]),
)
FREQUENCY = np.linspace(0.01, 0.49, 40)


def simulated(samples, noise=0.1, seed=0, units=(1.0, 1.0)):
    """A record of the truth, its inputs and outputs in other units."""
    rng = np.random.default_rng(seed)
    u, e = rng.normal(size=(2, samples, 2))
    x, y = np.zeros(3), np.empty((samples, 2))
    for t in range(samples):
        y[t] = TRUTH.C @ x + TRUTH.D @ u[t] + noise * e[t]
        x = TRUTH.A @ x + TRUTH.B @ u[t] + noise * TRUTH.K @ e[t]
    return (u + TRUTH.u_offset) * units[0], (y + TRUTH.y_offset) * units[1]


def distance(model):
    off = np.linalg.norm(model.response(FREQUENCY) - TRUTH.response(FREQUENCY), axis=(1, 2))
    return np.max(off / np.linalg.norm(TRUTH.response(FREQUENCY), axis=(1, 2)))


def test_subspace_without_noise_is_exact():
    model = subspace(*simulated(300, noise=1e-7), 3, 10)
    assert distance(model) < 1e-4
    np.testing.assert_allclose(
        np.sort_complex(np.linalg.eigvals(model.A)),
        np.sort_complex(np.linalg.eigvals(TRUTH.A)),
        atol=1e-4,
    )


def test_subspace_finds_the_noise_model_too():
    model = subspace(*simulated(5000), 3, 10)
    assert distance(model) < 0.03
    found, true = (np.linalg.eigvals(m.A - m.K @ m.C) for m in (model, TRUTH))
    np.testing.assert_allclose(np.sort(abs(found)), np.sort(abs(true)), atol=0.1)


def test_refinement_improves_the_start():
    u, y = simulated(800, noise=0.5)
    start = subspace(u, y, 3, 10)
    criterion = Criterion(start, Experiments(u, y), 0.1)
    model, iterations = refine(start, Experiments(u, y))
    assert iterations > 0
    assert criterion(criterion.start(model)) < criterion(criterion.start(start))
    assert distance(model) < distance(start)


@pytest.mark.parametrize("weight", [0.0, 0.7])
def test_gradient_is_exact(weight):
    u, y = simulated(60)
    criterion = Criterion(TRUTH, Experiments(u, y), weight)
    theta = criterion.start(TRUTH) + 0.01 * np.random.default_rng(1).normal(
        size=len(criterion.start(TRUTH))
    )
    value, gradient, hessian = criterion.expand(theta)
    assert value == pytest.approx(criterion(theta))
    step = 1e-6
    for i in range(len(theta)):
        move = step * np.eye(len(theta))[i]
        slope = (criterion(theta + move) - criterion(theta - move)) / (2 * step)
        assert slope == pytest.approx(gradient[i], rel=1e-4, abs=1e-3)
    assert np.linalg.eigvalsh(hessian).min() > -1e-6 * np.linalg.eigvalsh(hessian).max()


def test_units_do_not_matter():
    plain = refine(best_subspace(*simulated(300), 3), Experiments(*simulated(300)))[0]
    record = simulated(300, units=(1e3, 1e-6))
    other = refine(best_subspace(*record, 3), Experiments(*record))[0]
    np.testing.assert_allclose(
        other.response(FREQUENCY) * 1e9, plain.response(FREQUENCY), rtol=1e-3, atol=1e-4
    )


def test_predictions_from_an_unknown_initial_state():
    u, y = simulated(400, noise=0.0)
    for run in (TRUTH.one_step, TRUTH.free_run):
        np.testing.assert_allclose(run(u[100:], y[100:], 20), y[100:], atol=1e-8)


@pytest.fixture(scope="module")
def program():
    return StateSpaceFit(*simulated(700), estimation=400, orders=(1, 3), washout=20)


@pytest.mark.cases(1)
@pytest.mark.parametrize("method", ["subspace", "prediction-error"])
def test_program(program, method):
    solution = solve(program, method=method)
    assert solution.outcome is Outcome.SOLVED, solution.message
    metrics = program.metrics(solution.answer)
    assert metrics["order"] == metrics["order_free_run"] == 3
    assert metrics["fit_free_run_y2"] > 90
    assert metrics["fit_one_step_y1"] > metrics["fit_free_run_y1"]
    assert metrics["residual_autocorrelations_outside"] < 0.1
    assert set(program.figures(solution.answer)) == {
        "held-out", "response", "residuals", "validation",
    }  # fmt: skip
    back = program.from_dataset(program.to_dataset(solution.answer))
    assert program.metrics(back) == metrics
    assert " 3 | " in program.tables(solution.answer)["validation"]


def test_held_out_samples_are_not_used(program):
    spoilt = program.y.copy()
    spoilt[400:] *= -3
    other = StateSpaceFit(program.u, spoilt, estimation=400, orders=(1, 3), washout=20)
    np.testing.assert_array_equal(
        solve(other, method="subspace").answer.predictor.A,
        solve(program, method="subspace").answer.predictor.A,
    )


def sabotaged(spoilt, worse):
    """Subspace models of both orders, those of the spoilt order worse in the given use."""

    def way(order):
        def fit(record):
            model = best_subspace(record.u, record.y, 3)
            if order != spoilt:
                return model
            if worse == "free_run":  # a wrong D that the data correct in no way
                return replace(model, D=model.D + 0.3)
            return replace(model, K=0 * model.K)

        return fit

    return way


def test_each_use_chooses_its_own_order(program):
    predictors, simulators = sabotaged(3, "one_step"), sabotaged(1, "free_run")
    found = identify(program, predictors, simulators, Context(options=Options()))
    assert found.scores.shape == (2, 2, 2)
    np.testing.assert_array_equal(found.scores.mean(axis=-1).argmax(axis=-1), [0, 1])
    metrics = program.metrics(found)
    used = slice(400, None)
    u, y = program.u[used], program.y[used]
    rows = program.fits(found.predictor, found.simulator, u, y)
    np.testing.assert_array_equal(rows[0], program.fits(found.predictor, found.predictor, u, y)[0])
    np.testing.assert_array_equal(rows[1], program.fits(found.simulator, found.simulator, u, y)[1])
    assert metrics["fit_one_step_y1"] == rows[0, 0]
    assert metrics["fit_free_run_y2"] == rows[1, 1]


def test_models_of_different_orders_survive_the_dataset(program):
    u, y = program.u[:400], program.y[:400]
    answer = IdentifiedModels(best_subspace(u, y, 3), best_subspace(u, y, 4), np.zeros((2, 2, 2)))
    back = program.from_dataset(program.to_dataset(answer))
    metrics = program.metrics(back)
    assert (metrics["order"], metrics["order_free_run"]) == (3, 4)
    assert metrics == program.metrics(answer)
    assert program.figures(back)


def test_criteria_differ_by_use():
    u, y = simulated(400, noise=1.0)
    program = StateSpaceFit(u, y, estimation=300, orders=(3,), washout=20)
    answer = solve(program).answer
    start = best_subspace(u[:300], y[:300], 3)
    for model, weight in ((answer.predictor, 0.0), (answer.simulator, 1.0)):
        np.testing.assert_allclose(
            model.A, refine(start, Experiments(u[:300], y[:300]), weight)[0].A
        )


@pytest.mark.parametrize("name", ["predictor", "simulator"])
def test_an_unstable_model_is_found(program, name):
    answer = solve(program, method="subspace").answer
    model = getattr(answer, name)
    wild = replace(answer, **{name: replace(model, A=3 * model.A)})
    failed = {check.name for check in program.certify(wild, 1e-6).checks if not check.holds}
    assert f"stable {name}, A" in failed
    assert not {check for check in failed if check.startswith("stable") and name not in check}


def test_no_stable_model_is_a_failure(program):
    def none(order):
        return lambda record: None

    def some(order):
        return lambda record: best_subspace(record.u, record.y, order)

    for ways in ((none, none), (none, some), (some, none)):
        assert identify(program, *ways, Context(options=Options())) is None


def test_unstable_start():
    u, y = simulated(100)
    wild = InnovationsModel(
        2 * TRUTH.A, TRUTH.B, TRUTH.C, TRUTH.D, TRUTH.K, TRUTH.u_offset, TRUTH.y_offset
    )
    with pytest.raises(InputError, match="unstable"):
        refine(wild, Experiments(u, y))


U, Y = simulated(400)


def with_infinity():
    broken = Y.copy()
    broken[17, 1] = np.inf
    return broken


@pytest.mark.parametrize(
    ("u", "y", "orders", "message"),
    [
        (U, Y, (60,), r"order 60 does not fit.*choose lower orders"),
        (U, Y, (0, 2), r"order 0 does not fit"),
        (U, Y, (), "no orders"),
        (U, with_infinity(), (2,), r"y.*infinite.*channel 1, sample 17"),
        (np.column_stack([U[:, 0], 0 * U[:, 1]]), Y, (2,), r"u: channel 1 .u2. never changes"),
        (U[:-1], Y, (2,), r"399 samples.*400"),
        (U[None], Y, (2,), r"u has shape \(1, 400, 2\)"),
        (U[:70], Y[:70], (2,), "longer record"),
    ],
)
def test_bad_input(u, y, orders, message):
    with pytest.raises(InputError, match=message):
        StateSpaceFit(u, y, estimation=len(u) * 2 // 3, orders=orders, washout=20)


def test_order_too_high_for_one_past():
    with pytest.raises(InputError, match=r"order 50.*lower the order"):
        subspace(U, Y, 50, 10)
