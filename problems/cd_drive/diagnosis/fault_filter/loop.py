"""The loop for which a fault filter is designed: drive, disc and defects (figure 7.8).

    e = x_cd + f_sd - G (1 + W_c delta_c + W_r delta_r) K e,     u_f = F e,     K_f = F / K_optn

in metres. The disturbance is the disc's deviation x_cd. The fault is a defect's false displacement
f_sd, and the estimate is compared with f_sd after the loop's anti-aliasing filter. Section, figure
and equation numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players
(2003).
"""

from __future__ import annotations

import numpy as np

from workbench.diagnosis import EstimationDemands, FaultLoop
from workbench.types import RealArray, StateSpace
from workbench.uncertainty import UncertaintyModel

from ...drive.plants import ANTIALIASING
from ...drive.red_book import corners
from ...drive.tables import Axis, red_book
from ...laboratory.bench_setup import NOISE, PERIOD, RATE

FAST = 1500.0
"""Frequency [Hz] from which on the relative error of the estimate counts."""
SLOW = 200.0
"""Frequency [Hz] up to which the leakage of the disc's deviation counts."""
GAIN = 2.0
"""Largest gain allowed from the disc or a defect to the estimate, at any frequency."""
NOISE_BAND = 1750.0
"""Bandwidth of the measurement's white noise [Hz], 0.15 um rms (section 7.3)."""
LENGTH_UNIT = 1e-6
"""Unit of length in the convex problems [m]."""
LAGUERRE_POLE = 2 * np.pi * 600.0
"""Poles of the Laguerre basis [rad/s]."""
BOUND_CORNER = 2 * np.pi * 400.0
"""Corner of the variable z in the bound of the front [rad/s]."""
RESONANT = (15.0, 60.0)
"""Band [Hz] of the drives' first resonances, where the set's sensitivities have narrow peaks."""


def fault_loop(
    axis: Axis, model: UncertaintyModel, K: StateSpace, delay: float | None = None
) -> FaultLoop:
    """The loop of an axis; with a delay [samples], as a computer closes it.

    model: u [V] -> f_en [units], without the anti-aliasing filter. K: f_en -> u, with a positive
    sign as in the thesis.
    """
    import control

    filter_ = control.ss(-ANTIALIASING, ANTIALIASING, 1.0, 0.0)
    demands = EstimationDemands(
        error_above_hz=FAST,
        leakage_below_hz=SLOW,
        gain=GAIN,
        disturbance=disc_weight(axis),
        noise=NOISE[axis],
        noise_band_hz=NOISE_BAND,
        unit=LENGTH_UNIT,
    )
    if delay is None:
        return FaultLoop(model, K, filter_, demands)
    return FaultLoop(model, K, filter_, demands, dt=PERIOD, delay_samples=delay)


def disc_weight(axis: Axis) -> StateSpace:
    """A weight that is at least the Red Book's envelope [m] below its last corner.

    It is exact where the envelope is flat or limited by the acceleration, and up to 15 % larger at
    the corner.
    """
    import control

    omega = 2 * np.pi * corners(axis)[0]
    size = red_book(axis).deviation
    return control.ss(control.tf([size * omega**2], [1.0, omega, omega**2]))


def grid(loop: FaultLoop) -> RealArray:
    """Frequencies [Hz], including the drives' resonances and the ends of the
    requirements' bands.
    """
    ends = [SLOW, FAST, NOISE_BAND]
    resonances = [np.geomspace(*RESONANT, 80), np.geomspace(350.0, 700.0, 30)]
    top = 0.999 * RATE / 2 if loop.dt is not None else 1e5
    return np.unique(np.concatenate([np.geomspace(0.02, top, 220), *resonances, ends]))


def fine_grid(loop: FaultLoop) -> RealArray:
    """The grid, refined at the drives' resonances, where filters of low order are
    checked closely.
    """
    return np.union1d(grid(loop), np.geomspace(*RESONANT, 400))
