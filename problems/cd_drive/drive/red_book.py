"""How much a disc may deviate by the Red Book, and how much of that may remain (section 2.5).

Equation numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, ClassVar, get_args

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field

from workbench import Check, Study, figures, problem
from workbench.arrays import RealArray
from workbench.executor import Context
from workbench.heavy_types import Dataset, Figure

from .actuator import checked_frequency
from .tables import Axis, red_book

AXES: tuple[Axis, ...] = get_args(Axis)

ACCEPTABLE_ERROR = {"focus": 2e-6, "radial": 0.2e-6}
"""Largest position error [m] at which a CD can still be read (Bouwhuis et al., 1985)."""
PRINTED_CORNERS = {"focus": (22.0, 500.0), "radial": (12.0, 580.0)}
"""Lower and upper corner [Hz] as the text states them."""
DIRECTION = {"focus": "vertical", "radial": "horizontal"}


def corners(axis: Axis) -> tuple[float, float]:
    """Frequencies [Hz] between which the acceleration limits the deviation (eq. 2.7, 2.8).

    The radial upper corner compares a disc's acceleration with a tracking error in closed loop,
    which is what Table 2.4 states above 500 Hz.
    """
    limits = red_book(axis)
    lower, upper = (
        math.sqrt(limits.acceleration / deviation) / (2 * math.pi)
        for deviation in (limits.deviation, limits.deviation_above)
    )
    return lower, upper


def envelope(axis: Axis, frequency: ArrayLike) -> RealArray:
    """Largest amplitude [m] of a disc's deviation at `frequency` [Hz] (F,): (F,), figure 2.12.

    Flat up to the lower corner, limited by the acceleration (eq. 2.6) up to the upper one, flat
    beyond. The last part of the radial envelope is a tracking error measured in closed loop
    (crossover 200 Hz): it bounds the disc only as far as that loop does not act there.

    Raises InputError for an unknown axis and frequencies that are not positive, finite and 1-D.
    """
    limits = red_book(axis)
    omega = 2 * np.pi * checked_frequency(frequency)
    below = np.minimum(limits.deviation, limits.acceleration / omega**2)
    deviation: RealArray = np.maximum(below, limits.deviation_above)
    return deviation


@problem("cd/red-book", data="data/red_book.csv")
def specifications(frequencies: Annotated[int, Field(ge=10, le=1_000_000)] = 400) -> Specifications:
    """Deviations that a CD may have, and the servo that they ask for (Tables 2.3, 2.4, fig. 2.12).

    The envelope of vertical and horizontal deviations by equations 2.6 to 2.8, the acceptable
    errors beside it, and their ratio: how much the loops must attenuate.

    frequencies: how many, logarithmically spaced from 1 Hz to 10 kHz.
    """
    return Specifications(np.geomspace(1.0, 10e3, frequencies))


@dataclass(frozen=True, eq=False)
class Specifications(Study):
    """Disturbance envelopes of both axes over a frequency grid [Hz]."""

    frequency: np.ndarray

    headline: ClassVar[str] = "upper_corner_focus_hz"

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        limits = [red_book(axis) for axis in AXES]
        amplitudes = np.stack([envelope(axis, self.frequency) for axis in AXES])
        return xr.Dataset(
            {
                "envelope": (
                    ("axis", "frequency"),
                    amplitudes,
                    {"units": "m", "long_name": "largest deviation"},
                ),
                "corner": (("axis", "side"), [corners(axis) for axis in AXES], {"units": "Hz"}),
                "acceptable_error": (
                    "axis",
                    [ACCEPTABLE_ERROR[axis] for axis in AXES],
                    {"units": "m"},
                ),
                "acceleration": ("axis", [one.acceleration for one in limits], {"units": "m/s^2"}),
            },
            coords={
                "axis": list(AXES),
                "frequency": ("frequency", self.frequency, {"units": "Hz"}),
                "side": ["lower", "upper"],
            },
        )

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        return [check for axis in AXES for check in self._checks(answer.sel(axis=axis), axis)]

    def _checks(self, one: Dataset, axis: Axis) -> list[Check]:
        limits = red_book(axis)
        frequency, amplitude = one["frequency"].values, one["envelope"].values
        under = frequency <= float(one["corner"].sel(side="upper"))
        # A harmonic of the stated amplitude, differentiated twice (eq. 2.6).
        acceleration = amplitude * (2 * np.pi * frequency) ** 2 / limits.acceleration
        off = np.abs(one["corner"].values / PRINTED_CORNERS[axis] - 1)
        return [
            Check(
                f"{DIRECTION[axis]} corners",
                "relative distance from the printed frequencies, which are rounded",
                float(np.max(off)),
                0.025,
            ),
            Check(
                f"{DIRECTION[axis]} acceleration",
                "share of the permitted acceleration below the upper corner",
                float(np.max(acceleration[under])),
                1.0 + 1e-9,
            ),
            Check(
                f"{DIRECTION[axis]} deviation",
                "share of the permitted deviation",
                float(np.max(amplitude) / limits.deviation),
                1.0 + 1e-9,
            ),
        ]

    def metrics(self, answer: Dataset) -> dict[str, float]:
        numbers = {}
        for axis in AXES:
            one = answer.sel(axis=axis)
            acceptable = float(one["acceptable_error"])
            for side in ("lower", "upper"):
                numbers[f"{side}_corner_{axis}_hz"] = float(one["corner"].sel(side=side))
            numbers[f"attenuation_{axis}_db"] = float(
                20 * np.log10(one["envelope"].max() / acceptable)
            )
            numbers[f"error_acceptable_from_{axis}_hz"] = math.sqrt(
                float(one["acceleration"]) / acceptable
            ) / (2 * math.pi)
        return numbers

    def tables(self, answer: Dataset) -> dict[str, str]:
        lines = [
            "| direction | deviation [m] | acceleration [m/s^2] | above 500 Hz [m] "
            "| corners [Hz] | printed [Hz] | acceptable error [m] |",
            "| --- |" + " ---: |" * 6,
        ]
        for axis in AXES:
            limits, (lower, upper) = red_book(axis), answer["corner"].sel(axis=axis).values
            printed = "{:g}, {:g}".format(*PRINTED_CORNERS[axis])
            lines.append(
                f"| {DIRECTION[axis]} | {limits.deviation:g} | {limits.acceleration:g} "
                f"| {limits.deviation_above:g} | {lower:.1f}, {upper:.1f} | {printed} "
                f"| {ACCEPTABLE_ERROR[axis]:g} |"
            )
        return {"tables-2-3-2-4": "\n".join(lines) + "\n"}

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        figure, (deviation, attenuation) = figures.axes(2, 1, size=(7.0, 6.4), sharex=True)
        frequency = answer["frequency"]
        for axis, colour in zip(AXES, (figures.BLUE, figures.ORANGE), strict=True):
            one, name = answer.sel(axis=axis), f"{DIRECTION[axis]} ({axis})"
            acceptable = float(one["acceptable_error"])
            (lower, upper), limits = one["corner"].values, red_book(axis)
            deviation.loglog(frequency, one["envelope"] * 1e6, color=colour, label=name)
            deviation.axhline(
                acceptable * 1e6, color=colour, ls="--", lw=1, label=f"acceptable error, {axis}"
            )
            levels = np.array([limits.deviation, limits.deviation_above]) * 1e6
            deviation.plot([lower, upper], levels, "o", color=colour, ms=4)
            for place, level, below in zip((lower, upper), levels, (6, -14), strict=True):
                deviation.annotate(
                    f"{place:.3g} Hz", (place, level), (2, below), textcoords="offset points"
                )
            attenuation.loglog(frequency, one["envelope"] / acceptable, color=colour)
        deviation.set_ylim(bottom=0.01)
        attenuation.axhline(1.0, color=figures.BLACK, lw=0.8)
        deviation.set_ylabel("largest deviation [um]")
        attenuation.set_ylabel("deviation / acceptable error [1]")
        attenuation.set_xlabel("frequency [Hz]")
        figures.legend_below(figure, deviation, columns=2)
        return {"figure-2-12": figure}
