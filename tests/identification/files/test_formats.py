"""Formats other than text: MATLAB up to version 7.3, Touchstone, Excel, NetCDF."""

import io

import h5py
import numpy as np
import openpyxl
import pytest
import xarray as xr
from scipy.io import savemat
from scipy.io.matlab import MatlabOpaque
from scipy.sparse import csc_matrix
from timing import least_seconds

from workbench.collections import read_plant
from workbench.errors import InputError
from workbench.identification import read_record, read_response, read_variables
from workbench.identification.files.matlab import _of_level_5

U = np.array([1.0, -2.0, 3.0, 0.5])
HEAD_7_3 = b"MATLAB 7.3 MAT-file, Platform: GLNXA64".ljust(116) + bytes(8) + b"\x00\x02IM"


def version_7_3(file, write):
    """A file as MATLAB's save -v7.3 writes it: HDF5 behind a head of 512 bytes."""
    with h5py.File(file, "w", userblock_size=512) as stored:
        write(stored)
    with file.open("r+b") as raw:
        raw.write(HEAD_7_3)
    return file


def added(group, name, values, kind="double", **attributes):
    values = np.atleast_2d(values)
    if np.iscomplexobj(values):
        parts = np.empty(values.shape, dtype=[("real", "f8"), ("imag", "f8")])
        parts["real"], parts["imag"] = values.real, values.imag
        values = parts
    data = group.create_dataset(name, data=values.T)
    data.attrs["MATLAB_class"] = np.bytes_(kind)
    for key, value in attributes.items():
        data.attrs[key] = value
    return data


def test_matlab_7_3(tmp_path):
    def write(stored):
        added(stored, "u", U[:, None])
        added(stored, "y", np.column_stack([U, 2 * U]))
        added(stored, "G", (U + 1j * U[::-1])[:, None])
        added(stored, "on", [[1, 0, 1, 1]], "logical")
        added(stored, "note", np.frombuffer(b"abc", dtype="u1").astype("u2"), "char")
        added(stored, "nothing", np.array([0, 0], dtype="u8"), MATLAB_empty=np.uint8(1))
        log = stored.create_group("log")
        log.attrs["MATLAB_class"] = np.bytes_("struct")
        added(log, "t", np.arange(4) * 0.5)
        deep = log.create_group("signals")
        added(deep, "values", U[:, None])
        refs = stored.create_group("#refs#")
        cells = [added(refs, name, values).ref for name, values in (("a", U), ("b", 3 * U))]
        several = stored.create_dataset("runs", data=np.array([cells], dtype=h5py.ref_dtype).T)
        several.attrs["MATLAB_class"] = np.bytes_("cell")
        table = added(stored, "tt", np.zeros((1, 6), dtype="u4"), "timetable")
        table.attrs["MATLAB_object_decode"] = np.int32(3)
        sparse = stored.create_group("S")
        sparse.attrs["MATLAB_sparse"] = np.uint64(3)
        matrix = csc_matrix(np.diag([1.0, 0.0, 5.0]))
        for name, part in (("data", matrix.data), ("ir", matrix.indices), ("jc", matrix.indptr)):
            sparse.create_dataset(name, data=part)

    file = version_7_3(tmp_path / "new.mat", write)
    found = read_variables(file)
    np.testing.assert_array_equal(found["u"], U)
    np.testing.assert_array_equal(found["y"], np.column_stack([U, 2 * U]))
    np.testing.assert_array_equal(found["G"], U + 1j * U[::-1])
    np.testing.assert_array_equal(found["log.signals.values"], U)
    np.testing.assert_array_equal(found["runs[1]"], 3 * U)
    np.testing.assert_array_equal(found["S"], np.diag([1.0, 0.0, 5.0]))
    data = read_record(file, "u", "y[1]", time="log.t")
    np.testing.assert_array_equal(data["y"], [2 * U])
    for name, said in (("tt", "is an object of MATLAB, such as a time"), ("nothing", "is empty"),
                       ("note", "has no numbers")):  # fmt: skip
        with pytest.raises(InputError, match=f"'{name}' {said}"):
            read_record(file, "u", name, dt=1 / 1.0)


def test_structs_of_older_files(tmp_path):
    file = tmp_path / "old.mat"
    out = {"time": np.arange(4) * 0.1, "signals": [{"values": U}, {"values": 2 * U}]}
    savemat(file, {"out": out, "S": csc_matrix(np.eye(2)), "names": np.array(["a", "b"])})
    found = read_variables(file)
    assert set(found) == {"out.time", "out.signals[0].values", "out.signals[1].values", "S"}
    data = read_record(file, "out.signals[0].values", "out.signals[1].values", time="out.time")
    np.testing.assert_array_equal(data["y"], [2 * U])


def test_a_timetable_of_older_files_keeps_its_name():
    fields = [(name, object) for name in ("s0", "s1", "s2", "arr")]
    stored = np.array([(b"tt", b"MCOS", b"timetable", np.zeros((6, 1)))], dtype=fields)
    assert dict(_of_level_5("None", MatlabOpaque(stored), 0)) == {"tt": None}


def test_a_plant_of_version_7_3(tmp_path):
    def write(stored):
        added(stored, "A", -np.eye(2))
        added(stored, "B", np.ones((2, 2)))
        added(stored, "C", np.ones((3, 2)))

    plant = read_plant(version_7_3(tmp_path / "p.mat", write), measurements=1, controls=1)
    assert (plant.measurements, plant.controls, plant.system.nstates) == (1, 1, 2)


def test_touchstone(tmp_path):
    one = tmp_path / "one.s1p"
    one.write_text("! a probe\n# MHz S RI R 75\n1 0.5 -0.5 ! first\n2 0.25 0.1\n")
    data = read_response(one, "f", "S11")
    np.testing.assert_array_equal(data["frequency"], [1e6, 2e6])
    np.testing.assert_array_equal(data["response"].values.ravel(), [0.5 - 0.5j, 0.25 + 0.1j])
    two = tmp_path / "two.s2p"
    two.write_text("# kHz Z DB R 2\n1 0 0 20 90 40 180 0 -90\n2 0 0 20 90 40 180 0 -90\n"
                   "1 0.4 0.2 45 0.1\n")  # fmt: skip
    found = read_variables(two)
    assert list(found) == ["f", "Z11", "Z21", "Z12", "Z22"]
    expected = {"Z11": 2, "Z21": 20j, "Z12": -200, "Z22": -2j}
    for name, value in expected.items():
        np.testing.assert_allclose(found[name], [value, value], atol=1e-12)
    three = tmp_path / "three.s3p"
    three.write_text(
        "#\n1 " + "\n".join(" ".join(f"{3 * i + j} 0" for j in range(3)) for i in range(3))
    )
    assert read_variables(three)["S23"] == pytest.approx(5.0)
    np.testing.assert_array_equal(read_variables(three)["f"], [1e9])


TOUCHSTONE = {
    "version 2": ("[Version] 2.0\n# Hz S RI\n1 2 3\n", "line 1: Touchstone of version 2"),
    "torn": ("# Hz S RI\n1 2 3\n2 5\n", "5 numbers; rising frequencies .* multiples of 3"),
    "falling": ("# Hz S RI\n2 2 3\n1 5 6\n", "rising frequencies"),
    "a word": ("# Hz S RI\n1 2 x\n", "line 2: 'x' is not a finite number"),
    "infinity": ("# Hz S MA\n1 2 inf\n", "line 2: 'inf' is not a finite number"),
    "no resistance": ("# Hz S RI R -50\n1 2 3\n", "no positive resistance"),
    "nothing": ("# Hz S RI R 50\n", "0 numbers"),
}


@pytest.mark.parametrize(("text", "said"), TOUCHSTONE.values(), ids=TOUCHSTONE)
def test_bad_touchstone(tmp_path, text, said):
    file = tmp_path / "bad.s1p"
    file.write_text(text)
    with pytest.raises(InputError, match=said):
        read_variables(file)


def test_excel(tmp_path):
    book = openpyxl.Workbook()
    rows = [[0, 1, 0.1, True], [10, -2, 0.2, False], [20, 3, 0.375, True]]
    for row in (["Rig", 3], [], ["t", "u", "y", "ok"], ["ms", "V", "mm"], *rows):
        book.active.append(row)
    book.create_sheet("more")
    file = tmp_path / "log.xlsx"
    book.save(file)
    data = read_record(file, ["u", "ok"], "y", time="t")
    np.testing.assert_allclose(data["time"], [0, 0.01, 0.02])
    np.testing.assert_array_equal(data["u"], [[1, -2, 3], [1, 0, 1]])
    assert data["y"].values[0, 2] == 0.375
    assert "sheet 'Sheet', the first of 2; columns separated by tabs" in data.attrs["read"]
    file.write_bytes(file.read_bytes()[:2000])
    with pytest.raises(InputError, match="cannot be read as an Excel workbook"):
        read_variables(file)


def test_a_workbook_without_openpyxl_is_told(tmp_path, monkeypatch):
    file = tmp_path / "log.xlsx"
    openpyxl.Workbook().save(file)
    monkeypatch.setitem(__import__("sys").modules, "openpyxl", None)
    with pytest.raises(InputError, match=r'pip install "robust-workbench\[excel\]"'):
        read_variables(file)


def test_times_of_netcdf(tmp_path):
    file = tmp_path / "log.nc"
    time = np.datetime64("2024-01-31T23:00", "ns") + np.arange(4) * np.timedelta64(500, "ms")
    data = xr.Dataset({"u": ("time", U), "y": ("time", 2 * U)}, {"time": time})
    data.to_netcdf(file, engine="h5netcdf")
    assert np.diff(read_record(file, "u", "y", time="time")["time"].values) == pytest.approx(0.5)


@pytest.mark.cases(0)
def test_a_million_rows_take_about_a_second(tmp_path):
    """A second is asked; a busy machine takes twice that."""
    file = tmp_path / "long.csv"
    file.write_text("u [V],y [mm/s]\n" + "0.123456,-1.234567\n" * 1_000_000)
    read_variables(io_warmed(tmp_path))
    assert read_record(file, "u", "y", dt=1 / 1e3).sizes["time"] == 1_000_000
    assert least_seconds(lambda: read_record(file, "u", "y", dt=1 / 1e3), 2) < 2.0


def io_warmed(folder):
    """A short file, by which the libraries are imported."""
    file = folder / "short.csv"
    file.write_text(io.StringIO("u,y\n1,2\n3,4\n").getvalue())
    return file
