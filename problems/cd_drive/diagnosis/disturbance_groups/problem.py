"""Four groups of disturbances enter the error, one of them self-pollution (eq. 2.9, fig. 2.13).

Section, equation and figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import problem
from workbench._core.arrays import RealArray
from workbench._core.heavy_types import DataArray, Dataset
from workbench.executor import Context
from workbench.study import (
    Study,
    array,
    arrays,
    check,
    dim,
    draws_summary,
    figure,
    independent_seeds,
    interval_text,
    metric,
    part,
    share_of_draws,
    table,
)
from workbench.study.draws import SURE

from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis, drives
from ...laboratory.bench_setup import RATE
from .figures import by_force, groups
from .pollution import AUDIO_ROTATION
from .runs import CASES, DURATION, Disturbed, Superposed, error_of_force

FAST_ROTATION = 100.0
"""Rotation frequency [Hz] of a fast CD-ROM drive (section 2.5.1)."""
SUPERPOSED = 0.1
"""Largest accepted difference between the whole error and the sum of its parts, relative: the sine
of the radial diodes bends by 3 % at half of the acceptable error.
"""
EQUATION = 0.05
"""Largest accepted difference between the sensed error and equation 2.9, relative. Between samples
the lens is assumed to move in straight lines.
"""
LEAST_MOTION = 1e-9
"""Least error [m] that each group causes."""


@problem(
    "cd/{axis}/disturbance-groups", axis=("focus", "radial"), data=(*TABLES, "data/red_book.csv")
)
def disturbance_groups(
    axis: Axis, draws: Annotated[int, Field(ge=1, le=1000)] = 12
) -> DisturbanceGroups:
    """Disc deviations, shocks, self-pollution and surface defects in one error (figure 2.13).

    Self-pollution is a force w_sp on the lens: the carriage jumps and pulls the suspension, a share
    of the other coil's force leaks in, and the air of the disc pushes at the rotation frequency.
    The thesis prints no sizes, so assumed ones are drawn. Each group acts alone, and then all act
    together, without noise and within the linear range. The sensed error is compared with equation
    2.9, and with the sum of the errors of the single groups.

    The force that causes the acceptable error is computed over frequency, without an assumed size.

    draws: number of draws of all disturbances, on each of the twelve drives.
    """
    return DisturbanceGroups(axis, draws)


@dataclass(frozen=True)
class DisturbanceGroups(Study):
    """Every group alone and all together, on twelve drives."""

    axis: Axis
    draws: int

    headline: ClassVar[str] = "superposition_off_high"

    @property
    def quantifier(self) -> str:
        return f"for these 12 drives, in {self.draws} simulated draws"

    case = dim(CASES)
    drive = dim(lambda self: [one.name for one in drives(self.axis)])
    draw = dim(lambda self: range(self.draws))
    frequency = dim(lambda: np.geomspace(1.0, 1e3, 91), unit="Hz", meaning="frequency of a force")
    time = dim(lambda: np.arange(round(DURATION * RATE)) / RATE, unit="s")

    @array(dims=(draw, drive))
    def seed(self, context: Context) -> Any:
        return independent_seeds(context.rng, self.draws, 12)

    @part
    def met(self, context: Context, seed: DataArray) -> list[Superposed]:
        """Errors of every drive in every draw."""

        def one(place: tuple[int, ...]) -> Superposed:
            at = seed[place]
            return Disturbed(self.axis, str(at["drive"].values), int(at)).met()

        return context.spread(one, list(np.ndindex(seed.shape)), "drives and draws")

    @array(dims=(draw, drive, case), unit="m", meaning="largest true error")
    def peak(self, met: list[Superposed], seed: DataArray) -> RealArray:
        found = np.array([abs(one.error).max(axis=1) for one in met])
        return found.reshape(*seed.shape, len(CASES))

    @arrays((draw, drive), superposition_off="1", equation_2_9_off="1")
    def off(self, met: list[Superposed], seed: DataArray) -> dict[str, RealArray]:
        """Difference of the sensed error from the sum of its parts, and from equation 2.9."""
        names = {"superposition_off": "superposition", "equation_2_9_off": "equation_2_9"}
        return {
            name: np.reshape([getattr(one, field) for one in met], seed.shape)
            for name, field in names.items()
        }

    shown = array(
        dims=(case, time),
        unit="m",
        meaning="sensed error of the first drive in the first draw",
        value=lambda met: met[0].sensed.astype("f4"),
    )

    @array(dims=(drive, frequency), unit="m/N", meaning="error by a force on the lens")
    def error_of_force(self, drive: DataArray, frequency: DataArray) -> RealArray:
        names = drive.values.tolist()
        return np.array([error_of_force(self.axis, one, frequency.values) for one in names])

    # --- checks ---------------------------------------------------------------------------------

    @check(at_most=1.0 - SURE)
    def superposed(self, superposition_off: DataArray) -> float:
        """share of draws in which the error is farther than 10 % from the sum of its parts"""
        return float(share_of_draws(superposition_off > SUPERPOSED))

    @check(title="equation 2.9", at_most=1.0 - SURE)
    def as_printed(self, equation_2_9_off: DataArray) -> float:
        """share of draws in which the sensed error is farther than 5 % from the equation"""
        return float(share_of_draws(equation_2_9_off > EQUATION))

    @check(title="{case}", at_most=1.0 - SURE, each="case")
    def enters(self, peak: DataArray) -> DataArray:
        """share of draws in which a group causes an error below 1 nm"""
        return share_of_draws(peak < LEAST_MOTION, "case")

    # --- what is told ---------------------------------------------------------------------------

    peaks = metric(
        template="peak_{case}_{summary}_um", value=lambda peak: 1e6 * draws_summary(peak, "drive")
    )
    superpositions = metric(
        template="superposition_off_{summary}",
        value=lambda superposition_off: draws_summary(superposition_off, "drive"),
    )
    equations = metric(
        template="equation_2_9_off_{summary}",
        value=lambda equation_2_9_off: draws_summary(equation_2_9_off, "drive"),
    )

    @metric
    def air(self, error_of_force: DataArray) -> dict[str, float]:
        """Ratio of the errors at the rotations of a fast and an audio drive: by the same force, and
        by air.

        The force of air grows with the square of the rotation. Of the drives, the least ratio is
        taken.
        """
        slow, fast = (
            error_of_force.interp(frequency=one) for one in (AUDIO_ROTATION, FAST_ROTATION)
        )
        ratio, square = fast / slow, (FAST_ROTATION / AUDIO_ROTATION) ** 2
        acceptable = 1e3 * ACCEPTABLE_ERROR[self.axis]
        return {
            "fast_over_audio_same_force": float(ratio.min()),
            "fast_over_audio_air": float(square * ratio.min()),
            "force_allowed_audio_mN": float(acceptable / slow.max()),
            "force_allowed_fast_mN": float(acceptable / fast.max()),
        }

    @table
    def groups(self, answer: Dataset) -> tuple[list[str], list[list[str]]]:
        """Errors of every case over draws and drives."""
        told = draws_summary(1e6 * answer["peak"], "drive")
        rows = [[case, interval_text(told.sel(case=case), form="{:.4f}")] for case in CASES]
        return ["group", "largest error [um]"], rows

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Any]:
        acceptable = ACCEPTABLE_ERROR[self.axis]
        return {
            "figure-2-13": groups(answer, self.axis),
            "allowed-force": by_force(answer, self.axis, acceptable),
        }
