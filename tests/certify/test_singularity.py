"""Proven lower bounds against mu known exactly, and what they refuse to call a bound."""

import numpy as np
import pytest
from flint import arb, ctx, fmpq, fmpq_mat

from workbench.certify.balls import balls
from workbench.certify.krawczyk import zero_within
from workbench.certify.singularity import proven_bound, proven_bounds, singular_sizes
from workbench.certify.skewed import proven_skew
from workbench.mu import branch_and_bound, lower_bound, skew_bounds, upper_bound
from workbench.structure import Complex, Full, Real, Structure

GRADED = np.zeros((4, 4))
GRADED[:2, :2] = [[1e13, 1e14], [-1e14, 1e13]]
GRADED[2:, 2:] = [[1, 0.1], [-0.1, 1]]
ROTATION = np.array([[0.0, 1.0], [-1.0, 0.0]])


def largest_real_eigenvalue(M):
    """The largest size of a real eigenvalue of a real matrix, by exact arithmetic; 0 for none."""
    exact = fmpq_mat(
        [[fmpq(*(int(n) for n in float(x).as_integer_ratio())) for x in row] for row in M]
    )
    roots = exact.charpoly().complex_roots()
    return max((abs(root.real) for root, _ in roots if root.imag.is_zero()), default=arb(0))


def test_a_graded_matrix_without_real_eigenvalues_has_no_bound():
    structure = Structure([Real(4)])
    assert proven_bound(balls(GRADED), structure, np.eye(4)) == 0
    assert lower_bound(GRADED, structure).value == 0
    assert upper_bound(GRADED, structure).value < 1e-3
    interval = branch_and_bound(GRADED, structure)
    assert interval.lower == 0
    assert interval.upper < 1e-3
    assert skew_bounds(GRADED, structure, []).lower == 0


def test_no_bound_of_badly_scaled_real_matrices_is_false():
    rng = np.random.default_rng(0)
    structure, proven = Structure([Real(4)]), 0
    for _ in range(60):
        rows, columns = 10 ** rng.uniform(-6, 6, (2, 4))
        M = rows[:, None] * rng.standard_normal((4, 4)) * columns
        value, truth = float(lower_bound(M, structure).value), largest_real_eigenvalue(M)
        assert value == 0 or arb(value) <= truth
        proven += value > 0
    assert proven >= 30


@pytest.mark.parametrize("block", [Real(1), Complex(1), Full(1, 1)])
@pytest.mark.parametrize(("M", "Delta"), [(1.5, 0.5), (0.25, 0.75), (-0.5, -1.5), (0.5, 1.0)])
def test_a_proposal_that_is_not_singular_proves_no_more_than_is_true(block, M, Delta):
    """Sums, differences and quotients that are 1 are no products that are 1."""
    assert proven_bound(balls([[M]]), Structure([block]), np.array([[Delta]])) <= abs(M)


def test_nothing_is_proven_by_what_is_not_finite():
    structure = Structure([Real(1), Full(1, 1)])
    for Delta in (np.diag([1.0, np.nan]), np.diag([np.inf, 1.0])):
        assert proven_bound(balls(np.eye(2)), structure, Delta) == 0
        assert proven_skew(np.eye(2), structure, np.array([True, False]), Delta) == 0


@pytest.mark.parametrize("kind", [Real, Complex])
def test_of_similar_matrices_with_known_eigenvalues(kind):
    rng = np.random.default_rng(1)
    shear = np.triu(rng.integers(-3, 4, (5, 5)), 1) + np.eye(5)
    inverse = np.round(np.linalg.inv(shear))
    M = shear @ np.diag([1.0, 2, 3, -8, 5]) @ inverse  # integers: exact
    value = proven_bound(balls(M), Structure([kind(5)]), -np.eye(5) / 8)
    assert 8 * (1 - 1e-9) <= value < 8


def test_a_double_eigenvalue_is_found_where_it_may_be_complex():
    jordan = np.array([[2.0, 1], [0, 2]])
    value = proven_bound(balls(jordan), Structure([Complex(2)]), np.eye(2) / 2)
    assert 2 * (1 - 1e-4) <= value < 2
    # A real eigenvalue of even multiplicity does not change the sign of the determinant.
    assert proven_bound(balls(jordan), Structure([Real(2)]), np.eye(2) / 2) == 0


def test_any_vector_proves_a_bound_of_full_blocks():
    rng = np.random.default_rng(2)
    structure = Structure([Full(2, 3), Complex(1), Full(1, 2)])
    real, imag = rng.standard_normal((2, 20, structure.columns, structure.rows))
    M = real + 1j * imag
    far = np.array([structure.random(rng) for _ in M])
    value, upper = proven_bounds(M, structure, far), upper_bound(M, structure).value
    assert (value > 0).all()
    assert (value <= upper).all()


def test_one_real_scalar_and_a_complex_number_prove_nothing():
    structure = Structure([Real(1)])
    assert proven_bound(balls(np.array([[2.0]])), structure, np.array([[0.5]])) == pytest.approx(2)
    assert proven_bound(balls(np.array([[2 + 1e-15j]])), structure, np.array([[0.5]])) == 0


def test_two_real_scalars_of_a_complex_matrix():
    # det(I - M Delta) = 1 - d1 a - d2 b: with a = 1 + i, b = 1 - 2i zero at d = (2, 1) / 3
    M = np.array([[1 + 1j], [1 + 1j]]) @ np.array([[1, (1 - 2j) / (1 + 1j)]])
    sizes = singular_sizes(balls(M), Structure([Real(1), Real(1)]), np.diag([2 / 3, 1 / 3]))
    np.testing.assert_allclose(sizes, [2 / 3, 1 / 3], rtol=1e-12)


@pytest.mark.parametrize(
    "M",
    [np.zeros((2, 2)), np.array([[0.0, 1], [0, 0]]), ROTATION, 1e-300 * ROTATION, 1e300 * ROTATION],
    ids=["zero", "nilpotent", "rotation", "tiny", "huge"],
)
def test_a_real_scalar_has_no_bound_where_mu_is_zero(M):
    for Delta in (np.eye(2), 1e300 * np.eye(2), np.full((2, 2), np.nan), np.zeros((2, 2))):
        assert proven_bounds(M[None], Structure([Real(2)]), Delta[None] + 0j) == 0


@pytest.mark.parametrize("scale", [1e-300, 1e-150, 1.0, 1e150, 1e300])
def test_of_any_size(scale):
    M = scale * np.array([[3.0, 1], [1, 3]])
    for structure in (
        Structure([Real(2)]),
        Structure([Full(2, 2)]),
        Structure([Real(1), Complex(1)]),
    ):
        value = proven_bound(balls(M), structure, np.eye(2) / (4 * scale) + 0j)
        assert 4 * scale * (1 - 1e-9) <= value <= 4 * scale


def test_only_the_structure_of_a_proposal_counts():
    wrong = np.array([[0.5, 0.0], [0.0, 0.1]])  # no multiple of the identity
    value = proven_bound(balls(np.diag([2.0, 2.5])), Structure([Real(2)]), wrong)
    assert value == pytest.approx(2)
    off = np.array([[0.0, 1.0], [1.0, 0.0]])  # singular, but only outside the blocks
    assert proven_bound(balls(np.eye(2)), Structure([Complex(1), Complex(1)]), off) == 0


def test_a_matrix_of_balls_is_bounded_for_every_member():
    M = balls(np.array([[2.0, 1], [1, 2]]))
    for i in range(2):
        for j in range(2):
            M[i, j] = M[i, j] + arb(0, 0.01)
    structure = Structure([Full(2, 2)])
    value = proven_bound(M, structure, np.eye(2) / 3)
    assert 2.9 < value <= 2.98


def test_a_box_of_krawczyk_holds_the_zero_and_none_is_claimed_elsewhere():
    def residual(x):
        return [x[0] ** 2 + x[1] ** 2 - 5]

    def jacobian(x):
        return [[2 * x[0], 2 * x[1]]]

    with ctx.workprec(128):
        box = zero_within([arb(1), arb(2.0000001)], residual, jacobian)
        assert box is not None
        assert residual(box)[0].contains(0)
        assert box[0] == 1 or box[1] == arb(2.0000001)  # one unknown is kept
        assert zero_within([arb(3), arb(2)], residual, jacobian) is None
        assert zero_within([arb(0), arb(0)], residual, jacobian) is None
