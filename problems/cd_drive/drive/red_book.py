"""Deviations that the Red Book permits on a disc, and errors that may remain (section 2.5).

Equation numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from workbench import figures, problem
from workbench.study import Study, array, check, dim, figure, metric, table
from workbench.types import DataArray, Dataset, Figure, RealArray

from .actuator import checked_frequency
from .compact_discs import (
    coded_bits_per_mm,
    largest_tracking_sensitivity,
    rotations,
    user_data_rate,
)
from .tables import AXES, Axis, red_book

ACCEPTABLE_ERROR = {"focus": 2e-6, "radial": 0.2e-6}
"""Largest position error [m] at which a CD can still be read (Bouwhuis et al., 1985)."""
PRINTED_CORNERS = {"focus": (22.0, 500.0), "radial": (12.0, 580.0)}
"""Lower and upper corner [Hz] as stated in the text."""
DIRECTION = {"focus": "vertical", "radial": "horizontal"}
"""Direction of the disc's deviation that each axis follows."""


def corners(axis: Axis) -> tuple[float, float]:
    """Frequencies [Hz] between which the acceleration limits the deviation (eq. 2.7, 2.8).

    The radial upper corner compares the acceleration of a disc with a tracking error in closed
    loop, because above 500 Hz Table 2.4 states the tracking error.
    """
    limits = red_book(axis)
    lower, upper = (
        math.sqrt(limits.acceleration / deviation) / (2 * math.pi)
        for deviation in (limits.deviation, limits.deviation_above)
    )
    return lower, upper


def envelope(axis: Axis, frequency: ArrayLike) -> RealArray:
    """Largest amplitude [m] of a disc's deviation at `frequency` [Hz] (F,): (F,), as in figure
    2.12.

    It is flat up to the lower corner, limited by the acceleration (eq. 2.6) up to the upper one,
    and flat beyond. The last part of the radial envelope is a tracking error measured in closed
    loop (crossover 200 Hz), so it bounds the disc only where that loop has no effect.

    Raises InputError for an unknown axis, and for frequencies that are not positive, finite and
    1-D.
    """
    limits = red_book(axis)
    omega = 2 * np.pi * checked_frequency(frequency)
    below = np.minimum(limits.deviation, limits.acceleration / omega**2)
    deviation: RealArray = np.maximum(below, limits.deviation_above)
    return deviation


@problem("cd/red-book", data=("data/red_book.csv", "data/compact_disc.csv"))
def specifications(frequencies: Annotated[int, Field(ge=10, le=1_000_000)] = 400) -> Specifications:
    """Deviations that a CD may have, and the servo that they ask for (Tables 2.3, 2.4, fig. 2.12).

    The envelopes of vertical and horizontal deviations come from equations 2.6 to 2.8. Their ratio
    to the acceptable errors is the attenuation that the loops need. Other facts about the disc are
    among the metrics: rotation, data rate, and the loop that measures the tracking error.

    frequencies: number of frequencies, logarithmically spaced from 1 Hz to 10 kHz.
    """
    return Specifications(np.geomspace(1.0, 10e3, frequencies))


@dataclass(frozen=True, eq=False)
class Specifications(Study):
    """Disturbance envelopes of both axes over a frequency grid [Hz]."""

    grid: RealArray

    headline: ClassVar[str] = "upper_corner_focus_hz"

    @property
    def quantifier(self) -> str:
        return f"at {len(self.grid)} frequencies"

    axis = dim(AXES)
    frequency = dim(lambda self: self.grid, unit="Hz")
    side = dim("lower", "upper")

    @array(dims=(axis, frequency), unit="m", meaning="largest deviation")
    def envelope(self) -> list[RealArray]:
        return [envelope(axis, self.grid) for axis in AXES]

    corner = array(dims=(axis, side), unit="Hz", value=lambda: [corners(axis) for axis in AXES])
    acceptable_error = array(dims=axis, unit="m", value=lambda: ACCEPTABLE_ERROR)
    acceleration = array(dims=axis, unit="m/s^2", value=lambda: _limits("acceleration"))

    @check(title="{axis} corners", at_most=0.025, each="axis")
    def as_printed(self, corner: DataArray) -> DataArray:
        """relative distance from the printed frequencies, which are rounded"""
        off = abs(corner / list(PRINTED_CORNERS.values()) - 1)
        return _by_direction(off.max("side", skipna=False))

    @check(title="{axis} acceleration", at_most=1.0 + 1e-9, each="axis")
    def permitted_acceleration(self, answer: Dataset) -> DataArray:
        """share of the permitted acceleration below the upper corner"""
        frequency, limit = answer["frequency"], np.array(_limits("acceleration"))[:, None]
        # A harmonic of the stated amplitude has this acceleration (eq. 2.6).
        share = answer["envelope"] * (2 * np.pi * frequency) ** 2 / limit
        below = share.where(frequency <= answer["corner"].sel(side="upper"), 0.0)
        return _by_direction(below.max("frequency", skipna=False))

    @check(title="{axis} deviation", at_most=1.0 + 1e-9, each="axis")
    def permitted_deviation(self, envelope: DataArray) -> DataArray:
        """share of the permitted deviation"""
        return _by_direction(envelope.max("frequency", skipna=False) / _limits("deviation"))

    corners = metric("{side}_corner_{axis}_hz", value=lambda corner: corner)

    @metric("attenuation_{axis}_db")
    def attenuation(self, envelope: DataArray, acceptable_error: DataArray) -> Any:
        return 20 * np.log10(envelope.max("frequency") / acceptable_error)

    @metric("error_acceptable_from_{axis}_hz")
    def acceptable_from(self, acceleration: DataArray, acceptable_error: DataArray) -> DataArray:
        return (acceleration / acceptable_error) ** 0.5 / (2 * np.pi)

    _rotation = metric(
        template=lambda: {f"rotation_{place}_hz": f for place, f in rotations().items()}
    )
    _bits = metric(
        template=lambda: {f"coded_bits_per_mm_{v}": n for v, n in coded_bits_per_mm().items()}
    )
    user_data_kib_per_s = metric(lambda: user_data_rate())
    largest_tracking_S = metric(lambda: largest_tracking_sensitivity())

    @table
    def tables_2_3_2_4(self, corner: DataArray) -> tuple[list[str], list[list[str]]]:
        heads = ["direction", "deviation [m]", "acceleration [m/s^2]", "above 500 Hz [m]"]
        heads += ["corners [Hz]", "printed [Hz]", "acceptable error [m]"]
        rows = []
        for axis, limits in ((axis, red_book(axis)) for axis in AXES):
            lower, upper = corner.sel(axis=axis).values
            numbers = (limits.deviation, limits.acceleration, limits.deviation_above)
            printed = "{:g}, {:g}".format(*PRINTED_CORNERS[axis])
            row = [DIRECTION[axis], *map("{:g}".format, numbers), f"{lower:.1f}, {upper:.1f}"]
            rows.append([*row, printed, f"{ACCEPTABLE_ERROR[axis]:g}"])
        return heads, rows

    @figure
    def figure_2_12(self, answer: Dataset) -> Figure:
        drawn, (deviation, attenuation) = figures.axes(2, 1, size=(7.0, 6.4), sharex=True)
        frequency = answer["frequency"]
        for axis, colour in zip(AXES, (figures.BLUE, figures.ORANGE), strict=True):
            one, name = answer.sel(axis=axis), f"{DIRECTION[axis]} ({axis})"
            acceptable, limits = float(one["acceptable_error"]), red_book(axis)
            deviation.plot(frequency, one["envelope"] * 1e6, color=colour, label=name)
            name = f"acceptable error, {axis}"
            deviation.axhline(acceptable * 1e6, color=colour, ls="--", lw=1, label=name)
            levels = np.array([limits.deviation, limits.deviation_above]) * 1e6
            deviation.plot(one["corner"], levels, "o", color=colour, ms=4)
            for place, level, below in zip(one["corner"].values, levels, (6, -14), strict=True):
                deviation.annotate(
                    f"{place:.3g} Hz", (place, level), (2, below), textcoords="offset points"
                )
            attenuation.plot(frequency, one["envelope"] / acceptable, color=colour)
        attenuation.axhline(1.0, color=figures.BLACK, lw=0.8)
        figures.label(deviation, y=r"largest deviation [$\mu$m]", log="xy")
        deviation.set_ylim(bottom=0.01)
        figures.label(
            attenuation, x="frequency [Hz]", y="deviation / acceptable error [1]", log="xy"
        )
        figures.legend_below(drawn, deviation, columns=2)
        return drawn


def _limits(name: str) -> list[float]:
    """One limit of the Red Book for each axis."""
    return [getattr(red_book(axis), name) for axis in AXES]


def _by_direction(values: DataArray) -> DataArray:
    """Values (axis) labelled by the direction of the disc's deviation instead."""
    return values.assign_coords(axis=list(DIRECTION.values()))
