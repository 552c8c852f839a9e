"""Files that are torn, mixed up or something else: each is refused in words, and none hangs."""

import gzip
import io
import re

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lanes import examples
from scipy.io import savemat
from tables import each

from workbench.errors import InputError
from workbench.identification import read_record, read_response, read_variables

HEAD = "t,u,y\n"
ROWS = [f"{k / 10},{(k * 7) % 5},{(k * 3) % 4}" for k in range(12)]
TEXT = HEAD + "\n".join(ROWS) + "\n"


def changed(row, line):
    """The text with another line in the place of one row, from 0."""
    return HEAD + "\n".join([*ROWS[:row], line, *ROWS[row + 1 :]]) + "\n"


def column(name, cells):
    """Three columns, one of which has these cells."""
    rows = [f"{k / 10},{k % 3},{cell}" for k, cell in enumerate(cells)]
    return f"t,u,{name}\n" + "\n".join(rows) + "\n"


def time(cells):
    return "t,u,y\n" + "".join(f"{cell},{k % 3},{k % 4}\n" for k, cell in enumerate(cells))


def mat(**variables):
    stream = io.BytesIO()
    savemat(stream, variables)
    return stream.getvalue()


MAT = mat(t=np.arange(9.0), u=np.arange(9.0), y=np.arange(9.0))
CASES = {
    # no table at all
    "nothing": ("", "holds no numbers"),
    "blank lines": ("\n \n\t\n", "holds no numbers"),
    "comments": ("# a\n% b\n", "holds no numbers"),
    "names alone": (HEAD, "holds no numbers"),
    "prose": ("It was a dark and stormy night.\nThe rain fell.\n", "holds no numbers"),
    "a web page": ("<html><body>404</body></html>", "holds no numbers"),
    "JSON lines": ('{"t": 0.1, "u": 2}\n{"t": 0.2, "u": 3}\n', "holds no numbers|no variable"),
    "zeros": (bytes(100), "holds no numbers"),
    "zeros within": (TEXT[:40].encode() + bytes(50) + TEXT[40:].encode(), "is no text"),
    "one number": ("1", "no variable 'u'"),
    "one long line": ("1," * 200_000, "has 200001 columns; at most 10000 are read"),
    "one long quotation": ('t,u,y\n0,1,"' + "x" * 200_000 + '"\n1,2,3\n', "no variable 'u'"),
    "compressed": (gzip.compress(TEXT.encode()), "is compressed: unpack it"),
    "an archive": (b"PK\x03\x04" + bytes(50), "is an archive"),
    "old Excel": (b"\xd0\xcf\x11\xe0" + bytes(50), "save it as .xlsx or .csv"),
    "Parquet": (b"PAR1" + bytes(50), "is Parquet"),
    "HDF5": (b"\x89HDF\r\n\x1a\n" + bytes(50), "is HDF5: name it .mat or .nc"),
    "a MAT file": (MAT, "is a MAT file: name it .mat"),
    "a PDF": (b"%PDF-1.4", "is a PDF"),
    "noise": (np.random.default_rng(0).bytes(500), "is no text|holds no numbers"),
    "half of UTF-16": (TEXT.encode("utf-16")[:31], None),
    # lines
    "a short line": (changed(5, "0.5,1"), "line 7: 2 columns, 3 are needed: complete that line"),
    "a long line": (changed(5, "0.5,1,2,3"), "line 7: 4 columns, 3 are needed"),
    "two lines in one": (changed(5, ROWS[5] + ROWS[6]), "line 7: 5 columns"),
    "a quotation that is open": (changed(5, '0.5,1,"2'), "line 7: a quotation is open at its end"),
    "an open quotation first": (changed(5, '"0.5,1,2'), "line 7: a quotation is open"),
    "names again": (changed(5, "t,u,y"), "line 7: '[tu]' is not a number"),
    "another separator": (changed(5, "0.5;1;2"), "line 7: 1 columns"),
    "decimal commas": (changed(5, "0,5,1,2"), "line 7: 4 columns"),
    "only a separator": (changed(5, ","), "line 7: 2 columns"),
    "more names": ("t u y z\n0 1 2\n1 2 3\n", "line 1 names 4 columns, 3 are needed"),
    "fewer names": ("t,u\n0,1,2\n1,2,3\n", "line 1 names 2 columns, 3 are needed: name every"),
    "decimal commas throughout": (
        "t,u,y\n0,0,1,5,2,5\n0,1,2,5,3,5\n", "if the numbers have decimal commas, separate",
    ),
    "torn after the first row": (HEAD + "0.0,1,2\n0.1,", "needs 1 rising instants"),
    "torn in the first row": (HEAD + "0.0,1", "no variable 'y'; .* without entries: y"),
    # cells
    "a word": (column("y", ["1", "2", "x", "3"]), r"line 4: 'x' is not a number \(column 'y'\)"),
    "a blank": (column("y", ["1", "2", "", "3"]), "'y' has 1 entries .* line 4: fill the gaps"),
    "#N/A": (column("y", ["1", "#N/A", "2", "3"]), "'y' has 1 entries .* line 3"),
    "#DIV/0!": (column("y", ["1", "2", "#DIV/0!", "3"]), "line 4: '#DIV/0!' is not a number"),
    "nan": (column("y", ["1", "2", "nan", "3"]), "'y' has 1 entries .* line 4"),
    "infinity": (column("y", ["1", "2", "-inf", "3"]), "'y' has 1 entries .* line 4"),
    "1_000": (column("y", ["1", "2", "1_000", "3"]), "line 4: '1_000' is not a number"),
    "1.2.3": (column("y", ["1", "2", "1.2.3", "3"]), "line 4: '1.2.3' is not a number"),
    "0x1F": (column("y", ["1", "2", "0x1F", "3"]), "line 4: '0x1F' is not a number"),
    "two units": (column("y", ["1 V", "2 V", "3 mV", "4 V"]), "line 4: '3 mV' is not a number"),
    "an unknown unit": (column("y", ["1 V", "2 V", "3 quux", "4 V"]), "line 4: '3 quux'"),
    "words": (column("y", ["RUN", "RUN", "STOP", "RUN"]), "line 2: 'RUN' is not a number"),
    "ON and 3": (column("y", ["ON", "OFF", "3", "ON"]), "line 2: 'ON' is not a number"),
    "a date": (column("y", ["2024-01-01"] * 4), "line 2: '2024-01-01' is not a number"),
    "complex": (column("y", ["1+2j", "1-2j", "3j", "4"]), r"line 2: '1\+2j' is not a number"),
    "all blank": (column("y", [""] * 4), "no variable 'y'|'y' has 4 entries"),
    "two of one name": (
        "t,u,y,y\n0,1,2,3\n1,2,3,4\n", r"'y': name one of them, 'y\[0\]', 'y\[1\]'"),
    # instants
    "falling": (time([0.0, 0.1, 0.05, 0.3]), "falls or stays at line 4: sort the rows"),
    "standing": (time([0.0, 0.1, 0.1, 0.3]), "falls or stays at line 4.*rounded, give dt"),
    "a gap": (time([0.0, 0.1, 0.2, 0.5, 0.6]), "line 5: a step of 0.3 where the usual one is 0.1"),
    "rounded": (time([0.0, 0.0003, 0.0007, 0.001]), "give dt instead"),
    "milliseconds since 1970": (time(range(1706695200000, 1706695200500, 100)), "such as t_ms"),
    "hours and minutes, or not": (time(["10:00", "10:01", "10:02"]), "write hh:mm:ss"),
    "13/13/2024": (time(["13/13/2024", "14/13/2024"]), "write it as 2024-01-31"),
    "day or month": (
        time(["01/02/2024", "02/02/2024", "03/02/2024", "04/02/2024"]), None,
    ),
    "day or month, unevenly": (
        time(["01/02/2024", "02/02/2024", "05/02/2024"]), "leaves open which is the day",
    ),
    "a torn clock": (time(["10:00:00", "10:00:01", "10:", "10:00:03"]), "line 4: '10:' is not"),
    "a falling clock": (time(["25:61:99", "25:61:98", "25:61:97"]), "falls or stays at line 3"),
    "dates and numbers": (time(["2024-01-01", "5", "2024-01-03"]), "line 3: '5'"),
    "a unit of no time": ("t [V],u,y\n0,1,2\n1,2,3\n", "'V' cannot be converted to 's'"),
    "a unit unheard of": ("t [blink],u,y\n0,1,2\n1,2,3\n", "the unit 'blink' is not known"),
    "a unit to compute": ("t [9**9**9**9],u,y\n0,1,2\n1,2,3\n", "is not known"),
    "a unit that runs": ("t [import os],u,y\n0,1,2\n1,2,3\n", "is not known"),
}  # fmt: skip


def test_there_are_sixty():
    assert len(CASES) >= 60


@each(("content", "said"), CASES.values(), ids=CASES)
def test_each_is_refused_in_words(tmp_path, content, said):
    """Those without words may be read where nothing is left open, and are if they are."""
    file = tmp_path / "torn.csv"
    file.write_bytes(content if isinstance(content, bytes) else content.encode())
    if said is None:
        try:
            read_record(file, "u", "y", time="t")
        except InputError as error:
            assert "torn.csv" in str(error)
        return
    with pytest.raises(InputError, match=said) as caught:
        read_record(file, "u", "y", time="t")
    assert "torn.csv" in str(caught.value) and len(str(caught.value)) > 30


@pytest.mark.parametrize("cut", range(0, len(MAT), 23))
def test_a_torn_mat_file(tmp_path, cut):
    file = tmp_path / "torn.mat"
    file.write_bytes(MAT[:cut])
    with pytest.raises(InputError, match=r"torn\.mat"):
        read_record(file, "u", "y", time="t")


@each("cut", range(len(HEAD), len(TEXT)))
def test_a_text_that_ends_anywhere(tmp_path, cut):
    """What is read of a torn text are whole rows of it, but for a last number that is cut."""
    file = tmp_path / "torn.csv"
    file.write_text(TEXT[:cut])
    try:
        data = read_record(file, "u", "y", time="t")
    except InputError as error:
        assert re.search(r"torn\.csv", str(error)) and cut < len(HEAD + ROWS[0] + ROWS[1]) + 3
        return
    rows = np.array([list(map(float, row.split(","))) for row in ROWS[: data.sizes["time"]]])
    np.testing.assert_array_equal(data["time"], rows[:, 0])
    np.testing.assert_array_equal(data["u"].values[0], rows[:, 1])
    np.testing.assert_array_equal(data["y"].values[0], rows[:, 2])
    whole = TEXT[:cut].count("\n") - 1
    assert whole <= data.sizes["time"] <= whole + 1
    last = TEXT[:cut].splitlines()[-1]
    torn = last.count(",") < 2 or last.endswith(",")
    assert torn == (f"the last line, {whole + 2}, is torn" in data.attrs["read"])


# Not .mat: SciPy's reader crashes on some bytes that no writer makes; torn files are tried above.
ENDINGS = st.sampled_from(["csv", "nc", "xlsx", "s1p", "s2p", "txt"])
STARTS = st.sampled_from(
    [b"", TEXT.encode(), MAT, TEXT.encode("utf-16"), b"# Hz S RI R 50\n1 2 3\n"]
)


@given(STARTS, st.integers(0, 400), st.binary(max_size=40), ENDINGS)
@examples(30, 2000)
def test_any_bytes_are_read_or_refused(tmp_path_factory, start, place, noise, ending):
    file = tmp_path_factory.mktemp("any") / f"x.{ending}"
    file.write_bytes(start[:place] + noise + start[place + len(noise) :])
    for read in (
        read_variables,
        lambda one: read_record(one, "u", "y", time="t"),
        lambda one: read_response(one, "t", ("u", "y")),
    ):
        try:
            read(file)
        except InputError as error:
            assert "x." in str(error)
