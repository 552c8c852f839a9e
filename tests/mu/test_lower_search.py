"""The search for lower bounds of mu: its parts, and that it finds what slower searches find."""

import numpy as np
import pytest
from kernels import called
from lanes import thinned
from power_iteration import power_batch

from workbench.executor import Context
from workbench.mu.lower.ascent import ascend
from workbench.mu.lower.attain import block_table
from workbench.mu.lower.edges import point_count, set_crossings, set_point, set_polynomials
from workbench.mu.lower.methods import _Search, proposals
from workbench.mu.lower.program import MuLowerBound
from workbench.mu.lower.rayleigh import LOOP, X, Y, rayleigh_step
from workbench.mu.lower.realise import workspace
from workbench.mu.lower.search import search_batch
from workbench.solvers import Options
from workbench.structure import Complex, Full, Real, Structure

MIXED = Structure([Real(2), Complex(1), Full(2, 1), Real(1)])


def random(rng, *shape):
    real, imag = rng.normal(size=(2, *shape))
    return real + 1j * imag


def structure_of_four(rng):
    """A random structure of four channels with real and complex blocks, or of one kind."""
    sizes, left = [], 4
    while left:
        sizes.append(int(rng.integers(1, left + 1)))
        left -= sizes[-1]
    kinds = [Real, Complex, lambda n: Full(n, n)]
    return Structure(kinds[rng.integers(3)](size) for size in sizes)


def thorough(M, structure):
    """Values (B,) of ascents from power iterations, and of vertices, edges and levels."""
    search = _Search(MuLowerBound(M, structure), Context(options=Options()))
    values, deltas = power_batch(search.M, search.table, *search.starts(6))
    for start in range(len(values)):
        for m in np.flatnonzero(values[start] > 0):
            value = ascend(search.M[m], search.table, deltas[start, m], values[start, m])
            search.improve(slice(m, m + 1), np.array([value]), deltas[start, m][None])
    if any(isinstance(block, Real) for block in structure):
        search.each("gain", search.from_vertices)
    return search.proposed().value


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(10))
def test_the_search_finds_what_a_hundred_times_slower_one_finds(seed):
    """On 2,000 random matrices of size 4, ten times 200."""
    rng, ratios = np.random.default_rng([4, seed]), []
    for case in range(10):
        structure = structure_of_four(rng)
        M = random(rng, 20, 4, 4)
        if case == 0:
            M = M.real + 0j
        slow, fast = thorough(M, structure), proposals(M, structure, "best").value
        ratios += list(fast[slow > 0] / slow[slow > 0])
    assert np.mean(ratios) >= 1 - 1e-5
    assert np.min(ratios) >= 0.998


@pytest.mark.parametrize("structure", [MIXED, Structure([Real(1)] * 3)], ids=["mixed", "real"])
def test_the_answer_for_a_matrix_does_not_depend_on_the_others(structure):
    M = random(np.random.default_rng(1), 6, structure.columns, structure.rows)
    together = proposals(M, structure, "best")
    for index in (0, 3, 5):
        alone = proposals(M[index : index + 1], structure, "best")
        np.testing.assert_array_equal(alone.Delta[0], together.Delta[index])


@pytest.mark.cases(1)
@pytest.mark.parametrize("n", thinned([1, 2, 4, 9], 2))
def test_a_followed_eigenvalue_converges_cubically(n):
    rng = np.random.default_rng(2)
    w, _ = workspace(block_table(Structure([Full(n, n)])), n, n)
    A = random(rng, n, n)
    values, vectors = np.linalg.eig(A)
    w[LOOP : LOOP + n, :n] = A
    start = vectors[:, 0] + 1e-2 * random(rng, n)
    left = np.linalg.inv(vectors).conj().T[:, 0]
    w[X, :n], w[Y, :n] = start, left + 1e-2 * random(rng, n)
    value = values[0] * (1 + 1e-3)
    for _ in range(3):
        value = called(rayleigh_step)(w, n, value)
    assert value == pytest.approx(values[0], rel=1e-12)
    np.testing.assert_allclose(A @ w[X, :n], value * w[X, :n], atol=1e-11)
    np.testing.assert_allclose(w[Y, :n].conj() @ A, value * w[Y, :n].conj(), atol=1e-11)


@pytest.mark.cases(0)
def test_edges_have_the_eigenvalues_that_their_determinants_show():
    rng = np.random.default_rng(3)
    structure = Structure([Real(1)] * 4)
    table, count = block_table(structure), 16
    seen = 0
    for _ in range(5):
        M = random(rng, 4, 4)
        w, _ = workspace(table, 4, 4)
        polynomials, values = np.zeros((64, 5), complex), np.zeros((2, 64), complex)
        delta, found = np.zeros((4, 4), complex), np.zeros((6, 4))
        assert called(point_count)(table) == count
        called(set_polynomials)(M, table, count, delta, polynomials, w)
        called(set_point)(table, 5, -1, 0.0, delta)
        np.testing.assert_allclose(polynomials[5], np.poly(M @ delta), rtol=1e-9)
        called(set_crossings)(table, polynomials, count, 0.0, 8.0, values, delta, found)
        for value, point, block, place in found[found[:, 0] > 0]:
            called(set_point)(table, int(point), int(block), place, delta)
            assert np.abs(np.linalg.eigvals(M @ delta) - value).min() < 0.1
            seen += 1
    assert seen > 10


def test_an_ascent_ends_where_no_neighbour_is_better():
    rng = np.random.default_rng(4)
    M = random(rng, 3, 3)
    structure = Structure([Real(1), Complex(1), Complex(1)])
    answer = proposals(M[None], structure, "best")
    best, Delta = answer.value[0], answer.Delta[0] * answer.value[0]
    for _ in range(200):
        turn = np.exp(1j * rng.normal(scale=1e-2, size=3))
        real = np.clip(Delta[0, 0].real + rng.normal(scale=1e-2), -1, 1)
        near = np.diag([real, Delta[1, 1] * turn[1], Delta[2, 2] * turn[2]])
        values = np.linalg.eigvals(M @ near)
        values = values[np.abs(values.imag) < 1e-4 * np.abs(values)]
        assert (values.real <= best * (1 + 1e-3)).all()


@pytest.mark.parametrize(
    "blocks", [[Real(1)] * 3 + [Complex(1)], [Real(1), Complex(1), Full(2, 2)]]
)
def test_ends_that_are_known_hide_no_higher_one(blocks):
    """Ascents that stop at ends of earlier ones find what they find alone, in 200 matrices."""
    structure, rng = Structure(blocks), np.random.default_rng(4)
    search = _Search(MuLowerBound(random(rng, 200, 4, 4), structure), Context(options=Options()))
    vectors, reals, moving, levels = search.varied_starts(12)
    starts = vectors, reals, moving, np.zeros_like(levels)
    together = search_batch(search.M, search.table, *starts, 100)[0]
    alone = [
        search_batch(search.M, search.table, *(each[s : s + 1] for each in starts), 100)[0]
        for s in range(12)
    ]
    np.testing.assert_allclose(together, np.max(alone, axis=0), rtol=1e-6)
