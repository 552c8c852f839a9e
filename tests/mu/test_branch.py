"""Branch and bound on real blocks: intervals that hold mu and are as narrow as asked."""

from types import SimpleNamespace

import numpy as np
import pytest

from workbench.errors import InputError
from workbench.mu.lower.bound import LowerBound, MuLowerBound
from workbench.mu.lower.scaling import scaled_matrices
from workbench.mu.robust.branch import branch_and_bound
from workbench.structure import Complex, Full, Real, Structure


def norms(M, structure):
    """A coarse upper bound: the largest singular value of the balanced matrices."""
    balanced, exponent = scaled_matrices(M, structure)
    return SimpleNamespace(value=np.ldexp(np.linalg.norm(balanced, 2, axis=(1, 2)), exponent))


def random(seed, structure):
    rng = np.random.default_rng(seed)
    shape = structure.columns, structure.rows
    return rng.standard_normal(shape) + 1j * rng.standard_normal(shape)


@pytest.mark.parametrize(
    "structure",
    [
        Structure([Real(1), Real(1), Real(1)]),
        Structure([Real(2), Full(2, 1)]),
        Structure([Real(1), Real(1), Full(2, 2)]),
    ],
    ids=lambda s: str(s.to_pairs()),
)
def test_the_interval_closes(structure):
    M = random(0, structure)
    interval = branch_and_bound(M, structure, upper=norms, nodes=20000)
    assert interval.gap <= 0.05
    assert interval.lower <= interval.upper
    answer = LowerBound(np.array(interval.lower), interval.Delta)
    assert MuLowerBound(M, structure).certify(answer, 1e-6).valid


def test_with_the_upper_bound_of_the_bench():
    structure = Structure([Real(1), Real(1), Complex(1)])
    interval = branch_and_bound(random(4, structure), structure)
    assert interval.gap <= 0.05
    assert interval.nodes <= 200


def test_a_known_mu_lies_inside():
    M = np.random.default_rng(1).standard_normal((3, 3))
    signs = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3), -1).reshape(-1, 3)
    values = np.linalg.eigvals(M * signs[:, None, :])
    mu = abs(values[values.imag == 0]).max()
    interval = branch_and_bound(M, Structure([Real(1)] * 3), upper=norms, tolerance=0.2)
    assert interval.lower <= mu * (1 + 1e-9)
    assert mu <= interval.upper <= 1.2 * interval.lower


def test_a_small_budget_leaves_a_valid_interval():
    structure = Structure([Real(1)] * 5)
    interval = branch_and_bound(
        random(2, structure), structure, upper=norms, nodes=50, tolerance=1e-3
    )
    assert interval.nodes <= 50 + 32
    assert 0 < interval.lower < interval.upper
    assert interval.gap > 1e-3


def test_without_real_blocks_there_is_nothing_to_cut():
    structure = Structure([Full(2, 2)])
    interval = branch_and_bound(random(3, structure), structure, upper=norms)
    assert interval.nodes == 1
    assert interval.gap == pytest.approx(0, abs=1e-9)


def test_where_mu_is_zero_the_upper_bound_falls():
    interval = branch_and_bound(
        np.array([[1 + 1j]]), Structure([Real(1)]), upper=norms, nodes=500, tolerance=0.05
    )
    assert interval.lower == 0
    assert interval.upper < 0.1
    assert np.isnan(interval.Delta).all()
    assert interval.gap == np.inf


def test_of_a_zero_matrix():
    interval = branch_and_bound(
        np.zeros((2, 2)), Structure([Real(1), Complex(1)]), upper=norms, tolerance=0.05
    )
    assert (interval.lower, interval.upper, interval.gap) == (0, 0, 0)


def test_bad_input_is_refused():
    structure = Structure([Real(2)])
    with pytest.raises(InputError, match="one matrix"):
        branch_and_bound(np.zeros((3, 2, 2)), structure, upper=norms)
    with pytest.raises(InputError, match="positive"):
        branch_and_bound(np.eye(2), structure, upper=norms, tolerance=0)
