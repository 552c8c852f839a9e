"""Rational models of noisy responses, weighted by their variance."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np

from workbench import problem
from workbench.identification import RationalModelFit

OMEGA = np.geomspace(0.05, 50.0, 60)
"""Frequencies [rad/s] of the data."""
NOISE = 0.01
"""Standard deviation of the noise, relative to the response, or to a hundredth of the largest
response where that is more.
"""


@problem("textbook/{plant}/rational-model", plant=("delay", "two-masses"), slow=True)
def rational_model(
    plant: Literal["delay", "two-masses"], stable: bool = False, draw: int = 0
) -> RationalModelFit:
    """Rational model from noisy responses, its order chosen by tests of the residuals.

    Plant "delay": a lag behind a delay of 1 s, which is fitted too. Plant "two-masses": two masses
    of 1 kg with a spring of 1 N/m to the wall and one of 4 N/m between them, from the force on the
    first mass to both positions.

    stable: whether the poles must be stable. draw: seed of the noise.
    """
    s = 1j * OMEGA
    if plant == "delay":
        response = (np.exp(-s) / (1.0 + s))[:, None, None]
        more: dict[str, Any] = {"orders": (1, 2, 3), "excess": 1, "delay_bounds": (0.0, 3.0)}
    else:
        first, second = s**2 + 0.04 * s + 5.0, s**2 + 0.02 * s + 4.0
        spring = 0.02 * s + 4.0
        both = np.stack([second, spring], axis=1) / (first * second - spring**2)[:, None]
        response = both[:, :, None]
        more = {"orders": (2, 3, 4, 5, 6)}
    size = np.abs(response)
    deviation = NOISE * np.maximum(size, 0.01 * size.max(axis=0))
    parts = np.random.default_rng(draw).standard_normal((2, *response.shape))
    noisy = response + deviation * (parts[0] + 1j * parts[1]) / np.sqrt(2)
    return RationalModelFit(OMEGA, noisy, deviation**2, stable=stable, **more)
