"""Tables in Markdown of heads and rows, and of a matrix with labels."""

import numpy as np
import xarray as xr

from workbench._core.tables import crossed, markdown_table


def test_a_matrix_has_a_row_for_each_label_of_its_first_dimension():
    values = xr.DataArray(
        [[1, 2], [3, 40]], coords={"kind": ["dot", "hair"], "found": ["dot", "missed"]}
    )
    assert markdown_table(*crossed(values)).splitlines() == [
        "| kind | dot | missed |",
        "| ---- | --: | -----: |",
        "| dot  |   1 |      2 |",
        "| hair |   3 |     40 |",
    ]
    heads, rows = crossed(values / np.array([3.0, 10.0]), "{:.1f}", "rate")
    assert heads[0] == "rate" and rows == [["dot", "0.3", "0.2"], ["hair", "1.0", "4.0"]]
