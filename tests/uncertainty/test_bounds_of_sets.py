"""Bounds of the size of sets of matrices, and checks of sets and models, by hand."""

import control
import numpy as np
import pytest

import workbench as wb
from workbench.uncertainty import MatrixCover, MatrixModel, MatrixResponses
from workbench.uncertainty.matrix_covers.checks_of_model import (
    off_shape,
    plants_made,
    semidefinite,
    unstable_poles,
)
from workbench.uncertainty.matrix_covers.found import FoundCover
from workbench.uncertainty.matrix_covers.sets.optimality import farthest, trace_bound, volume_excess
from workbench.uncertainty.matrix_covers.sets.program import FoundSets, MatrixSets

NO_REACH = np.zeros(1), np.zeros(1)
TURN = np.array([[0.6, -0.8], [0.8, 0.6]])


def sets(left, right, centre=None, count=1):
    left, right = np.array(left, complex)[None], np.array(right, complex)[None]
    p, m = left.shape[1], right.shape[1]
    middle = np.zeros((1, p, m)) if centre is None else np.array(centre, complex)[None]
    return FoundSets(left, right, middle, np.zeros((1, count + p * m, min(p, m))))


def failed(checks):
    return {check.name for check in checks if not check.holds}


# --- volume -------------------------------------------------------------------------------------


@pytest.mark.parametrize(("size", "excess"), [(1.0, 0.0), (0.5, np.log(2)), (2.0, 0.0)])
def test_a_set_of_one_number_is_as_large_as_the_number(size, excess):
    M = np.array([[[[size]]]])
    assert volume_excess(M, np.ones((1, 1, 1)), "full", "full", NO_REACH) == pytest.approx(excess)


def test_a_direction_that_nothing_touches_can_shrink():
    """One matrix of one row touches the first column alone: B has room, times its reach."""
    M, weights = np.array([[[[1.0, 0.0]]]]), np.ones((1, 1, 1))
    for shape, reach, excess in (("full", 3.0, 3.0), ("diagonal", 2.0, 2.0), ("scalar", 2.0, 0.0)):
        found = volume_excess(M, weights, "full", shape, (np.ones(1), np.full(1, reach)))
        assert found == pytest.approx(excess, abs=1e-12)
    column = M.swapaxes(2, 3)
    found = volume_excess(column, weights, "full", "full", (np.full(1, 3.0), np.ones(1)))
    assert found == pytest.approx(3.0)


def test_weights_fall_and_are_not_negative():
    """Weights that rise count as their running minimum, negative ones as none."""
    square = np.eye(2)[None, None]
    rising, level = np.array([[[1.0, 3.0]]]), np.ones((1, 1, 2))
    for weights in (rising, level):
        assert volume_excess(square, weights, "full", "full", NO_REACH) == pytest.approx(0.0)
        far = np.full(1, 5.0), np.full(1, 5.0)
        assert volume_excess(square, weights, "full", "full", far) == pytest.approx(0.0, abs=1e-12)
    two = np.array([[[[0.9]], [[0.5]]]])
    found = volume_excess(two, np.array([[[1.0], [-0.5]]]), "full", "full", NO_REACH)
    assert found == pytest.approx(-np.log(0.9))


def test_the_floor_bounds_how_far_a_smaller_set_may_be():
    one = np.ones((1, 1, 1))
    channels = np.ones((1, 1)), np.ones((1, 1))
    found = farthest(one, one, channels, 1e-3)
    assert [float(part[0]) for part in found] == pytest.approx([np.log(1e3)] * 2)


# --- trace --------------------------------------------------------------------------------------


@pytest.mark.parametrize("weights", [(1.0, 1.0), (0.0, 1.0), (-1.0, 1.0)])
def test_the_trace_of_numbers_is_the_largest(weights):
    """Of 2 and 3, proven by weights of 3 alone; a negative one is none."""
    away = np.array([[[[2.0]], [[3.0]]]])
    P, S = np.full((1, 1, 1), 1 / 3), np.ones((1, 1, 1))
    c = np.array(weights)[None, :, None]
    found = trace_bound(away, 2, P, S, c, "full", "full", False)
    assert found <= 3.0 * (1 + 1e-12)
    if weights[0] <= 0.0:
        assert found == pytest.approx(3.0)


def test_another_centre_makes_the_set_of_one_number_a_point():
    away = np.array([[[[2.0]], [[1e-3]]]])
    P, S = np.full((1, 1, 1), 0.5), np.ones((1, 1, 1))
    c = np.array([[[1.0], [0.0]]])
    assert trace_bound(away, 1, P, S, c, "full", "full", False) == pytest.approx(2.0)
    assert trace_bound(away, 1, P, S, c, "full", "full", True) == 0.0


# --- sets ---------------------------------------------------------------------------------------


def test_sizes_of_sets_by_hand():
    column = np.array([[[[1.0], [1.0]]]])
    answer = sets(np.diag([1.0, 4.0]), [[3.0]])
    assert MatrixSets(column).sizes(answer) == pytest.approx(6.0)  # sqrt(1 * 4) * 3
    trace = MatrixSets(column, size="trace").sizes(sets(np.diag([1.0, 3.0]), [[2.0]]))
    assert trace == pytest.approx(np.sqrt(10 / 2) * 2)


def test_what_a_set_contains():
    program = MatrixSets(np.array([[[[2.0, 0.0], [0.0, 4.0]]]]), floor=0.01)
    rows, columns = program.channel_sizes
    away = program.away(np.zeros((1, 2, 2)))
    for k, (i, j) in enumerate(np.ndindex(2, 2)):
        entry = np.zeros((2, 2))
        entry[i, j] = 0.01 * rows[0, i] * columns[0, j]
        assert away[0, 1 + k] == pytest.approx(entry)
        assert entry[i, j] > 0


def test_a_delta_is_what_a_set_makes_the_matrix_of():
    W_1, W_2, Z = np.array([[2.0, 0.0], [1.0, 3.0]]), np.array([[1.0, 0.5], [0.0, 1.0]]), TURN
    Delta = np.array([[0.1, 0.2], [-0.3, 0.4]])
    found = sets(W_1, W_2, Z).deltas((Z + W_1 @ Delta @ W_2)[None, None])
    assert found[0, 0] == pytest.approx(Delta)


@pytest.mark.parametrize(
    ("W", "side", "holds"),
    [
        (TURN @ np.diag([1.0, 2.0]), "W_2", True),  # W_2^* W_2 is diagonal
        (np.diag([1.0, 2.0]) @ TURN, "W_2", False),
        (np.diag([1.0, 2.0]) @ TURN, "W_1", True),  # W_1 W_1^* is
        (TURN @ np.diag([1.0, 2.0]), "W_1", False),
    ],
)
def test_the_shape_is_that_of_the_square_that_a_set_depends_on(W, side, holds):
    program = MatrixSets(0.1 * TURN[None, None], left="diagonal", right="diagonal")
    answer = sets(W, np.eye(2)) if side == "W_1" else sets(np.eye(2), W)
    expected = set() if holds else {f"{side} diagonal"}
    assert failed(program.checks(answer, 1e-6)) == expected


@pytest.mark.parametrize("centre", ["zero", "free"])
def test_a_centre_that_is_not_free_is_zero(centre):
    two = np.stack([0.1 * TURN, 0.2 * TURN])[None]
    answer = sets(np.eye(2), np.eye(2), 0.01 * np.eye(2))
    found = failed(MatrixSets(two, centre=centre).checks(answer, 1e-6))
    assert found == ({"centre"} if centre == "zero" else set())


@pytest.mark.parametrize(("largest", "holds"), [(0.9, True), (1.5, False)])
def test_the_largest_direction_of_a_matrix_counts_in_both_opinions(largest, holds):
    program = MatrixSets(np.diag([largest, 0.1])[None, None])
    answer = sets(np.eye(2), np.eye(2))
    assert bool(failed(program.checks(answer, 1e-6))) is not holds
    (opinion,) = program.second_opinion(answer)
    assert opinion.holds is holds and opinion.value == pytest.approx(largest**2 - 1)


# --- models -------------------------------------------------------------------------------------

OMEGA = np.geomspace(0.1, 10.0, 6)
NOMINAL = control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2)))
PLANTS = [NOMINAL * 0.9, NOMINAL * 1.1]
RESPONSES = MatrixResponses.of_systems(PLANTS, OMEGA)


def static(W):
    return control.ss([], [], [], W)


def lags(zero, gain=0.11):
    """gain (s / |zero| + 1) / (s + 1) in both channels, of the sign of the zero."""
    one = control.ss(control.tf([gain / abs(zero), -gain * np.sign(zero)], [1.0, 1.0]))
    return control.append(one, one)


@pytest.mark.parametrize(("shape", "value"), [("full", 0.0), ("diagonal", 0.5), ("scalar", 0.5)])
def test_entries_that_are_not_of_a_shape(shape, value):
    response = np.array([[[1.0, 0.5], [0.0, 0.8]]])
    assert off_shape(response, shape) == pytest.approx(value)
    level = off_shape(response * np.eye(2), shape)
    assert level == pytest.approx(0.2 if shape == "scalar" else 0.0)


@pytest.mark.parametrize(
    ("pole", "dt", "count"), [(-1, 0, 0), (1, 0, 1), (0, 0, 1), (0.5, 1, 0), (1, 1, 1), (-1, 1, 1)]
)
def test_a_pole_on_the_border_is_not_proven_stable(pole, dt, count):
    system = control.ss([[float(pole)]], [[1.0]], [[1.0]], [[0.0]], dt)
    assert unstable_poles(system) == count


def test_containment_by_squares_of_weights_that_are_not_normal():
    W_1, W_2 = np.array([[1.0, 0.0], [2.0, 1.0]]), np.array([[1.0, 0.7], [0.0, 2.0]])
    model = MatrixModel(NOMINAL, static(W_1), static(W_2))
    for size, holds in ((0.99, True), (1.01, False)):
        X = np.broadcast_to(W_1 @ (size * TURN) @ W_2, (6, 2, 2, 2))
        assert semidefinite(RESPONSES, X, model).holds is holds


def test_every_plant_is_made_by_its_own_delta():
    model = MatrixModel(NOMINAL, static(0.2 * np.eye(2)), static(np.eye(2)))
    response = np.eye(2) / (1 + 1j * OMEGA)[:, None, None]
    deltas = np.stack([-0.5 * response, 0.5 * response], axis=1)
    assert plants_made(RESPONSES, deltas, model).holds
    assert not plants_made(RESPONSES, deltas[:, ::-1], model).holds


@pytest.fixture(scope="module")
def cover():
    """Of responses alone: what is known at every frequency has a check more."""
    values = MatrixResponses(OMEGA, RESPONSES.values)
    return MatrixCover(values, NOMINAL, left_order=1, right_order=0)


@pytest.fixture(scope="module")
def least(cover):
    return wb.solve(cover.sets, method="barrier").answer


def model(W_1, W_2=None, nominal=NOMINAL):
    return MatrixModel(nominal, W_1, static(np.eye(2)) if W_2 is None else W_2)


@pytest.mark.parametrize(
    ("answer", "fails"),
    [
        (model(lags(-100.0)), set()),
        (model(lags(-100.0, 0.09)), {"containment"}),
        (model(lags(100.0)), {"inverse of W_1 stable"}),
        (model(lags(-100.0) * lags(-50.0, 2.0)), {"order of W_1"}),
        (model(lags(-100.0), control.append(*[control.ss([[-9]], [[0]], [[0]], [[1]])] * 2)),
         {"order of W_2"}),
        (model(lags(-100.0), nominal=NOMINAL * -1.0), {"nominal given"}),
    ],
)  # fmt: skip
def test_each_check_of_a_cover_refuses_its_own_fault(cover, least, answer, fails):
    found = failed(cover.checks(FoundCover(answer, least), 1e-6))
    assert fails <= found <= fails | {"containment"} and bool(found) is bool(fails)


def test_smallest_sets_contain_and_are_the_smallest(cover, least):
    good, replaced = model(lags(-100.0)), type(least)
    for factor, name in ((0.9, "smallest sets"), (1.1, "no set is smaller")):
        other = replaced(factor * least.left, least.right, least.centre, least.weights)
        assert failed(cover.checks(FoundCover(good, other), 1e-6)) == {name}


def test_deltas_of_known_plants_are_of_their_distance_from_the_nominal():
    cover = MatrixCover(RESPONSES, NOMINAL, left_order=1, right_order=0)
    for plant, delta in zip(PLANTS, cover.known_deltas(model(lags(-100.0))), strict=True):
        s = 2j
        apart = plant(s) - NOMINAL(s)
        assert delta(s) == pytest.approx(np.linalg.solve(lags(-100.0)(s), apart))
