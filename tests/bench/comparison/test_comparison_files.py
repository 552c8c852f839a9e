"""The cells of a comparison in files that other programs read."""

import csv
import sys

import numpy as np
import pytest
from made_cells import invalid, made, nothing, solved

from workbench.bench.comparison import write_cells
from workbench.errors import InputError, ResultError


@pytest.fixture
def data():
    cells = {
        ("p", "a"): solved(0.1, message='says "1,2"\nand more'), ("p", "b"): nothing(""),
        ("q", "a"): nothing("unfit"), ("q", "b"): invalid(),
    }  # fmt: skip
    return made(cells, ("low", "middle"), sizes={"p": 7.0})


def read(path):
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_a_csv_file_has_a_row_for_every_cell(data, tmp_path):
    path = write_cells(data, tmp_path / "cells.csv")
    rows = read(path)
    assert [(row["problem"], row["method"], row["accuracy"]) for row in rows] == [
        ("p", "a", "low"), ("p", "a", "middle"), ("q", "a", "low"), ("q", "a", "middle"),
        ("q", "b", "low"), ("q", "b", "middle"),
    ]  # fmt: skip
    first, last = rows[0], rows[-1]
    assert float(first["objective"]) == 0.1 and first["message"] == 'says "1,2"\nand more'
    assert first["verdict"] == "solved" and last["verdict"] == "wrong" and last["reason"]
    assert float(first["solve [s]"]) == 0.1 and first["memory [byte]"] == "100000000.0"
    assert first["size"] == "7.0" and last["size"] == last["objective"] == ""
    assert last["command"].startswith("workbench run q --method b --tolerance middle")


def test_parquet_holds_the_same_cells_with_their_types(data, tmp_path):
    parquet = pytest.importorskip("pyarrow.parquet")
    table = parquet.read_table(write_cells(data, str(tmp_path / "cells.parquet")))
    plain = read(write_cells(data, tmp_path / "cells.csv"))
    assert table.num_rows == len(plain) == 6
    assert table.column_names == list(plain[0])
    for name in ("problem", "verdict", "command"):
        assert table[name].to_pylist() == [row[name] for row in plain]
    found = np.array(table["objective"].to_pylist(), dtype=float)
    assert found[0] == 0.1 and np.isnan(found[-1])
    assert str(table.schema.field("solve [s]").type) == "double"


def test_parquet_without_its_package_says_what_to_install(data, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(InputError, match=r"pip install 'robust-workbench\[parquet\]'"):
        write_cells(data, tmp_path / "cells.parquet")
    assert list(tmp_path.iterdir()) == []


def test_wrong_places_are_refused(data, tmp_path):
    with pytest.raises(InputError, match=r"to \.csv or \.parquet, not to 'cells\.xlsx'"):
        write_cells(data, tmp_path / "cells.xlsx")
    with pytest.raises(InputError, match=r"folder .*none.* does not exist"):
        write_cells(data, tmp_path / "none" / "cells.csv")
    with pytest.raises(ResultError, match="lacks gap"):
        write_cells(data.drop_vars("gap"), tmp_path / "cells.csv")
    assert list(tmp_path.iterdir()) == []
