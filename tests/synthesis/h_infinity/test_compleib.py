"""Sixty plants of COMPleib, named before the first of them was tried.

F. Leibfritz, COMPleib: constrained matrix-optimization problem library (2004). The collection is its
author's: this test reads the user's own copy, a folder of MAT files ``AC1.mat`` and so on, each with
the matrices that COMPleib.m returns. The environment variable names the folder.
"""

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
"""Plants of at most 20 states and a few more whose matrices stand in COMPleib.m itself."""


def test_there_are_sixty():
    assert len(set(NAMES)) == 60
