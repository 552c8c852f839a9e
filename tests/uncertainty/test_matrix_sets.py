"""The smallest sets of matrices: contained, proven, independent of units, alike by every method."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import workbench as wb
from workbench.errors import InputError
from workbench.uncertainty.matrix_covers.sets.program import FoundSets, MatrixSets

SHAPES = ("full", "diagonal", "scalar")


def drawn(*shape, seed=0):
    real, imaginary = np.random.default_rng(seed).normal(size=(2, *shape))
    return real + 1j * imaginary


def solved(program, method=None):
    solution = wb.solve(program, method=method)
    assert solution.certificate is not None, solution.message
    assert solution.certificate.valid, solution.certificate.failures
    return solution


@pytest.mark.parametrize("size", ["volume", "trace"])
@pytest.mark.parametrize("left", SHAPES)
@pytest.mark.parametrize("right", SHAPES)
def test_the_sets_about_zero_contain_the_matrices_and_are_proven_to_be_the_smallest(
    left, right, size
):
    program = MatrixSets(drawn(3, 9, 3, 2), left=left, right=right, size=size)
    solution = solved(program)
    norms = np.linalg.norm(solution.answer.deltas(program.deviations), 2, axis=(2, 3))
    assert norms.max() == pytest.approx(1.0, abs=1e-8)
    assert solution.certificate.gap.value <= 1e-6


@pytest.mark.parametrize("left", SHAPES)
def test_a_free_centre_makes_them_smaller_and_the_trace_is_proven_least(left):
    E = drawn(2, 8, 2, 2, seed=1) + 3.0
    fixed, free = (
        solved(MatrixSets(E, left=left, right="diagonal", size="trace", centre=centre))
        for centre in ("zero", "free")
    )
    program = MatrixSets(E, left=left, right="diagonal", size="trace", centre="free")
    assert free.certificate.gap.value <= 1e-6
    assert (program.sizes(free.answer) < 0.8 * program.sizes(fixed.answer)).all()


@pytest.mark.cases(2)
@pytest.mark.parametrize("centre", ["zero", "free"])
@pytest.mark.parametrize("method", ["clarabel", "scs", "cvxopt"])
def test_semidefinite_programs_find_the_same_least_trace(method, centre):
    program = MatrixSets(
        drawn(2, 6, 2, 3, seed=2), left="full", right="diagonal", size="trace", centre=centre
    )
    sizes = [program.sizes(solved(program, name).answer) for name in ("barrier", method)]
    np.testing.assert_allclose(sizes[1], sizes[0], rtol=2e-6)


def test_the_volume_of_one_row_is_that_of_the_least_ellipsoid():
    """John's ellipsoid by Khachiyan's algorithm, centred, in C^3."""
    E = drawn(1, 12, 3, 1, seed=3)
    program = MatrixSets(E, floor=1e-6)
    found = solved(program).answer
    points = E[0, :, :, 0].T
    weights = np.full(12, 1 / 12)
    for _ in range(20000):
        gram = (points * weights) @ points.conj().T
        reach = np.einsum("ik,ij,jk->k", points.conj(), np.linalg.inv(gram), points).real
        weights = weights * reach / 3
    gram = (points * weights) @ points.conj().T * reach.max()
    expected = np.linalg.det(gram).real ** (1 / 6)
    assert program.sizes(found)[0] == pytest.approx(expected, rel=1e-5)


def test_scalar_sets_of_matrices_are_balls():
    E = drawn(4, 7, 2, 3, seed=4)
    found = solved(MatrixSets(E, left="scalar", right="scalar")).answer
    largest = np.linalg.norm(E, 2, axis=(2, 3)).max(axis=1)
    np.testing.assert_allclose(found.radius, largest, rtol=1e-6)


@pytest.mark.cases(0)
@settings(max_examples=15, deadline=None)
@given(
    st.lists(st.floats(-6, 6), min_size=4, max_size=4),
    st.integers(0, 1000),
    st.sampled_from(SHAPES[:2]),
)
def test_the_least_volume_does_not_depend_on_the_units_of_channels(powers, seed, shape):
    E = drawn(1, 6, 2, 2, seed=seed)
    rows, columns = 10.0 ** np.array(powers[:2]), 10.0 ** np.array(powers[2:])
    one = MatrixSets(E, left=shape, right=shape)
    other = MatrixSets(rows[:, None] * E * columns, left=shape, right=shape)
    ratio = np.exp(np.log(rows).mean() + np.log(columns).mean())
    sizes = [program.sizes(solved(program).answer)[0] for program in (one, other)]
    # the floor is found from the sizes of the channels, which equilibration finds to some digits
    assert sizes[1] / sizes[0] / ratio == pytest.approx(1.0, rel=1e-4)


@pytest.mark.parametrize("seed", range(4))
def test_no_weights_drawn_at_random_make_a_smaller_set(seed):
    rng = np.random.default_rng(seed)
    program = MatrixSets(drawn(1, 5, 2, 2, seed=seed))
    answer = solved(program).answer
    least, away = program.sizes(answer)[0], program.away(np.zeros((1, 2, 2)))
    for scale in np.geomspace(1e-3, 1.0, 200):
        turns = rng.normal(size=(2, 2, 2)) + 1j * rng.normal(size=(2, 2, 2))
        left, right = (np.eye(2) + scale * turn for turn in turns)
        W_1, W_2 = left @ answer.left[0], answer.right[0] @ right
        norm = np.linalg.norm(np.linalg.inv(W_1) @ away[0] @ np.linalg.inv(W_2), 2, axis=(1, 2))
        size = norm.max() * np.sqrt(abs(np.linalg.det(W_1)) * abs(np.linalg.det(W_2)))
        assert size >= least * (1 - 1e-6)


HARD = {
    "one matrix": drawn(2, 1, 2, 2),
    "one direction": drawn(2, 9, 1, 1) * drawn(2, 1, 2, 1) @ drawn(2, 1, 1, 2),
    "one output": drawn(2, 9, 2, 2) * np.array([[1.0], [0.0]]),
    "graded": np.diag([1.0, 1e-8]) @ drawn(2, 9, 2, 2) @ np.diag([1.0, 1e5]),
    "diagonal": drawn(2, 9, 2, 2) * np.eye(2),
    "tiny": 1e-200 * drawn(2, 9, 2, 2),
    "huge": 1e150 * drawn(2, 9, 2, 2),
    "alike": np.tile(drawn(2, 1, 2, 2), (1, 5, 1, 1)),
    "many": drawn(1, 200, 2, 2),
    "wide": drawn(2, 9, 1, 4),
}


@pytest.mark.parametrize("name", HARD)
def test_hard_matrices_have_proven_sets(name):
    assert solved(MatrixSets(HARD[name])).certificate.gap.value <= 1e-6


@pytest.mark.parametrize("floor", [1e-6, 1e-4, 0.5])
def test_flat_sets_are_as_thick_as_the_floor(floor):
    E = np.zeros((1, 3, 2, 2))
    E[0, :, 0, 0] = [1.0, -1.0, 0.5]
    found = solved(MatrixSets(E, left="diagonal", right="diagonal", floor=floor)).answer
    inner = np.zeros((1, 1, 2, 2))
    inner[0, 0, 1, 1] = floor**2  # the size of a channel without deviations is the floor
    assert np.linalg.norm(found.deltas(inner), 2, axis=(2, 3)).max() <= 1 + 1e-9


def test_weights_too_small_or_multipliers_of_nothing_are_refused():
    program = MatrixSets(drawn(2, 6, 2, 2))
    answer = solved(program).answer
    smaller = FoundSets(0.999 * answer.left, answer.right, answer.centre, answer.weights)
    assert not program.certify(smaller, 1e-6).valid
    larger = FoundSets(1.01 * answer.left, answer.right, answer.centre, answer.weights)
    assert program.gap(larger)[1] >= 0.0099
    unproven = FoundSets(answer.left, answer.right, answer.centre, 0 * answer.weights)
    assert not program.certify(unproven, 1e-6, optimal=True).gap.closed


def test_the_proof_holds_for_what_it_claims():
    """A bound by any weights is below the size of any cover."""
    rng = np.random.default_rng(5)
    program = MatrixSets(drawn(1, 6, 2, 2, seed=6))
    answer = solved(program).answer
    least = np.log(program.sizes(answer))
    for _ in range(50):
        weights = answer.weights * rng.uniform(0, 2, answer.weights.shape)
        other = FoundSets(1.3 * answer.left, answer.right, answer.centre, weights)
        bound = np.log(program.sizes(other)) - program.excess(other)
        assert (bound <= least + 1e-9).all()


def test_an_answer_comes_back_from_its_dataset():
    program = MatrixSets(drawn(2, 4, 2, 3), left="full", right="diagonal", centre="free")
    answer = solved(program).answer
    back = program.from_dataset(program.to_dataset(answer))
    np.testing.assert_array_equal(back.left, answer.left)
    np.testing.assert_array_equal(back.centre, answer.centre)
    assert "sets at 2 frequencies" in repr(back)


def test_the_square_roots_are_triangular_and_of_determinant_one():
    found = solved(MatrixSets(drawn(2, 8, 2, 2))).answer
    assert np.abs(found.left[:, 0, 1]).max() == 0.0
    assert np.abs(found.right[:, 1, 0]).max() == 0.0
    np.testing.assert_allclose(np.linalg.det(found.right), 1.0, rtol=1e-12)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"deviations": drawn(3, 2, 2)}, "shape"),
        ({"deviations": np.full((1, 2, 2, 2), np.nan)}, "finite"),
        ({"deviations": np.zeros((2, 3, 2, 2))}, "zero"),
        ({"deviations": np.ones((2, 3, 2, 2)), "centre": "free"}, "are equal"),
        ({"deviations": "many"}, "numbers"),
        ({"left": "round"}, "left is 'round'"),
        ({"right": None}, "right is None"),
        ({"size": "area"}, "size is 'area'"),
        ({"centre": "mean"}, "centre is 'mean'"),
        ({"floor": 0.0}, "floor is 0.0"),
        ({"floor": 1.0}, "floor is 1.0"),
        ({"floor": "low"}, "floor"),
    ],
)
def test_bad_input_is_named(changes, words):
    with pytest.raises(InputError, match=words):
        MatrixSets(**({"deviations": drawn(1, 3, 2, 2)} | changes))


def test_a_volume_is_no_cone_program():
    with pytest.raises(InputError, match="barrier"):
        wb.solve(MatrixSets(drawn(1, 3, 2, 2)), method="clarabel")
