"""Upper bounds of mu: closed forms, degenerate matrices, invariances, bad input."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lanes import examples

from workbench.errors import InputError
from workbench.mu.upper.bound import MuUpperBound, upper_bound
from workbench.program import methods
from workbench.solution import solve
from workbench.solvers import Outcome
from workbench.structure import Complex, Full, Real, Structure

MIXED = Structure([Real(1), Complex(1), Full(2, 2)])
seeds = st.integers(0, 2**32 - 1)


def random_matrix(seed, *shape):
    real, imag = np.random.default_rng(seed).normal(size=(2, *shape))
    return real + 1j * imag


def bound(M, blocks, method="fast"):
    """The certified bound."""
    solution = solve(MuUpperBound(np.array(M, complex), Structure(blocks)), method=method)
    assert solution.outcome is Outcome.SOLVED, solution.message
    return solution.answer.value


def test_one_full_block_has_the_largest_singular_value():
    M = random_matrix(0, 3, 5)
    assert bound(M, [Full(5, 3)]) == pytest.approx(np.linalg.norm(M, 2), rel=1e-7)


def test_one_repeated_complex_scalar_has_the_spectral_radius():
    M = random_matrix(1, 4, 4)
    radius = np.abs(np.linalg.eigvals(M)).max()
    assert bound(M, [Complex(4)]) == pytest.approx(radius, rel=1e-6)


def test_one_repeated_real_scalar_has_the_largest_real_eigenvalue():
    M = random_matrix(2, 4, 4).real
    values = np.linalg.eigvals(M)
    expected = np.abs(values[values.imag == 0].real).max(initial=0.0)
    assert bound(M, [Real(4)]) == pytest.approx(expected, rel=1e-6)


def test_rank_one_has_a_closed_form():
    # mu(u v^H) = sum |v_i| |u_i| over complex scalars, |v_i| and |u_i| norms over full blocks.
    u, v = random_matrix(3, 2, 5)
    expected = abs(u[0] * v[0]) + abs(u[1] * v[1]) + np.linalg.norm(u[2:]) * np.linalg.norm(v[2:])
    M = np.outer(u, v.conj())
    assert bound(M, [Complex(1), Complex(1), Full(3, 3)]) == pytest.approx(expected, rel=1e-6)


@pytest.mark.parametrize(
    "number, expected", [(-3, 3), (3, 3), (2j, 0), (1 + 1j, 0), (1 + 1e-6j, 0), (0, 0)]
)
def test_a_real_scalar_meets_real_numbers_only(number, expected):
    assert bound([[number]], [Real(1)]) == pytest.approx(expected, rel=1e-9, abs=1e-7)


def test_a_block_diagonal_matrix_has_the_largest_of_its_parts():
    M = np.zeros((5, 5), complex)
    M[:2, :2], M[2:, 2:] = random_matrix(4, 2, 2), random_matrix(5, 3, 3)
    first, second = [Real(1), Complex(1)], [Full(2, 2), Real(1)]
    parts = bound(M[:2, :2], first), bound(M[2:, 2:], second)
    assert bound(M, first + second) == pytest.approx(max(parts), rel=1e-6)


@pytest.mark.parametrize("scale", [1.0, 1e-150, 1e150])
def test_a_triangular_matrix_has_its_diagonal(scale):
    M = scale * np.array([[1, 2, 3], [0, 2, 1e6], [0, 0, -1.5]])
    assert bound(M, [Complex(1)] * 3) == pytest.approx(2 * scale, rel=1e-7)


def test_an_ill_balanced_matrix_is_balanced_first():
    M = [[1, 1e12], [0, 0.5]]
    assert bound(M, [Complex(1)] * 2) == pytest.approx(1, rel=1e-7)
    assert bound(M, [Complex(1)] * 2, "ab13md") > 1e5  # a trap: what SLICOT makes of it


@pytest.mark.parametrize(
    "blocks", [[Complex(3)], [Complex(1)] * 3, [Real(3)], [Real(1), Full(2, 2)]]
)
def test_a_nilpotent_matrix_has_next_to_nothing(blocks):
    M = np.array([[0, 1, 2], [0, 0, 1], [0, 0, 0]])
    if len(blocks) == 2:
        M[1, 2] = 0  # inside the full block
    assert bound(M, blocks) < 1e-6


def test_zero_has_zero():
    answer = upper_bound(np.zeros((2, 4, 4)), MIXED)
    assert np.all(answer.value == 0)


@pytest.mark.parametrize("scale", [1e-150, 1e150])
def test_extreme_scales_scale_the_bound(scale):
    M = random_matrix(6, 4, 4)
    assert bound(scale * M, MIXED) == pytest.approx(scale * bound(M, MIXED), rel=1e-7)


def test_batches_of_any_shape():
    M = random_matrix(7, 2, 3, 4, 4)
    answer = upper_bound(M, MIXED)
    assert answer.value.shape == (2, 3)
    assert answer.G.shape == (2, 3, 4, 4)
    each = [[float(upper_bound(one, MIXED).value) for one in row] for row in M]
    assert answer.value == pytest.approx(np.array(each), rel=1e-6)
    assert upper_bound(np.zeros((0, 4, 4)), MIXED).value.shape == (0,)


@settings(derandomize=True, deadline=None, max_examples=25)
@given(seeds)
def test_the_bound_lies_between_a_lower_bound_and_the_norm(seed):
    M = random_matrix(seed, 4, 4)
    value = bound(M, MIXED)
    assert value <= np.linalg.norm(M, 2) * (1 + 1e-6)
    assert value <= bound(M, MIXED.complexified()) * (1 + 1e-6)
    rng = np.random.default_rng(seed)
    for _ in range(10):  # a Delta with I - M Delta singular is no smaller than 1 / bound
        product = np.linalg.eigvals(M @ MIXED.random(rng))
        real = product[np.abs(product.imag) < 1e-12].real
        assert np.all(real <= value)


@examples(8, 25)
@given(seeds, st.permutations(range(3)))
def test_order_and_unitary_factors_of_blocks_do_not_matter(seed, order):
    M = random_matrix(seed, 4, 4)
    places = [np.arange(4)[s] for s in MIXED.row_slices]
    permuted = np.concatenate([places[k] for k in order])
    other = [MIXED.blocks[k] for k in order]
    value = bound(M, MIXED)
    assert bound(M[np.ix_(permuted, permuted)], other) == pytest.approx(value, rel=2e-6)
    U = np.eye(4, dtype=complex)
    U[1, 1] = np.exp(1j * seed)
    U[2:, 2:] = np.linalg.qr(random_matrix(seed + 1, 2, 2))[0]
    assert bound(U @ M, MIXED) == pytest.approx(value, rel=2e-6)
    assert bound(M.conj().T, MIXED) == pytest.approx(value, rel=2e-6)
    assert bound(-M, MIXED) == pytest.approx(value, rel=2e-6)


def test_worse_answers_are_rejected():
    program = MuUpperBound(random_matrix(8, 3, 4, 4), MIXED)
    answer = upper_bound(program.M, MIXED)
    assert program.certify(answer, 1e-6).valid
    assert not program.certify(replace(answer, value=answer.value * (1 - 1e-9)), 1e-6).valid
    assert not program.certify(replace(answer, value=answer.value * np.nan), 1e-6).valid
    assert not program.certify(replace(answer, D_left=-answer.D_left), 1e-6).valid
    off = answer.G.copy()
    off[0, 1, 1] += 1  # a complex scalar has no G
    assert not program.certify(replace(answer, G=off), 1e-6).valid
    assert not program.certify(replace(answer, G=answer.G * 1j), 1e-6).valid


def test_an_answer_is_stored_and_read_back():
    program = MuUpperBound(random_matrix(9, 3, 4, 4), MIXED)
    answer = upper_bound(program.M, MIXED)
    again = program.from_dataset(program.to_dataset(answer))
    assert np.array_equal(again.value, answer.value)
    assert program.certify(again, 1e-6).valid
    assert program.metrics(answer)["largest_bound"] == answer.value.max()
    assert set(program.figures(answer)) == {"bound"}


@pytest.mark.parametrize("name", sorted(methods(MuUpperBound)))
def test_bad_input_is_named_before_any_method_hangs_on_it(name):
    M = random_matrix(10, 2, 4, 4)
    M[1, 0, 0] = np.nan
    with pytest.raises(InputError, match=r"finite.*\(1,\)"):
        upper_bound(M, MIXED, method=name)
    M[1, 0, 0] = np.inf
    with pytest.raises(InputError, match="finite"):
        upper_bound(M, MIXED, method=name)
    with pytest.raises(InputError, match=r"needs \(..., 4, 4\)"):
        upper_bound(np.ones((3, 4)), MIXED, method=name)
    with pytest.raises(InputError, match="Structure"):
        upper_bound(np.ones((2, 2)), [[-1, 0], [1, 0]], method=name)
    with pytest.raises(InputError, match="numbers"):
        upper_bound([["a"]], Structure([Real(1)]), method=name)
