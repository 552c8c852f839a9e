"""Sixty plants of COMPleib, named before the first of them was tried.

F. Leibfritz, COMPleib: constrained matrix-optimization problem library (2004). The collection is
its author's, so the test reads the user's own copy: a folder of MAT files ``AC1.mat`` and so on,
each with the matrices that COMPleib.m returns. An environment variable names the folder.
"""

import os
from pathlib import Path

import pytest

from workbench import solve
from workbench.collections import read_plant
from workbench.synthesis import HinfSynthesis, regularise
from workbench.synthesis.h_infinity.assumptions import checked
from workbench.systems.standard_plant import standard_plant

FOLDER = "COMPLEIB"
"""Environment variable with the folder of MAT files."""

NAMES = (
    *("AC1", "AC2", "AC3", "AC4", "AC5", "AC6", "AC7", "AC8", "AC9", "AC11", "AC12", "AC15"),
    *("AC16", "AC17", "HE1", "HE2", "HE3", "HE4", "HE5", "REA1", "REA2", "REA3"),
    *("DIS1", "DIS2", "DIS3", "DIS4", "DIS5", "TG1", "AGS", "WEC1", "WEC2", "WEC3"),
    *("BDT1", "MFP", "UWV", "EB1", "EB2", "EB3", "EB4", "PAS", "TF1", "TF2", "TF3", "PSM"),
    *("NN1", "NN2", "NN3", "NN4", "NN5", "NN6", "NN7", "NN8", "NN9", "NN10", "NN11", "NN12"),
    *("NN13", "NN14", "NN15", "NN16"),
)
"""Plants of at most 20 states whose matrices stand in COMPleib.m itself."""

PUBLISHED = {"AC2": 0.1115, "AC3": 2.97, "AC6": 3.43, "HE2": 2.42, "REA1": 0.862, "NN8": 2.36}
"""Least norms of controllers of full order, by the inequalities of Gahinet and Apkarian."""


def test_there_are_sixty():
    assert len(set(NAMES)) == 60


@pytest.fixture
def folder():
    if FOLDER not in os.environ:
        pytest.skip(f"{FOLDER} names no folder with MAT files of COMPleib")
    return Path(os.environ[FOLDER])


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
def test_a_plant_has_a_certified_controller(folder, name):
    solution = solve(HinfSynthesis(read_plant(folder / f"{name}.mat")))
    assert solution.certificate.holds, solution.certificate.failures
    if name in PUBLISHED:
        assert solution.answer.norm == pytest.approx(PUBLISHED[name], rel=3e-3)


@pytest.mark.slow
@pytest.mark.parametrize("name", NAMES)
@pytest.mark.parametrize("size", [1e-2, 1e-4])
def test_a_plant_is_made_regular(folder, name, size):
    regular = regularise(read_plant(folder / f"{name}.mat"), size)
    checked(standard_plant(regular))
    assert solve(HinfSynthesis(regular)).certificate.holds
