"""Known poles and static gains: every method's models have them, and err less for it."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from scipy.signal import lfilter

from tests.lanes import thinned
from workbench import solve
from workbench.errors import InputError
from workbench.identification import ClosedLoopFit, StateSpaceFit
from workbench.identification.innovations.input_regression import (
    InputRegression,
    constrained_least_squares,
)
from workbench.identification.innovations.knowledge import Knowledge
from workbench.identification.innovations.model import InnovationsModel
from workbench.identification.innovations.scaling import Scaling
from workbench.identification.innovations.uncertainty import model_deviations
from workbench.identification.state_space.identified import MODELS
from workbench.program import methods

PAIR = np.roots([1, -1.6, 0.8])
PLANTS = {
    "integrator": ([0, 0.1, 0.05], [1, -1.7, 0.7], {"known_poles": [1.0]}),
    "slow": ([0, 0.1, 0.05], [1, -1.65, 0.665], {"static_gain": 10.0}),
    "resonant": ([0, 0.1, 0.05], [1, -1.6, 0.8], {"known_poles": PAIR}),
    "both": ([0, 0.1, 0.05], [1, -1.65, 0.665], {"static_gain": 10.0, "known_poles": [0.95]}),
    "two integrators": ([0, 0.01, 0.005], [1, -2.7, 2.4, -0.7], {"known_poles": [1.0, 1.0]}),
}
"""Numerator, denominator, and what is known, of plants with one input and one output."""
CHOOSING = ("best", "averaged")
SIMPLE = [name for name in methods(StateSpaceFit) if name not in CHOOSING]


def record(plant, seed=0, samples=400, noise=0.5):
    rng = np.random.default_rng(seed)
    u = rng.standard_normal(samples)
    y = lfilter(*PLANTS[plant][:2], u)
    return u, y + noise * rng.standard_normal(samples)


def two_channels(samples=500):
    """Integrators from each input to an output of its own, and a stable path across."""
    rng = np.random.default_rng(1)
    u = rng.standard_normal((samples, 2))
    first = lfilter([0, 0.1], [1, -1], u[:, 0])
    second = lfilter([0, 0.3], [1, -1], u[:, 1]) + lfilter([0, 1], [1, -0.5], u[:, 0])
    return u, np.column_stack([first, second]) + 0.3 * rng.standard_normal((samples, 2))


def assert_known(solution, poles=(), gain=None):
    """Both models have what is known, by their matrices."""
    assert solution.certificate is not None, solution.message
    failures = [each for each in solution.certificate.failures if "free run" not in each]
    assert not failures
    for name in MODELS:
        model = getattr(solution.answer, name)
        values = np.linalg.eigvals(model.A)
        rounding = 1e-6 if len(set(poles)) == len(poles) else 1e-4
        for pole in poles:
            place = np.argmin(np.abs(values - pole))
            assert abs(values[place] - pole) < rounding
            values = np.delete(values, place)
        if gain is not None:
            found = model.C @ np.linalg.solve(np.eye(model.order) - model.A, model.B) + model.D
            known = np.isfinite(gain)
            np.testing.assert_allclose(found[known], np.asarray(gain)[known], rtol=1e-8, atol=1e-8)


@pytest.mark.parametrize("plant", PLANTS)
@pytest.mark.parametrize("method", SIMPLE)
def test_every_method_keeps_what_is_known_or_says_why_not(plant, method):
    known = PLANTS[plant][2]
    program = StateSpaceFit(*record(plant, noise=0.1), orders=(3,), **known)
    reason = methods(program)[method].unfit(program)
    if reason:
        marginal = plant in ("integrator", "two integrators")
        assert method == "impulse-response" or (
            marginal and method in ("output-error", "box-jenkins")
        )
        with pytest.raises(InputError, match="cannot take this StateSpaceFit"):
            solve(program, method=method)
        return
    gain = known.get("static_gain")
    solution = solve(program, method=method)
    assert_known(solution, known.get("known_poles", ()), gain and np.array([[gain]]))


@pytest.mark.slow
@pytest.mark.parametrize("plant", ["integrator", "both"])
@pytest.mark.parametrize("method", CHOOSING)
def test_choices_and_averages_keep_what_is_known(plant, method):
    known = PLANTS[plant][2]
    gain = known.get("static_gain")
    solution = solve(StateSpaceFit(*record(plant), orders=(2, 3), **known), method=method)
    assert_known(solution, known.get("known_poles", ()), gain and np.array([[gain]]))


@pytest.mark.cases(0)
@pytest.mark.parametrize("method", ["subspace", "prediction-error", "arx", "cva"])
def test_integrators_of_several_outputs_and_gains_of_some_channels(method):
    u, y = two_channels()
    solution = solve(StateSpaceFit(u, y, orders=(3,), known_poles=[1, 1]), method=method)
    assert_known(solution, [1, 1])
    stable = y.copy()
    stable[:, 0] = lfilter([1, -1], [1, -0.9], y[:, 0])
    stable[:, 1] = lfilter([1, -1], [1, -0.8], y[:, 1])
    gain = np.array([[1.0, 0.0], [np.nan, 1.5]])
    assert_known(solve(StateSpaceFit(u, stable, static_gain=gain), method=method), (), gain)


@pytest.mark.cases(0)
def test_an_unstable_pole_of_a_closed_loop():
    rng = np.random.default_rng(0)
    r, e = rng.standard_normal((2, 600))
    x, u, y = 0.0, np.empty(600), np.empty(600)
    for t in range(600):
        y[t] = x + 0.1 * e[t]
        u[t] = r[t] - 0.8 * y[t]
        x = 1.1 * x + 0.5 * u[t]
    with pytest.raises(InputError, match='poles="any"'):
        StateSpaceFit(u, y, known_poles=[1.1], assume="open loop")
    loop = {"direct": False, "poles": "any", "orders": (1, 2), "known_poles": [1.1]}
    for method in ("subspace", "prediction-error", "arx", "armax"):
        assert_known(solve(StateSpaceFit(u, y, **loop, assume="open loop"), method=method), [1.1])
    program = ClosedLoopFit(u, y, excitation=r, **loop)
    assert_known(solve(program, method="direct"), [1.1])
    with pytest.raises(InputError, match="take method direct"):
        solve(program, method="two-stage")


@pytest.mark.cases(0)
def test_delays_gaps_experiments_and_units_far_apart():
    u, y = record("both")
    known = PLANTS["both"][2]
    late = np.concatenate([np.zeros(3), y[:-3]])
    assert_known(solve(StateSpaceFit(u, late, orders=(2,), delay_samples=3, **known)), [0.95])
    gaps = y.copy()
    gaps[[20, 21, 150, 333]] = np.nan
    for method in ("subspace", "prediction-error"):
        assert_known(solve(StateSpaceFit(u, gaps, orders=(2,), **known), method=method), [0.95])
    apart = [u[:200], u[200:]], [y[:200], y[200:]]
    assert_known(solve(StateSpaceFit(*apart, orders=(2,), **known)), [0.95])
    far = {"known_poles": [0.95], "static_gain": 1e13}
    solution = solve(StateSpaceFit(1e-6 * u, 1e6 * y, orders=(2,), **far))
    assert_known(solution, [0.95], np.array([[1e13]]))
    single = solve(StateSpaceFit(u.astype("f4"), y.astype("f4"), orders=(2,), **known))
    assert_known(single, [0.95], np.array([[10.0]]))


def test_without_noise_the_plant_is_found_again():
    u, y = record("both", noise=0.0)
    for method in ("subspace", "prediction-error", "arx"):
        solution = solve(StateSpaceFit(u, y, orders=(2,), **PLANTS["both"][2]), method=method)
        assert_known(solution, [0.95, 0.7], np.array([[10.0]]))


def test_what_is_given_has_no_deviation():
    u, y = record("both")
    program = StateSpaceFit(u, y, orders=(2,), **PLANTS["both"][2])
    solution = solve(program)
    found = model_deviations(
        solution.answer.predictor, program.estimation_record, True, program.known
    )
    given = np.argmin(np.abs(found.poles - 0.95))
    assert found.pole_deviations[given] < 1e-6
    assert found.pole_deviations[1 - given] > 1e-4
    assert found.gain_deviations[0, 0] < 1e-5
    facts = program.facts(solution.answer)
    assert "poles 0.95 are given, not estimated" in facts
    assert "1 static gains are given, not estimated" in facts


# --- what it is good for --------------------------------------------------------------------------

SEEDS = 50
LARGEST_RATIO = {"integrator": 0.7, "slow": 0.8, "resonant": 0.95}
"""Largest median of errors with the knowledge over those without, set before any was measured."""
FEWEST_BETTER = 0.6
"""Least share of records on which the knowledge helps, set before too."""


@cache
def _step_error(plant, method, seed, knowing):
    """Relative error of the step response over 100 samples; the noise is about as large as y."""
    numerator, denominator, known = PLANTS[plant]
    u, y = record(plant, seed, samples=150, noise=1.0)
    program = StateSpaceFit(u, y, orders=(2, 3), **(known if knowing else {}))
    solution = solve(program, method=method)
    assert solution.answer is not None, solution.message
    model = solution.answer.simulator
    step = np.ones((100, 1))
    run = replace(model, u_offset=np.zeros(1), y_offset=np.zeros(1), members=())
    x, found = np.zeros(run.order), []
    for u_now in step:
        found.append(float((run.C @ x + run.D @ u_now)[0]))
        x = run.A @ x + run.B @ u_now
    truth = lfilter(numerator, denominator, step[:, 0])
    return np.linalg.norm(np.array(found) - truth) / np.linalg.norm(truth)


@pytest.mark.slow
@pytest.mark.parametrize("method", ["subspace", "prediction-error"])
@pytest.mark.parametrize("plant", LARGEST_RATIO)
def test_knowledge_makes_models_of_short_noisy_records_better(plant, method):
    errors = np.array(
        [[_step_error(plant, method, seed, knows) for knows in (True, False)]
         for seed in range(SEEDS)]
    )  # fmt: skip
    medians = np.median(errors, axis=0)
    print(plant, method, medians, (errors[:, 0] < errors[:, 1]).mean())
    assert medians[0] <= LARGEST_RATIO[plant] * medians[1]
    assert (errors[:, 0] < errors[:, 1]).mean() >= FEWEST_BETTER


# --- certificate ----------------------------------------------------------------------------------


def test_wrong_answers_are_rejected():
    u, y = record("both")
    program = StateSpaceFit(u, y, orders=(2,), **PLANTS["both"][2])
    answer = solve(program, method="subspace").answer
    for name in MODELS:
        model = getattr(answer, name)
        moved = replace(model, A=model.A - 1e-4 * np.eye(2))
        louder = replace(model, B=1.0001 * model.B, D=1.0001 * model.D)
        for wrong, words in ((moved, "known poles"), (louder, "static gain")):
            checks = program.checks(replace(answer, **{name: wrong}), 1e-6)
            failed = [check.name for check in checks if not check.holds]
            assert f"{words}, {name}" in failed
        far = replace(model, A=model.A - 0.01 * np.eye(2))
        opinions = program.second_opinion(replace(answer, **{name: far}))
        failed = [check.name for check in opinions if not check.holds]
        assert {f"poles of the {name}", f"gain of the {name}"} <= set(failed)


def test_a_double_pole_is_not_a_single_one():
    single = StateSpaceFit(*record("integrator"), orders=(2,), known_poles=[1.0])
    answer = solve(single, method="subspace").answer
    double = StateSpaceFit(*record("integrator"), orders=(2,), known_poles=[1.0, 1.0])
    failed = [check.name for check in double.checks(answer, 1e-6) if not check.holds]
    assert "known poles, predictor" in failed
    failed = [check.name for check in double.second_opinion(answer) if not check.holds]
    assert "poles of the predictor" in failed


# --- bad input ------------------------------------------------------------------------------------

BAD = {
    "unpaired": ({"known_poles": [0.8 + 0.1j]}, "conjugate is not given"),
    "unpaired below": ({"known_poles": [0.8 - 0.1j, 0.8 + 0.2j]}, "conjugate is not given"),
    "nested": ({"known_poles": [[0.8]]}, "list of finite numbers"),
    "words": ({"known_poles": "integrator"}, "list of"),
    "infinite": ({"known_poles": [np.inf]}, "list of finite numbers"),
    "zero": ({"known_poles": [0.0]}, "delay_samples="),
    "too many": ({"known_poles": [0.8, 0.9], "orders": [1, 2]}, "order 1 is too low for 2 known"),
    "outside": ({"known_poles": [1.2]}, 'poles="any"'),
    "not stable": ({"known_poles": [1.0], "poles": "stable"}, 'poles="marginal"'),
    "shape": ({"static_gain": [[1.0, 2.0]]}, r"shape \(1, 2\); \(1, 1\) is needed"),
    "no number": ({"static_gain": "ten"}, "static_gain is 'ten'"),
    "infinite gain": ({"static_gain": np.inf}, "known_poles="),
    "nothing": ({"static_gain": np.nan}, "NaN throughout"),
    "integrator with gain": ({"static_gain": 1.0, "known_poles": [1.0]}, "give one of them"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_knowledge_is_refused(name):
    arguments, words = BAD[name]
    with pytest.raises(InputError, match=words):
        StateSpaceFit(*record("slow", samples=200), **arguments)


# --- the parts ------------------------------------------------------------------------------------


def test_a_basis_that_shows_poles_keeps_the_model():
    rng = np.random.default_rng(0)
    A = np.diag([0.5, 0.9, -0.3, 0.2]) + np.triu(rng.standard_normal((4, 4)), 1)
    A[:2, :2] = [[0.8, 0.4], [-0.4, 0.8]]
    turned = np.linalg.qr(rng.standard_normal((4, 4)))[0]
    model = InnovationsModel(
        turned @ A @ turned.T, rng.standard_normal((4, 1)), rng.standard_normal((1, 4)),
        np.zeros((1, 1)), np.zeros((4, 1)), np.zeros(1), np.zeros(1),
    )  # fmt: skip
    known = Knowledge((0.8 + 0.4j, 0.8 - 0.4j, 0.2 + 0j))
    found = known.exact(model)
    assert not found.A[3:, :3].any()
    grid = np.linspace(0.01, 0.49, 20)
    np.testing.assert_allclose(found.response(grid), model.response(grid), rtol=1e-8)
    free = known.free_entries(found)[:16].reshape(4, 4)
    changed = np.where(free, rng.standard_normal((4, 4)), found.A)
    for pole in known.poles:
        assert np.abs(np.linalg.eigvals(changed) - pole).min() < 1e-10
    assert Knowledge((0.1 + 0j,)).exact(model) is None


def test_slopes_of_gains_are_right():
    rng = np.random.default_rng(1)
    parts = [rng.standard_normal(shape) for shape in ((3, 3), (3, 2), (2, 3), (2, 2), (3, 2))]
    parts[0] *= 0.3

    def model(matrices):
        return InnovationsModel(*matrices, np.zeros(2), np.zeros(2))

    known = Knowledge((), np.array([[1.0, np.nan], [0.5, -2.0]]))
    start = known.gain_error(model(parts))
    place = 0
    for number, part in enumerate(parts):
        for index in np.ndindex(part.shape):
            moved = [each.copy() for each in parts]
            moved[number][index] += 1e-6
            slope = (known.gain_error(model(moved))[0] - start[0]) / 1e-6
            np.testing.assert_allclose(start[1][:, place], slope, atol=1e-4)
            place += 1


def test_regressions_of_inputs_find_a_plant_again_and_meet_constraints():
    rng = np.random.default_rng(2)
    A, C = np.array([[0.7, 0.2], [-0.2, 0.7]]), np.array([[1.0, 0.5]])
    B, D, level = rng.standard_normal((2, 3)), np.array([[0.3, 0.0, -0.2]]), np.array([2.0])
    pieces = []
    for samples in (700, 90):
        u, x = rng.standard_normal((samples, 3)), rng.standard_normal(2)
        y = np.empty((samples, 1))
        for t in range(samples):
            y[t] = C @ x + D @ u[t] + level
            x = A @ x + B @ u[t]
        y[5] = np.nan
        pieces.append((u, y))
    drive = InputRegression(A, C, (True, False, True))
    nothing = np.zeros((0, drive.columns)), np.zeros(0)
    theta = constrained_least_squares(*drive.factor(pieces), *nothing)
    for found, true in zip(drive.parts(theta), (B, D, level), strict=True):
        np.testing.assert_allclose(found, true, atol=1e-9)
    gain = drive.row(np.outer(np.linalg.solve(np.eye(2) - A.T, C[0]), [1, 0, 0]), D * [1, 0, 0])
    rows = np.array([gain, 2 * gain])  # one repeats the other
    theta = constrained_least_squares(*drive.factor(pieces), rows, np.array([5.0, 10.0]))
    assert gain @ theta == pytest.approx(5.0)


def test_units_of_what_is_known():
    program = StateSpaceFit(*record("slow"), static_gain=10.0)
    scaling = Scaling.of(program.estimation_record)
    unit = program.known.in_units(scaling.u_spread, scaling.y_spread)
    assert unit.gain[0, 0] == pytest.approx(10 * scaling.u_spread[0] / scaling.y_spread[0])


@pytest.mark.cases(1)
@pytest.mark.parametrize("seed", thinned(range(6), 2))
def test_refined_models_fit_no_worse_than_their_starts(seed):
    program = StateSpaceFit(*record("both", seed), orders=(2,), **PLANTS["both"][2])
    errors = [
        1 - solve(program, method=method).metrics["estimation_fit_one_step_y1"] / 100
        for method in ("subspace", "prediction-error")
    ]
    assert errors[1] <= errors[0] * 1.0001
