"""Parameter fits: known answers, coverage of the intervals, certificates, methods together."""

import casadi as ca
import numpy as np
import pytest
from scipy import stats

from workbench.errors import InputError, SolverError
from workbench.identification import (
    FittedParameter,
    IdentificationWarning,
    MeasuredRecord,
    MeasuredResponse,
    ParameterFit,
    fit_parameters,
    periodic_response,
)
from workbench.program import methods
from workbench.solution import solve
from workbench.solvers import Outcome

METHODS = ("ipopt", "scipy")
TRUTH = {"stiffness": 40.0, "damping": 0.5, "gain": 3.0}
START = {
    "stiffness": FittedParameter(20.0, lower=1.0, upper=1e3),
    "damping": FittedParameter(2.0, lower=1e-3, upper=100.0),
    "gain": FittedParameter(1.0, lower=0.0, upper=10.0),
}
FREQUENCY = np.linspace(0.2, 2.5, 60)


def oscillator(p, s):
    return p["gain"] / (s**2 + p["damping"] * s + p["stiffness"])


def delayed(p, s):
    return [[oscillator(p, s) * np.exp(-s * p["delay"]), p["gain"] / (s + 1)]]


def decay(p, x, u):
    """A saturating first-order recursion."""
    return [p["pole"] * x[0] + (1 - p["pole"]) * ca.tanh(p["gain"] * u[0])], [x[0]]


def exact(model, truth, frequency=FREQUENCY):
    datum = MeasuredResponse(model, frequency, np.zeros(len(frequency)))
    return datum.predicted(truth)


def noisy(rng, values, size):
    return values + size * (rng.normal(size=values.shape) + 1j * rng.normal(size=values.shape))


def response(seed=0, size=1e-3, **changes):
    """The oscillator measured with noise of a standard deviation of either part."""
    values = noisy(np.random.default_rng(seed), exact(oscillator, TRUTH), size)
    return MeasuredResponse(oscillator, FREQUENCY, values, **({"variance": 2 * size**2} | changes))


TINY = TRUTH | {"gain": 3e-9}


def tiny():
    """Metres per volt, variance unknown: residuals of 1e-12."""
    values = noisy(np.random.default_rng(3), exact(oscillator, TINY), 1e-12)
    return MeasuredResponse(oscillator, FREQUENCY, values)


def two_responses():
    truth = TRUTH | {"delay": 0.05}
    frequency = np.linspace(0.3, 3, 40)
    s = 2j * np.pi * frequency
    matrix = np.array(delayed(truth, s)).transpose(2, 0, 1)
    rng = np.random.default_rng(1)
    wide = MeasuredResponse(
        delayed, frequency, noisy(rng, matrix, 1e-3), variance=2e-6, name="matrix"
    )
    parameters = START | {"delay": FittedParameter(0.0, lower=0.0, upper=0.2)}
    return ParameterFit([response(), wide], parameters), truth


def record():
    truth = {"pole": 0.9, "gain": 2.0}
    rng = np.random.default_rng(2)
    u = rng.normal(size=300)
    clean = MeasuredRecord(decay, lambda p: [0.0], u, np.ones(300))
    y = clean.predicted(truth) + 0.01 * rng.normal(size=(1, 300))
    datum = MeasuredRecord(decay, lambda p: [0.0], u, y, variance=[1e-4])
    return ParameterFit(
        [datum],
        {"pole": FittedParameter(0.5, lower=0.0, upper=0.999), "gain": FittedParameter(1.0)},
    ), truth


PROBLEMS = {
    "one response": lambda: (ParameterFit([response()], START), TRUTH),
    "variance unknown": lambda: (ParameterFit([response(variance=None)], START), TRUTH),
    "several responses": two_responses,
    "a record": record,
    "tiny": lambda: (ParameterFit([tiny()], START | {"gain": FittedParameter(1e-9)}), TINY),
    "noise-free": lambda: (ParameterFit([response(size=1e-12)], START), TRUTH),
}


@pytest.mark.parametrize("name", PROBLEMS)
@pytest.mark.parametrize("method", METHODS)
def test_every_method_is_certified(name, method):
    program, truth = PROBLEMS[name]()
    solution = solve(program, method=method)
    assert solution.certificate.failures == ()
    assert solution.outcome is Outcome.SOLVED
    error = np.abs(solution.answer - list(truth.values()))
    assert (error < 1.7 * program.intervals(solution.answer)).all()
    metrics = program.metrics(solution.answer)
    assert metrics["gain"] == pytest.approx(truth["gain"], rel=0.02)
    assert program.notes(solution.answer) == [] or name == "noise-free"


def test_the_methods_are_all_tested():
    elsewhere = {"evolution"}  # test_parameter_evolution
    assert set(methods(ParameterFit)) == {*METHODS, *elsewhere}


@pytest.mark.parametrize("name", ["one response", "several responses", "a record"])
def test_the_methods_agree(name):
    program, _ = PROBLEMS[name]()
    answers = [solve(program, method=method).answer for method in METHODS]
    np.testing.assert_allclose(answers[0], answers[1], rtol=1e-6)


@pytest.mark.parametrize("name", ["several responses", "a record"])
def test_symbols_and_numbers_are_one_model(name):
    program, truth = PROBLEMS[name]()
    vector = ca.MX.sym("v", len(truth))
    parts = [one.expression(program.names, vector) for one in program.data]
    values = np.array(list(truth.values()))
    residuals = ca.Function("r", [vector], [ca.vertcat(*parts)])
    found, exact = residuals(values).full().ravel(), program.residuals(values)
    np.testing.assert_allclose(np.sort(found), np.sort(exact), atol=1e-9 * np.abs(exact).max())
    slopes = residuals.jacobian()(values, 0).full()
    numeric = program.jacobian(values)
    size = np.linalg.norm(numeric, axis=0)
    gram, exact = slopes.T @ slopes / np.outer(size, size), numeric.T @ numeric
    np.testing.assert_allclose(gram, exact / np.outer(size, size), atol=1e-7)


RUNS = 500


@pytest.mark.parametrize("periods", [6, 10, None])
@pytest.mark.slow
def test_the_intervals_cover_as_they_say(periods):
    """Weights known, or estimated from as many periods."""
    rng = np.random.default_rng(10)
    clean, truth = exact(oscillator, TRUTH), np.array(list(TRUTH.values()))
    size = 2e-3 * (1 + np.abs(clean))
    hits = {confidence: np.zeros(3, dtype=int) for confidence in (0.9, 0.99)}
    ratios = []
    for _ in range(RUNS):
        if periods is None:
            datum = MeasuredResponse(
                oscillator, FREQUENCY, noisy(rng, clean, size), variance=2 * size**2
            )
        else:
            y = noisy(rng, np.repeat(clean[:, None], periods, axis=1), size[:, None])
            estimate = periodic_response(FREQUENCY, np.ones(y.shape), y)
            datum = MeasuredResponse.of(oscillator, estimate)
        program = ParameterFit([datum], {name: FittedParameter(v) for name, v in TRUTH.items()})
        found = solve(program, method="scipy").answer
        for confidence, count in hits.items():
            count += np.abs(found - truth) <= program.intervals(found, confidence=confidence)
        ratios.append(program.chi_square(found))
    for confidence, count in hits.items():
        low, high = stats.binom.interval(1 - 1e-4, RUNS, confidence)
        assert ((count >= low) & (count <= high)).all()
    ratio, p = np.mean(ratios, axis=0)
    assert ratio == pytest.approx(1, abs=0.03)
    assert p == pytest.approx(0.5, abs=0.06)


@pytest.mark.slow
def test_intervals_cover_with_variance_unknown():
    rng = np.random.default_rng(11)
    frequency = FREQUENCY[::10]  # few data: Student's distribution matters
    clean, truth = exact(oscillator, TRUTH, frequency), np.array(list(TRUTH.values()))
    hits = np.zeros(3, dtype=int)
    for _ in range(RUNS):
        datum = MeasuredResponse(oscillator, frequency, noisy(rng, clean, 1e-4))
        program = ParameterFit([datum], {name: FittedParameter(v) for name, v in TRUTH.items()})
        found = solve(program, method="scipy").answer
        hits += np.abs(found - truth) <= program.intervals(found, confidence=0.9)
    low, high = stats.binom.interval(1 - 1e-4, RUNS, 0.9)
    assert ((hits >= low) & (hits <= high)).all()


@pytest.mark.parametrize("method", METHODS)
def test_an_active_bound_is_reported(method):
    low = START | {"damping": FittedParameter(2.0, lower=1.0, upper=100.0)}
    with pytest.warns(IdentificationWarning) as caught:
        fit = fit_parameters(response(), low, method=method)
    assert "damping lies on its lower bound 1" in str(caught[0].message)
    assert fit["damping"] == pytest.approx(1.0)
    assert np.isnan(fit.half_widths["damping"])
    assert np.isfinite(fit.half_widths["gain"])


def test_a_wrong_order_is_reported():
    """Two resonances close together, fitted by one."""
    s = 2j * np.pi * FREQUENCY
    values = oscillator(TRUTH, s) + 0.1 * oscillator(TRUTH | {"stiffness": 60.0}, s)
    datum = MeasuredResponse(
        oscillator, FREQUENCY, noisy(np.random.default_rng(0), values, 1e-3), variance=2e-6
    )
    with pytest.warns(IdentificationWarning, match="the model lacks something"):
        fit = fit_parameters(datum, START)
    assert fit.chi_square > 10


def heavy(p, s):
    return p["gain"] / (p["mass"] * s**2 + p["damping"] * s + p["stiffness"])


@pytest.mark.parametrize("method", METHODS)
def test_what_the_data_cannot_see_is_named(method):
    datum = MeasuredResponse(heavy, FREQUENCY, response().response, variance=2e-6)
    with pytest.raises(SolverError, match="stiffness, damping, gain and mass scale together"):
        fit_parameters(
            datum, START | {"mass": FittedParameter(0.7, lower=0.01, upper=10.0)}, method=method
        )


def test_what_the_noise_hides_is_named():
    datum = response(size=3.0)
    program = ParameterFit([datum], START)
    seen = program.identifiability(np.array(list(TRUTH.values())))
    assert seen.blind == ()
    assert any("damping" in text for text in seen.unseen)


@pytest.mark.slow
def test_several_starts_find_the_least_of_several_minima():
    def delay(p, s):
        return np.exp(-s * p["delay"])

    frequency = np.linspace(1, 5, 80)
    datum = MeasuredResponse(
        delay, frequency, exact(delay, {"delay": 1.3}, frequency), variance=1e-4
    )
    far = {"delay": FittedParameter(0.1, lower=0.05, upper=2.0)}
    for method in METHODS:
        stuck = solve(ParameterFit([datum], far), method=method)
        found = solve(ParameterFit([datum], far, starts=40), method=method)
        assert stuck.answer[0] != pytest.approx(1.3, rel=1e-3)
        assert found.answer[0] == pytest.approx(1.3, rel=1e-6)
        assert found.outcome is Outcome.SOLVED


@pytest.mark.parametrize(
    ("shift", "check"),
    [
        ([1.0, 0.0, 0.0], "stationary"),
        ([0.0, -0.6, 0.0], "bounds"),
        ([np.nan, 0.0, 0.0], "bounds"),
    ],
)
def test_wrong_answers_are_refused(shift, check):
    program = ParameterFit([response()], START)
    certificate = program.certify(solve(program).answer + shift, 1e-6)
    assert next(one.name for one in certificate.checks if not one.holds) == check


def test_answers_are_stored_and_drawn():
    for name, figures in (("several responses", {"response", "matrix"}), ("a record", {"record"})):
        program, _ = PROBLEMS[name]()
        answer = solve(program, method="scipy").answer
        data = program.to_dataset(answer)
        np.testing.assert_array_equal(program.from_dataset(data), answer)
        assert set(program.figures(answer)) == figures
        assert "| gain  " in program.tables(answer)["parameters"]


def test_bad_parameters_and_data():
    with pytest.raises(InputError, match="start between its bounds"):
        FittedParameter(2.0, lower=0.0, upper=1.0)
    with pytest.raises(InputError, match="both 1"):
        FittedParameter(1.0, lower=1.0, upper=1.0)
    short = MeasuredResponse(oscillator, [1.0], [1.0], variance=1.0)
    with pytest.raises(InputError, match="3 parameters are too many for 2 real data"):
        ParameterFit([short], START)
    with pytest.raises(InputError, match="different names"):
        ParameterFit([response(), response()], START)
    with pytest.raises(InputError, match="or of none"):
        ParameterFit([response(), response(variance=None, name="b")], START)
    with pytest.raises(InputError, match="finite"):
        ParameterFit([response()], {"gain": FittedParameter(1.0)}, starts=2)
    with pytest.raises(InputError, match="needs data"):
        ParameterFit([], START)
    with pytest.raises(InputError, match="3 values"):
        ParameterFit([response()], START).certify(np.ones(2), 1e-6)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"response": [1.0, np.nan]}, "not finite at 2 Hz"),
        ({"response": [1.0]}, "needs shape"),
        ({"frequency_hz": [1.0, np.inf]}, "NaN or infinite"),
        ({"variance": [1.0, 0.0]}, "positive"),
        ({"variance": [1.0]}, "needs shape"),
        ({"degrees": 4}, "four periods"),
    ],
)
def test_bad_responses(changes, message):
    good = {"frequency_hz": [1.0, 2.0], "response": [1.0, 1.0], "variance": 1.0}
    with pytest.raises(InputError, match=message):
        MeasuredResponse(oscillator, **(good | changes))


def test_a_model_of_the_wrong_shape_is_named():
    with pytest.raises(InputError, match="gives 2 entries, the data have 1"):
        MeasuredResponse(lambda p, s: [s, s], [1.0], [1.0]).predicted({})
    with pytest.raises(InputError, match="u has 3 samples, y has 2"):
        MeasuredRecord(decay, lambda p: [0.0], np.ones(3), np.ones(2))
