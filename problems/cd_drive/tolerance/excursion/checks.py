"""Checks of `cd/{axis}/excursion`: the theory by numerical integration, and runs repeated.

Equation numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from itertools import product

import numpy as np
from scipy.integrate import solve_ivp

from workbench.types import DataArray, Dataset

from ...drive.disc import VELOCITY
from ...drive.photo_diodes import CAPTURE
from .runs import MET, Crossing, DefectCase, excursion_of


def disc_difference(crossing: Crossing, standing: DataArray) -> float:
    """Largest difference [m] between equation 8.1 and the motion of the laboratory's disc."""
    worst = 0.0
    for angle, length in product(standing["theta"].values, standing["length"].values):
        disc = crossing.disc(DefectCase(angle, length, crossing.allowed))
        before, after = disc.deviation(crossing.axis, np.array([MET, MET + length / VELOCITY]))
        stored = float(standing.sel(theta=angle, length=length))
        worst = max(worst, abs(stored - (after - before)))
    return worst


def flight_difference(crossing: Crossing, answer: Dataset) -> float:
    """Largest difference between stored errors of a blind lens and an integration, over the
    deviation.
    """
    worst, angle, length = 0.0, answer["theta"].values[1], answer["length"].values[-1]
    for name, driven in (("free", False), ("driven", True)):
        lens = crossing.blind_lens(driven)
        step = length / VELOCITY
        start = np.imag(lens.steady * np.exp(1j * (angle - lens.omega * step / 2)))
        # Displacements are micrometres, and controller states are large, so each is scaled by its
        # size.
        size = np.maximum(abs(lens.steady), 1e-300)
        flight = solve_ivp(
            lambda _, z, F=lens.free, size=size: F @ (z * size) / size,
            (0.0, step),
            start / size,
            method="LSODA",
            rtol=1e-11,
            atol=1e-13,
        )
        x = flight.y[0, -1] * size[0]  # the lens is the first of the states
        stored = float(answer[name].sel(theta=angle, length=length))
        disc = crossing.allowed * np.sin(angle + lens.omega * step / 2)
        worst = max(worst, abs(disc - x - stored) / crossing.allowed)
    return worst


def half_step_change(crossing: Crossing, answer: Dataset) -> float:
    """Largest relative change of a peak error, where the loop is kept, when the step of the
    simulation is halved.

    Every strategy is run again with the defect of middle length at the first angle, in the first
    draw.
    """
    place = answer.isel(angle=0, length=answer.sizes["length"] // 2, draw=0).sel(share=1.0)
    cell = crossing.drawn(place["seed"])
    off = [0.0]
    for name in answer["strategy"].values:
        stored = float(place["peak"].sel(strategy=name))
        if stored < CAPTURE[crossing.axis]:  # a lost loop is chaotic
            again = crossing.run(cell, str(name), int(place["seed"]), refine=2)
            off.append(abs(excursion_of(again, cell.length)[0] / stored - 1.0))
    return max(off)
