"""Checks of identified models, by models of which only what is checked is known."""

from types import SimpleNamespace

import numpy as np
import pytest

from workbench.fitting.rational import Rational
from workbench.identification import (
    CommonPoleModel,
    InnovationsModel,
    RationalModelFit,
    RationalModels,
    StateSpaceFit,
)
from workbench.identification.rational_models.optimality import fall_nearby, movement

RNG = np.random.default_rng(3)


# --- models of records --------------------------------------------------------------------------


def fit(poles="stable"):
    u, noise = RNG.standard_normal((300, 1)), RNG.standard_normal((300, 2))
    y = np.cumsum(0.1 * np.hstack([u, -u]), axis=0) * 0.9 ** np.arange(300)[:, None] + noise
    named = {} if poles == "stable" else {"poles": poles}
    return StateSpaceFit(u, y, estimation=200, orders=(1,), washout=5, **named)


def models(radius=0.9, predictor_radius=0.8):
    one = SimpleNamespace(radius=radius, predictor_radius=predictor_radius)
    return SimpleNamespace(predictor=one, simulator=one)


def failed(checks):
    return {check.name for check in checks if not check.holds}


@pytest.mark.parametrize(
    ("fits", "names"),
    [
        ([[90.0, 90.0], [80.0, 80.0]], set()),
        ([[90.0, -20.0], [80.0, 80.0]], {"one step"}),
        ([[90.0, 90.0], [-20.0, 80.0]], {"free run"}),
    ],
)
def test_every_output_is_no_worse_than_its_mean(monkeypatch, fits, names):
    program = fit()
    monkeypatch.setattr(StateSpaceFit, "_fits", lambda self, answer, part: np.array(fits))
    found = program.checks(models(), 1e-6)
    assert failed(found) == names
    values = {check.name: check.value for check in found}
    assert values["free run"] == pytest.approx(1 - min(fits[1]) / 100)


@pytest.mark.parametrize(
    ("radius", "predictor_radius", "count"), [(0.9, 0.8, 0), (1.1, 0.8, 2), (0.9, 1.0001, 2)]
)
def test_poles_of_models_and_of_their_predictors(radius, predictor_radius, count):
    found = fit()._radii(models(radius, predictor_radius))
    assert sum(not check.holds for check in found) == count and len(found) == 4


def test_errors_of_a_predictor_decay(monkeypatch):
    """A is stable, and A - K C is not, or is."""
    program, one, none = fit(), np.ones((1, 1)), np.zeros((1, 1))
    monkeypatch.setattr(StateSpaceFit, "_simulation_difference", lambda self, model, u, y: 0.0)
    for gain, holds in ((0.2, True), (-0.8, False)):
        C = np.array([[1.0], [0.0]])
        K = np.array([[gain, 0.0]])
        model = InnovationsModel(0.5 * one, one, C, np.zeros((2, 1)), K, none[0], np.zeros(2))
        answer = SimpleNamespace(predictor=model, simulator=model)
        found = {check.name: check.holds for check in program.second_opinion(answer)}
        assert found["predictor decays"] and found["simulator decays"]
        assert found["errors of the predictor decay"] is holds


# --- rational models ----------------------------------------------------------------------------

OMEGA = np.geomspace(0.1, 100.0, 40)
TRUTH = CommonPoleModel(
    [[Rational([], np.array([-1 + 3j, -1 - 3j]), 10.0)]], np.zeros((1, 1)), dt=None
)
VARIANCE = np.full((40, 1, 1), 1e-4)
DEVIATION = np.sqrt(1e-4 / 2)
"""Of the real and of the imaginary part."""


def rational(orders=(1, 2), response=None, **options):
    given = TRUTH.response(OMEGA) if response is None else response
    return RationalModelFit(OMEGA, given, VARIANCE, orders=orders, **options)


def scaled(model, factor):
    (entry,) = model.entries[0]
    return CommonPoleModel([[entry.scaled(factor)]], model.delay, dt=model.dt)


def test_the_optimum_does_not_move_and_others_do():
    program = rational()
    assert movement(program.structure, TRUTH) < 1e-6
    for factor in (0.9, 1.01):
        other = scaled(TRUTH, factor)
        apart = np.linalg.norm((other.response(OMEGA) - TRUTH.response(OMEGA)) / DEVIATION)
        assert movement(program.structure, other) == pytest.approx(apart, rel=1e-6)


def test_delays_turn_the_directions():
    """The gain of a delayed model is 1 % off: the step along it is the whole distance."""
    late = CommonPoleModel(TRUTH.entries, np.full((1, 1), 0.03), dt=None)
    program = rational((2,), late.response(OMEGA), delay=np.full((1, 1), 0.03))
    assert movement(program.structure, late) < 1e-6
    off = scaled(late, 1.01)
    apart = np.linalg.norm((off.response(OMEGA) - late.response(OMEGA)) / DEVIATION)
    assert movement(program.structure, off) == pytest.approx(apart, rel=1e-6)


def test_a_fall_nearby_is_found():
    program, other = rational(), scaled(TRUTH, 1.05)
    rng = np.random.default_rng(0)
    assert fall_nearby(program.residual, TRUTH, program.structure, rng) < 1e-6
    assert fall_nearby(program.residual, other, program.structure, rng) > 1e-3


def test_costs_fall_with_the_order():
    """Of the orders 1, 2 and 3 the last one is worse than the second."""
    lag = CommonPoleModel([[Rational([], np.array([-3.0 + 0j]), 3.0)]], np.zeros((1, 1)), dt=None)
    poles = np.array([-1 + 3j, -1 - 3j, -50.0 + 0j])
    third = CommonPoleModel([[Rational([], poles, 500.0 * 1.2)]], np.zeros((1, 1)), dt=None)
    program = rational((1, 2, 3))
    answer = RationalModels((lag, TRUTH, third), 2)
    found = {check.name: check for check in program.checks(answer, 1e-6)}
    assert not found["nested"].holds and found["nested"].where == "to order 3"
    assert not found["stationary"].holds and found["stationary"].where == "of order 1"


def test_a_model_of_another_structure_is_refused():
    program = rational((2,), delay_bounds=(0.0, 0.01), excess=1)
    entry = TRUTH.entries[0][0]

    def with_zeros(zeros, delay=0.0):
        one = Rational(np.array(zeros, complex), entry.poles, entry.gain)
        return CommonPoleModel([[one]], np.full((1, 1), delay), dt=None)

    assert program._misshapen(with_zeros([]), 2) == 0
    assert program._misshapen(with_zeros([-2.0]), 2) == 0
    assert program._misshapen(with_zeros([], 0.01), 2) == 0
    assert program._misshapen(with_zeros([-2.0, -3.0]), 2) == 1
    assert program._misshapen(with_zeros([], 0.02), 2) == 1
    assert program._misshapen(with_zeros([], -0.01), 2) == 1
    assert program._misshapen(with_zeros([]), 3) == 1


@pytest.mark.parametrize(("true", "held"), [(0.03, True), (0.01, False)])
def test_a_bound_holds_a_delay_that_would_go_beyond_it(true, held):
    """The model's delay is at the bound, 0.02; the data's is beyond it, or within. Without zeros,
    which would take its place."""
    at = {
        delay: CommonPoleModel(TRUTH.entries, np.full((1, 1), delay), dt=None)
        for delay in (true, 0.02)
    }
    data = at[true].response(OMEGA)
    bounded, free = (
        movement(rational((2,), data, excess=2, delay_bounds=(0.0, end)).structure, at[0.02])
        for end in (0.02, 0.1)
    )
    assert bounded < 0.9 * free if held else bounded == pytest.approx(free)
