"""Bounds in single precision stay bounds."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from workbench._core.arrays import single_precision_bounds


@given(arrays(float, (3, 2, 4), elements=st.floats(allow_nan=True, allow_infinity=True)))
def test_bounds_are_rounded_outward_by_one_spacing_at_most(bounds):
    found = single_precision_bounds(bounds)
    assert found.dtype == np.float32
    wide = found.astype(float)
    known = ~np.isnan(bounds)
    np.testing.assert_array_equal(np.isnan(wide), ~known)
    assert np.all((wide <= bounds)[:, 0] | ~known[:, 0])
    assert np.all((wide >= bounds)[:, 1] | ~known[:, 1])
    normal = (np.abs(bounds) < 3e38) & (np.abs(bounds) > 1e-37)
    off = np.abs(wide[normal] - bounds[normal]) / np.abs(bounds[normal])
    assert np.all(off <= np.finfo(np.float32).eps)


def test_what_single_precision_has_stays_as_it_is():
    bounds = np.array([[0.5, -np.inf, 0.0], [0.75, np.inf, 3.0]])
    np.testing.assert_array_equal(single_precision_bounds(bounds), bounds)
