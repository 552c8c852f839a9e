"""Checks of `cd/{axis}/excursion`: the theory by integration, runs played again.

Equation numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from itertools import product

import numpy as np
from scipy.integrate import solve_ivp

from workbench import Check
from workbench.heavy_types import Dataset

from ...drive.disc import VELOCITY
from ...drive.photo_diodes import CAPTURE
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import Axis, red_book
from .runs import MET, Cell, Crossing, excursion_of
from .theory import WORST, standing


def checks_of(crossing: Crossing, answer: Dataset) -> list[Check]:
    reference = answer.sel(strategy="reference", share=1.0)
    full = float(abs(answer["standing"]).max())
    driven = answer["driven"].sel(theta=answer["angle"]).drop_vars("theta")
    # The false displacement gets through while the light fades and comes back.
    scale = abs(driven).max("angle") + crossing.swing * ACCEPTABLE_ERROR[crossing.axis]
    apart = abs(reference["end"] - driven) / scale
    kept = reference["peak"] < CAPTURE[crossing.axis] / 2  # where the diodes are about linear
    return [
        Check(
            "equation 8.1",
            "difference from the disc [m]",
            _disc_off(crossing, answer),
            1e-9,
        ),
        Check("53.7 um", "relative difference", _thesis_off(), 1e-3),
        Check(
            "lens in flight", "difference from an integration", _flight_off(crossing, answer), 1e-6
        ),
        Check(
            "order",
            "free over standing lens, worst angle and length",
            float(abs(answer["free"]).max()) / full,
            0.1,
        ),
        Check(
            "reference strategy",
            "its end off the blind controller's, over the worst angle's and the swing",
            float(apart.where(kept).max()) if bool(kept.any()) else np.nan,
            0.3,
        ),
        Check(
            "replay", "change of a kept peak at half the step", _replay_off(crossing, answer), 0.02
        ),
        Check(
            "harder",
            "share of defects kept though lost at a smaller deviation, reference",
            _reversed(crossing.axis, answer),
            0.05,
        ),
    ]


def _disc_off(crossing: Crossing, answer: Dataset) -> float:
    """Equation 8.1 against where the laboratory's disc is before and after the defect."""
    worst = 0.0
    for angle, length in product(answer["theta"].values, answer["length"].values):
        disc = crossing.disc(Cell(angle, length, crossing.allowed))
        before, after = disc.deviation(crossing.axis, np.array([MET, MET + length / VELOCITY]))
        stored = float(answer["standing"].sel(theta=angle, length=length))
        worst = max(worst, abs(stored - (after - before)))
    return worst


def _thesis_off() -> float:
    focus = red_book("focus").deviation
    return abs(float(standing(focus, *WORST, 0.0)) / 53.7e-6 - 1.0)


def _flight_off(crossing: Crossing, answer: Dataset) -> float:
    """Stored flights against an integration of the same equations; relative to the largest."""
    worst, angle, length = 0.0, answer["theta"].values[1], answer["length"].values[-1]
    for name, driven in (("free", False), ("driven", True)):
        lens = crossing.blind_lens(driven)
        step = length / VELOCITY
        start = np.imag(lens.steady * np.exp(1j * (angle - lens.omega * step / 2)))
        # Displacements are micrometres, memories of the controller large: each by its size.
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


def _replay_off(crossing: Crossing, answer: Dataset) -> float:
    """A defect of middle length at the first angle, again with the optics at half the step."""
    place = answer.isel(angle=0, length=answer.sizes["length"] // 2).sel(share=1.0)
    cell = Cell(float(place["angle"]), float(place["length"]), crossing.allowed)
    off = [0.0]
    for name in answer["strategy"].values:
        stored = float(place["peak"].sel(strategy=name))
        if stored < CAPTURE[crossing.axis]:  # a lost loop is chaotic
            again = crossing.run(cell, str(name), int(place["seed"]), refine=2)
            off.append(abs(excursion_of(again, cell.length)[0] / stored - 1.0))
    return max(off)


def _reversed(axis: Axis, answer: Dataset) -> float:
    kept = (answer["peak"].sel(strategy="reference") <= CAPTURE[axis]).values
    return float((kept[..., 1:] & ~kept[..., :-1]).mean())
