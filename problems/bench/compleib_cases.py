"""Cases of COMPleib for controllers of an order, named before the first of them was run.

F. Leibfritz, COMPleib: constrained matrix-optimization problem library (2004). The collection
belongs to its author: only names of plants and published norms are listed here, and the matrices
come from the user's own copy. Each case is a plant and an order; all plants are continuous-time.

The published norms were written down from memory of the papers' tables, before the first run. The
papers were identified again, but no copy of their tables was at hand. Look up a number in its paper
if it matters to you. For other plants HIFOO (J. V. Burke, D. Henrion, A. S. Lewis, M. L. Overton,
HIFOO, a Matlab package for fixed-order controller design and H-infinity optimization, IFAC
Symposium on Robust Control Design (2006)) was run as an independent reference.
"""

from __future__ import annotations

TRAN_DINH = {
    "AC2": 0.1115, "AC3": 3.5053, "AC6": 4.1140, "AC7": 0.0651, "AC8": 2.0050, "AC9": 1.0048,
    "AC11": 3.0104, "AC12": 0.3160, "AC15": 15.1995, "AC16": 14.9881, "AC17": 6.6124,
    "HE1": 0.1540, "HE2": 4.4931, "HE3": 0.8545, "HE4": 22.8713, "HE5": 8.8952,
    "REA1": 0.8815, "REA2": 1.1881, "REA3": 74.2513,
    "DIS1": 4.1716, "DIS2": 1.0548, "DIS3": 1.0816, "DIS4": 0.7465,
    "TG1": 12.8462, "AGS": 8.1732, "WEC2": 4.2726, "WEC3": 4.4497, "BDT1": 0.2664,
    "MFP": 31.5899, "IH": 1.1858, "CSE1": 0.0201, "PSM": 0.9202,
    "EB1": 3.1225, "EB2": 2.0201, "EB3": 2.0575, "EB4": 2.0563,
    "NN1": 13.8782, "NN2": 2.2216, "NN4": 1.3627, "NN8": 2.8871, "NN9": 28.9083,
    "NN11": 0.0912, "NN15": 0.1039, "NN16": 0.9557, "NN17": 11.2182,
}  # fmt: skip
"""Least norms of static gains: the best of HIFOO, PENBMI and the authors' own method.

For AC9 and EB1 to EB3 the norm is HIFOO's. The lower norms that were listed here before the first
run are below what controllers of any order can reach. HIFOO, run as below for 20 s, confirms the
norm of HE5 (8.89516); in 12 s it reached 0.320062 for AC12.

Q. Tran Dinh, S. Gumussoy, W. Michiels, M. Diehl, Combining convex-concave decompositions and
linearization approaches for solving BMIs, with application to static output feedback, IEEE Trans.
Automatic Control 57 (2012) 1377-1390.
"""

APKARIAN_NOLL = {("AC10", 0): 13.11, ("AC10", 1): 10.21, ("BDT2", 0): 0.8364, ("HF1", 0): 0.447}
"""Least norms by plant and order. That of HF1 is rounded: no controller reaches less than 0.4472.

P. Apkarian, D. Noll, Nonsmooth H-infinity synthesis, IEEE Trans. Automatic Control 51 (2006) 71-86.
"""

HIFOO = {
    ("AC5", 0): 680.151, ("AC18", 0): 13.3885, ("TF1", 0): 0.321473, ("TF2", 0): 5200.0,
    ("TF3", 0): 1.03681, ("TMD", 0): 2.53759, ("DLR1", 0): 2.77729, ("NN13", 0): 26.1431,
    ("NN14", 0): 21.4713, ("HF2D10", 0): 79908.6, ("HF2D16", 0): 444364.0,
    ("HE1", 1): 0.123709, ("NN2", 1): 1.76505, ("NN17", 1): 5.36141, ("REA2", 1): 1.16712,
    ("HE2", 2): 2.49592, ("NN8", 2): 2.36707,
}  # fmt: skip
"""Norms of the controllers that HIFOO 3.501 found, by plant and order. It ran in GNU Octave 7.3 for
at most 5 s of processor time each, and 12 s for AC5, AC18 and TF1.

They are no published numbers, and a longer run may find lower ones. HIFOO found no stabilising gain
for FS and REA4.
"""

ZERO = {"AC1": 0.0, "UWV": 0.0}
"""Plants whose least norm is zero: larger gains suppress the disturbance ever more. For UWV, HIFOO
reached 5e-8.
"""

UNPUBLISHED = {
    0: (
        *("AC4", "AC5", "AC18", "TF1", "TF2", "DIS5", "WEC1", "TMD", "FS", "NN13", "NN14", "CM1"),
        *("HF2D10", "HF2D11", "HF2D14", "HF2D16", "HF2D_CD5", "HF2D_IS5", "HF2D_IS7"),
        *("UWV", "DLR1", "TF3", "REA4", "HE6"),
    ),
    1: ("AC4", "AC17", "HE1", "HE5", "REA2", "NN1", "NN2", "NN9", "NN15", "NN17", "EB1"),
    2: ("AC7", "HE2", "REA3", "MFP", "NN3", "NN8"),
    3: ("AC8", "HE1", "REA1", "TG1"),
}
"""Plants, by order, without a published norm at hand. They are compared with the lower bound for
any order, and those in HIFOO with its norm.
"""

STABLE = {1: ("AC4", "HE2", "NN1", "NN2", "REA1"), 2: ("AC8", "NN8", "DIS2")}
"""Plants, by order of the controller, whose controller must itself be stable."""
