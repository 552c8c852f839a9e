"""Positions and disturbances estimated while a scratch passes (sections 7.2.2 and 7.3.3).

Figure, equation and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control
of CD-players (2003).
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from workbench import problem

from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis, Values
from ...laboratory.printed_noise import Amplitude
from .told import PositionEstimator
from .trials import Quality, Scratches


@problem(
    "cd/{axis}/position-estimator",
    axis=("focus", "radial"),
    data=(*TABLES, "data/red_book.csv"),
)
def position_estimator(
    axis: Axis,
    length: Annotated[float, Field(gt=0, le=2.4e-3)] = 1.2e-3,
    depth: Annotated[float, Field(ge=0.6, le=0.9)] = 0.7,
    displacement: Annotated[float, Field(ge=0, le=1)] = 0.5,
    wrong: Annotated[float, Field(gt=0, le=0.3)] = 0.05,
    values: Values = "printed",
    draws: Annotated[int, Field(ge=1, le=1000)] = 12,
    noise: Amplitude = "rms",
    quality: Quality = "graded",
) -> PositionEstimator:
    """Positions and disturbance estimated through scratches (figures 7.14, 7.15, eq. 7.33-7.35).

    The virtual laboratory follows a disc of the largest deviation at 5.5 Hz with the mu-PID while
    scratches pass. The estimators read f_en and u, and a quality signal that reduces their gain in
    a defect. They are the observer of the thesis, ITAE poles with placed oscillators, and a Kalman
    filter whose noise follows the quality; the rotation is known, wrong, or tracked. Then all
    twelve drives are tried with the estimators of the nominal one.

    length [m], depth: of the scratches. displacement: false displacement, over the largest error
    that can be read (2 um in focus, 0.2 um radially). wrong: relative error of the rotation.
    values: of the drives. draws: number of draws of noise, the scratch's angle, its edge and the
    sign of its displacement, on each drive. noise: reading of the printed amplitude of 0.15 um
    (`printed_noise`); the Kalman filter always expects 0.15 um rms. quality: signal that reduces
    the estimators' gain, graded or binary.
    """
    scratches = Scratches(axis, length, depth, displacement, values, noise, quality)
    return PositionEstimator(axis, scratches, wrong, values, draws)
