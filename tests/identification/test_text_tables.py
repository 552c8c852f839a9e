"""Text files as loggers and spreadsheets write them."""

import csv
import io

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lanes import examples

from workbench.errors import InputError
from workbench.identification import read_record, read_response, read_variables
from workbench.identification.files.units import is_unit
from workbench.identification.files.variables import read_table

FILES = {
    "trailing commas": "t,u,y,\n0,1,2,\n1,3,4,\n2,5,6,\n",
    "trailing commas below a shorter head": "t,u,y\n0,1,2,\n1,3,4,\n2,5,6,\n",
    "units row": "t,u,y\ns,V,rad/s\n0,1,2\n1,3,4\n2,5,6\n",
    "units in brackets": "t [s],u [V],y (rad/s)\n0,1,2\n1,3,4\n2,5,6\n",
    "metadata": "Logger 7\nRate,1 Hz,\nDate,2024-05-01,x\n\nt,u,y\n0,1,2\n1,3,4\n2,5,6\n",
    "metadata and units": "Logger 7\nt,u,y\n[s],[V],[rad/s]\n0,1,2\n1,3,4\n2,5,6\n",
    "dates": "day,t,u,y\n2024-05-01,0,1,2\n2024-05-01,1,3,4\n2024-05-02,2,5,6\n",
    "clock": "t;u;y;at\n0;1;2;10:00:00,5\n1;3;4;10:00:01,5\n2;5;6;10:00:02,5\n",
    "decimal commas": "t;u;y\n0,0;1,0;2,0\n1,0;3,0;4,0\n2,0;5,0;6,0\n",
    "decimal commas and tabs": "t\tu\ty\n0,0\t1,0\t2,0\n1,0\t3,0\t4,0\n2,0\t5,0\t6,0\n",
    "decimal commas in quotes": 't,u,y\n"0,0","1,0","2,0"\n"1,0","3,0","4,0"\n"2,0","5,0","6,0"\n',
    "integers and decimal commas": "t;u;y\n0;1;2,0\n1;3;4,0\n2;5;6,0\n",
    "names in a comment": "# made by numpy\n# t,u,y\n0,1,2\n1,3,4\n2,5,6\n",
    "aligned": "  t      u      y\n  0.0    1.0    2.0\n  1.0    3.0    4.0\n  2.0    5.0    6.0\n",
    "names with blanks, tabs": "t\tu\ty\n0\t1\t2\n1\t3\t4\n2\t5\t6\n",
    "windows": "t,u,y\r\n0,1,2\r\n1,3,4\r\n2,5,6\r\n",
    "comments and blank lines": "t,u,y\n0,1,2\n\n   \n% pause\n1,3,4\n2,5,6\n\n",
    "quoted numbers": '"t","u","y"\n"0","1","2"\n"1","3","4"\n"2","5","6"\n',
    "one line of blanks at the end": "t,u,y\n0,1,2\n1,3,4\n2,5,6\n,,\n",
    "another column is blank": "t,u,y,z\n0,1,2,\n1,3,4,7\n2,5,6,\n",
}


@pytest.mark.parametrize("text", FILES.values(), ids=FILES)
def test_what_people_have_is_read(tmp_path, text):
    file = tmp_path / "record.csv"
    file.write_bytes(text.encode())
    data = read_record(file, "u", "y", time="t")
    np.testing.assert_array_equal(data["time"], [0, 1, 2])
    np.testing.assert_array_equal(data["u"], [[1, 3, 5]])
    np.testing.assert_array_equal(data["y"], [[2, 4, 6]])
    assert "3 samples, 1 s apart" in data.attrs["read"]


def test_what_was_found_out_is_said(tmp_path):
    file = tmp_path / "record.csv"
    file.write_text("Logger 7\n\nday;t;u\n;ms;mV\n2024-05-01;0;1,5\n2024-05-01;2;2,5\n")
    data = read_record(file, "u", "u", time="t")
    assert data.attrs["read"] == (
        "columns separated by semicolons, decimal comma, names in line 3, units below; without "
        "numbers: day; 2 samples, 0.002 s apart"
    )
    assert data["u"].attrs["units"] == "mV"
    np.testing.assert_array_equal(data["time"], [0, 0.002])


def test_quoted_names_may_contain_the_separator(tmp_path):
    file = tmp_path / "record.csv"
    file.write_text('"time, s","torque, Nm","speed"\n0,1,2\n1,3,4\n')
    assert list(read_variables(file)) == ["time, s", "torque, Nm", "speed"]


def test_names_of_windows_are_read(tmp_path):
    file = tmp_path / "record.csv"
    file.write_bytes("t [µs];Größe\n0;1\n1;2\n".encode("cp1252"))
    data = read_record(file, "Größe", "Größe", time="t")
    np.testing.assert_allclose(data["time"], [0, 1e-6])


def test_frequencies_come_in_hertz(tmp_path):
    file = tmp_path / "response.csv"
    file.write_text(f"w [rad/s],re,im\n{2 * np.pi!r},1,2\n{4 * np.pi!r},3,4\n")
    data = read_response(file, "w", ("re", "im"))
    np.testing.assert_allclose(data["frequency"], [1, 2])
    np.testing.assert_array_equal(data["response"].values.ravel(), [1 + 2j, 3 + 4j])


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("t,u\n0,1\n1,\n2,3\n", "'u' has 1 entries that are blank, NaN or infinite, .* line 3"),
        (
            "t,u,d\n0,1,2024-05-01\n1,2,2024-05-02\n",
            "line 2: '2024-05-01' is not a number \\(column 'd'",
        ),
        ("t [fathom],u\n0,1\n1,2\n", "is in 'fathom': .* cannot be converted to 's'"),
        ("t u v\n0 1\n1 2\n", "line 1 names 3 columns, 2 are needed"),
        ("a note\n0,1\n1,2\n", r"no variable 'u'; it has 1, 2 \(.*no line names them\)"),
        ("t,u\n0,1\n1,2\n2,3,4\n", "line 4: 3 columns, 2 are needed"),
        ("t,u\n0,1_000\n1,2\n", "line 2: '1_000' is not a number"),
        ("t,u\n0,inf\n1,2\n", "'u' has 1 entries"),
    ],
)
def test_bad_tables(tmp_path, text, message):
    file = tmp_path / "bad.csv"
    file.write_text(text)
    with pytest.raises(InputError, match=message):
        read_record(file, "u", "d" if "d\n" in text else "u", time="t")


def test_a_column_of_a_matrix_is_named_by_number(tmp_path):
    from scipy.io import savemat

    matrix = np.arange(12.0).reshape(6, 2)
    savemat(tmp_path / "one.mat", {"data": matrix})
    for name in ("2", "data[1]"):
        data = read_record(tmp_path / "one.mat", "1", name, dt=1 / 2.0)
        np.testing.assert_array_equal(data["y"], matrix.T[1:])
    with pytest.raises(InputError, match=r"'data' has 2 columns, no 'data\[2\]'"):
        read_record(tmp_path / "one.mat", "1", "data[2]", dt=1 / 2.0)


numbers = st.floats(allow_nan=False, allow_infinity=False)
MARKS = st.sampled_from([(",", "."), (";", "."), ("\t", "."), (";", ","), ("\t", ","), (" ", ".")])


@given(st.lists(st.tuples(numbers, numbers, numbers), min_size=1, max_size=150), MARKS)
@examples(20, 200)
def test_every_number_comes_back_to_the_bit(tmp_path_factory, rows, marks):
    mark, point = marks
    file = tmp_path_factory.mktemp("table") / "x.csv"
    lines = [mark.join(repr(x).replace(".", point) for x in row) for row in rows]
    file.write_text("\n".join([mark.join("abc"), *lines]))
    found = read_variables(file)
    assert list(found) == list("abc")
    np.testing.assert_array_equal(np.column_stack(list(found.values())), rows)


@given(st.lists(st.text(max_size=12), min_size=1, max_size=30))
@examples(50, 2000)
def test_any_text_is_read_or_refused(tmp_path_factory, lines):
    file = tmp_path_factory.mktemp("any") / "x.csv"
    file.write_text("\n".join(lines), encoding="utf-8")
    try:
        table = read_table(file)
    except InputError as error:
        assert "x.csv" in str(error)
    else:
        assert all(values.dtype == float for values in table.variables.values())


def test_python_reads_the_same(tmp_path):
    """A table of csv's own writer, read by csv's own reader and by ours."""
    rng = np.random.default_rng(0)
    stream = io.StringIO()
    writer = csv.writer(stream, quoting=csv.QUOTE_ALL)
    writer.writerows([["a", "b, c"], *rng.standard_normal((500, 2)).tolist()])
    file = tmp_path / "x.csv"
    file.write_text(stream.getvalue())
    rows = list(csv.reader(stream.getvalue().splitlines()))[1:]
    expected = np.array([[*map(float, row)] for row in rows])
    np.testing.assert_array_equal(np.column_stack(list(read_variables(file).values())), expected)


@pytest.mark.parametrize("unit", ["ms", "rad/s", "m/s^2", "kHz", "-", "µm"])
def test_units_are_known(unit):
    assert is_unit(unit)
    assert not is_unit("torque")
