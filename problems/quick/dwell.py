"""Dwell times of switched loops."""

from __future__ import annotations

from typing import Literal

import numpy as np

from workbench import problem
from workbench.synthesis import Mode, SwitchedStability
from workbench.types import RealArray

SAMPLE = 0.1
"""Sampling time of the cart [s]."""
MASSES = (0.5, 1.0, 2.0)
"""Masses that the cart may have [kg]."""
FEEDBACK = np.array([[1.0, 1.5]])
"""Gains of the state feedback u = -K x: of the position [N/m] and of the speed [N s/m]."""
LONGEST_LOSS = 5
"""Largest number of samples in a row without a measurement."""
OSCILLATORS = {"soft": (0.1, 0.5), "stiff": (10.0, 1.0)}
"""Stiffness over mass [1/s^2] and damping over mass [1/s] of two oscillators."""
STEP = 0.5
"""Sampling time of the oscillators [s]: switches happen only at its multiples."""


@problem("quick/{loop}/dwell", loop=("oscillators", "cart"))
def dwell(loop: Literal["oscillators", "cart"]) -> SwitchedStability:
    """The shortest stay between switches for which a switched loop is proven stable.

    Loop "oscillators": two damped oscillators that take turns. Loop "cart": a cart of uncertain
    mass under sampled state feedback, whose measurements are lost for up to five samples in a row.
    """
    if loop == "oscillators":
        return SwitchedStability(
            tuple(
                Mode(name, _oscillator(*about), shortest_samples=None)
                for name, about in OSCILLATORS.items()
            )
        )
    carts = [_cart(mass) for mass in MASSES]
    return SwitchedStability(
        (
            Mode("measured", np.array([A - B @ FEEDBACK for A, B in carts]), shortest_samples=None),
            Mode(
                "lost",
                np.array([A for A, _ in carts]),
                shortest_samples=1,
                longest_samples=LONGEST_LOSS,
            ),
        )
    )


def _oscillator(stiffness: float, damping: float) -> RealArray:
    """State transition matrix of an oscillator over one STEP."""
    from scipy.linalg import expm

    A: RealArray = expm(STEP * np.array([[0.0, 1.0], [-stiffness, -damping]]))
    return A


def _cart(mass: float) -> tuple[RealArray, RealArray]:
    """State transition matrix of (position, speed) over one sample, and the input matrix of a held
    force.
    """
    A = np.array([[1.0, SAMPLE], [0.0, 1.0]])
    return A, np.array([[SAMPLE**2 / 2], [SAMPLE]]) / mass
