"""Covers of matrix responses: every plant is in the model, in every form, in both kinds of time."""

from dataclasses import replace
from functools import cache
from typing import get_args

import control
import numpy as np
import pytest
from lanes import thinned

import workbench as wb
from workbench.errors import InputError
from workbench.mu import robust_stability, worst_case_gain
from workbench.systems.bilinear import bilinear_sampled
from workbench.uncertainty import (
    MatrixCover,
    MatrixModel,
    MatrixResponses,
    central_nominal,
    feedback,
    real,
    tf,
)
from workbench.uncertainty.matrix_covers.checks_of_model import unstable_poles
from workbench.uncertainty.matrix_covers.forms import MatrixForm, delta_shape
from workbench.uncertainty.matrix_covers.responses import system_response
from workbench.uncertainty.matrix_covers.sets.program import MatrixSets

OMEGA = np.geomspace(0.1, 100.0, 40)
FORMS = get_args(MatrixForm)


def plant(k1=1.0, k2=1.0, z=0.2, w=10.0):
    s = control.tf("s")
    resonance = w**2 / (s**2 + 2 * z * w * s + w**2)
    rows = [[k1 / (0.5 * s + 1), 0.3 * k2 * resonance], [0.2 * k2 / (0.1 * s + 1), k1 * resonance]]
    return control.ss(control.combine_tf(rows))


@cache
def family(count=6):
    draws = np.random.default_rng(3).uniform(-1, 1, (count, 4))
    return tuple(
        plant(1 + 0.2 * a, 1 + 0.3 * b, 0.2 * (1 + 0.3 * c), 10 * (1 + 0.1 * d))
        for a, b, c, d in draws
    )


def measured(dt=0.0):
    plants = [bilinear_sampled(each, dt) for each in family()] if dt else family()
    known = MatrixResponses.of_systems(plants, OMEGA)
    return MatrixResponses(known.omega, known.values, dt=dt)


def cover(form="additive", dt=0.0, **changes):
    nominal = bilinear_sampled(plant(), dt) if dt else plant()
    return MatrixCover(
        measured(dt), nominal, form=form, **({"left_order": 2, "right_order": 2} | changes)
    )


def solved(program, method="steps"):
    solution = wb.solve(program, method=method)
    assert solution.certificate is not None, solution.message
    assert solution.certificate.valid, solution.certificate.failures
    return solution.answer


def closed(model, Delta, omega):
    """Response (F, p, m) of the model with matrices Delta (F, ., .)."""
    H = system_response(model.system, omega)
    r, c = Delta.shape[-2:]
    a, b, d, e = H[:, :c, :r], H[:, :c, r:], H[:, c:, :r], H[:, c:, r:]
    return e + d @ Delta @ np.linalg.solve(np.eye(c) - a @ Delta, b)


@pytest.mark.cases(1)
@pytest.mark.parametrize("dt", [0.0, 0.02])
@pytest.mark.parametrize("form", FORMS)
def test_the_model_with_its_delta_is_the_plant(form, dt):
    program = cover(form, dt)
    model = solved(program).model
    deltas = program.deltas(model)
    assert np.linalg.norm(deltas, 2, axis=(2, 3)).max() == pytest.approx(1.0, abs=1e-6)
    for k in range(deltas.shape[1]):
        expected = program.responses.values[:, k]
        found = closed(model, deltas[:, k], OMEGA)
        assert np.abs(found - expected).max() <= 1e-9 * np.abs(expected).max()


@pytest.mark.cases(1)
@pytest.mark.parametrize("form", FORMS)
def test_entries_of_the_models_plants_fill_the_discs(form):
    rng = np.random.default_rng(1)
    program = cover(form)
    model = solved(program).model
    small = MatrixModel(
        model.nominal, 0.2 * model.W_1, model.W_2, form=form
    )  # else some discs are half planes
    centre, radius = small.entry_discs(OMEGA)
    r, c = delta_shape(form, 2, 2)
    largest = np.zeros_like(radius)
    for _ in range(400):
        u, v = rng.normal(size=(2, 1, r, 1)) @ [[1]], rng.normal(size=(2, 1, 1, c))
        u, v = u[0] + 1j * u[1], v[0] + 1j * v[1]
        Delta = np.broadcast_to(u @ v / np.linalg.norm(u) / np.linalg.norm(v), (len(OMEGA), r, c))
        largest = np.maximum(largest, np.abs(closed(small, Delta, OMEGA) - centre) / radius)
    assert np.isfinite(radius).any()
    assert largest.max() <= 1 + 1e-9
    assert np.median(largest[np.isfinite(radius)]) > 0.6


@pytest.mark.cases(0)
@pytest.mark.parametrize("shapes", [("full", "full"), ("diagonal", "scalar"), ("scalar", "scalar")])
def test_weights_have_their_shapes_and_orders_and_come_near_the_least_sets(shapes):
    program = cover(left=shapes[0], right=shapes[1], left_order=4, right_order=3)
    answer = solved(program, "joint")
    metrics = program.metrics(answer)
    assert 1 <= metrics["inflation_mean"] <= 1.35
    assert metrics["least_gap"] <= 1e-6
    assert metrics["order_W1"] <= 8
    assert answer.model.W_2.nstates == (0 if shapes[1] == "scalar" else 6)


@pytest.mark.cases(0)
def test_weights_together_are_smaller_than_one_after_the_other_and_those_with_free_poles_too():
    program = cover(left_order=2, right_order=2)
    sizes = {
        name: program.objective(solved(program, name)) for name in ("steps", "joint", "descent")
    }
    assert sizes["joint"] <= sizes["steps"]
    assert sizes["descent"] <= sizes["joint"] + 1e-3


def test_weights_together_keep_half_of_their_size_where_nothing_is_known():
    """A share of the previous round's weights alone would let them fall by half in each round."""
    program = cover(left_order=1, right_order=1)
    steps, joint = (solved(program, name) for name in ("steps", "joint"))
    assert program.objective(joint) < program.objective(steps) - 0.1
    outside = np.concatenate([OMEGA[0] / [10, 100], OMEGA[-1] * np.array([10, 100])])
    for name in ("W_1", "W_2"):
        before, after = (
            system_response(getattr(one.model, name), outside) for one in (steps, joint)
        )
        shares = np.abs(np.diagonal(after / np.where(before == 0, 1, before), axis1=1, axis2=2))
        assert shares.min() >= 0.5 * (1 - 1e-3)


def test_full_weights_leave_smaller_sets_than_diagonal_ones():
    sizes = [cover("output", left=s, right=s).sets for s in ("diagonal", "full")]
    assert (
        sizes[1].sizes(wb.solve(sizes[1]).answer).mean()
        < sizes[0].sizes(wb.solve(sizes[0]).answer).mean()
    )


@pytest.mark.parametrize("method", thinned(["steps", "joint", "descent"], 3))
def test_known_plants_are_covered_at_every_frequency(method):
    known = MatrixResponses.of_systems(family(4), np.geomspace(0.1, 100, 15), plants=list("abcd"))
    program = MatrixCover(known, plant(), left_order=2, right_order=1)
    solution = wb.solve(program, method=method)
    assert solution.certificate.valid, solution.certificate.failures
    everywhere = [check for check in solution.certificate.checks if check.name == "everywhere"]
    assert [check.opinion for check in everywhere] == [False, True]
    assert "every frequency" in everywhere[0].over
    omega = np.geomspace(1e-3, 1e4, 3000)
    model = solution.answer.model
    W = [np.linalg.inv(system_response(each, omega)) for each in (model.W_1, model.W_2)]
    for each in family(4):
        away = system_response(each, omega) - system_response(model.nominal, omega)
        assert np.linalg.norm(W[0] @ away @ W[1], 2, axis=(1, 2)).max() <= 1 + 1e-8


@pytest.mark.cases(0)
def test_weights_of_order_zero_are_constants():
    program = cover(left_order=0, right_order=0)
    for method in ("steps", "joint", "descent"):
        model = solved(program, method).model
        assert model.W_1.nstates == model.W_2.nstates == 0


def test_a_family_of_parameters_is_covered_where_its_worst_delta_is_below_one():
    """The parameters and the frequency together, by the worst gain of the family's Delta."""
    k = real("k", 1.0, percent=20)
    uncertain = tf([1.0], [0.5, 1.0]) * k
    nominal = control.ss(control.tf([1.0], [0.5, 1.0]))
    members = MatrixResponses.of_systems([uncertain.at(k=v) for v in (0.8, 1.2)], OMEGA)
    program = MatrixCover(members, nominal, left_order=1, right_order=0)
    model = solved(program).model
    gain = worst_case_gain(model.delta_of(uncertain))
    assert gain.upper <= 1.005  # bounds are 1 % apart at most
    smaller = MatrixModel(nominal, 0.5 * model.W_1, model.W_2)
    assert worst_case_gain(smaller.delta_of(uncertain)).lower > 1.9


def test_the_model_is_an_uncertain_system_with_certified_margins():
    model = solved(cover("output")).model
    s = control.tf("s")
    integral = control.ss(0.3 / (s + 0.01))
    loop = feedback(model * control.append(integral, integral), control.ss([], [], [], np.eye(2)))
    margin = robust_stability(loop)
    assert margin.lower > 0
    T = control.feedback(plant() * control.append(integral, integral), np.eye(2))
    seen = control.append(model.W_2) * T * control.append(model.W_1)
    peak = np.linalg.norm(
        system_response(control.ss(seen), np.geomspace(1e-3, 1e3, 4000)), 2, (1, 2)
    ).max()
    assert margin.lower <= 1 / peak * (1 + 1e-6)
    assert margin.upper >= 1 / peak * (1 - 1e-3)


@pytest.mark.cases(0)
@pytest.mark.parametrize("shape", [(3, 2), (2, 3)])
def test_plants_that_are_not_square(shape):
    p, m = shape
    rng = np.random.default_rng(2)
    base = control.ss(
        -np.diag([1.0, 3.0]), rng.normal(size=(2, m)), rng.normal(size=(p, 2)), np.zeros((p, m))
    )
    plants = [
        control.ss(base.A * (1 + 0.1 * a), base.B * (1 + 0.2 * b), base.C, base.D)
        for a, b in rng.uniform(-1, 1, (5, 2))
    ]
    responses = MatrixResponses.of_systems(plants, OMEGA)
    for form in ("additive", "coprime"):
        program = MatrixCover(responses, base, form=form, left_order=1, right_order=1)
        model = solved(program).model
        deltas = program.deltas(model)
        found = closed(model, deltas[:, 0], OMEGA)
        np.testing.assert_allclose(found, responses.values[:, 0], atol=1e-9)


def test_a_form_that_does_not_reach_a_plant_names_it():
    rng = np.random.default_rng(2)
    tall = [
        control.ss([[-1.0]], [[1.0]], rng.normal(size=(2, 1)), np.zeros((2, 1))) for _ in range(3)
    ]
    responses = MatrixResponses.of_systems(tall, OMEGA, plants=["one", "two", "three"])
    with pytest.raises(InputError, match="form 'input' gives plant"):
        MatrixCover(responses, tall[0], form="input")


def test_unstable_plants_are_covered_where_they_are_measured():
    s = control.tf("s")
    plants = [control.ss(k / (s - a)) for k, a in ((1.0, 1.0), (1.2, 1.1), (0.9, 0.8))]
    responses = MatrixResponses.of_systems(plants, OMEGA)
    for form in ("coprime", "inverse-output", "input"):
        program = MatrixCover(responses, plants[0], form=form, left_order=1, right_order=1)
        assert not program.covers_every_frequency
        solved(program)


def test_a_known_plant_with_other_unstable_poles_is_refused_where_no_stable_delta_makes_it():
    s = control.tf("s")
    stable, unstable = control.ss(1 / (s + 0.1)), control.ss(1 / (s - 0.1))
    responses = MatrixResponses.of_systems([stable, unstable], OMEGA, plants=["one", "two"])
    for form in ("additive", "input", "output"):
        with pytest.raises(InputError, match="plant two has 1 unstable poles, the nominal 0"):
            MatrixCover(responses, stable, form=form)
    solved(MatrixCover(responses, stable, form="coprime", left_order=1, right_order=1))


@pytest.mark.cases(1)
@pytest.mark.parametrize("dt", [0, 0.5])
def test_an_integrator_counts_as_unstable_wherever_its_bits_round_it(dt):
    rounded = set()
    for seed in range(40):
        T = np.linalg.qr(np.random.default_rng(seed).normal(size=(4, 4)))[0]
        A = T @ np.diag([1.0, 0.5, 0.2, -0.3] if dt else [0.0, -1.0, -2.0, 3.0]) @ T.T
        system = control.ss(A, np.ones((4, 1)), np.ones((1, 4)), 0.0, dt)
        assert unstable_poles(system) == (1 if dt else 2)
        poles = system.poles()
        rounded.add(int(((abs(poles) >= 1) if dt else (poles.real >= 0)).sum()))
    assert len(rounded) == 2  # eigenvalues alone do not tell


def test_measured_data_of_python_control():
    omega = np.geomspace(0.1, 10, 12)
    data = [control.frd(each, omega, smooth=False) for each in family(3)]
    responses = MatrixResponses.from_frd(data, plants=["a", "b", "c"])
    np.testing.assert_allclose(
        responses.values, MatrixResponses.of_systems(family(3), omega).values
    )
    assert responses.known == ()


def test_an_answer_comes_back_from_its_dataset_and_has_figures():
    program = cover("inverse-output", left="full")
    answer = solved(program)
    back = program.from_dataset(program.to_dataset(answer))
    assert program.certify(back, 1e-6).valid
    assert set(program.figures(back)) == {"magnitudes", "radius", "deltas"}
    assert "inverse-output" in repr(answer)
    assert len(answer.model.plot().axes) == 4


def test_a_cover_too_small_is_refused():
    program = cover()
    answer = solved(program)
    model = MatrixModel(answer.model.nominal, 0.999 * answer.model.W_1, answer.model.W_2)
    failures = program.certify(type(answer)(model, answer.least), 1e-6).failures
    assert any("containment" in each for each in failures)


@pytest.mark.cases(1)
@pytest.mark.parametrize("side", ["left", "right"])
def test_sets_called_the_smallest_are_proven_so(side):
    program = cover()
    answer = solved(program)
    large = replace(answer.least, **{side: 1.25 * getattr(answer.least, side)})
    failures = program.certify(replace(answer, least=large), 1e-6).failures
    assert any(each.startswith("no set is smaller") for each in failures)


VALUES = MatrixResponses.of_systems(family(2), OMEGA).values
RESPONSES = MatrixResponses(OMEGA, VALUES)
LAG = control.ss(control.tf([1], [1, 1]))


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: MatrixResponses(OMEGA, VALUES[:, 0]), r"\(F, N, p, m\)"),
        (lambda: MatrixResponses(OMEGA[:-1], VALUES), "40"),
        (lambda: MatrixResponses(OMEGA, VALUES * np.nan), "plant 1 at 0.1 rad/s"),
        (lambda: MatrixResponses(OMEGA[::-1], VALUES), "rise"),
        (lambda: MatrixResponses(OMEGA, VALUES, plants=["a", "a"]), "different names"),
        (lambda: MatrixResponses(OMEGA, VALUES, plants=3), "plants must be a list"),
        (lambda: MatrixResponses(OMEGA, VALUES, dt=0.1), "half the sampling rate"),
        (lambda: MatrixResponses.of_systems([], OMEGA), "there are no systems"),
        (lambda: MatrixResponses.of_systems([plant(), LAG], OMEGA), "differ"),
        (lambda: MatrixResponses.of_systems(plant(), OMEGA), "list"),
        (lambda: MatrixResponses.of_systems(["P"], OMEGA), "plant 1"),
        (lambda: MatrixResponses.from_frd([1.0]), "FrequencyResponseData"),
        (lambda: MatrixCover(VALUES, plant()), "MatrixResponses"),
        (lambda: MatrixCover(RESPONSES, LAG), "1 outputs and 1 inputs"),
        (lambda: MatrixCover(RESPONSES, bilinear_sampled(plant(), 0.01)), "dt = 0.01"),
        (lambda: MatrixCover(RESPONSES, "G"), "nominal"),
        (lambda: MatrixCover(RESPONSES, plant(), form="multiplicative"), "form is 'multiplicati"),
        (lambda: MatrixCover(RESPONSES, plant(), left="round"), "left is 'round'"),
        (lambda: MatrixCover(RESPONSES, plant(), left_order=-1), "left_order"),
        (lambda: MatrixCover(RESPONSES, plant(), right_order=30), "19 at most"),
        (lambda: MatrixCover(RESPONSES, plant(), floor=2.0), "floor"),
        (lambda: MatrixModel(plant(), np.eye(3), np.eye(2)), "W_1 has 3 outputs"),
        (lambda: MatrixModel(plant(), np.eye(2), np.eye(2), form="round"), "form is 'round'"),
        (lambda: MatrixModel(plant(), np.eye(2), bilinear_sampled(plant(), 0.1)), "W_2 has dt"),
    ],
)  # fmt: skip
def test_bad_input_is_named(make, words):
    with pytest.raises(InputError, match=words):
        make()


def test_a_nominal_that_is_a_plant_alone_leaves_nothing_to_cover():
    responses = MatrixResponses.of_systems([plant()], OMEGA)
    with pytest.raises(InputError, match="nothing to cover"):
        MatrixCover(responses, plant())


@pytest.mark.cases(1)
@pytest.mark.parametrize("dt", [0.0, 0.02])
def test_a_nominal_through_the_centres_leaves_hardly_larger_sets_than_free_centres(dt):
    responses = measured(dt)
    nominal = central_nominal(responses, 6)
    assert nominal.nstates == 6
    assert float(nominal.dt or 0.0) == dt
    least = MatrixSets(responses.values, left="diagonal", right="diagonal", centre="free")
    about = MatrixCover(responses, nominal).sets
    radii = [wb.solve(program).answer.radius.mean() for program in (about, least)]
    assert radii[0] <= 1.05 * radii[1]


def test_a_nominal_needs_responses():
    with pytest.raises(InputError, match="MatrixResponses"):
        central_nominal(VALUES, 2)
    with pytest.raises(InputError, match="are equal"):
        central_nominal(MatrixResponses.of_systems([plant(), plant()], OMEGA), 2)


@pytest.mark.cases(1)
@pytest.mark.parametrize("method", ["steps", "joint", "descent"])
def test_entries_that_do_not_change_are_covered_to_the_floor(method):
    """Weights that only reached the plants would vanish there, and their sets be flat."""
    base, values = system_response(plant(), OMEGA), measured().values.copy()
    values[:, :, 0, 1], values[:, :, 1] = base[:, None, 0, 1], base[:, None, 1]
    responses = MatrixResponses(OMEGA, values)
    program = MatrixCover(responses, plant(), left_order=2, right_order=2)
    metrics = program.metrics(solved(program, method))
    assert 1 - 1e-6 <= metrics["inflation_mean"] <= 1.3
    assert metrics["radius_mean_least"] > 1e-4


def test_a_channel_of_matrix_responses_is_a_set_of_plants_with_one_input_and_output():
    omega = np.geomspace(0.1, 10, 12)
    lag = control.tf([1.0], [1.0, 1.0])
    grow = control.tf([1.0], [1.0, -1.0])
    plants = [control.combine_tf([[k * lag, lag], [lag, grow]]) for k in (1.0, 1.2)]
    responses = MatrixResponses.of_systems([control.ss(each) for each in plants], omega)
    stable, unstable = responses.channel(0, 0), responses.channel(1, 1)
    np.testing.assert_allclose(stable.values[:, 1], 1.2 / (1 + 1j * omega), rtol=1e-12)
    assert len(stable.known_plants) == 2
    assert unstable.known_plants == {}
    for channel in ((2, 0), (0, -1)):
        with pytest.raises(InputError, match=r"numbered from 0|0 or more"):
            responses.channel(*channel)
