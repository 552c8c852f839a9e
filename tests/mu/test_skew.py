"""Skewed mu: closed forms, mu itself, and perturbations checked by singular values."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from lanes import thinned

from workbench.errors import InputError, UnknownNameError
from workbench.mu import skew_bounds, upper_bound
from workbench.structure import Complex, Full, Real, Structure

STRUCTURES = [
    (Structure([Complex(1), Full(2, 3)]), [0]),
    (Structure([Real(1), Full(1, 2)]), [0]),
    (Structure([Real(1), Real(2), Complex(1), Full(2, 1)]), [0, 3]),
    (Structure([Real(1), Complex(2), Real(1)]), [1]),
    (Structure([Full(2, 2), Full(1, 2), Complex(1)]), [0, 1]),
]

IDS = [str(structure.to_pairs()) for structure, _ in STRUCTURES]


def random(seed, structure, *batch):
    rng = np.random.default_rng(seed)
    shape = (*batch, structure.columns, structure.rows)
    return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)


def check(M, structure, fixed, found):
    """Delta has the structure, fixed blocks at most 1, the others 1 / lower, and is singular."""
    for index in np.ndindex(found.lower.shape):
        lower, Delta = found.lower[index], found.Delta[index]
        assert 0 <= lower <= found.upper[index]
        if lower == 0:
            assert np.isnan(Delta).all()
            continue
        assert structure.contains(Delta)
        sizes = [
            np.linalg.norm(Delta[row, column], 2)
            for row, column in zip(structure.row_slices, structure.column_slices, strict=True)
        ]
        assert max((sizes[k] for k in fixed), default=0.0) <= 1
        varying = max(size for k, size in enumerate(sizes) if k not in fixed)
        assert varying == pytest.approx(1 / lower if lower < np.inf else 0.0)
        product = M[index] @ Delta
        least = np.linalg.svd(np.eye(len(product)) - product, compute_uv=False)[-1]
        assert least < 1e-8 * max(1, np.linalg.norm(product))


@pytest.mark.parametrize("case", thinned(STRUCTURES, 2), ids=IDS)
def test_perturbations_attain_the_lower_bound(case):
    structure, fixed = case
    M = 0.3 * random(0, structure, 6)
    found = skew_bounds(M, structure, fixed)
    check(M, structure, fixed, found)
    assert (np.isfinite(found.upper)).any()
    assert (found.lower > 0).any()


@pytest.mark.cases(1)
@pytest.mark.parametrize(("structure", "fixed"), STRUCTURES, ids=IDS)
def test_no_sample_is_worse_than_the_upper_bound(structure, fixed):
    """For given fixed blocks of size 1 a spectral radius is a lower bound of complex ones."""
    M = 0.2 * random(1, structure)
    found = skew_bounds(M, structure.complexified(), fixed)
    rng = np.random.default_rng(2)
    worst = 0.0
    for _ in range(2000):
        parts = [block.random(rng) for block in structure.complexified()]
        parts = [part / np.linalg.norm(part, 2) for part in parts]
        sized = [part if k in fixed else 0 * part for k, part in enumerate(parts)]
        closed = structure.diagonal(sized)
        free = structure.diagonal(parts) - closed
        seen = np.linalg.solve(np.eye(len(M)) - M @ closed, M) @ free
        worst = max(worst, abs(np.linalg.eigvals(seen)).max())
    assert 0.4 * found.upper < worst <= found.upper


def test_without_fixed_blocks_it_is_mu():
    structure = Structure([Real(1), Complex(1), Full(2, 2)])
    M = random(3, structure, 5)
    found = skew_bounds(M, structure, [])
    np.testing.assert_allclose(found.upper, upper_bound(M, structure).value, rtol=1e-6)
    full = Structure([Full(3, 2)])
    M = random(4, full, 5)
    found = skew_bounds(M, full, ())
    expected = np.linalg.norm(M, 2, axis=(1, 2))
    np.testing.assert_allclose(found.upper, expected, rtol=1e-6)
    np.testing.assert_allclose(found.lower, expected, rtol=1e-6)


def test_two_complex_scalars_by_the_circle_of_a_moebius_map():
    structure = Structure([Complex(1, name="held"), Complex(1)])
    M = random(5, structure, 30)
    M[:, 0, 0] *= 0.9 / abs(M[:, 0, 0])
    a = M[:, 0, 0]
    around = M[:, 0, 1] * M[:, 1, 0] / (1 - abs(a) ** 2)
    expected = abs(M[:, 1, 1] + around * a.conj()) + abs(around)
    found = skew_bounds(M, structure, "held")
    check(M, structure, [0], found)
    np.testing.assert_allclose(found.upper, expected, rtol=1e-5)
    np.testing.assert_allclose(found.lower, expected, rtol=1e-5)
    assert (found.upper >= expected * (1 - 1e-12)).all()


def test_a_fixed_real_scalar_by_its_values():
    structure = Structure([Real(1), Full(1, 1)])
    M = random(6, structure, 20)
    M[:, 0, 0] *= 0.8 / abs(M[:, 0, 0])
    delta = np.linspace(-1, 1, 20001)
    gain = M[:, 1, 1, None] + (M[:, 0, 1] * M[:, 1, 0])[:, None] * delta / (
        1 - M[:, 0, 0, None] * delta
    )
    expected = abs(gain).max(-1)
    found = skew_bounds(M, structure, 0)
    check(M, structure, [0], found)
    assert (found.upper >= expected * (1 - 1e-12)).all()
    np.testing.assert_allclose(found.lower, expected, rtol=1e-4)
    np.testing.assert_allclose(found.upper, expected, rtol=1e-4)


def test_a_varying_real_scalar_sees_real_numbers_only():
    held = Structure([Real(1), Complex(1)])
    # det = 1 - d1 m - d2 n: |1 - d1 m| <= |n| first holds at d1 = (1 - n) / m for real m
    m, n = 0.7, 0.6
    M = np.array([[m, n], [m, n]])
    found = skew_bounds(M, held, 1)
    assert found.upper == pytest.approx(m / (1 - n), rel=1e-5)
    assert found.lower == pytest.approx(m / (1 - n), rel=1e-4)
    alone = skew_bounds(np.array([[2j]]), Structure([Real(1)]), [])
    assert alone.lower == 0
    assert alone.upper < 1e-6


def test_a_rank_one_matrix():
    # det(I - u v^H Delta) = 1 - sum of v_i* u_i d_i
    structure = Structure([Complex(1)] * 5)
    u, v = random(7, Structure([Full(5, 2)]))
    share = abs(u * v)
    share, u = share / (2 * share[:3].sum()), u / (2 * share[:3].sum())
    found = skew_bounds(np.outer(u, v.conj()), structure, [0, 1, 2])
    expected = share[3:].sum() / (1 - 0.5)
    assert found.upper == pytest.approx(expected, rel=1e-5)
    assert found.lower == pytest.approx(expected, rel=1e-5)
    twice = skew_bounds(2.01 * np.outer(u, v.conj()), structure, [0, 1, 2])
    assert (twice.lower, twice.upper) == (np.inf, np.inf)
    check(2.01 * np.outer(u, v.conj()), structure, [0, 1, 2], twice)
    nearly = skew_bounds(1.999 * np.outer(u, v.conj()), structure, [0, 1, 2])
    assert nearly.upper == pytest.approx(1.999 * share[3:].sum() / (1 - 1.999 / 2), rel=1e-3)


def test_what_is_in_no_loop_cannot_be_destabilised():
    structure = Structure([Full(1, 1), Full(1, 1)])
    found = skew_bounds(np.array([[[0.5, 3.0], [0, 0]], [[0.5, 0], [3, 0]]]), structure, [0])
    assert (found.upper == 0).all()
    assert (found.lower == 0).all()
    unstable = skew_bounds(np.array([[1.5, 3.0], [0, 0]]), structure, [0])
    assert (unstable.lower, unstable.upper) == (np.inf, np.inf)
    assert unstable.Delta[1, 1] == 0


@settings(deadline=None, max_examples=15)
@given(st.integers(0, 10**6), st.floats(-6, 6), st.sampled_from(STRUCTURES))
@pytest.mark.slow
def test_is_homogeneous_in_the_varying_blocks(seed, decades, case):
    structure, fixed = case
    M = 0.2 * random(seed, structure)
    factor = np.ones(structure.rows)
    for k, row in enumerate(structure.row_slices):
        if k not in fixed:
            factor[row] = 10**decades
    one, other = skew_bounds(M, structure, fixed), skew_bounds(M * factor, structure, fixed)
    assert other.upper == pytest.approx(10**decades * one.upper, rel=1e-4)
    assert one.lower <= one.upper
    assert other.lower <= other.upper


def test_it_is_between_mu_of_the_varying_blocks_and_infinity():
    structure, fixed = STRUCTURES[4]
    M = 0.3 * random(9, structure, 20)
    found = skew_bounds(M.reshape(4, 5, *M.shape[1:]), structure, fixed)
    assert found.upper.shape == (4, 5)
    assert found.Delta.shape == (4, 5, structure.rows, structure.columns)
    assert (found.upper.ravel() >= abs(M[:, -1, -1])).all()


def test_bad_input_is_refused():
    structure = Structure(
        [Real(1, name="mass"), Complex(1, name="a"), Complex(1, name="a"), Full(1, 1)]
    )
    M = np.eye(4)
    with pytest.raises(UnknownNameError, match="mass"):
        skew_bounds(M, structure, "mas")
    with pytest.raises(InputError, match="give their number"):
        skew_bounds(M, structure, ["a"])
    with pytest.raises(InputError, match="no block 4"):
        skew_bounds(M, structure, [4])
    with pytest.raises(InputError, match="leave at least one"):
        skew_bounds(M, structure, range(4))
    with pytest.raises(InputError, match="shape"):
        skew_bounds(np.eye(3), structure, [0])
    with pytest.raises(InputError, match="not finite"):
        skew_bounds(np.full((4, 4), np.nan), structure, [0])
