"""The change of the upper bound with M, against differences of the bound itself."""

import numpy as np
import pytest

from workbench.mu import bound_gradient, upper_bound
from workbench.solvers import Options
from workbench.structure import Complex, Full, Real, Structure

STRUCTURES = [
    [Real(1), Complex(1), Full(2, 2)],
    [Complex(1), Complex(1), Full(1, 1)],
    [Real(2), Complex(1)],
    [Full(2, 1), Complex(2), Real(1)],
    [Full(3, 3)],
]
STEP = 1e-4


def random(rng, *shape):
    return rng.normal(size=shape) + 1j * rng.normal(size=shape)


@pytest.mark.parametrize("blocks", STRUCTURES)
def test_it_is_the_slope_of_the_bound(blocks):
    rng, structure, high = np.random.default_rng(2), Structure(blocks), Options(tolerance="high")
    M, change = random(rng, 2, 100, structure.columns, structure.rows)
    change /= np.linalg.norm(change, axis=(1, 2), keepdims=True)
    up, down = (
        upper_bound(M + sign * STEP * change, structure, options=high).value for sign in (1, -1)
    )
    gamma = bound_gradient(M, structure, upper_bound(M, structure, options=high))
    slope = np.einsum("fij,fji->f", gamma, change).real
    apart = np.abs(slope - (up - down) / (2 * STEP))
    # A few of the random matrices lie on a kink.
    assert np.quantile(apart, 0.97) < 1e-4
    assert np.median(apart) < 1e-6


def test_the_bound_is_homogeneous():
    """Along M itself the bound grows in proportion."""
    structure = Structure([Real(1), Complex(1), Full(2, 2)])
    M = random(np.random.default_rng(4), 3, 5, 4, 4)
    bound = upper_bound(M, structure)
    along = np.einsum("...ij,...ji->...", bound_gradient(M, structure, bound), M).real
    np.testing.assert_allclose(along, bound.value, rtol=1e-5)


def test_of_one_full_block_it_is_that_of_the_largest_singular_value():
    structure = Structure([Full(2, 3)])
    M = random(np.random.default_rng(6), 3, 2)
    u, _, v = np.linalg.svd(M, full_matrices=False)
    found = bound_gradient(M, structure, upper_bound(M, structure))
    np.testing.assert_allclose(found, np.outer(v[0].conj(), u[:, 0].conj()), atol=1e-9)
