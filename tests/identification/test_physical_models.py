"""Models from physics among the candidates of a record."""

import control
import numpy as np
import pytest

import workbench as wb
from workbench.errors import InputError
from workbench.identification import FittedParameter, PhysicalModel, StateSpaceFit, as_experiments
from workbench.identification.state_space.candidates import compared_candidates

PERIOD = 0.05
TRUE = {"inertia": 0.5, "friction": 0.8, "stiffness": 9.0}


def spring(p):
    m, b, k = p["inertia"], p["friction"], p["stiffness"]
    return [[0, 1], [-k / m, -b / m]], [[0], [1 / m]], [[1, 0]], [[0]]


def model(**bounds):
    start = {"inertia": 1.0, "friction": 0.3, "stiffness": 5.0}
    return PhysicalModel(
        spring,
        {
            name: FittedParameter(value, **bounds.get(name, {"lower": 0.01}))
            for name, value in start.items()
        },
    )


def record(count=300, noise=0.0, seed=0, offset=0.0, late=0):
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], size=count // 5), 5)
    time = PERIOD * np.arange(count)
    acting = np.concatenate([np.full(late, u[0]), u[: count - late]])
    plant = control.sample_system(control.ss(*spring(TRUE)), PERIOD)
    y = control.forced_response(plant, time, acting).outputs
    return u, y + offset + noise * np.std(y) * rng.standard_normal(count)


@pytest.mark.parametrize("late", [0, 3])
def test_parameters_of_a_clean_record_are_the_true_ones(late):
    experiments = as_experiments(*record(offset=3.0, late=late), dt=PERIOD)
    found = model().estimated(experiments, delay_samples=(late,) if late else ())
    assert found == pytest.approx(TRUE, rel=1e-4)


def test_units_of_the_parameters_do_not_matter():
    scaled = PhysicalModel(
        lambda p: spring({name: value * 1e-9 for name, value in p.items()}),
        {name: FittedParameter(2e9 * value, lower=0.0) for name, value in TRUE.items()},
    )
    found = scaled.estimated(as_experiments(*record(), dt=PERIOD))
    assert found == pytest.approx({name: 1e9 * value for name, value in TRUE.items()}, rel=1e-4)


def test_a_bound_is_kept():
    found = model(stiffness={"lower": 1.0, "upper": 7.0}).estimated(
        as_experiments(*record(), dt=PERIOD)
    )
    assert found["stiffness"] == pytest.approx(7.0, rel=1e-6)


def test_a_transfer_function_and_a_sampled_model_are_taken():
    def transfer(p):
        return control.tf([1], [p["inertia"], p["friction"], p["stiffness"]])

    def sampled(p):
        return control.sample_system(control.ss(*spring(p)), PERIOD)

    experiments = as_experiments(*record(), dt=PERIOD)
    for made in (transfer, sampled):
        found = PhysicalModel(made, model().parameters).estimated(experiments)
        assert found == pytest.approx(TRUE, rel=1e-4)


def error_of(simulator):
    """Largest error of a response, relative to the largest response."""
    frequency = np.linspace(0.001, 0.3, 100)
    exact = control.sample_system(control.ss(*spring(TRUE)), PERIOD)(np.exp(2j * np.pi * frequency))
    return np.abs(simulator.response(frequency)[:, 0, 0] - exact).max() / np.abs(exact).max()


@pytest.mark.cases(0)
def test_of_short_noisy_records_physics_simulates_best():
    """Where all but the stiffness is known, the response errs far less than by other models."""
    known = PhysicalModel(
        lambda p: spring(TRUE | p), {"stiffness": FittedParameter(5.0, lower=0.01)}
    )
    errors = []
    for seed in range(4):
        u, y = record(count=150, noise=0.5, seed=seed)
        asked = {"dt": PERIOD, "orders": [1, 2, 3], "direct": False}
        solution = wb.solve(StateSpaceFit(u, y, **asked, physical={"spring": known}), method="best")
        assert solution.certificate.valid, solution.certificate
        assert any(label == "spring (physics) 2" for label in solution.answer.candidates.labels)
        assert solution.answer.simulator.dt == PERIOD
        plain = wb.solve(StateSpaceFit(u, y, **asked), method="best")
        errors.append([error_of(one.answer.simulator) for one in (solution, plain)])
    with_physics, without = np.mean(errors, axis=0)  # a median hangs on two of four records
    assert with_physics < 0.6 * without


def test_wrong_physics_is_not_chosen():
    u, y = record(noise=0.02)
    wrong = PhysicalModel(
        lambda p: control.tf([p["k"]], [p["tau"], 1]),
        {"k": FittedParameter(1.0), "tau": FittedParameter(1.0, lower=0.01)},
    )
    fit = StateSpaceFit(u, y, dt=PERIOD, orders=[2], physical={"lag": wrong})
    solution = wb.solve(fit, method="best")
    candidates = solution.answer.candidates
    assert "lag (physics) 1" in candidates.labels
    assert "lag (physics) 1" not in solution.message


def test_physics_that_gives_no_model_is_not_chosen():
    """Its pole is where the record allows none."""
    growing = PhysicalModel(
        lambda p: ([[p["a"]]], [[1.0]], [[1.0]], [[0.0]]),
        {"a": FittedParameter(2.0, lower=1.0, upper=3.0)},
    )
    fit = StateSpaceFit(*record(noise=0.02), dt=PERIOD, orders=[2], physical={"growing": growing})
    solution = wb.solve(fit, method="best")
    assert solution.certificate.valid
    assert solution.answer.candidates.fits[0].tolist().count(-np.inf) == 1
    assert "growing" not in solution.message


def test_what_physics_lost_is_told():
    found = compared_candidates(
        ["ARX 2", "spring (physics) 2"],
        np.stack(
            [np.full((1, 2, 10, 1), 1.0), 1.01 + 0.1 * np.cos(np.arange(20.0)).reshape(1, 2, 10, 1)]
        ),
        np.ones((1, 1)),
    )
    assert found.best(0) == found.best(1) == 1
    assert "spring (physics) 2; ARX 2 validates" in found.words(0, "predict")


def test_experiments_with_gaps_are_taken():
    records = [record(200, seed=k) for k in (1, 2)]
    records[0][1][50:60] = np.nan
    experiments = as_experiments([r[0] for r in records], [r[1] for r in records], dt=PERIOD)
    assert model().estimated(experiments) == pytest.approx(TRUE, rel=1e-4)


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"a": "spring"}, "must be a PhysicalModel, not str"),
        (
            {"a": PhysicalModel(lambda p: ([[-p["a"]]], [[1, 1]], [[1]], [[0, 0]]),
                                {"a": FittedParameter(1.0)})},
            "has 2 inputs and 1 outputs, the record has 1 and 1",
        ),
    ],
)  # fmt: skip
def test_what_does_not_fit_the_record_is_named(given, words):
    with pytest.raises(InputError, match=words):
        StateSpaceFit(*record(), dt=PERIOD, physical=given)


@pytest.mark.parametrize(
    ("made", "parameters", "words"),
    [
        (spring, {}, "without parameters"),
        (spring, {"inertia": 1.0}, "'inertia' must be a FittedParameter, not 1.0"),
        (lambda p: ([[1, 2]], [[1]], [[1]], [[0]]), {"a": FittedParameter(1.0)}, "model at"),
        (lambda p: "nothing", {"a": FittedParameter(1.0)}, "the physical model must be"),
    ],
)
def test_what_is_no_model_is_refused(made, parameters, words):
    with pytest.raises(InputError, match=words):
        PhysicalModel(made, parameters)
