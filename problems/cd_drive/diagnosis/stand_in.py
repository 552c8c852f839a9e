"""A stand-in for the thesis' fault filter, whose coefficients are not printed.

Figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

import numpy as np

from workbench.types import StateSpace

FILTER_CORNER = 450.0
"""Corner [Hz] of the low-pass filter 1 - F, which remains of the error behind the filter."""


def low_pass() -> StateSpace:
    """1 - F, continuous, of first order: with it, K (1 - F) has the margins of figure 8.10."""
    import control

    corner = 2 * np.pi * FILTER_CORNER
    return control.ss(-corner, corner, 1.0, 0.0)
