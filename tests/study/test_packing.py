"""Datasets by label, packed_datasets into a few variables and back."""

import numpy as np
import pytest
import xarray as xr
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes

from workbench.errors import InputError
from workbench.study.packing import packed_datasets, unpacked_datasets

LABELS = st.lists(st.text("ab 1", min_size=1), min_size=1, max_size=4, unique=True)


@pytest.mark.cases(0)
@given(LABELS, st.data())
def test_what_is_packed_comes_back(labels, data):
    every = {}
    for label in labels:
        shape = data.draw(array_shapes(min_dims=2, max_dims=2, min_side=0, max_side=3))
        some = {"p_scalar": ((), 1.5, {"units": "s"}), "p_words": ("word", ["x", "longer"])}
        if data.draw(st.booleans()):
            some["p_matrix"] = (("row", "column"), np.arange(np.prod(shape)).reshape(shape))
        every[label] = xr.Dataset(some)
    again = unpacked_datasets("p", xr.Dataset(packed_datasets("p", every)))
    assert list(again) == labels
    for label in labels:
        xr.testing.assert_equal(again[label], every[label])
    assert all(one["p_scalar"].attrs["units"] == "s" for one in again.values())


def test_sizes_that_do_not_fit_are_named():
    stored = xr.Dataset(packed_datasets("p", {"a": xr.Dataset({"p_x": ("place", [1.0, 2.0])})}))
    for sizes in ([[3, 3]], [[2, 1]], [[1, 1]], [[-1, -1]], [[2, -2]]):
        spoilt = stored.assign(p_x_shape=(stored["p_x_shape"].dims, sizes))
        with pytest.raises(InputError, match="'p_x_shape' does not say how 2 entries of 'p_x' lie"):
            unpacked_datasets("p", spoilt)
    apart = {"a": xr.Dataset({"p_x": ("place", [1.0])}), "b": xr.Dataset({"p_x": ((), 1.0)})}
    with pytest.raises(InputError, match="'p_x' of 'b' has the dimensions"):
        packed_datasets("p", apart)
    assert unpacked_datasets("q", stored) == {}
