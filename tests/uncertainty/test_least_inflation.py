"""The least inflation of an order: never above a known nominal, and sharp where it can be."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import minimize

import workbench as wb
from workbench.errors import InputError
from workbench.uncertainty import CircleCover, Responses, StadiumCover, cover_front, least_inflation
from workbench.uncertainty.covers.limits.least_inflation import LeastInflationChecker
from workbench.uncertainty.covers.sizes.inflation import extent

OMEGA = np.geomspace(0.03, 30, 40)
S = 1j * OMEGA[:, None]


def resonances(seed, count=6):
    """Plants of second order with random frequency, damping and gain, times a lag."""
    rng = np.random.default_rng(seed)
    gain, tone, damping, lag = 1 + 0.3 * rng.uniform(-1, 1, (4, count))
    values = gain / (S**2 / tone**2 + 0.3 * damping * S / tone + 1) / (S * lag / 8 + 1)
    return Responses(omega=OMEGA, values=values)


def reached(program, nominal):
    """Largest distance of a plant from a response (F,), over the narrowest extents."""
    away = np.abs(program.responses.values - nominal[:, None]).max(axis=1)
    return float((away / extent(program.raw_sets)).max())


@pytest.mark.parametrize("seed", range(8))
@pytest.mark.parametrize("kind", [CircleCover, StadiumCover])
def test_it_is_never_above_a_planted_nominal(kind, seed):
    """The plants lie about a nominal of the order; what that one reaches, no bound may exceed."""
    rng = np.random.default_rng(seed)
    order = int(rng.integers(1, 4))
    poles = rng.uniform(0.1, 10, order)
    nominal = 1 / np.prod(1 + S / poles, axis=1)
    away = rng.uniform(0.05, 0.4) * rng.normal(size=(40, 5, 2)) @ [1, 1j]
    program = kind(Responses(omega=OMEGA, values=nominal[:, None] * (1 + away)), order, zeros=0)
    bound = least_inflation(program)
    assert bound.holds
    assert bound.value <= reached(program, nominal)


@pytest.mark.parametrize("seed", range(3))
def test_no_cover_is_below_it(seed):
    program = CircleCover(resonances(seed), 2, zeros=1, complex_order=2)
    bound = least_inflation(program)
    for method in ("joint", "steps"):
        solution = wb.solve(program, method=method)
        assert program.inflation(solution.answer).free.max() >= bound.value


def test_it_is_sharp_for_a_constant_nominal():
    """With order 0 the nominal is a real number: a search in one variable knows the least ratio."""
    program = CircleCover(resonances(5), 0)
    least = min(
        minimize(lambda c: reached(program, np.full(40, c[0])), [start], method="Nelder-Mead").fun
        for start in (0.1, 0.5, 1.0, 2.0)
    )
    bound = least_inflation(program)
    assert bound.holds
    assert 0.9 * least <= bound.value <= least


def test_too_low_an_order_is_told():
    """Third-order lags: order 1 misses them by far, and the middle one is a nominal of order 3."""
    values = 1 / (S * [0.95, 1.0, 1.05] + 1) ** 3
    programs = [CircleCover(Responses(omega=OMEGA, values=values), order) for order in (1, 2, 3)]
    bounds = [least_inflation(program).value for program in programs]
    assert bounds[0] > 10 > bounds[1] > 2
    assert 0.95 < bounds[2] <= reached(programs[2], values[:, 1]) < 1.1


def test_units_of_frequency_and_response_do_not_matter():
    plants, values = resonances(1), []
    for time, gain in ((1.0, 1.0), (1e6, 1e-9), (1e-6, 1e9)):
        scaled = replace(plants, omega=plants.omega * time, values=plants.values * gain)
        values.append(least_inflation(CircleCover(scaled, 2)).value)
    assert values[1:] == pytest.approx(values[:1] * 2, rel=0.02)


@pytest.mark.parametrize("share", [1.01, 1.2, 10.0])
def test_a_larger_claim_fails(share):
    program = CircleCover(resonances(1), 1)
    bound = least_inflation(program)
    checker = LeastInflationChecker(program)
    wrong = replace(bound, value=share * bound.value)
    assert not all(check.holds for check in checker.checks(wrong, 1e-6))
    assert not all(check.holds for check in checker.second_opinion(wrong))


@pytest.mark.parametrize("change", ["order", "zeros", "negative", "moved", "shape", "nan"])
def test_an_answer_that_was_changed_fails(change):
    program = CircleCover(resonances(1), 1)
    bound, rng = least_inflation(program), np.random.default_rng(0)
    wrong = {
        "order": {"order": 0},
        "zeros": {"zeros": 0},
        "negative": {"weights": -bound.weights},
        "moved": {"weights": rng.permutation(bound.weights.ravel()).reshape(bound.weights.shape)},
        "shape": {"weights": bound.weights[:-1]},
        "nan": {"value": np.nan},
    }[change]
    bound = replace(bound, **wrong)
    assert not LeastInflationChecker(program).certify(bound, 1e-6).holds


def test_a_front_tells_it_and_refuses_a_bound_above_a_cover():
    front = cover_front(resonances(1), orders=[(1, 2, 0)], shape="circle")
    assert front.holds and "least" in repr(front)
    checker = front._checked_by[0]
    least = {1: replace(front.least[1], value=1.01 * front.points[0].inflation_free)}
    failed = {c.name for c in checker.checks(replace(front, least=least), 1e-6) if not c.holds}
    assert failed == {"1, 2, 0: above the bound", "least inflation"}


@pytest.mark.parametrize("apart", [0, 1])
def test_plants_that_are_equal_nearly_everywhere_have_no_bound(apart):
    values = np.repeat(1 / (S + 1), 3, axis=1)
    values[:apart] *= [0.9, 1.0, 1.1]
    bound = least_inflation(CircleCover(Responses(omega=OMEGA, values=values), 2))
    assert bound.value == 0.0 and bound.holds


def test_a_given_nominal_and_other_things_are_refused():
    import control

    program = CircleCover(resonances(1), 1, nominal=control.tf([1.0], [1.0, 1.0]))
    with pytest.raises(InputError, match="the nominal is given"):
        least_inflation(program)
    with pytest.raises(InputError, match="leave out none"):
        least_inflation(CircleCover(resonances(1), 1, leave_out=1))
    with pytest.raises(InputError, match="program"):
        least_inflation(resonances(1))
