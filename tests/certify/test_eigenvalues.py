"""Discs of eigenvalues against eigenvalues that are known exactly."""

import numpy as np
import pytest

from workbench.certify.eigenvalues import (
    Discs,
    linear_discs,
    pencil_discs,
    pole_discs,
    static_discs,
    touched,
)
from workbench.certify.rounding import Enclosure, exact


def similar(rng, values):
    """An integer matrix with these eigenvalues, exactly."""
    n = len(values)
    lower, upper = np.eye(n), np.eye(n)
    lower += np.tril(rng.integers(-2, 3, (n, n)), -1)
    upper += np.triu(rng.integers(-2, 3, (n, n)), 1)
    T = lower @ upper
    back = np.round(np.linalg.inv(upper) @ np.linalg.inv(lower))
    assert (T @ back == np.eye(n)).all()
    return T @ np.diag(values) @ back


def eigenvalue_discs(A):
    """Discs of a matrix without other blocks."""
    n = len(A.mid)
    return static_discs(A, *(exact(np.zeros(shape)) for shape in ((n, 0), (0, n), (0, 0))))


def holds(discs, values):
    """Whether each value lies in a disc."""
    away = np.abs(np.asarray(values, complex)[:, None] - discs.centre)
    return (away <= discs.radius).any(axis=1).all()


def test_the_part_of_the_axis_in_a_disc():
    discs = Discs(np.array([3 + 4j, 1 - 3j, 2 + 1j, 7 + 0j]), np.array([5.0, 5.0, 0.5, 0.25]))
    first, last = touched(discs)
    np.testing.assert_allclose(first, [0.0, -3.0, 6.75], atol=1e-5)
    np.testing.assert_allclose(last, [6.0, 5.0, 7.25], atol=1e-5)
    assert (first <= [0.0, -3.0, 6.75]).all()
    assert (last >= [6.0, 5.0, 7.25]).all()


@pytest.mark.parametrize("seed", range(10))
def test_discs_hold_known_eigenvalues(seed):
    rng = np.random.default_rng(seed)
    values = rng.choice(np.arange(-40, 41), 6, replace=False)
    A = similar(rng, values)
    found = eigenvalue_discs(exact(A))
    assert holds(found, values)
    assert found.radius.max() < 1e-3
    assert found.rightmost >= values.max()
    wider = eigenvalue_discs(Enclosure(A, np.full(A.shape, 1e-4)))
    for _ in range(20):
        member = A + 1e-4 * rng.uniform(-1, 1, A.shape) * (1 - 1e-9)
        assert holds(wider, np.linalg.eigvals(member))


@pytest.mark.parametrize("seed", range(10))
def test_poles_keep_their_side_of_the_axis(seed):
    rng = np.random.default_rng(seed)
    values = -rng.choice(np.arange(1, 60), 5, replace=False)
    A = similar(rng, values) / 1024.0
    found = pole_discs(exact(A))
    assert holds(found, values / 1024.0)
    assert found.rightmost < 0
    assert pole_discs(exact(-A)).rightmost > 0


@pytest.mark.parametrize("seed", range(10))
def test_discs_of_a_matrix_in_parts_hold_its_eigenvalues(seed):
    """A - B D^-1 C is the integer matrix."""
    rng = np.random.default_rng(seed)
    values = rng.choice(np.arange(-30, 31), 5, replace=False)
    B, C = rng.integers(-3, 4, (5, 2)), rng.integers(-3, 4, (2, 5))
    D = np.diag([2.0, -4.0])
    A = similar(rng, values) + B @ np.diag([0.5, -0.25]) @ C
    found = static_discs(*(exact(part.astype(float)) for part in (A, B, C, D)))
    assert holds(found, values)
    assert np.sort(found.radius)[0] < 1e-3
    singular = static_discs(*(exact(part.astype(float)) for part in (A, B, C, 0 * D)))
    assert np.isinf(singular.radius).all()


@pytest.mark.parametrize("seed", range(10))
def test_discs_of_a_pencil_hold_the_roots_within_reach(seed):
    """T (diag(a) - t) S is singular at t = a."""
    rng = np.random.default_rng(seed)
    a = rng.choice(np.arange(1, 40), 5, replace=False) * rng.choice([-1.0, 1.0], 5)
    T, S = (similar(rng, np.array([1, 2, 3, 1, 2])).astype(float) for _ in range(2))
    within = float(np.median(np.abs(a)))
    found = linear_discs(exact(T @ np.diag(a) @ S), exact(T @ S), within)
    assert holds(found, a[np.abs(a) <= within])


@pytest.mark.parametrize(
    ("centre", "radius", "proven"),
    [
        ([2.0, -1.0], [0.5, 0.1], True),
        ([2.0, -1.0], [0.5, 10.0], False),  # both eigenvalues may be in the larger disc
        ([2.0, 3.0, -1.0], [0.6, 0.6, 0.1], True),
        ([2.0, 3.0, -1.0], [0.6, 0.6, 2.5], False),  # by way of the disc at 2 all three touch
        ([2.0, -1.0], [1.0, 2.0], False),  # where they just touch, rounding decides nothing
        ([2.0, 0.0], [0.5, np.inf], False),
        ([-2.0, -1.0], [0.5, 0.1], False),
    ],
)
def test_a_disc_on_the_right_proves_a_pole_only_where_it_touches_no_other_kind(
    centre, radius, proven
):
    discs = Discs(np.array(centre), np.array(radius))
    assert discs.proves_some(discs.centre > discs.radius) == proven


def test_a_stable_matrix_is_never_proven_unstable():
    """Far from normal: discs are wide, and some lie wholly on the right."""
    rng = np.random.default_rng(0)
    wrong = 0
    for _ in range(40):
        T = rng.standard_normal((6, 6)) * 10.0 ** rng.uniform(-4, 4, (6, 1))
        A = T @ np.diag(-rng.uniform(0.1, 2.0, 6)) @ np.linalg.inv(T)
        V = np.linalg.eig(A)[1] + 1e-3 * rng.standard_normal((6, 6))
        found = pencil_discs(exact(np.linalg.inv(V) @ A @ V), exact(np.eye(6)))
        right = found.centre.real > found.radius
        wrong += int(right.any())
        assert not found.proves_some(right)
    assert wrong
