"""Runs of both loops together: on a wobbling disc, and after a kick of one of them."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workbench.types import RealArray

from ...drive.disc import Disc
from ...drive.photo_diodes import CAPTURE
from ...drive.tables import AXES, red_book
from ...laboratory.bench_setup import OUTPUT_LIMIT, PERIOD
from ..bench import TwoAxisBench
from ..paths import TwoAxes
from .performance import error_response

ROTATION = 9.0
"""Rotation frequency [Hz], at which a disc starts; the errors are the largest there."""
SETTLED = 0.35
"""Time [s] from which errors count; the disc is at full deviation since 0.2 s."""
TURN = 1.0 / ROTATION
AFTER = 20e-3
"""Time [s] for which a kick is followed."""
JUDGED = 5e-3
"""Time [s] at the end in which it is judged whether focus and track are held."""
LIMITS = np.array([CAPTURE[axis] for axis in AXES])


class Kicked(NamedTuple):
    """Largest errors [m] of focus and radial loop after a kick, and whether each is lost: held at
    another place, or nowhere.
    """

    focus: float
    radial: float
    focus_lost: float
    radial_lost: float


def disc_of(share: float) -> Disc:
    """A disc with this share of the Red Book's deviations, along and across the light in phase."""
    warp, eccentricity = (share * red_book(axis).deviation for axis in AXES)
    return Disc(warp=(warp,), eccentricity=(eccentricity,), rotation=ROTATION)


def largest_errors(bench: TwoAxisBench, seed: int, share: float = 1.0) -> RealArray:
    """Largest errors [m] of both loops (2,) in a turn of a disc with a share of the Red Book's
    deviations.
    """
    found = bench.closed_loop(disc_of(share), SETTLED + TURN, seed=seed)
    worst: RealArray = abs(found.error[round(SETTLED / PERIOD) :]).max(axis=0)
    return worst


def linear_errors(two: TwoAxes, share: float) -> RealArray:
    """The same errors (2,) by the linear loops in continuous time, without noise."""
    deviations = [share * red_book(axis).deviation for axis in AXES]
    found: RealArray = abs(error_response(two, np.array([2 * np.pi * ROTATION]))[0] @ deviations)
    return found


def kicked(bench: TwoAxisBench, axis: int, samples: int, seed: int) -> Kicked:
    """Effect of the largest voltage on one axis for a number of samples, on a disc with a tenth of
    the Red Book's deviations.
    """
    first, last = round(SETTLED / PERIOD), round((SETTLED + AFTER) / PERIOD)
    excitation = np.zeros((last, 2))
    excitation[first : first + samples, axis] = OUTPUT_LIMIT
    error = abs(bench.closed_loop(disc_of(0.1), SETTLED + AFTER, excitation, seed=seed).error)
    lost = error[-round(JUDGED / PERIOD) :].max(axis=0) > LIMITS
    return Kicked(*error[first:].max(axis=0).tolist(), *lost.astype(float).tolist())
