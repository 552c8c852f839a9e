"""The gain of a controller with which two channels of a loop have the same peak.

Source: E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003), section 6.3.2.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.optimize import brentq

from workbench.mu import performance_peak
from workbench.systems.generalised_plant import GeneralisedPlant

LARGEST_GAIN = 30.0
"""Largest factor on the controller that is tried; the least one is 1."""
COMPARED_PEAK_TOLERANCE = 1e-2
"""Relative width of the intervals that certify the compared peaks."""


def equalising_gain(falling: GeneralisedPlant, rising: GeneralisedPlant, controller: Any) -> float:
    """The factor on K, at least 1, with which two plants have equal peaks of robust performance.

    Parameters
    ----------
    falling, rising
        Two channels of one plant. A larger gain lowers the peak of the first and raises the peak of
        the second, as for the channels of a disturbance and of the control signal.
    controller
        Controller, StateSpace or TransferFunction, that stabilises both.

    Returns
    -------
    float
        The factor; NaN if no factor up to 30, or up to instability, makes the peaks
        equal.

    Examples
    --------
    >>> import control
    >>> from workbench.structure import Complex
    >>> from workbench.synthesis import equalising_gain
    >>> from workbench.uncertainty import generalised_plant
    >>> def channel(output, weight):
    ...     parts = [
    ...         (control.tf([1.0], [1.0, 1.0]), "v", "y"),
    ...         (control.ss([], [], [], [[weight]]), output, "z"),
    ...     ]
    ...     parts.append((control.ss([], [], [], [[0.01]]), "u", "z_d"))
    ...     return generalised_plant(
    ...         parts,
    ...         {"v": "u + d", "e": "r - y"},
    ...         perturbation=[(Complex(1), "z_d", "d")],
    ...         exogenous=["r"],
    ...         performance=["z"],
    ...         control=["u"],
    ...         measurement="e",
    ...     )
    ...
    >>> K = control.ss([], [], [], [[1.0]])
    >>> equalising_gain(channel("e", 1.0), channel("u", 0.1), K) > 1
    True
    """

    def apart(log_gain: float) -> float:
        scaled = np.exp(log_gain) * controller
        one = performance_peak(falling, scaled, tolerance=COMPARED_PEAK_TOLERANCE)
        other = performance_peak(rising, scaled, tolerance=COMPARED_PEAK_TOLERANCE)
        if one is None or other is None:  # unstable
            return np.nan
        return float(np.log(one.upper / other.upper))

    logs = np.log(np.geomspace(1.0, LARGEST_GAIN, 12))
    distance = np.array([apart(each) for each in logs])
    crossing = np.flatnonzero((distance[:-1] > 0) & (distance[1:] <= 0))
    if not crossing.size:
        return np.nan
    first = crossing[0]
    return float(np.exp(brentq(apart, logs[first], logs[first + 1], xtol=1e-3)))
