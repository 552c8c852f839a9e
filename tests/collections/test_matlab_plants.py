"""Generalised plants from MATLAB files."""

import control
import numpy as np
import pytest
from scipy.io import savemat
from scipy.sparse import csc_array

from workbench.collections import read_plant
from workbench.errors import InputError

RNG = np.random.default_rng(0)
SIZES = {"A": (4, 4), "B1": (4, 2), "B2": (4, 1), "C1": (3, 4), "C2": (2, 4)}
SIZES |= {"D11": (3, 2), "D12": (3, 1), "D21": (2, 2), "D22": (2, 1)}
PARTS = {name: RNG.standard_normal(shape) for name, shape in SIZES.items()}


def whole(parts):
    B, C = np.hstack([parts["B1"], parts["B2"]]), np.vstack([parts["C1"], parts["C2"]])
    D = np.block([[parts["D11"], parts["D12"]], [parts["D21"], parts["D22"]]])
    return control.ss(parts["A"], B, C, D)


def same(plant, system, dt=0.0):
    for name in "ABCD":
        np.testing.assert_array_equal(getattr(plant.system, name), getattr(system, name))
    assert (plant.controls, plant.measurements, plant.system.dt) == (1, 2, dt)


def test_every_way_to_name_the_matrices(tmp_path):
    file = tmp_path / "plant.mat"
    savemat(file, PARTS)
    same(read_plant(file), whole(PARTS))
    others = {"B2": "B", "C2": "C"}
    savemat(file, {others.get(name, name): value for name, value in PARTS.items()})
    same(read_plant(file), whole(PARTS))
    system = whole(PARTS)
    savemat(
        file, {"A": csc_array(system.A), "B": system.B, "C": system.C, "D": system.D, "Ts": 0.1}
    )
    same(read_plant(file, measurements=2, controls=1), system, 0.1)


def test_feedthroughs_that_are_not_there_are_zero(tmp_path):
    file = tmp_path / "plant.mat"
    left = {name: value for name, value in PARTS.items() if name not in ("D11", "D22", "D21")}
    savemat(file, left | {"D11": 0.0, "D21": np.zeros((0, 0))})
    zeros = {name: np.zeros(SIZES[name]) for name in ("D11", "D22", "D21")}
    same(read_plant(file), whole(PARTS | zeros))


@pytest.mark.parametrize(
    ("change", "numbers", "message"),
    [
        ({"C1": None}, (None, None), "has no matrix C1; it has A, B1"),
        ({"B1": np.ones((3, 2))}, (None, None), r"B1 has shape \(3, 2\), A has 4 rows"),
        ({"A": np.ones((4, 3))}, (None, None), r"A has shape \(4, 3\)"),
        ({"D12": np.ones((3, 2))}, (None, None), r"D12 has shape \(3, 2\), \(3, 1\) is needed"),
        ({"C2": np.full((2, 4), np.nan)}, (None, None), "C2 is not finite"),
        ({}, (2, 1), "leave their numbers out"),
        ({"B1": None}, (None, None), "has no B1 but A, B2"),
        ({"B1": None, "B": np.ones((4, 3)), "C": np.ones((5, 4))}, (9, 1), "controller"),
    ],
)
def test_a_file_that_holds_no_plant(tmp_path, change, numbers, message):
    file = tmp_path / "plant.mat"
    savemat(file, {n: v for n, v in (PARTS | change).items() if v is not None})
    with pytest.raises(InputError, match=message):
        read_plant(file, measurements=numbers[0], controls=numbers[1])


def test_files_that_are_no_mat_files(tmp_path):
    with pytest.raises(InputError, match="no such file"):
        read_plant(tmp_path / "none.mat")
    (tmp_path / "bad.mat").write_bytes(b"nonsense")
    with pytest.raises(InputError, match="cannot be read as a MAT file"):
        read_plant(tmp_path / "bad.mat")
