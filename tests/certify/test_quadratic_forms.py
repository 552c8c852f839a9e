"""Ratios of quadratic forms against generalised eigenvalues, and powers against their products."""

import numpy as np
import pytest
from flint import arb, arb_mat, ctx
from scipy.linalg import eigh

from workbench.certify.modes.modal_form import real_balls
from workbench.certify.quadratic_forms import (
    QuadraticForm,
    ball_product,
    ball_quotient,
    power,
)
from workbench.certify.rounding import BALL_BITS

A = np.array([[0.5, 1.0, 0.25], [-0.75, 0.5, 0.0], [0.125, -2.0, 0.25]])
P = np.array([[4.0, 1.0, 0.0], [1.0, 2.0, -0.5], [0.0, -0.5, 0.25]])
Q = np.array([[1.0, -0.5, 0.25], [-0.5, 3.0, 1.0], [0.25, 1.0, 2.0]])


def doubles(balls):
    return np.array([[float(entry.mid()) for entry in row] for row in balls.tolist()])


@pytest.mark.parametrize(("first", "second"), [(P, Q), (Q, P), (P, P), (Q, Q)])
@pytest.mark.parametrize("through", [np.eye(3), A, A.T, 1e-3 * A @ A])
def test_a_ratio_is_the_largest_generalised_eigenvalue(first, second, through):
    found = QuadraticForm(first).ratio(QuadraticForm(second), real_balls(through))
    truth = eigh(through.T @ second @ through, first, eigvals_only=True)[-1]
    assert found == pytest.approx(truth, rel=1e-10)
    if first is second and (through == np.eye(3)).all():
        assert found >= 1.0


@pytest.mark.parametrize("skew", [1.0, 1e3, 1e6])
def test_a_ratio_is_no_lower_than_any_state_shows(skew):
    """In coordinates of a large condition, by states in exact arithmetic."""
    rng = np.random.default_rng(3)
    T = np.eye(3) + skew * np.triu(rng.standard_normal((3, 3)), 1)
    form = T.T @ P @ T
    other, M = T.T @ Q @ T, np.linalg.solve(T, A @ T)
    found = QuadraticForm(form).ratio(QuadraticForm(other), real_balls(M))
    states = np.linalg.solve(T, rng.standard_normal((3, 400)))
    with ctx.workprec(BALL_BITS):
        above, below, through = (arb_mat(one.tolist()) for one in (other, form, M))
        for x in states.T:
            column = arb_mat(x[:, None].tolist())
            y = through * column
            share = (y.transpose() * above * y)[0, 0] / (column.transpose() * below * column)[0, 0]
            assert share < arb(found)


JUST_BELOW = np.array([[6.0, 9.0, -2.0], [4.0, 9.0, 3.0]])
JUST_BELOW = JUST_BELOW.T @ JUST_BELOW / 7.0
"""Its determinant is -2.2e-14 in fractions, and doubles find a root of it all the same."""


@pytest.mark.parametrize(
    ("form", "positive"),
    [
        (P, True),
        (np.diag([1.0, 1e-300]), True),
        (np.array([[1.0, 1.0], [1.0, 1.0]]), False),
        (np.array([[1.0, 2.0], [2.0, 1.0]]), False),
        (JUST_BELOW, False),
        (-P, False),
        (np.full((2, 2), np.nan), False),
    ],
)
def test_positive_forms(form, positive):
    assert QuadraticForm(form).positive is positive


def test_a_root_in_doubles_makes_no_form_positive():
    assert QuadraticForm(JUST_BELOW).basis is not None


def test_powers_are_products():
    product = np.linalg.multi_dot([A, A, A])
    assert doubles(power(A, 3)) == pytest.approx(product, rel=1e-15)
    assert doubles(power(A, 1)) == pytest.approx(A)
    assert doubles(power(A, 3, 0.5)) == pytest.approx(0.25 * A)
    assert doubles(power(A, 1, 0.5)) == pytest.approx(A)
    assert doubles(ball_product(A, power(P, 1))) == pytest.approx(A @ P, rel=1e-15)
    assert doubles(ball_quotient(A, 0.5)) == pytest.approx(2 * A)
    assert power(A, 2)[0, 0].overlaps(arb(float((A @ A)[0, 0])))


def test_a_ratio_within_bounds_holds_for_every_choice_of_signs():
    """|M| up to a size: the form with all signs alike is worst, with those of Q it is not."""
    size = np.array([[0.1, 0.3, 0.0], [0.2, 0.1, 0.4], [0.0, 0.3, 0.2]])
    found = QuadraticForm(P).ratio_within(QuadraticForm(Q), size)
    rng, worst = np.random.default_rng(5), 0.0
    for _ in range(300):
        M = size * rng.choice([-1.0, 1.0], (3, 3))
        worst = max(worst, eigh(M.T @ Q @ M, P, eigvals_only=True)[-1])
    assert worst <= found < 100 * worst
    mixed = np.array([[1.0, -0.9, 0.0], [-0.9, 1.0, 0.0], [0.0, 0.0, 1e-3]])
    one = QuadraticForm(np.eye(3)).ratio_within(QuadraticForm(mixed), np.ones((3, 3)))
    assert one >= 3 * 3.8
    assert QuadraticForm(P).ratio_within(QuadraticForm(Q), np.zeros((3, 3))) == 0.0
