"""Labelled arrays survive the file; what differs between two datasets is found and named."""

import h5py
import numpy as np
import pytest
import xarray as xr
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp

from workbench.bench.formats import netcdf
from workbench.errors import ResultError

TEXT = st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=5)
KINDS = st.sampled_from(["f8", "c16", "i8", "i4", "u1", "?", "f4", "c8"])
SHAPES = hnp.array_shapes(min_dims=0, max_dims=3, min_side=0, max_side=3)


@st.composite
def arrays(draw):
    shape = draw(SHAPES)
    if draw(st.integers(0, 4)) == 0:
        entries = draw(st.lists(TEXT, min_size=int(np.prod(shape)), max_size=int(np.prod(shape))))
        return np.array(entries, dtype=object).reshape(shape).astype(str)
    return draw(hnp.arrays(draw(KINDS), shape))


@st.composite
def datasets(draw):
    variables = {}
    for name in draw(st.lists(st.sampled_from("abcd"), unique=True)):
        array = draw(arrays())
        dims = [f"{name}{i}" for i in range(array.ndim)]
        variables[name] = (dims, array, {"units": "m", "long_name": draw(TEXT)})
    return xr.Dataset(variables, attrs={"title": draw(TEXT)})


@pytest.fixture(scope="module")
def file(tmp_path_factory):
    return tmp_path_factory.mktemp("netcdf") / "data.nc"


def through(data, file):
    netcdf.write(data, file)
    return netcdf.read(file)


@pytest.mark.cases(0)
@settings(deadline=None, max_examples=60)
@given(data=datasets())
def test_every_array_comes_back(file, data):
    back = through(data, file)
    xr.testing.assert_identical(back, data)
    assert netcdf.differences(data, back, 0.0) == []


NASTY = np.array([complex(np.nan, 1), complex(1, np.inf), complex(-np.inf, np.nan), -0.0j, 1 - 2j])


def test_a_complex_array_is_a_pair_of_real_ones_that_any_reader_knows(file):
    attrs = {"units": "V", "long_name": "response"}
    data = xr.Dataset({"z": ("f", NASTY, attrs)}, {"f": ("f", np.arange(5.0), {"units": "Hz"})})
    back = through(data, file)
    assert np.array_equal(back["z"].values.view(float), NASTY.view(float), equal_nan=True)
    assert back["z"].attrs == attrs
    with h5py.File(file) as raw:
        assert set(raw) == {"f", "z_real", "z_imag"}
        assert np.array_equal(raw["z_real"][:], NASTY.real, equal_nan=True)
        assert np.array_equal(raw["z_imag"][:], NASTY.imag, equal_nan=True)
        assert raw["z_real"].attrs["units"] == b"V"  # characters, as NetCDF has them


def test_a_complex_coordinate_comes_back(file):
    poles = np.array([1j, -1j])
    data = xr.Dataset({"gain": ("pole", [1.0, 2.0])}, {"pole": poles})
    xr.testing.assert_identical(through(data, file), data)
    with h5py.File(file) as raw:
        assert not [name for name, array in raw.items() if np.iscomplexobj(array)]


@pytest.mark.parametrize("order", [("z", "z_real"), ("z_real", "z")])
def test_a_real_array_named_like_a_part_is_not_lost(file, order):
    values = {"z": ("k", np.array([1 + 2j])), "z_real": ("k", np.array([7.0]))}
    data = xr.Dataset({name: values[name] for name in order})
    try:
        back = through(data, file)
    except ResultError as error:
        assert "z_real" in str(error)
    else:
        xr.testing.assert_identical(back, data[["z", "z_real"]])


@pytest.mark.parametrize("units", ["s", "seconds", "days", "seconds since 2000-01-01", "1", "%"])
def test_units_of_time_stay_numbers(file, units):
    data = xr.Dataset({"t": ("k", np.array([0.0, 1.5]), {"units": units})})
    xr.testing.assert_identical(through(data, file), data)


@pytest.mark.parametrize("attribute", ["scale_factor", "missing_value"])
def test_attributes_do_not_change_values(file, attribute):
    data = xr.Dataset({"x": ("k", np.array([2.0, 3.0]), {attribute: 2.0})})
    assert through(data, file)["x"].values.tolist() == [2.0, 3.0]


@pytest.mark.parametrize("share", [0.0, 0.1, 0.5, 0.9, 0.999])
def test_a_truncated_file_is_a_clear_error(file, share):
    netcdf.write(xr.Dataset({"z": ("f", NASTY), "x": ("f", np.arange(5.0))}), file)
    whole = file.read_bytes()
    file.write_bytes(whole[: int(share * len(whole))])
    with pytest.raises(ResultError, match=r"data\.nc cannot be read"):
        netcdf.read(file)


def test_a_missing_file_is_a_clear_error(tmp_path):
    with pytest.raises(ResultError, match=r"data\.nc is missing"):
        netcdf.read(tmp_path / "data.nc")


def test_half_of_a_complex_pair_is_a_clear_error(file):
    netcdf.write(xr.Dataset({"z": ("f", NASTY)}), file)
    with h5py.File(file, "a") as raw:
        del raw["z_imag"]
    with pytest.raises(ResultError, match="z_imag"):
        netcdf.read(file)


# --- differences ------------------------------------------------------------------------------


def dataset(values, name="x", dims=("k",), **coords):
    return xr.Dataset({name: (dims, np.array(values))}, coords)


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ([1.0, 2.0], [1.0, 2.0], None),
        ([1.0, 2.0], [1.0, 2.0 + 1e-10], None),
        ([1.0, 2.0], [1.0, 2.1], "x differs by 0.0476 of its largest entry"),
        ([1e-12, 1.0], [0.0, 1.0], None),
        ([0.0, 0.0], [0.0, 1e-3], "x differs by 1"),
        ([1 + 1j], [1 - 1j], "x differs by"),
        ([np.nan, 1.0], [np.nan, 1.0], None),
        ([np.nan, 1.0], [0.0, 1.0], "x differs by inf"),
        ([np.nan, 1.0], [np.inf, 1.0], "x differs by inf"),
        ([np.inf, 1.0], [-np.inf, 1.0], "x differs by inf"),
        ([np.inf, 1.0], [np.inf, 1.0], None),
        ([1, 2], [1, 3], "x differs by"),
        ([True, False], [True, True], "x differs in 1 of 2 entries"),
        (["u", "v"], ["u", "w"], "x differs in 1 of 2 entries"),
        ([1.0, 2.0], [1.0], r"x has shape (2,), not (1,)"),
        ([], [], None),
        ([1e308, -1e308], [-1e308, 1e308], "x differs by 2"),
        ([3.0], ["3"], "x differs"),
        (["3"], [3.0], "x differs"),
    ],
    ids=str,
)
def test_differences_are_found_and_named(old, new, words):
    found = netcdf.differences(dataset(old), dataset(new), 1e-9)
    assert (len(found) == 1 and words in found[0]) if words else found == []


def test_missing_and_unexpected_arrays_are_named():
    found = netcdf.differences(dataset([1.0], "a"), dataset([1.0], "b"), 1e-9)
    assert found == ["b is missing", "a is unexpected"]


def test_coordinates_count():
    one, other = dataset([1.0], k=[1.0]), dataset([1.0], k=[2.0])
    assert netcdf.differences(one, other, 1e-9) == ["k differs by 0.5 of its largest entry"]


def test_units_count():
    one, other = dataset([1.0]), dataset([1.0])
    one["x"].attrs["units"], other["x"].attrs["units"] = "Hz", "rad/s"
    (found,) = netcdf.differences(one, other, 1e-9)
    assert "x" in found and "units" in found


def test_a_complex_array_of_single_precision_stays_one_and_may_differ_by_its_rounding(file):
    exact = np.array([1.0 + 2.0j, 0.3 - 1e-30j])
    rounded = through(xr.Dataset({"z": ("t", exact.astype(np.complex64))}), file)
    assert rounded["z"].dtype == np.complex64
    eps = np.finfo(np.float32).eps
    for off, same in ((0.4 * eps, True), (1.5 * eps, False)):
        moved = xr.Dataset({"z": ("t", (exact * (1 + off)))})
        assert (netcdf.differences(moved, rounded, 1e-9) == []) == same
    assert netcdf.differences(xr.Dataset({"z": ("t", exact * (1 + 2e-9))}), _full(exact), 1e-9)


def _full(values):
    return xr.Dataset({"z": ("t", values)})
