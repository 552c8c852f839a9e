"""The stand-in of the thesis' fault filter, whose coefficients are not printed.

Figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

import numpy as np

from workbench.heavy_types import StateSpace

CORNER = 450.0
"""Of the low-pass that the filter leaves of the error [Hz]."""


def low_pass() -> StateSpace:
    """1 - F (continuous, first order): K (1 - F) has the margins of figure 8.10 with it."""
    import control

    corner = 2 * np.pi * CORNER
    return control.ss(-corner, corner, 1.0, 0.0)
