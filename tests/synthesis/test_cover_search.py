"""The best end of several descents: the same one whatever the last bits of the start are."""

import numpy as np
import pytest
from scipy.optimize import OptimizeResult

from workbench.executor import Context
from workbench.synthesis.mu.cover_search import (
    STALLED_STEPS,
    UNSTABLE_MU,
    _descent,
    _positive_definite,
    _random_start,
    _until_stalled,
    least_of_several,
)


def two_wells(y, power):
    """Wells of depths 1 and 0.7 at -1 and 1 of the first parameter, a ridge exactly between them.

    The other parameters follow the first along a curved valley.
    """
    x, rest = y[0], y[1:] - y[0] ** 2
    value = 1.0 - 0.075 * (x + 1) ** 2 * (2 - x) + 0.5 * (x**2 - 1) ** 2 + rest @ rest
    slope = -0.075 * (2 * (x + 1) * (2 - x) - (x + 1) ** 2) + 2 * x * (x**2 - 1)
    return value, np.append(slope - 4 * x * rest.sum(), 2 * rest)


RIDGE = np.array([-0.1125, 0.1125**2, 0.1125**2])
"""The saddle between the wells, where rounding decides on which side a descent ends."""


@pytest.mark.parametrize("seed", range(20))
def test_the_best_end_does_not_hang_on_last_bits(seed):
    start = RIDGE * (1 + 1e-13 * np.random.default_rng(seed).uniform(-1, 1, 3))
    found = least_of_several(two_wells, start, Context(), "wells")
    assert two_wells(found, 8)[0] == pytest.approx(0.7, abs=1e-3)


def test_one_descent_may_end_in_the_worse_well():
    ends = {
        round(_descent(two_wells, np.array([x, 0.0, 0.0]), (8,), 300).mu, 2) for x in (-0.3, 0.3)
    }
    assert ends == {1.0, 0.7}


def test_starts_are_stable_where_there_are_any():
    def half_plane(y, power):
        return (1.0 if y[0] > 0.0 else UNSTABLE_MU), np.zeros_like(y)

    rng = np.random.default_rng(0)
    drawn = [_random_start(half_plane, np.array([0.01, 0.0]), rng) for _ in range(20)]
    assert all(y[0] > 0.0 for y in drawn) and len({y[0] for y in drawn}) == 20
    alone = np.array([-1.0, 0.0])
    assert _random_start(half_plane, alone, rng) is alone


def test_a_search_ends_where_it_no_longer_gains():
    told = _until_stalled()
    for step in range(60):  # 2e-5 in 20 steps
        told(OptimizeResult(fun=1 - 1e-6 * step))
    with pytest.raises(StopIteration):
        for _ in range(STALLED_STEPS):
            told(OptimizeResult(fun=1 - 6e-5))


def test_rounding_leaves_second_derivatives_definite():
    """Symmetric to the last bit, as the next search asks; unchanged where they were definite."""
    random = np.random.default_rng(0)
    root = random.standard_normal((5, 5)) * 10.0 ** np.arange(-6, 4, 2)
    exact = root @ root.T
    np.testing.assert_allclose(
        _positive_definite(exact), exact, rtol=1e-9, atol=1e-9 * abs(exact).max()
    )
    erred = exact - 1e-3 * abs(exact).max() * np.eye(5) + 1e-6 * random.standard_normal((5, 5))
    found = _positive_definite(erred)
    assert np.array_equal(found, found.T)
    assert (np.linalg.eigvalsh(found) > 0).all()
