"""Optical gains from the diodes' signals and one known distance (section 4.4).

Focus: a ramp moves the lens through the s-curve of a disc at rest; the extremes of the s-curve are
12 um apart. Radial: an eccentric disc moves its tracks past a lens at rest; the tracks are 1.6 um
apart. Section and figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field
from scipy import stats

from workbench import Check, figures, problem
from workbench.executor import Context
from workbench.study import (
    CLAIM_SHARE,
    Study,
    array,
    check,
    dim,
    draws_summary,
    figure,
    interval_text,
    metric,
    part,
    table,
)
from workbench.types import DataArray, Dataset, Figure, RealArray

from ..drive.photo_diodes import S_CURVE_PEAK, TRACK_PITCH
from ..drive.shared_parameters import TABLES, spread
from ..drive.tables import Axis, drives
from .experiment import Laboratory
from .printed_noise import Amplitude, Fixed, position_noise
from .scans import Scan, focus_scan, radial_scan
from .unknowns import DISTANCE_DEVIATION, Told, experiment_seeds

OPTICAL_GAINS = {"K_opt": "V/m", "K_optn": "units/m"}
"""The two optical gains and their units."""
SIGNS = {"K_opt": "$K_{opt}$", "K_optn": "$K_{optn}$"}
"""The gains as they are written in figures and tables."""
CONFIDENCE = 0.99
"""Probability with which an interval covers the true gain."""
NORMAL = float(stats.norm.ppf(0.5 + CONFIDENCE / 2))
LEAST_P = 1e-3
"""Smallest accepted probability of a coverage this low, if the intervals keep their promise."""
GAIN_TOLERANCE = {"focus": 0.06, "radial": 0.03}
"""Largest accepted error of a gain in 95 % of the draws, relative: three standard deviations of the
told distance.
"""
STATED_SPREADS = {"focus": {"K_opt": 0.5, "K_optn": 0.2}, "radial": {"K_opt": 0.3, "K_optn": 0.1}}
"""Spreads over the twelve drives as stated in section 4.6.3. In focus the spread of K_opt is stated
as more and that of K_optn as less than these; the radial spreads are near them.
"""
SPREAD_TOLERANCE = {"K_opt": 0.03, "K_optn": 0.02}
"""Largest accepted difference between a radial spread and the stated one."""
SPREAD_SLACK = 0.02
"""Amount by which errors of the told distance may widen a spread over the drives."""


@problem(
    "cd/{axis}/optical-gain",
    slow=True,
    axis=("focus", "radial"),
    data=TABLES,
    added=("delay", "noise", "noise_fixed"),
)
def optical_gain(
    axis: Axis,
    passes: Annotated[int, Field(ge=2, le=1000)] = 10,
    draws: Annotated[int, Field(ge=1, le=1000)] = 12,
    delay: Annotated[float, Field(ge=0, le=2)] = 1.0,
    noise: Amplitude = "rms",
    noise_fixed: Fixed = "metres",
) -> OpticalGain:
    """Optical gains of the twelve drives from scans of s-curve and tracks (figures 4.6, 4.7).

    Focus: ramps through the s-curve while the disc is at rest. Radial: the tracks of an eccentric
    disc pass the lens sideways in open loop. The diodes' signals and a known distance in them give
    K_opt [V/m] and K_optn [units/m] of Table A.3, and their spreads over the drives. The bench has
    no optical cross-coupling, so the radial sum of figure 4.6 is left out.

    In every draw the known distance is told with an error, whose standard deviation is 2 % in focus
    and 1 % radially. The intervals include this error, the noise, and, in focus, the change of the
    gains if no shape of the s-curve is assumed.

    passes: number of averaged passes to and fro (focus), or of half rotations (radial). draws:
    number of draws of the noise and of the told distance on each drive. delay [samples]: of the
    computer. noise, noise_fixed: reading of the printed amplitude of 0.15 um (`printed_noise`).
    """
    return OpticalGain(axis, passes, draws, delay, noise, noise_fixed)


@dataclass(frozen=True, eq=False)
class OpticalGain(Study):
    """Scans of one axis on all drives, repeated over draws."""

    axis: Axis
    passes: int
    draws: int
    delay: float = 1.0
    noise: Amplitude = "rms"
    noise_fixed: Fixed = "metres"

    headline: ClassVar[str] = "error_K_optn_mean"

    @property
    def quantifier(self) -> str:
        return f"for these 12 drives, in {self.draws} simulated draws of each"

    drive = dim(lambda self: [each.name for each in drives(self.axis)])
    quantity, draw = dim(OPTICAL_GAINS), dim(lambda self: range(self.draws))
    unit = array(dims=quantity, value=lambda: list(OPTICAL_GAINS.values()), coordinate=True)

    @array(dims=(draw, drive))
    def seed(self, drive: DataArray, context: Context) -> Any:
        every = [
            experiment_seeds(context.rng, "optical-gain", name, self.draws)
            for name in drive.values.tolist()
        ]
        return np.transpose(every)

    def bench(self, drive: str) -> Laboratory:
        """The bench with one drive on it."""
        size = position_noise(self.axis, drive, self.noise, self.noise_fixed)
        return Laboratory(self.axis, drive, delay=self.delay, noise=size)

    @part
    def scans(self, seed: DataArray, context: Context) -> list[list[Scan]]:
        """A scan of every drive in every draw, each with its own noise."""
        scan = focus_scan if self.axis == "focus" else radial_scan

        def scanned(place: tuple[int, ...]) -> Scan:
            one = seed[place]
            return scan(self.bench(str(one["drive"].values)), self.passes, int(one))

        found = context.spread(scanned, list(np.ndindex(seed.shape)), "scans")
        size = seed.sizes["drive"]
        return [found[n * size : (n + 1) * size] for n in range(self.draws)]

    distance = dim(lambda scans: scans[0][0].distance, unit="m")
    along = (drive, distance)
    difference = array(
        dims=along,
        unit="V",
        meaning="error, one draw",
        value=lambda scans: _first_draw(scans, "difference"),
    )
    sum = array(
        dims=along,
        unit="V",
        meaning="sum of the diodes, one draw",
        value=lambda scans: _first_draw(scans, "sum"),
    )
    normalised = array(
        dims=along,
        unit="1",
        meaning="normalised error",
        value=lambda difference, sum: difference / sum,
    )

    told = array(
        dims=(draw, drive),
        unit="1",
        meaning="distance that is told over the true one",
        value=lambda self, seed: [
            [Told.drawn(self.axis, one).distance for one in row] for row in seed.values.tolist()
        ],
    )
    found = array(
        dims=(draw, drive, quantity),
        value=lambda scans, told: _field_of_scans(scans, "gains") / told.values[..., None],
    )

    @array(
        dims=(draw, drive, quantity), unit="1", meaning="half-width of the 99 % interval, relative"
    )
    def half_width(self, scans: list[list[Scan]]) -> RealArray:
        degrees = _field_of_scans(scans, "repeats")[..., None] - 1
        noise = stats.t.ppf(0.5 + CONFIDENCE / 2, degrees) * _field_of_scans(scans, "scatter")
        known = NORMAL * DISTANCE_DEVIATION[self.axis]
        half: RealArray = np.hypot(noise, known) + _field_of_scans(scans, "law")[..., None]
        return half

    gain = array(dims=(drive, quantity), value=lambda found: found.isel(draw=0, drop=True))

    def error(self, gain: DataArray) -> DataArray:
        """Relative distance of gains (..., drive, quantity) from those of Table A.3."""
        return gain / _table_gains(self.axis) - 1

    @check(title="{quantity}", at_most=1.0 - CLAIM_SHARE, each="quantity")
    def near(self, found: DataArray) -> DataArray:
        """share of the scans with an error above three deviations of the told distance"""
        return (abs(self.error(found)) > GAIN_TOLERANCE[self.axis]).mean(["draw", "drive"])

    @check(title="{quantity} covered", at_most=1.0 - LEAST_P, each="quantity")
    def enough(self, found: DataArray, half_width: DataArray) -> DataArray:
        """one minus the probability that 99 % intervals cover no more often than these"""
        covered = self.covered(found, half_width)
        held, tried = covered.sum(["draw", "drive"]), self.draws * covered.sizes["drive"]
        return held.copy(data=1.0 - stats.binom.cdf(held, tried, CONFIDENCE))

    def covered(self, found: DataArray, half_width: DataArray) -> DataArray:
        """Whether an interval holds the true gain."""
        return abs(self.error(found)) <= half_width

    @check()
    def spreads(self, found: DataArray) -> list[Check]:
        """The statements of section 4.6.3: bounds in focus, approximate values in the
        radial loop.
        """
        mean, stated = spread(found.mean("draw")), STATED_SPREADS[self.axis]
        K_opt, K_optn = (float(mean.sel(quantity=name)) for name in OPTICAL_GAINS)
        if self.axis == "focus":
            short = f"{stated['K_opt']:g} less the drives' spread of the mean over the draws [1]"
            most = "drives' spread of the mean over the draws [1]"
            return [
                Check("spread of K_opt", short, stated["K_opt"] - K_opt, 0.0),
                Check("spread of K_optn", most, K_optn, stated["K_optn"] + SPREAD_SLACK),
            ]
        return [
            Check(
                f"spread of {name}",
                f"distance from {said:g} of the drives' spread of the mean over the draws [1]",
                abs(one - said),
                SPREAD_TOLERANCE[name],
            )
            for (name, said), one in zip(stated.items(), (K_opt, K_optn), strict=True)
        ]

    errors = metric(
        template="error_{quantity}_{summary}",
        value=lambda self, found: draws_summary(abs(self.error(found)), "drive"),
    )
    errors_without_told = metric(
        template="error_{quantity}_known_distance_{summary}",
        value=lambda self, found, told: draws_summary(abs(self.error(found * told)), "drive"),
    )
    coverage = metric(
        template="covered_{quantity}",
        value=lambda self, found, half_width: self.covered(found, half_width).mean(
            ["draw", "drive"]
        ),
    )
    half_widths = metric(
        template="half_width_{quantity}",
        value=lambda half_width: half_width.mean(["draw", "drive"]),
    )
    spread = metric(
        template="spread_{quantity}_{summary}",
        value=lambda found: draws_summary(found.groupby("draw").map(spread)),
    )

    @table
    def gains(self, found: DataArray, half_width: DataArray) -> tuple[list[str], list[list[str]]]:
        heads = ["drive"]
        for name, unit in OPTICAL_GAINS.items():
            heads += [f"{SIGNS[name]} [{unit}]", "99 %", "Table A.3", "covered"]
        covered, told = self.covered(found, half_width).mean("draw"), draws_summary(found)
        rows = []
        for number, drive in enumerate(found["drive"].values):
            row = [str(drive)]
            for name, true in zip(OPTICAL_GAINS, _table_gains(self.axis)[number], strict=True):
                at = {"drive": drive, "quantity": name}
                width = float(half_width.sel(at).mean("draw"))
                share = f"{float(covered.sel(at)):.0%}"
                row += [
                    interval_text(told.sel(at), form="{:.0f}"),
                    f"{width:.1%}",
                    f"{true:.0f}",
                    share,
                ]
            rows.append(row)
        return heads, rows

    @figure
    def scan(self, answer: Dataset) -> dict[str, Figure]:
        name = "s-curve" if self.axis == "focus" else "track-scan"
        return {name: _scan_figure(answer, self.axis), "gains": _gain_figure(answer)}


def _field_of_scans(scans: list[list[Scan]], name: str) -> RealArray:
    """One field of all scans (draws, drives, ...)."""
    return np.array([[getattr(one, name) for one in row] for row in scans])


def _first_draw(scans: list[list[Scan]], name: str) -> list[RealArray]:
    """One signal of every drive in the first draw."""
    return [getattr(one, name).astype("f4") for one in scans[0]]


def _table_gains(axis: Axis) -> RealArray:
    """The gains of Table A.3, (12, 2)."""
    return np.array([[getattr(drive, name) for name in OPTICAL_GAINS] for drive in drives(axis)])


def _scan_figure(answer: Dataset, axis: Axis) -> Figure:
    one = answer.sel(drive="CD1")
    distance = 1e6 * one["distance"].values
    figure, (volts, units) = figures.axes(2, 1, size=(7.0, 5.6), sharex=True)
    volts.plot(distance, 1e3 * one["difference"], label=f"{axis} error")
    volts.plot(distance, 1e3 * one["sum"], color=figures.GREEN, label=f"{axis} sum")
    units.plot(distance, one["normalised"], color=figures.ORANGE)
    slope = float(one["gain"].sel(quantity="K_optn"))
    reach = S_CURVE_PEAK if axis == "focus" else TRACK_PITCH / 4
    line = np.array([-0.6, 0.6]) * reach
    dashed: Any = {"color": figures.BLACK, "linestyle": "--", "linewidth": 1.0}
    units.plot(1e6 * line, slope * line, **dashed)
    volts.plot([], [], color=figures.ORANGE, label="normalised error")
    volts.plot([], [], **dashed, label=f"slope {SIGNS['K_optn']}")
    volts.set_title(f"CD1, {'s-curve' if axis == 'focus' else 'tracks passing sideways'}, one draw")
    volts.set_ylabel("diodes [mV]")
    units.set_ylabel("normalised error [units]")
    units.set_xlabel(r"distance [$\mu$m]")
    figures.legend_below(figure, volts)
    return figure


def _gain_figure(answer: Dataset) -> Figure:
    figure, panels = figures.axes(2, 1, size=(7.0, 5.0), sharex=True)
    for panel, (name, unit) in zip(panels, OPTICAL_GAINS.items(), strict=True):
        found = answer["gain"].sel(quantity=name)
        gain = found.values
        middle = (gain.max() + gain.min()) / 2
        panel.bar(answer["drive"].values, gain, color=figures.BLUE, width=0.6)
        panel.axhline(middle, color=figures.BLACK, linestyle="--", linewidth=1.0)
        panel.set_title(
            f"{SIGNS[name]}: ±{float(spread(found)):.1%} around the dashed middle, one draw"
        )
        panel.set_ylabel(f"{SIGNS[name]} [{unit}]")
    return figure
