"""The bound that multipliers prove: its inequality in exact rational arithmetic."""

import numpy as np
import pytest
from exact_rational import is_positive_definite, rational, real_form
from hypothesis import given, settings
from hypothesis import strategies as st
from last_bits import shaken

from workbench.certify.mu_bound import (
    SAID_ALLOWANCES,
    SAID_SHARPNESS,
    SHARPNESS,
    WIDENING,
    certified_bound,
    structured,
)
from workbench.mu import upper_bound
from workbench.structure import Complex, Full, Real, Structure

STRUCTURES = [
    Structure([Full(1, 1), Full(1, 1)]),
    Structure([Real(2), Full(2, 1)]),
    Structure([Real(1), Complex(2), Full(1, 2)]),
]


def proves(value, M, structure, multipliers):
    """Whether value^2 D_r - M^H D_l M - j (G M - M^H G^H) > 0, without any rounding."""
    D_left, D_right, G = structured(structure, *multipliers)
    M, left, right, twist = (real_form(part) for part in (M, D_left, D_right, 1j * G))
    square = rational(value) * rational(value)
    twisted = twist * M
    form = right * square - M.transpose() * left * M - twisted - twisted.transpose()
    return is_positive_definite(form)


def data(seed, structure, decades, least):
    """A matrix and multipliers, their entries over so many decades, D nearly singular or not."""
    rng = np.random.default_rng(seed)
    c, r = structure.columns, structure.rows

    def some(rows, columns):
        return rng.normal(size=(rows, columns)) + 1j * rng.normal(size=(rows, columns))

    out, into = (10 ** rng.uniform(-decades, decades, n) for n in (c, r))
    M = out[:, None] * some(c, r) * into
    blocks_left, blocks_right = np.zeros((c, c), complex), np.zeros((r, r), complex)
    for block, row, column in zip(
        structure, structure.row_slices, structure.column_slices, strict=True
    ):
        size = block.rows
        if isinstance(block, Full):
            d = 10 ** rng.uniform(-decades, decades)
            blocks_left[column, column] = d * np.eye(block.columns)
            blocks_right[row, row] = d * np.eye(size)
            continue
        vectors = np.linalg.qr(some(size, size))[0]
        values = np.geomspace(1.0, least, size) if size > 1 else np.ones(1)
        blocks_left[column, column] = blocks_right[row, row] = (vectors * values) @ vectors.conj().T
    G = some(r, c) * 10 ** rng.uniform(-decades, decades)
    return M, (blocks_left, blocks_right, G)


@settings(max_examples=60, deadline=None)
@given(
    st.integers(0, 2**31),
    st.sampled_from(STRUCTURES),
    st.sampled_from([0.0, 2.0, 6.0]),
    st.sampled_from([1.0, 1e-6, 1e-12]),
)
def test_a_bound_satisfies_its_inequality_without_rounding(seed, structure, decades, least):
    M, multipliers = data(seed, structure, decades, least)
    value = float(certified_bound(M, structure, *multipliers))
    assert value == np.inf or proves(value, M, structure, multipliers)


@pytest.mark.parametrize("structure", STRUCTURES)
@pytest.mark.parametrize("seed", range(5))
def test_a_bound_is_the_least_one_of_good_multipliers(seed, structure):
    M, multipliers = data(seed, structure, 0.0, 1.0)
    value = float(certified_bound(M, structure, *multipliers))
    assert not proves(value * (1 - 1e-9), M, structure, multipliers)


def test_nearly_singular_multipliers_are_searched_and_stay_true():
    """Rounding of the eigenvalue says nothing here; the bisection finds a bound in all cases."""
    structure, found = Structure([Complex(3)]), 0
    for seed in range(20):
        M, multipliers = data(seed, structure, 5.0, 1e-10)
        value = float(certified_bound(M, structure, *multipliers))
        assert value == np.inf or proves(value, M, structure, multipliers)
        found += value < np.inf
    assert found >= 10


def test_multipliers_that_are_not_positive_prove_nothing():
    structure = Structure([Complex(2)])
    M = np.eye(2)
    for D in (np.diag([1.0, -1.0]), np.diag([1.0, 0.0]), np.diag([1.0, np.nan])):
        assert certified_bound(M, structure, D, D, np.zeros((2, 2))) == np.inf


def test_what_is_said_is_proven_where_rounding_makes_both_search():
    """Bounds of real scalars are small beside the terms that cancel in them."""
    rng = np.random.default_rng(7)
    M = rng.normal(size=(400, 4, 4)) + 1j * rng.normal(size=(400, 4, 4))
    structure = Structure([Real(1)] * 4)
    answer = upper_bound(M, structure)
    multipliers = answer.D_left, answer.D_right, answer.G
    said = certified_bound(M, structure, *multipliers, allowances=SAID_ALLOWANCES)
    proven = certified_bound(M, structure, *multipliers)
    assert (proven <= said).all() and (said <= proven * (1 + 1e-9)).all()
    assert (said > proven).sum() > 40  # the searches differ


HARD = {
    "real": [Real(1)] * 3,
    "repeated": [Complex(2), Real(2), Full(1, 1)],
    "mixed": [Real(1), Full(2, 1), Full(1, 2)],
}


@pytest.mark.parametrize("growth", [1.0, 1e6])
@pytest.mark.parametrize("kind", ["plain", "nearly real", "sparse", "graded"])
@pytest.mark.parametrize("name", HARD)
def test_what_is_said_is_proven_and_hardly_larger_for_hard_data(name, kind, growth):
    """Also with a G that is too large by far, whose terms cancel."""
    structure, rng = Structure(HARD[name]), np.random.default_rng(11)
    M = rng.normal(size=(60, structure.columns, structure.rows)) * (1 + 0j)
    M += 1j * rng.normal(size=M.shape) * (1e-6 if kind == "nearly real" else 1.0)
    if kind == "sparse":
        M = M * (rng.uniform(size=M.shape) < 0.4)
    if kind == "graded":
        M = M * 10 ** rng.uniform(-4, 4, (60, M.shape[1], 1))
    answer = upper_bound(M, structure)
    multipliers = answer.D_left, answer.D_right, growth * answer.G
    said = certified_bound(M, structure, *multipliers, allowances=SAID_ALLOWANCES)
    proven = certified_bound(M, structure, *multipliers)
    assert (proven <= said).all()
    size = np.linalg.norm(M, 2, axis=(1, 2))
    assert (said <= proven * (1 + 1e-3) + 1e-9 * size * growth).all()


@pytest.mark.parametrize("growth", [1.0, 1e6])
@pytest.mark.parametrize("name", HARD)
def test_what_is_said_is_proven_whatever_the_last_bits_are(name, growth):
    """Another processor multiplies in another order, which changes as much as these do."""
    structure, rng = Structure(HARD[name]), np.random.default_rng(12)
    M = rng.normal(size=(20, structure.columns, structure.rows)) * (1 + 1j)
    M += 1e-3j * rng.normal(size=M.shape)
    answer = upper_bound(M, structure)
    multipliers = answer.D_left, answer.D_right, growth * answer.G
    said = certified_bound(M, structure, *multipliers, allowances=SAID_ALLOWANCES)
    bare, above = certified_bound(M, structure, *multipliers), 0
    for seed in range(40):
        proven = certified_bound(shaken(M, seed), structure, *shaken(multipliers, seed))
        assert (proven <= shaken(said, seed)).all()
        above += int((proven > bare).sum())
    assert above > 0  # what one proves and no more, another does not


def test_the_widths_at_which_searches_end_share_their_steps():
    """Every beta that the search for a said bound tries, that for a proven one must try too."""
    steps = np.log(SAID_SHARPNESS / SHARPNESS) / np.log(WIDENING)
    assert steps == round(steps) > 0


def test_a_search_needs_few_proofs(monkeypatch):
    rng = np.random.default_rng(5)
    M = rng.normal(size=(500, 4, 4)) + 1j * rng.normal(size=(500, 4, 4))
    structure = Structure([Real(1)] * 4)
    answer = upper_bound(M, structure)
    multipliers, counts = (answer.D_left, answer.D_right, answer.G), []
    eigenvalues = np.linalg.eigvalsh
    monkeypatch.setattr(np.linalg, "eigvalsh", lambda A: counts.append(len(A)) or eigenvalues(A))
    said = certified_bound(M, structure, *multipliers, allowances=SAID_ALLOWANCES)
    assert counts[0] == len(M)
    searched = max(counts[1:])
    assert searched > 40 and (said > 0).any()
    assert sum(counts[1:]) < 6 * searched
