"""Rational fits to functions that are not rational."""

from __future__ import annotations

from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from workbench import problem
from workbench.fitting import MagnitudeFit, ResponseFit

Shape = Literal["delay", "half-order"]
SHAPES = ("delay", "half-order")
Order = Annotated[int, Field(ge=1, le=10)]
OMEGA = np.geomspace(0.05, 50.0, 60)
"""Frequencies [rad/s] of the data, for a delay of 1 s and a corner of 1 rad/s."""


@problem("quick/{shape}/magnitude-fit", shape=SHAPES)
def magnitude_fit(shape: Shape, order: Order = 3) -> MagnitudeFit:
    """A weight from magnitudes: over all delays up to 1 s from above, or of (1 + s)^(-1/2).

    order: number of poles.
    """
    if shape == "delay":  # |exp(-j omega T) - 1| for the worst T up to 1 s
        worst = np.where(np.pi > OMEGA, 2.0 * np.sin(np.minimum(OMEGA, np.pi) / 2.0), 2.0)
        return MagnitudeFit(OMEGA, worst, order, cover=True)
    return MagnitudeFit(OMEGA, np.abs(1.0 + 1j * OMEGA) ** -0.5, order)


@problem("quick/{shape}/response-fit", shape=SHAPES)
def response_fit(shape: Shape, order: Order = 4) -> ResponseFit:
    """A stable rational function from responses: of a delay of 1 s behind a lag, or (1 + s)^(-1/2).

    order: number of poles.
    """
    s = 1j * OMEGA
    response = np.exp(-s) / (1.0 + s) if shape == "delay" else (1.0 + s) ** -0.5
    absolute = np.ones_like(OMEGA) if shape == "delay" else None
    return ResponseFit(OMEGA, response, order, weight=absolute)
