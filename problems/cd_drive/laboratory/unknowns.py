"""Values of a drive and of the bench that an experimenter is told, with errors.

The told values are drawn around the truth with stated standard deviations. An estimator receives
these values and their deviations; only the simulation and the judgement of an estimate know the
truth.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from workbench.errors import InputError
from workbench.study import independent_seeds

from ..drive.plants import ANTIALIASING
from ..drive.tables import Axis

Experiment = Literal["open-loop", "closed-loop", "optical-gain", "linearity"]
DRIVES = ("nominal", *(f"CD{number}" for number in range(1, 13)))

MASS_DEVIATION = 0.02
"""Relative standard deviation of the effective mass: its parts can be weighed, but not the share of
the springs and of the glue that moves with them.
"""
GAIN_DEVIATION = {"focus": 0.03, "radial": 0.02}
"""Relative standard deviation of the optical gain that a scan finds (`cd/{axis}/optical-gain`)."""
DISTANCE_DEVIATION = {"focus": 0.02, "radial": 0.01}
"""Relative standard deviation of the known distance of a scan: between the s-curve's extremes of
one pick-up, or the track pitch of one disc.
"""
CORNER_DEVIATION = 0.02
"""Relative standard deviation of the corner of each channel's anti-aliasing filter."""
DELAY_DEVIATION = 0.02
"""Standard deviation of the computer's delay [samples]: half a microsecond."""


@dataclass(frozen=True)
class Told:
    """The values that an experimenter is told in one draw; by default they are true.

    mass, gain, distance: effective mass, optical gain and known distance of a scan, over the true
    values. delay: told minus true delay [samples]. error_corner, control_corner, current_corner:
    corners of the filters in the channels of the diodes, u_m and v_r, over the true values.
    """

    mass: float = 1.0
    gain: float = 1.0
    distance: float = 1.0
    delay: float = 0.0
    error_corner: float = 1.0
    control_corner: float = 1.0
    current_corner: float = 1.0

    @classmethod
    def drawn(cls, axis: Axis, seed: int) -> Told:
        """The told values in the draw of this seed; they are independent of the noise of the same
        seed.
        """
        rng = np.random.default_rng([int(seed), 1])  # the noise uses the seed alone
        about_one = (MASS_DEVIATION, GAIN_DEVIATION[axis], DISTANCE_DEVIATION[axis])
        mass, gain, distance = 1 + np.array(about_one) * rng.standard_normal(3)
        corners = 1 + CORNER_DEVIATION * rng.standard_normal(3)
        delay = DELAY_DEVIATION * rng.standard_normal()
        return cls(*map(float, (mass, gain, distance, delay, *corners)))


TRUTH = Told()


def experiment_seeds(
    rng: np.random.Generator, experiment: Experiment, drive: str, draws: int
) -> NDArray[np.int64]:
    """Seeds (draws,) of an experiment on a drive, independent of other experiments and drives.

    The first seeds are the same for every number of draws. Raises InputError for an unknown drive.
    """
    if drive not in DRIVES:
        raise InputError(f'drive is {drive!r}; it must be "CD1" ... "CD12" or "nominal"')
    kinds = get_args(Experiment)
    every = independent_seeds(rng, draws, len(kinds), len(DRIVES))
    return every[:, kinds.index(experiment), DRIVES.index(drive)]


def corner_ratio(ratio: Any, s: Any) -> Any:
    """Response of one channel's filter divided by that of another, whose corner is lower by the
    ratio.
    """
    return (1 + s / ANTIALIASING) / (1 + s / (ratio * ANTIALIASING))
