"""Error curves of two methods that sense the focus, over a range of designs (figure 2.8).

Section and figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field
from scipy.optimize import brentq

from workbench import problem
from workbench.study import Study, array, arrays, check, dim, figure, metric, part, table
from workbench.types import DataArray, Dataset, RealArray

from ..tables import disc_formats, drives
from .figures import curves, designs
from .methods import FocusSensor, extremes, gain, half_range, linear_range

FOUCAULT, ASTIGMATIC, SAME_GAIN = METHODS = (
    "Foucault",
    "astigmatic",
    "astigmatic, same gain",
)
LINES = (6e-6, 12e-6, 20e-6)
"""Distances between the focal lines [m at the disc], which in ray optics are the extremes of the
astigmatic curve. Section 4.4.1 has 12 um; the others are about half and about twice that.
"""
DIODES = (1.25, 1.5, 2.0, 3.0)
"""Half width of the diodes, over the radius of the astigmatic method's round spot in focus. The
diodes must hold this spot.
"""
FARTHEST = 60e-6
"""Largest error [m]."""
MUCH = 2.0
"""Ratio of capture ranges from which one range counts as "much" smaller than the other."""
SHIFTS = (1e-6, 2e-6, 5e-6)
"""Displacements of the diodes [m, measured on the diodes]."""
Length = Annotated[float, Field(gt=0, allow_inf_nan=False)]


@problem("cd/focus-error", data=("data/disc_formats.csv", "data/drives.csv"))
def focus_error(
    errors: Annotated[int, Field(ge=61, le=2001)] = 201,
    objective: Length = 4e-3,
    detector_lens: Length = 24e-3,
) -> FocusError:
    """Focus error by Foucault's and by the astigmatic method, by scalar diffraction (figure 2.8).

    Twelve designs have focal lines 6, 12 or 20 um apart at the disc, and diodes 1.25 to 3 times as
    wide as the round spot. In each, both methods have the same diodes. A third curve is astigmatic,
    with focal lines so close that its gain equals Foucault's.

    Capture ranges are given in two ways: the distance between the extremes of the difference, and
    the width over which the difference still has at least half of its extremes. Gains are those of
    the normalised difference (equation 3.16).

    errors: number of errors within 60 um, made odd. objective, detector_lens: focal lengths [m],
    which convert lengths at the disc into lengths on the diodes and change nothing else.
    """
    if errors % 2 == 0:
        errors += 1
    return FocusError(errors, objective, detector_lens)


@dataclass(frozen=True)
class FocusError(Study):
    """Signals of both methods in every design."""

    errors: int
    objective: float
    detector_lens: float

    headline: ClassVar[str] = "extremes_Foucault_over_astigmatic_median"

    @property
    def quantifier(self) -> str:
        return f"for these {len(LINES) * len(DIODES)} designs"

    scheme = dim(METHODS)
    lines = dim(LINES, unit="m", meaning="distance of the focal lines at the disc")
    diode = dim(DIODES, meaning="width of the diodes over that of the round spot")
    shift = dim(SHIFTS, unit="m", meaning="displacement of the diodes")

    @part
    def places(self) -> RealArray:
        """Focus errors [m], denser near the focus."""
        even = np.linspace(-1.0, 1.0, self.errors)
        return FARTHEST * np.sinh(3.5 * even) / np.sinh(3.5)

    error = dim(lambda places: places, unit="m", meaning="focus error")

    @part
    def sensor(self, places: RealArray) -> FocusSensor:
        disc = disc_formats()["CD"]
        return FocusSensor(disc, places, max(LINES) * disc.NA * max(DIODES))

    @array(dims=(lines, diode), unit="m", meaning="half the width of the diodes, at the disc")
    def half_width(self, sensor: FocusSensor) -> RealArray:
        return np.outer([sensor.least_confusion(one) for one in LINES], DIODES)

    @array(dims=(), unit="m", meaning="distance of focal lines at which the gains are the same")
    def matched(self, sensor: FocusSensor) -> float:
        """Computed with the widest diodes; narrower ones change the gains by a few per cent."""
        near = FocusSensor(sensor.disc, np.array([-1.0, 0.0, 1.0]) * 0.05e-6, sensor.reach)
        wanted = _gain(near.errors, near.on_halves(near.knife(), near.reach))

        def off(lines: float) -> float:
            pairs = near.on_quadrants(near.astigmatic(lines), near.reach)
            return abs(_gain(near.errors, pairs)) - abs(wanted)

        return float(brentq(off, 4e-6, 12e-6, xtol=1e-9))

    @arrays((scheme, lines, diode, error), difference="1", total="1")
    def signals(
        self, sensor: FocusSensor, half_width: DataArray, matched: DataArray
    ) -> dict[str, RealArray]:
        """Difference and sum of the diodes, as shares of the returned light."""
        pairs = np.zeros((2, *half_width.shape, len(METHODS), self.errors))
        knife, near = sensor.knife(), sensor.astigmatic(float(matched))
        for i, one in enumerate(LINES):
            spots = sensor.astigmatic(one)
            for j, a in enumerate(half_width.values[i]):
                pairs[:, i, j, 0] = sensor.on_halves(knife, a)
                pairs[:, i, j, 1] = sensor.on_quadrants(spots, a)
                pairs[:, i, j, 2] = sensor.on_quadrants(near, a)
        first, second = np.moveaxis(pairs, 3, 1)
        middle = self.errors // 2
        upwards = np.sign((first - second)[..., middle + 1])[..., None]
        return {"difference": upwards * (first - second), "total": first + second}

    @array(
        dims=(scheme, shift),
        unit="m",
        meaning="false focus of displaced diodes, focal lines 12 um apart",
    )
    def offset(self, sensor: FocusSensor, half_width: DataArray) -> RealArray:
        """Error at which the difference is 0, for diodes twice as wide as the spot."""
        a = float(half_width.sel(lines=12e-6, diode=2.0))
        fine = FocusSensor(sensor.disc, np.linspace(-4e-6, 4e-6, 33), sensor.reach)
        shifts = np.array(SHIFTS) * self.objective / self.detector_lens
        spots = (fine.knife(), fine.astigmatic(12e-6))
        found = [
            [_zero(fine.errors, on(one, a, shift)) for shift in shifts]
            for one, on in zip(spots, (fine.on_halves, fine.on_quadrants), strict=True)
        ]
        return np.array([*found, [np.nan] * len(SHIFTS)])

    # --- what is read of the curves -----------------------------------------------------------

    def normalised(self, answer: Dataset) -> DataArray:
        """Difference over sum, as the computer forms it from the diodes (eq. 3.16)."""
        return answer["difference"] / answer["total"]

    apart = array(
        dims=(scheme, lines, diode),
        unit="m",
        meaning="between the extremes",
        value=lambda difference: _each(extremes, difference),
    )
    half = array(
        dims=(scheme, lines, diode),
        unit="m",
        meaning="told by half of the extremes",
        value=lambda difference: _each(half_range, difference),
    )
    slope = array(
        dims=(scheme, lines, diode),
        unit="1/m",
        meaning="gain of the normalised difference",
        value=lambda difference, total: _each(gain, difference / total),
    )
    straight = array(
        dims=(scheme, lines, diode),
        unit="m",
        meaning="within 10 % of its tangent",
        value=lambda difference, total: _each(linear_range, difference / total),
    )

    @check(at_most=1e-9)
    def odd(self, difference: DataArray) -> float:
        """largest sum of a curve at two places of opposite defocus, as a share of the light"""
        return float(abs(difference.values + difference.values[..., ::-1]).max())

    @check(at_most=0.15)
    def foucault_gain(self, slope: DataArray) -> float:
        """relative distance of Foucault's gain from 3 NA^2 / (2 lambda), which is paraxial"""
        disc = disc_formats()["CD"]
        paraxial = 1.5 * disc.NA**2 / disc.wavelength
        return float(abs(slope.sel(scheme=FOUCAULT) / paraxial - 1).max())

    @check(at_most=0.15)
    def astigmatic_gain(self, slope: DataArray) -> float:
        """relative distance of the astigmatic gain from 8 / (pi lines), which is that of rays"""
        rays = 8.0 / (np.pi * slope["lines"])
        return float(abs(slope.sel(scheme=ASTIGMATIC) / rays - 1).max())

    @check(at_most=0.15)
    def same_gain(self, slope: DataArray) -> float:
        """relative difference of the gains that are to be the same"""
        return float(abs(slope.sel(scheme=SAME_GAIN) / slope.sel(scheme=FOUCAULT) - 1).max())

    @check(at_most=1.0)
    def smaller(self, apart: DataArray, half: DataArray) -> float:
        """largest ratio of the astigmatic method's capture range to Foucault's, same diodes"""
        return max(float(1.0 / _ratio(one, ASTIGMATIC).min()) for one in (apart, half))

    @metric
    def ratios(self, apart: DataArray, half: DataArray) -> dict[str, float]:
        """Foucault's capture range over the others': least, median and largest, and how often
        "much" smaller.
        """
        numbers: dict[str, float] = {}
        for kind, one in (("extremes", apart), ("half", half)):
            for scheme, name in ((ASTIGMATIC, "astigmatic"), (SAME_GAIN, "same_gain")):
                ratio = _ratio(one, scheme)
                key = f"{kind}_Foucault_over_{name}"
                numbers |= {
                    f"{key}_least": float(ratio.min()),
                    f"{key}_median": float(ratio.median()),
                    f"{key}_most": float(ratio.max()),
                    f"{key}_much": float((ratio >= MUCH).mean()),
                }
        return numbers

    gains = metric(
        template="gain_{scheme}_per_um", value=lambda slope: 1e-6 * slope.median(["lines", "diode"])
    )
    linear = metric(
        template="linear_{scheme}_um",
        value=lambda straight: 1e6 * straight.median(["lines", "diode"]),
    )
    matched_lines = metric("lines_of_same_gain_um", value=lambda matched: 1e6 * matched)
    false = metric(
        template="offset_{scheme}_um_per_um_on_the_diodes",
        value=lambda offset: (
            abs(offset / offset["shift"]).max("shift").sel(scheme=list(METHODS[:2]))
        ),
    )

    @metric
    def measured_gain(self, slope: DataArray) -> dict[str, float]:
        """Middle gain of Table A.3 over the gains of the methods, as a median over the designs."""
        table = [one.K_optn for one in drives("focus", "printed")]
        middle = (min(table) + max(table)) / 2
        return {
            f"table_A_3_over_gain_{name}": middle / float(slope.sel(scheme=scheme).median())
            for name, scheme in (("Foucault", FOUCAULT), ("astigmatic", ASTIGMATIC))
        }

    @table
    def every_design(self, answer: Dataset) -> tuple[list[str], list[list[str]]]:
        """Table of every design, with sizes on the diodes from the focal lengths."""
        power = self.detector_lens / self.objective
        rows = []
        for lines in LINES:
            for diode in DIODES:
                one = answer.sel(lines=lines, diode=diode)
                sizes = [2 * lines * power**2, 2 * float(one["half_width"]) * power]
                row = [f"{1e6 * lines:g}", f"{diode:g}", f"{1e3 * sizes[0]:.2f}"]
                row.append(f"{1e6 * sizes[1]:.0f}")
                for name in ("apart", "half", "straight"):
                    row += [f"{1e6 * x:.1f}" for x in one[name].values]
                rows.append([*row, *(f"{1e-6 * x:.3f}" for x in one["slope"].values)])
        heads = ["focal lines [um]", "diode / spot", "focal lines [mm behind the lens]"]
        heads.append("diodes [um wide]")
        told = ("extremes apart [um]", "half range [um]", "linear range [um]", "gain [1/um]")
        heads += [f"{what}, {scheme}" for what in told for scheme in METHODS]
        return heads, rows

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Any]:
        return {"figure-2-8": curves(answer), "capture": designs(answer)}


def _gain(errors: RealArray, pair: RealArray) -> float:
    first, second = pair
    return gain(errors, (first - second) / (first + second))


def _zero(errors: RealArray, pair: RealArray) -> float:
    """Error [m] nearest to the focus at which two diodes have the same light; NaN if
    there is none.
    """
    signal = pair[0] - pair[1]
    at = np.flatnonzero(np.diff(np.signbit(signal)))
    if not at.size:
        return float("nan")
    left = at[abs(errors[at]).argmin()]
    share = signal[left] / (signal[left] - signal[left + 1])
    return float(errors[left] + share * (errors[left + 1] - errors[left]))


def _each(read: Callable[[RealArray, RealArray], float], curves: DataArray) -> RealArray:
    """Value that `read` finds for each curve."""
    errors = curves["error"].values
    found: RealArray = np.apply_along_axis(lambda one: read(errors, one), -1, curves.values)
    return found


def _ratio(values: DataArray, scheme: str) -> DataArray:
    return values.sel(scheme=FOUCAULT) / values.sel(scheme=scheme)
