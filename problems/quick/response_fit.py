"""Rational functions from complex responses."""

from __future__ import annotations

import numpy as np

from workbench import problem
from workbench.fitting import ResponseFit

from .shapes import OMEGA, Order, Shape


@problem("quick/{shape}/response-fit", shape=("delay", "half-order"))
def response_fit(shape: Shape, order: Order = 4) -> ResponseFit:
    """A stable rational function from responses: of a delay of 1 s behind a lag, or (1 + s)^(-1/2).

    order: number of poles.
    """
    s = 1j * OMEGA
    response = np.exp(-s) / (1.0 + s) if shape == "delay" else (1.0 + s) ** -0.5
    absolute = np.ones_like(OMEGA) if shape == "delay" else None
    return ResponseFit(OMEGA, response, order, weight=absolute)
