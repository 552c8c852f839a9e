"""Eight matrices at a time: the arithmetic, and the same bounds as one matrix at a time."""

import numba
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from kernels import called

from workbench._core.machine_code.sums import LANES
from workbench._core.machine_code.values import of_lanes, put, square_root, where_less
from workbench.mu import MuUpperBound, upper_bound
from workbench.mu.upper import multipliers
from workbench.mu.upper.lanes import algebra, system
from workbench.mu.upper.lanes.state import Places
from workbench.mu.upper.pattern import diagonal_places, pattern_of
from workbench.structure import Complex, Full, Real, Structure


def drawn(*shape, seed=0):
    real, imaginary = np.random.default_rng(seed).normal(size=(2, *shape))
    return real + 1j * imaginary


def laid(matrices):
    """Matrices (LANES, rows, columns) as a flat array of lanes."""
    moved = np.moveaxis(matrices, 0, -1)
    return np.ascontiguousarray(np.stack([moved.real, moved.imag], axis=-2)).ravel()


def read(lanes, rows, columns):
    parts = np.moveaxis(lanes.reshape(rows, columns, 2, LANES), -1, 0)
    return parts[..., 0] + 1j * parts[..., 1]


STRUCTURES = {
    "complex": (Complex(1),) * 5,
    "real": (Real(1),) * 4,
    "full": (Full(2, 2), Full(2, 2)),
    "not square": (Full(1, 3), Complex(1), Full(2, 1), Real(1)),
    "mixed": (Real(1), Complex(1), Full(2, 2), Real(1)),
    "one": (Full(3, 3),),
}


@numba.njit
def of_values(a, b, out):
    one, other = of_lanes(a, 0), of_lanes(b, 0)
    found = (one + other) * one - other / 3.0
    found -= 2.0 * one
    put(out, 0, square_root(found * found))
    put(out, 1, where_less(one, other, one, -1.0))
    put(out, 2, 7.0)


def test_eight_values_are_a_number():
    a, b = np.random.default_rng(3).normal(size=(2, LANES))
    a[2], b[5] = np.nan, np.inf
    out = np.zeros(3 * LANES)
    of_values(a, b, out)
    found = out.reshape(3, LANES)
    np.testing.assert_allclose(found[0], np.abs((a + b) * a - b / 3 - 2 * a), rtol=1e-12)
    np.testing.assert_array_equal(found[1], np.where(a < b, a, -1.0))
    np.testing.assert_array_equal(found[2], 7.0)


@pytest.mark.cases(2)
@pytest.mark.parametrize("bad", [0.0, -1e-300, -1.0, np.inf, -np.inf, np.nan])
@pytest.mark.parametrize("n", [1, 2, 3, 4])
def test_a_factor_with_a_bad_pivot_is_told_and_spoils_no_other(n, bad):
    for at in range(n):
        S = np.broadcast_to(np.eye(n, dtype=complex), (LANES, n, n)).copy()
        S[6, at, at] = bad
        held, L = np.ones(LANES), np.zeros(2 * n * n * LANES)
        called(algebra.cholesky)(laid(S), L, n, held)
        assert held.tolist() == [1.0] * 6 + [0.0, 1.0]
        lower = np.tril(np.delete(read(L, n, n).real, 6, axis=0))
        np.testing.assert_array_equal(lower, np.broadcast_to(np.eye(n), lower.shape))


@pytest.mark.parametrize("rows", [1, 2, 3, 6])
@pytest.mark.parametrize("n", [1, 2, 3, 4, 7])
def test_a_product_with_a_triangle_is_that_of_numpy(rows, n):
    A, B = drawn(LANES, rows, n), np.tril(drawn(LANES, n, n, seed=1))
    beyond = np.triu(np.full((n, n), np.nan), 2)  # is not looked at
    out = laid(np.zeros((LANES, rows, n), complex))
    called(algebra.product_of_half)(laid(A), laid(B + beyond), out, rows, n)
    np.testing.assert_allclose(read(out, rows, n), A @ B, rtol=1e-13, atol=1e-13)


@pytest.mark.cases(1)
@pytest.mark.parametrize("name", ["real", "mixed", "not square", "complex", "full"])
def test_the_adjoint_from_a_triangle_is_that_from_all(name):
    structure = Structure(STRUCTURES[name])
    pattern = pattern_of(structure)
    c, r, q = structure.columns, structure.rows, int(pattern.skew.sum())
    parts = np.split(diagonal_places(pattern), [c, c + r, c + r + q])
    places = Places(*parts, pattern.size, c, r, q)
    M, half = drawn(LANES, c, r), np.tril(drawn(LANES, r, r, seed=2))
    half[:, range(r), range(r)] = half[:, range(r), range(r)].real
    whole, t = half + half.conj().mT, np.linspace(0.1, 2.0, LANES)
    found, expected = np.zeros((2, (pattern.size + q) * LANES))
    called(system.half_adjoint)(places, laid(M), t, laid(half), laid(M @ half), found)
    called(system.inequality_adjoint)(places, laid(M), t, laid(whole), laid(M @ whole), expected)
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-12)
    # <F(x), X> = <x, F*(X)>
    x, S, scaled = np.zeros_like(found), laid(np.zeros_like(whole)), laid(np.zeros_like(M))
    x[:] = np.random.default_rng(4).normal(size=x.size)
    called(system.inequality)(places, laid(M), t, x, scaled, S)
    inner = (read(S, r, r).conj() * whole).real.sum((1, 2))
    np.testing.assert_allclose((x * expected).reshape(-1, LANES).sum(0), inner, rtol=1e-10)


@pytest.mark.cases(1)
@pytest.mark.parametrize("n", [1, 2, 3, 4, 7])
def test_the_arithmetic_is_that_of_numpy(n):
    A, B = drawn(2, LANES, n, n + 1), drawn(LANES, n + 1, n)
    out = laid(np.zeros((LANES, n, n), complex))
    called(algebra.product)(laid(A[0]), laid(B), out, n, n + 1, n)
    np.testing.assert_allclose(read(out, n, n), A[0] @ B, rtol=1e-13, atol=1e-13)
    square, Z = drawn(LANES, n, n), drawn(LANES, n, n, seed=1)
    Z = Z + Z.conj().mT
    called(algebra.twice_hermitian_part)(laid(square), laid(Z), out, n)
    both = square @ Z
    np.testing.assert_allclose(read(out, n, n), both + both.conj().mT, rtol=1e-12, atol=1e-12)
    S = square @ square.conj().mT + np.eye(n)
    called(algebra.hermitian_product)(laid(square), laid(square), out, n, n)
    np.testing.assert_allclose(read(out, n, n), S - np.eye(n), rtol=1e-12, atol=1e-12)
    L, work, held = np.zeros_like(out), np.zeros_like(out), np.ones(LANES)
    called(algebra.cholesky)(laid(S), L, n, held)
    called(algebra.inverse_of_factored)(L, work, out, n)
    assert held.all()
    np.testing.assert_allclose(read(out, n, n) @ S, np.broadcast_to(np.eye(n), S.shape), atol=1e-10)
    S[3] -= 2 * np.linalg.eigvalsh(S[3])[0] * np.eye(n)
    called(algebra.cholesky)(laid(S), L, n, held)
    assert not held[3] and held.sum() == LANES - 1


@pytest.mark.cases(1)
@pytest.mark.parametrize("m", [1, 2, 5, 8])
def test_real_systems_are_solved(m):
    H, b = np.random.default_rng(m).normal(size=(2, LANES, m, m))
    H, b = H @ H.mT + np.eye(m), b[:, :, 0]
    x, pivots = np.zeros(m * LANES), np.zeros(m * LANES)
    lower = np.moveaxis(H, 0, -1).flatten()
    called(algebra.real_cholesky)(lower, pivots, m)
    called(algebra.real_cholesky_solve)(lower, pivots, b.T.flatten(), x, m)
    expected = np.linalg.solve(H, b[..., None])[..., 0]
    np.testing.assert_allclose(x.reshape(m, LANES).T, expected, rtol=1e-9)


def one_at_a_time(M, structure, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(multipliers, "diagonal_places", lambda pattern: None)
        return upper_bound(M, structure).value


@pytest.mark.parametrize("name", STRUCTURES)
@pytest.mark.parametrize("count", [1, 7, 8, 21])
def test_bounds_are_those_of_one_matrix_at_a_time(name, count, monkeypatch):
    structure = Structure(STRUCTURES[name])
    M = drawn(count, structure.columns, structure.rows, seed=count)
    expected = one_at_a_time(M, structure, monkeypatch)
    np.testing.assert_allclose(upper_bound(M, structure).value, expected, rtol=1e-6)


@settings(max_examples=25, deadline=None)
@given(
    st.lists(
        st.sampled_from([Real(1), Complex(1), Full(2, 2), Full(1, 2)]), min_size=1, max_size=5
    ),
    st.integers(0, 10_000),
    st.floats(-6, 6),
)
def test_bounds_of_graded_matrices_are_least(blocks, seed, decades):
    structure = Structure(tuple(blocks))
    rng = np.random.default_rng(seed)
    M = drawn(9, structure.columns, structure.rows, seed=seed)
    rows, columns = (10 ** (decades * rng.uniform(-1, 1, (9, size))) for size in M.shape[1:])
    M = rows[:, :, None] * M * columns[:, None]
    found = upper_bound(M, structure).value
    with pytest.MonkeyPatch.context() as patch:
        expected = one_at_a_time(M, structure, patch)
    assert (found <= expected * (1 + 1e-5) + 1e-12 * np.abs(M).max((1, 2))).all()


def test_paths_of_nearly_triangular_matrices_are_rarely_lost(monkeypatch):
    M = np.triu(drawn(60, 5, 5)) + 1e-8 * drawn(60, 5, 5, seed=1)
    left = []

    def counted(batch, *others):
        left.append(len(batch))
        return solve_each(batch, *others)

    solve_each = multipliers.solve_each
    monkeypatch.setattr(multipliers, "solve_each", counted)
    found = upper_bound(M, Structure((Complex(1),) * 5)).value
    assert sum(left) <= 12
    np.testing.assert_allclose(found, np.abs(np.diagonal(M, axis1=1, axis2=2)).max(1), rtol=1e-2)


@pytest.mark.cases(1)
@pytest.mark.parametrize("blocks", [(Real(1),) * 2, (Real(1),) * 3], ids=["two", "three"])
def test_no_step_of_rounding_raises_a_bound_that_was_least(blocks, monkeypatch):
    structure, rng = Structure(blocks), np.random.default_rng(77)
    real, imaginary = rng.normal(size=(2, 6000, len(blocks), len(blocks)))
    M = real + 1j * imaginary
    found, expected = upper_bound(M, structure).value, one_at_a_time(M, structure, monkeypatch)
    clear = expected > 1e-6 * np.linalg.norm(M, 2, axis=(1, 2))
    assert (found[clear] <= expected[clear] * (1 + 1e-6)).all()


def test_hard_matrices_beside_easy_ones_leave_these_alone():
    structure = Structure((Real(1), Complex(1), Real(1), Complex(1)))
    M = drawn(16, 4, 4)
    alone = upper_bound(M, structure).value
    hard = M.copy()
    hard[1] = 0.0
    hard[4] = np.triu(np.ones((4, 4)), 1)  # nilpotent
    hard[6] = np.diag([1.0, 1e-200, 1e5, 0.0])
    hard[9] *= 1e-300
    hard[10] *= 1e150
    hard[13] = 1j * np.eye(4)
    found = upper_bound(hard, structure).value
    easy = np.setdiff1d(np.arange(16), [1, 4, 6, 9, 10, 13])
    np.testing.assert_allclose(found[easy], alone[easy], rtol=1e-9)
    assert found[1] == 0.0 and found[4] <= 1e-7
    assert found[6] == pytest.approx(1e5, rel=1e-6)
    assert found[9] == pytest.approx(1e-300 * alone[9], rel=1e-6)
    assert found[10] == pytest.approx(1e150 * alone[10], rel=1e-6)
    assert found[13] == pytest.approx(1.0, rel=1e-6)


def test_an_answer_does_not_depend_on_the_size_of_its_batch():
    structure = Structure((Complex(1),) * 4)
    M = drawn(403, 4, 4)
    whole = upper_bound(M, structure).value
    parts = [upper_bound(part, structure).value for part in (M[:13], M[13:])]
    np.testing.assert_allclose(np.concatenate(parts), whole, rtol=1e-12)


def test_repeated_scalars_have_no_diagonal_multipliers():
    assert diagonal_places(pattern_of(Structure((Complex(2),)))) is None
    places = diagonal_places(pattern_of(Structure((Full(2, 1), Real(1), Complex(1), Real(1)))))
    assert places.tolist() == [*[0, 1, 2, 3], *[0, 0, 1, 2, 3], *[1, 3], *[2, 4]]


def test_certificates_hold():
    import workbench as wb

    structure = Structure((Real(1), Complex(1), Full(2, 2)))
    assert wb.solve(MuUpperBound(drawn(30, 4, 4), structure)).certificate.holds
