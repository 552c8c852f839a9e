"""Uncertainty structures: sizes, converters, members."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.structure import Complex, Full, Real, Structure

BLOCKS = st.one_of(
    st.builds(Real, st.integers(1, 3)),
    st.builds(Complex, st.integers(1, 3)),
    st.builds(Full, st.integers(1, 3), st.integers(1, 3)),
)
STRUCTURES = st.builds(Structure, st.lists(BLOCKS, min_size=1, max_size=4))
MIXED = Structure([Real(2, name="k"), Full(2, 3), Complex(1)])


def test_sizes_and_slices():
    assert (MIXED.rows, MIXED.columns) == (5, 6)
    assert MIXED.row_slices == (slice(0, 2), slice(2, 4), slice(4, 5))
    assert MIXED.column_slices == (slice(0, 2), slice(2, 5), slice(5, 6))
    assert len(MIXED) == 3
    assert [block.name for block in MIXED] == ["k", "", ""]


def test_pairs_mean_what_they_mean_elsewhere():
    pairs = [[-2, 0], [3, 0], [2, 4], [1, 1], [-1, 1], [-1, 0]]
    blocks = (Real(2), Complex(3), Full(2, 4), Full(1, 1), Real(1), Real(1))
    assert Structure.from_pairs(pairs).blocks == blocks
    assert Structure.from_pairs(np.array(pairs)).blocks == blocks
    assert MIXED.to_pairs() == [(-2, 0), (2, 3), (1, 0)]


@given(STRUCTURES)
@settings(derandomize=True, deadline=None, max_examples=50)
def test_pairs_go_both_ways(structure):
    assert Structure.from_pairs(structure.to_pairs()) == structure


@given(STRUCTURES, st.integers(0, 2**32 - 1))
@settings(derandomize=True, deadline=None, max_examples=50)
def test_random_members(structure, seed):
    delta = structure.random(np.random.default_rng(seed))
    assert delta.shape == (structure.rows, structure.columns)
    assert np.linalg.norm(delta, 2) == pytest.approx(1.0)
    assert structure.contains(delta)
    assert structure.complexified().contains(delta)
    structure.check(delta.T)
    assert structure.contains(1e9 * delta)
    assert structure.contains(0 * delta)


@pytest.mark.parametrize(
    "place, value", [((0, 1), 0.1), ((0, 0), 0.1), ((0, 3), 0.1), ((1, 1), 1e-3j)]
)
def test_what_is_no_member(place, value):
    delta = np.diag([1.0, 1.0, 0.5, 0.5, 0.5]).astype(complex)
    structure = Structure([Real(2), Complex(3)])
    assert structure.contains(delta)
    delta[place] += value
    assert not structure.contains(delta)
    assert structure.contains(delta, rounding=0.2)


def test_complexified_and_performance():
    structure = MIXED.complexified().with_performance(performance=3, exogenous=1)
    assert structure.blocks == (
        Complex(2, name="k"),
        Full(2, 3),
        Complex(1),
        Full(1, 3, name="performance"),
    )
    assert (structure.rows, structure.columns) == (MIXED.rows + 1, MIXED.columns + 3)


def test_check_takes_a_batch():
    MIXED.check(np.zeros((7, 6, 5)))
    with pytest.raises(InputError, match=r"\(\.\.\., 6, 5\)"):
        MIXED.check(np.zeros((5, 6)))
    with pytest.raises(InputError, match="M maps"):
        MIXED.check(np.zeros(6))


@pytest.mark.parametrize("size", [0, -1, 1.0, True, "2", None])
def test_bad_sizes(size):
    for make in (Real, Complex, lambda n: Full(n, 1), lambda n: Full(1, n)):
        with pytest.raises(InputError, match="integer of at least 1"):
            make(size)


@pytest.mark.parametrize(
    "pair", [[0, 0], [-1, 2], [-2, 1], [1, -1], [2], [1, 0, 0], 3, [1.0, 0], "10", [0, 1]]
)
def test_bad_pairs(pair):
    with pytest.raises(InputError, match="no row of a structure"):
        Structure.from_pairs([pair])


def test_bad_structures():
    with pytest.raises(InputError, match="no blocks"):
        Structure([])
    with pytest.raises(InputError, match="from_pairs"):
        Structure([(1, 0)])
    with pytest.raises(InputError, match="delta has shape"):
        MIXED.contains(np.zeros((6, 5)))
