"""Rational weights from magnitudes."""

from __future__ import annotations

import numpy as np

from workbench import problem
from workbench.fitting import MagnitudeFit

from .shapes import OMEGA, Order, Shape


@problem("quick/{shape}/magnitude-fit", shape=("delay", "half-order"))
def magnitude_fit(shape: Shape, order: Order = 3) -> MagnitudeFit:
    """A weight fitted to magnitudes: it covers all delays up to 1 s, or follows |1 + s|^(-1/2).

    order: number of poles.
    """
    if shape == "delay":  # |exp(-j omega T) - 1| for the worst T up to 1 s
        worst = np.where(np.pi > OMEGA, 2.0 * np.sin(np.minimum(OMEGA, np.pi) / 2.0), 2.0)
        return MagnitudeFit(OMEGA, worst, order, cover=True)
    return MagnitudeFit(OMEGA, np.abs(1.0 + 1j * OMEGA) ** -0.5, order)
