"""Records and responses from files; errors that name the file, line or variable."""

import numpy as np
import pytest
import xarray as xr
from scipy.io import savemat

from workbench.errors import InputError
from workbench.identification import read_record, read_response, read_variables

TABLE = np.arange(12.0).reshape(4, 3)


@pytest.mark.parametrize("mark", [",", "; ", "\t", "  "])
@pytest.mark.parametrize("header", ["", "t{0}u{0}y\n", '# a comment\n\n"t"{0}"u"{0}"y"\n'])
def test_text(tmp_path, mark, header):
    file = tmp_path / "record.csv"
    rows = [mark.join(f"{x:g}" for x in row) for row in TABLE]
    file.write_text(header.format(mark) + "\n".join(rows) + "\n", encoding="utf-8-sig")
    found = read_variables(file)
    assert list(found) == (list("tuy") if header else ["1", "2", "3"])
    np.testing.assert_array_equal(np.column_stack(list(found.values())), TABLE)


def test_a_record_of_text(tmp_path):
    file = tmp_path / "arm.dat"
    file.write_text("".join(" ".join(f"{x:e}" for x in row) + "\n" for row in TABLE))
    data = read_record(file, ["1"], ["2", "3"], dt=1 / 2.0)
    np.testing.assert_array_equal(data["u"], TABLE[:, :1].T)
    np.testing.assert_array_equal(data["y"], TABLE[:, 1:].T)
    np.testing.assert_array_equal(data["time"], [0, 0.5, 1, 1.5])
    assert data["output"].values.tolist() == ["2", "3"]


def test_a_record_of_matlab(tmp_path):
    file = tmp_path / "record.mat"
    savemat(file, {"t": np.arange(4) / 8, "u": TABLE[:, :1], "y": TABLE[:, 1:], "note": "text"})
    data = read_record(file, ["u"], ["y"], time="t")
    np.testing.assert_array_equal(data["y"], TABLE[:, 1:].T)
    assert data["output"].values.tolist() == ["y[0]", "y[1]"]
    assert data["time"].values[1] == 0.125


def test_netcdf(tmp_path):
    file = tmp_path / "record.nc"
    arrays = {"u": ("time", TABLE[:, 0]), "y": (("channel", "time"), TABLE[:, 1:].T)}
    xr.Dataset(arrays, coords={"time": np.arange(4.0)}).to_netcdf(file, engine="h5netcdf")
    data = read_record(file, ["u"], ["y"], time="time")
    np.testing.assert_array_equal(data["y"], TABLE[:, 1:].T)


def test_responses(tmp_path):
    frequency, values = np.array([1.0, 2.0, 3.0]), np.array([1 + 2j, 3j, -1])
    text, matlab = tmp_path / "g.csv", tmp_path / "g.mat"
    rows = np.column_stack([frequency, values.real, values.imag])
    np.savetxt(text, rows, delimiter=",", header="f,re,im", comments="")
    savemat(matlab, {"f": frequency, "G": values, "H": np.ones((3, 2, 2)) * 1j})
    for file, name in ((text, ("re", "im")), (matlab, "G")):
        data = read_response(file, "f", name)
        np.testing.assert_array_equal(data["response"].values[:, 0, 0], values)
        np.testing.assert_array_equal(data["frequency"], frequency)
    assert read_response(matlab, "f", "H")["response"].shape == (3, 2, 2)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("t,u\n1,2\n3,x\n", r"bad\.csv, line 3: 'x' is not a number"),
        ("1,2\n\n3,4,5\n", r"bad\.csv, line 3: 3 columns, 2 are needed"),
        ("t,u\n1,2,3\n", r"line 1 names 2 columns, 3 are needed"),
        ("t,u\n1,x\n3,4\n5,6\n", "line 2: 'x' is not a number"),
        ("t,u\n1,2\n3\n4,5\n", "line 3: 1 columns, 2 are needed"),
        ("t,u\n", "holds no numbers"),
        ("", "holds no numbers"),
        ("t,u\n1,2\nt,u\n3,4\n5,6\n", "line 3: 't' is not a number"),
    ],
)
def test_bad_text(tmp_path, text, message):
    file = tmp_path / "bad.csv"
    file.write_text(text)
    with pytest.raises(InputError, match=message):
        read_variables(file)


@pytest.mark.parametrize(
    ("name", "content", "message"),
    [
        ("a.mat", b"nonsense", r"a\.mat cannot be read as a MAT file"),
        ("a.mat", b"", "cannot be read as a MAT file"),
        ("a.nc", b"nonsense", r"a\.nc cannot be read as NetCDF"),
        ("a.csv", b"\x07\x00\xff\xfe", "is no text"),
    ],
)
def test_broken_files(tmp_path, name, content, message):
    file = tmp_path / name
    file.write_bytes(content)
    with pytest.raises(InputError, match=message):
        read_variables(file)


def test_a_broken_file_of_matlab_7_3_is_told(tmp_path):
    file = tmp_path / "new.mat"
    head = b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM"
    file.write_bytes(head + bytes(512))
    with pytest.raises(InputError, match="cannot be read as a MAT file"):
        read_variables(file)


def test_bad_records(tmp_path):
    file = tmp_path / "record.mat"
    holes = np.array([0, 1, np.nan, 3])
    savemat(file, {"u": TABLE[:, 0], "y": TABLE[:3, 1], "n": holes, "t": [0, 1, 3, 4.0], "c": 1j})
    with pytest.raises(InputError, match="no such file"):
        read_variables(tmp_path / "none.csv")
    with pytest.raises(InputError, match="no variable 'v'; it has u, y, n, t, c"):
        read_record(file, ["v"], ["y"], dt=1 / 1.0)
    with pytest.raises(InputError, match="differ in length"):
        read_record(file, ["u"], ["y"], dt=1 / 1.0)
    with pytest.raises(InputError, match="outputs differ in length"):
        read_record(file, ["u"], ["u", "y"], dt=1 / 1.0)
    with pytest.raises(InputError, match=r"'n' has 1 entries .* index 2"):
        read_record(file, ["u"], ["n"], dt=1 / 1.0)
    with pytest.raises(InputError, match="'t' is not equidistant at index 2"):
        read_record(file, ["u"], ["u"], time="t")
    with pytest.raises(InputError, match="rising instants"):
        read_record(file, ["u"], ["u"], time="y")
    with pytest.raises(InputError, match="either dt"):
        read_record(file, ["u"], ["u"])
    with pytest.raises(InputError, match="is no input"):
        read_record(file, ["c"], ["u"], dt=1 / 1.0)
    with pytest.raises(InputError, match=r"outputs is \[\]; names of variables are needed"):
        read_record(file, ["u"], [], dt=1 / 1.0)
    with pytest.raises(InputError, match="differ in shape"):
        read_response(file, "u", ("u", "y"))
    with pytest.raises(InputError, match=r"shape \(3,\), 4 frequencies"):
        read_response(file, "u", "y")


def test_without_instants_the_columns_are_named(tmp_path):
    file = tmp_path / "log.csv"
    file.write_text("t [s],u,y\n0,1,0\n1,1,0.5\n2,0,0.7\n")
    with pytest.raises(InputError, match=r"name of the time variable, one of 't \[s\]', 'u', 'y'"):
        read_record(file, inputs=["u"], outputs=["y"])
    with pytest.raises(InputError, match="not both"):
        read_record(file, inputs=["u"], outputs=["y"], dt=1.0, time="t")
