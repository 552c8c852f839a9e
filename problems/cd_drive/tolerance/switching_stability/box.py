"""The parametric set as a box of plants; surface defects switch their controllers.

The actuator is affine in g = 1 / (R + r), k1 and k2, which follow from the parameters of Table 5.3:
R enters only through the coil's force Bl g u and the damping Bl^2 g. The loop has a delay of one
sample.
"""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.synthesis import SampledPlant, SwitchedBox
from workbench.synthesis.switching.loops import mode_transition

from ...control.control_problem import optical_gain
from ...drive.actuator import SERIES_RESISTANCE
from ...drive.plants import ANTIALIASING
from ...drive.tables import Axis, nominal_table
from ...laboratory.bench_setup import PERIOD
from ...uncertainty.parametric_model import two_masses, uncertain_parameters
from ..switched_loop import MICRO, filtered

NAMES = ("R", "k1", "k2")
"""Parameters of Table 5.3 that span the box."""
LABEL = "g [1/ohm], k1 and k2 [N/m]"
"""The box's parameters and their units."""
FIRST_CELLS = (1, 1, 8)
"""Numbers of cells along g, k1 and k2 into which the whole box is divided at the start."""
HALVED = (2, 0, 2)
"""Parameters along which a cell is halved, in this order, before it counts as unproven."""
DWELLS = (1, 10, 30)
"""Least stays [samples] in the clean mode that are tried; 1 allows any switching."""
UNITS = np.array([1 / MICRO, 1 / MICRO, PERIOD / MICRO, PERIOD / MICRO, 1.0, 1.0])
"""Units of the states (positions, speeds, filter and command) over SI units."""


def parametric_box(
    axis: Axis, modes: tuple[StateSpace, StateSpace], share: float = 1.0
) -> SwitchedBox:
    """Smallest box of g [1/ohm], k1 and k2 [N/m] that contains a multiple of an axis' set.

    Raises InputError for a share that is not positive, or at which a spring would have no
    stiffness.
    """
    widest = 1 / max(p.tolerance for p in uncertain_parameters(axis))
    if not 0.0 < share < widest:
        raise InputError(
            f"share is {share}; it must be above 0 and below {widest:.3g}, where a spring "
            "has no stiffness"
        )
    R, k1, k2 = (
        [p.nominal * (1 + side * share * p.tolerance) for side in (-1, 1)]
        for p in (
            next(each for each in uncertain_parameters(axis) if each.name == name) for name in NAMES
        )
    )
    g = [1 / (R[1] + SERIES_RESISTANCE), 1 / (R[0] + SERIES_RESISTANCE)]
    low, high = np.array([g, k1, k2]).T

    def plant(parameters: RealArray) -> RealArray:
        return _continuous(axis, parameters)

    def loops(held: RealArray) -> tuple[RealArray, RealArray]:
        clean, defect = (mode_transition(_late(axis, held), mode) for mode in modes)
        return clean, defect

    return SwitchedBox((low, high), plant, loops, PERIOD, FIRST_CELLS, halved=HALVED, dwells=DWELLS)


def _continuous(axis: Axis, parameters: RealArray) -> RealArray:
    """[A B; 0 0] (6, 6) of actuator and filter, affine in g, k1, k2.

    Positions are in um and speeds in um per sample, so that the entries are about 1.
    """
    g, k1, k2 = parameters
    values = {name: entry.nominal for name, entry in nominal_table(axis).items()}
    given = values | {"R": 1 / g - SERIES_RESISTANCE, "k1": k1, "k2": k2}
    A, B, C, _ = (np.asarray(part, float) for part in two_masses(**given))
    M = np.zeros((6, 6))
    M[:4, :4], M[:4, 5:] = A, B
    M[4, :4] = ANTIALIASING * C[0] * (1.0 / (optical_gain(axis) * MICRO))
    M[4, 4] = -ANTIALIASING
    scaled: RealArray = M * UNITS[:, None] / UNITS
    return scaled


def _late(axis: Axis, held: RealArray) -> SampledPlant:
    """Plant of [A B; 0 1] with an input delay of one sample."""
    A, B = np.zeros((6, 6)), np.zeros((6, 1))
    A[:5], B[5] = held[:5], 1.0
    measured, lens = np.zeros((1, 6)), np.zeros((1, 6))
    measured[0, 4] = 1.0
    return SampledPlant(A, B, lens, measured, optical_gain(axis) * MICRO, PERIOD, filtered)
