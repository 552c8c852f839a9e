"""The study of fixed-order controllers on a folder that has one plant."""

import numpy as np
import pytest
import xarray as xr
from scipy.io import savemat

import workbench as wb
from problems.bench.compleib import CASES, PUBLISHED, Compleib, largest, share_near


def test_cases_are_many_and_different():
    assert len(set(CASES)) == len(CASES) >= 60
    assert len(PUBLISHED) >= 40


def test_a_folder_with_one_plant(tmp_path):
    parts = {"A": [[1.0]], "B1": [[1.0, 0.0]], "B": [[1.0]], "C1": [[1.0], [0.0]], "C": [[1.0]],
             "D12": [[0.0], [1.0]], "D21": [[0.0, 1.0]]}  # fmt: skip
    savemat(tmp_path / f"{CASES[0][0]}.mat", parts)
    answer = wb.solve(Compleib(str(tmp_path), ("bfgs",), 30.0, 2)).answer
    assert answer["norm"].values[0, 0] == pytest.approx(1 + np.sqrt(3), rel=1e-2)
    assert answer["full"].values[0] == pytest.approx(1 + np.sqrt(3), rel=1e-2)
    assert np.isnan(answer["norm"].values[1, 0])


def test_no_folder():
    solution = wb.solve(Compleib("there is none", ("bfgs",), 1.0, 1))
    assert solution.answer is None
    assert "name the folder with your MAT files" in solution.message


def test_shares():
    norm = xr.DataArray([[1.0], [1.004], [1.1], [np.nan], [5e-4], [9.0]])
    published = xr.DataArray([1.0, 1.0, 1.0, 1.0, 0.0, np.nan])
    assert share_near(norm, published, 5e-3) == pytest.approx(3 / 5)
    assert share_near(norm, published, 0.2) == pytest.approx(4 / 5)
    levels = np.array([[np.nan, 1.0], [np.nan, np.nan], [2.0, 1.0]])
    assert largest(levels).tolist()[::2] == [1.0, 2.0]
    assert np.isnan(largest(levels)[1])
