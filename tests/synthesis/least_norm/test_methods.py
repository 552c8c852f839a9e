"""Methods for the least norm of an order, against a gain whose least norm is known."""

import control
import numpy as np
import pytest

import workbench as wb
from workbench import Options
from workbench.executor import Context
from workbench.synthesis import PI, HinfSynthesis, MuSynthesis
from workbench.synthesis.families.demands import Shippable
from workbench.synthesis.families.free import FreeMatrices
from workbench.synthesis.mu.structured.least_norm import without_perturbation
from workbench.synthesis.mu.structured.norm import descents
from workbench.synthesis.mu.structured.norm.drawn import stable_draws
from workbench.synthesis.mu.structured.norm.ends import FURTHER, descended_further
from workbench.synthesis.mu.structured.norm.loop_norm import LoopNorm
from workbench.synthesis.mu.structured.norm.search import NormPoint, NormSearch
from workbench.systems.standard_plant import standard_plant
from workbench.uncertainty import GeneralisedPlant

METHODS = ("fixed", "bfgs", "smoothed", "evolution", "trust_region")


def first_order(dt=0.0):
    """x' = x + w1 + u, z = (x, u), y = x + w2: the least norm is that of a gain, 1 + sqrt(3)."""
    A, B = [[1.0]], [[1.0, 0, 1]]
    C, D = [[1.0], [0], [1]], [[0, 0, 0], [0, 0, 1], [0, 1, 0]]
    return GeneralisedPlant(control.ss(A, B, C, D, dt), None, 1, 1)


def flexible():
    """Two masses and a spring, force on the first and position of the second."""
    A = [[0, 0, 1, 0], [0, 0, 0, 1], [-1, 1, -0.05, 0.05], [1, -1, 0.05, -0.05]]
    B = np.array([[0.0, 0, 0], [0, 0, 0], [0, 0, 1], [1, 0, 0]])
    C = np.array([[0.0, 1, 0, 0], [0, 0, 0, 0], [0, 1, 0, 0]])
    D = np.array([[0.0, 0, 0], [0, 0, 1], [0, 1, 0]])
    return GeneralisedPlant(control.ss(A, B, C, D), None, 1, 1)


@pytest.mark.cases(1)
@pytest.mark.parametrize("method", METHODS)
def test_every_method_finds_the_best_gain(method):
    solution = wb.solve(
        HinfSynthesis(first_order(), order=0), method=method, options=Options(seed=0)
    )
    assert solution.certificate.holds
    assert solution.answer.norm == pytest.approx(1 + np.sqrt(3), rel=2e-3)
    assert solution.answer.least <= solution.answer.norm


def test_the_answer_tells_what_starts_reached_and_the_slope_that_remains():
    solution = wb.solve(
        HinfSynthesis(first_order(), order=0), method="bfgs", options=Options(seed=0)
    )
    answer = solution.answer
    assert len(answer.reached) > 3
    assert list(answer.reached) == sorted(answer.reached)
    assert answer.norm <= answer.reached[0] * (1 + 1e-3)
    assert answer.slope < 0.01
    assert any("stationary" in fact for fact in solution.certificate.facts)
    back = HinfSynthesis(first_order(), order=0)
    again = back.from_dataset(back.to_dataset(answer))
    assert (again.reached, again.slope) == (answer.reached, answer.slope)


@pytest.mark.cases(0)
def test_a_family_and_a_sampled_plant():
    solution = wb.solve(
        HinfSynthesis(first_order(), family=PI()), method="bfgs", options=Options(seed=0)
    )
    assert solution.certificate.holds
    sampled = first_order()
    A, B = [[1.02]], [[0.02, 0, 0.02]]
    system = control.ss(A, B, sampled.system.C, sampled.system.D, 0.02)
    plant = GeneralisedPlant(system, None, 1, 1)
    solution = wb.solve(HinfSynthesis(plant, order=0), method="fixed", options=Options(seed=0))
    assert solution.certificate.holds
    assert solution.answer.norm == pytest.approx(1 + np.sqrt(3), rel=0.05)


def test_a_level_that_is_asked_for_ends_the_search():
    solution = wb.solve(
        HinfSynthesis(first_order(), gamma=3.5, order=0), method="fixed", options=Options(seed=0)
    )
    assert solution.certificate.holds
    assert solution.answer.norm <= 3.5


@pytest.mark.parametrize("order", [0, 2])
def test_slopes_are_those_of_differences(order):
    plant = standard_plant(flexible())
    family = FreeMatrices(order, 1, 1)
    norm = LoopNorm(plant, family, Shippable())
    rng = np.random.default_rng(5)
    if order == 0:
        norm = LoopNorm(standard_plant(first_order()), family, Shippable())
    x = next(stable_draws(norm, family, rng, 20))
    value, slope = norm.valued(x)
    step = 1e-6
    differences = [
        (norm.value(x + step * e) - norm.value(x - step * e)) / (2 * step) for e in np.eye(len(x))
    ]
    assert np.isfinite(value)
    assert slope == pytest.approx(differences, rel=1e-3, abs=1e-4 * np.abs(slope).max())


def test_random_starts_stabilise_a_flexible_plant():
    plant = standard_plant(flexible())
    family = FreeMatrices(2, 1, 1)
    norm = LoopNorm(plant, family, Shippable())
    found = list(stable_draws(norm, family, np.random.default_rng(0), 6))
    assert found
    assert all(np.isfinite(norm.value(x)) for x in found)


def test_all_starts_and_further_ones_descend_unless_the_level_is_reached():
    stated = without_perturbation(HinfSynthesis(first_order(), order=0))
    search = NormSearch(stated, Context(options=Options(seed=0)))
    starts = sorted(search.drawn(0, 2), key=lambda point: point.value)
    found = descended_further(search, starts, starts, 0.0)
    norms = [point.value for point in found]
    assert len(starts) + FURTHER // 2 < len(norms) <= len(starts) + FURTHER
    assert norms[0] == pytest.approx(descents.by_bfgs(starts[0]).value)
    assert min(norms) == pytest.approx(1 + np.sqrt(3), rel=1e-3)
    assert not descended_further(search, starts, starts, 2 * starts[0].value)


def crossed():
    """An integrator that the second control moves and the first measurement shows, and a lag."""
    A, B = np.diag([0.0, -1.0]), [[1.0, 0, 0, 0, 1], [0, 0, 0, 1, 0]]
    C = [[1.0, 0], [0, 0], [0, 0], [1, 0], [0, 1]]
    D = np.zeros((5, 5))
    D[1, 3] = D[2, 4] = D[3, 1] = D[4, 2] = 1.0
    return GeneralisedPlant(control.ss(A, B, C, D), None, 2, 2)


@pytest.mark.cases(1)
@pytest.mark.parametrize("Synthesis", [HinfSynthesis, MuSynthesis])
def test_a_pole_that_no_channel_has_alone_hinders_no_search(Synthesis):
    solution = wb.solve(Synthesis(crossed(), order=0), options=Options(seed=0))
    assert solution.certificate.holds
    norms = [
        control.linfnorm(crossed().close(control.ss([], [], [], [[0.0, 0.0], [-k, 0.0]])))[0]
        for k in np.linspace(0.5, 2.0, 151)
    ]
    peak = solution.answer.norm if Synthesis is HinfSynthesis else solution.answer.upper
    assert peak == pytest.approx(min(norms), rel=2e-3)


def test_mu_synthesis_without_perturbation_is_h_infinity_synthesis():
    solution = wb.solve(MuSynthesis(first_order(), order=0), options=Options(seed=0))
    assert solution.certificate.holds
    assert solution.answer.upper == pytest.approx(1 + np.sqrt(3), rel=2e-3)


def test_a_start_with_fewer_states_is_where_the_search_begins():
    lower = wb.solve(
        HinfSynthesis(first_order(), order=0), method="bfgs", options=Options(seed=0)
    ).answer
    begun = HinfSynthesis(first_order(), order=2, start=lower.K)
    answer = wb.solve(begun, method="bfgs", options=Options(seed=0)).answer
    assert answer.K.nstates == 2
    assert answer.norm <= (1 + 1e-6) * lower.norm


def test_states_that_are_added_keep_to_the_fastest_pole():
    plant = standard_plant(first_order())
    norm = LoopNorm(plant, FreeMatrices(0, 1, 1), Shippable(fastest=0.01))
    gain = NormPoint(norm, np.array([-2.7]), norm.value(np.array([-2.7])))
    grown = gain.grown(3, np.random.default_rng(0))
    assert grown.norm.value(grown.x) == pytest.approx(gain.value, rel=1e-6)
    assert np.abs(grown.controller.poles()).max() <= 0.01


@pytest.mark.slow
def test_more_states_are_not_worse():
    lower, higher = (
        wb.solve(
            HinfSynthesis(flexible(), order=order), method="bfgs", options=Options(seed=0)
        ).answer
        for order in (1, 2)
    )
    assert higher.norm <= 1.001 * lower.norm
