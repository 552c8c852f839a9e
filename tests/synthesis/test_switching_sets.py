"""Sets of transitions: nothing in them is beyond the bound."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import eigh, expm

from workbench.errors import InputError
from workbench.synthesis.switching.transition_sets import TransitionSet, held_set


def parts(seed, size=0.3):
    rng = np.random.default_rng(seed)
    M = rng.normal(size=(4, 4))
    return M, [size * rng.normal(size=(4, 4)) for _ in range(2)], rng


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000))
def test_every_exponential_is_in_its_set(seed):
    M, slopes, rng = parts(seed)
    held = held_set(M, slopes, 0.2)
    weights = rng.uniform(-1, 1, 2)
    exact = expm(0.2 * (M + sum(d * Y for d, Y in zip(weights, slopes, strict=True))))
    # the linear part at these weights: the vertices' convex combination
    share = (1 + np.array([-1, 1]) * weights[:, None]) / 2
    linear = sum(
        share[0, i] * share[1, j] * held.vertices[2 * i + j] for i in range(2) for j in range(2)
    )
    assert (abs(exact - linear) <= held.remainder).all()


def test_the_remainder_is_of_second_order():
    M, slopes, _ = parts(3)
    large, small = (held_set(M, [s * Y for Y in slopes], 0.2).remainder for s in (0.1, 0.01))
    assert np.median(large / small) == pytest.approx(100.0, rel=0.05)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10_000))
def test_the_ratio_bounds_every_member(seed):
    M, slopes, rng = parts(seed)
    held = held_set(M, slopes, 0.2)
    P, Q = (B @ B.T + 0.1 * np.eye(4) for B in rng.normal(size=(2, 4, 4)))
    bound = held.ratio(P, Q)
    A = np.einsum("v,vij->ij", rng.dirichlet(np.ones(4)), held.vertices)
    A = A + held.remainder * rng.uniform(-1, 1, (4, 4))
    assert eigh(A.T @ Q @ A, P, eigvals_only=True)[-1] <= bound


def test_a_point_has_its_own_ratio():
    A = np.array([[0.5, 1.0], [0.0, 0.4]])
    point = TransitionSet(A[None], np.zeros((2, 2)))
    assert point.ratio(np.eye(2), np.eye(2)) == pytest.approx(np.linalg.norm(A, 2) ** 2, rel=1e-8)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: TransitionSet(np.eye(2), np.eye(2)), "vertices"),
        (lambda: TransitionSet(np.eye(2)[None], np.eye(3)), "remainder"),
        (lambda: TransitionSet(np.eye(2)[None], -np.eye(2)), "negative"),
        (lambda: TransitionSet(np.full((1, 2, 2), np.nan), np.eye(2)), "finite"),
        (lambda: held_set(np.eye(2), [np.eye(3)], 1.0), "centre and slopes"),
        (lambda: held_set(np.eye(2), [np.eye(2)], 0.0), "duration"),
        (
            lambda: TransitionSet(np.eye(2)[None], np.eye(2)).ratio(-np.eye(2), np.eye(2)),
            "positive definite",
        ),
    ],
)
def test_wrong_input_is_named(make, words):
    with pytest.raises(InputError, match=words):
        make()
