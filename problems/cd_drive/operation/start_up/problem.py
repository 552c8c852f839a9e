"""The focus loop is closed on a ramp: how fast may it be, and on which disc (section 2.4.3)?

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import problem
from workbench.executor import Context
from workbench.study import (
    CLAIM_SHARE,
    Study,
    array,
    arrays,
    check,
    dim,
    figure,
    independent_seeds,
    interval_text,
    metric,
    part,
    share_interval,
    table,
)
from workbench.types import DataArray, Dataset, RealArray

from ...drive.photo_diodes import S_CURVE_LINEAR, S_CURVE_PEAK
from ...drive.shared_parameters import TABLES
from ...drive.tables import drives, red_book
from ...laboratory.bench_setup import RATE
from .bounds import escape_speed, held_speed, linear_overshoot
from .figures import by_relative_speed, by_speed, started
from .runs import LAWS, LAYER_OFFSET, OUTCOMES, QUIET, Attempt, StartUp

SPEEDS = (2.5e-3, 5e-3, 10e-3, 20e-3, 40e-3)
"""Speeds of the ramp [m/s]."""
SHARES = (0.0, 0.1, 0.3, 1.0)
"""Deviations of the disc over what the Red Book allows."""
OWN, NOMINAL, LOW, QUIET_LOW = LAWS
CAPTURED = OUTCOMES.index("captured")
FARTHEST = LAYER_OFFSET + red_book("focus").deviation
"""Largest distance [m] of the layer from the rest of the lens."""
STEADY = SPEEDS[:2]
"""Speeds of ramps that are long enough for the lens to stop ringing before it meets the layer."""
BEFORE, AFTER = 2e-3, 4e-3
"""Times [s] before and after the closing of the loop that figures show."""


@problem("cd/focus/start-up", data=(*TABLES, "data/red_book.csv"))
def start_up(draws: Annotated[int, Field(ge=1, le=1000)] = 4) -> StartUpStudy:
    """How fast the focus loop may be started, and on which disc (section 2.4.3).

    The lens draws back, then advances through the disc's surface to its layer, driven by a voltage
    that suits the nominal drive. If the sum of the diodes exceeds a threshold and the error crosses
    zero, the reference controller takes over from the ramp. There are twelve drives, five speeds,
    discs at rest or wobbling at 9 Hz, and thresholds on the sum.

    Assumed: the s-curve fades as in the laboratory's optics; the surface reflects by Fresnel's law,
    a lens position of 0.75 mm before the layer, undisturbed by spherical aberration; the layer lies
    within 0.1 mm of the lens' rest. Computed for each drive: the relative speed up to which the
    error stays where the loop is linear, and the one above which no voltage keeps it in the
    s-curve. Simulated: shares of draws with 99 % Clopper-Pearson intervals.

    draws: number of draws of the disc's position and angle and of noise, for every drive, speed,
    disc and threshold.
    """
    return StartUpStudy(draws)


@dataclass(frozen=True)
class StartUpStudy(Study):
    """Start-ups by every law, at every speed, on every disc and drive."""

    draws: int

    headline: ClassVar[str] = "captured_slow_still_low"

    @property
    def quantifier(self) -> str:
        return f"for these 12 drives, in {self.draws} simulated draws of each start"

    law, share = dim(LAWS), dim(SHARES, meaning="deviation over the Red Book's")
    speed = dim(SPEEDS, unit="m/s")
    drive = dim(lambda: [one.name for one in drives("focus")])
    draw = dim(lambda self: range(self.draws))
    kind = dim(OUTCOMES)

    # --- bounds -------------------------------------------------------------------------------

    held = arrays(
        drive,
        lambda drive: {
            "held": [held_speed(str(one)) for one in drive.values],
            "per_speed": [linear_overshoot(str(one)) for one in drive.values],
            "escape": [escape_speed(str(one), FARTHEST) for one in drive.values],
        },
        held=("m/s", "relative speed up to which the error stays in the linear range"),
        per_speed=("s", "largest error over the relative speed, linear loop"),
        escape=("m/s", "relative speed above which the lens leaves the s-curve"),
    )

    # --- simulations --------------------------------------------------------------------------

    seed = array(
        dims=(drive, draw),
        value=lambda self, context: independent_seeds(context.rng, 12, self.draws),
    )

    @part
    def met(self, context: Context, seed: DataArray) -> RealArray:
        """Attempts (laws, speeds, shares, drives, draws, 3)."""

        def one(place: tuple[int, ...]) -> list[Attempt]:
            at = seed[place]
            name, number = str(at["drive"].values), int(at)
            return [
                StartUp(law, speed, share).attempt(name, number)
                for law in LAWS
                for speed in SPEEDS
                for share in SHARES
            ]

        found = context.spread(one, list(np.ndindex(seed.shape)), "start-ups")
        shape = (*seed.shape, len(LAWS), len(SPEEDS), len(SHARES), len(Attempt._fields))
        return np.moveaxis(np.reshape(found, shape), (0, 1), (3, 4))

    told = arrays(
        (law, speed, share, drive, draw),
        lambda met: {
            "outcome": met[..., 0].astype("i1"),
            "relative": met[..., 1].astype("f4"),
            "overshoot": met[..., 2].astype("f4"),
        },
        outcome=("1", "number of the kind of outcome"),
        relative=("m/s", "speed of lens and layer when the loop is closed"),
        overshoot=("m", "largest error from then on"),
    )

    @part
    def without_noise(self, seed: DataArray) -> RealArray:
        """Attempts (drives, steady speeds, 3) without noise on discs at rest, for the first
        draws.
        """
        return np.array(
            [
                [
                    StartUp(OWN, speed, 0.0).attempt(name, int(seed.sel(drive=name)[0]), **QUIET)
                    for speed in STEADY
                ]
                for name in seed["drive"].values.tolist()
            ]
        )

    steady = dim(STEADY, unit="m/s")
    quiet = arrays(
        (drive, steady),
        lambda without_noise: {
            "quiet_relative": without_noise[..., 1],
            "quiet_overshoot": without_noise[..., 2],
        },
        quiet_relative=("m/s", "relative speed at closing, without noise"),
        quiet_overshoot=("m", "largest error, without noise"),
    )

    @array(
        dims=steady,
        unit="m",
        meaning="largest error of the first drive, optics followed twice as finely",
    )
    def half_step(self, seed: DataArray) -> list[float]:
        name, number = str(seed["drive"].values[0]), int(seed[0, 0])
        starts = [StartUp(OWN, speed, 0.0) for speed in STEADY]
        return [one.attempt(name, number, **QUIET, refine=2).overshoot for one in starts]

    time = dim(
        lambda: np.arange(-round(BEFORE * RATE), round(AFTER * RATE)) / RATE,
        unit="s",
        meaning="time from the closing of the loop",
    )
    tick = dim(lambda one_start: range(len(one_start[0])))
    shown_time = array(dims=tick, unit="s", value=lambda one_start: one_start[0])
    whole = arrays(
        tick,
        value=lambda one_start: dict(zip(("whole_lens", "whole_sum"), one_start[1:3], strict=True)),
        whole_lens=("m", "lens, from the layer"),
        whole_sum=("1", "sum over that of the layer"),
    )
    zoomed = arrays(
        time,
        value=lambda one_start: dict(
            zip(("zoom_error", "zoom_read", "zoom_u"), one_start[3], strict=True)
        ),
        zoom_error=("m", "true error"),
        zoom_read=("1", "normalised error"),
        zoom_u=("V", "control voltage"),
    )

    @part
    def one_start(self) -> tuple[Any, ...]:
        """One record: every tenth sample, and all samples around the closing."""
        start = StartUp(OWN, SPEEDS[1], 0.0)
        record = start.record("CD1", 1)
        error, first = record.x_cd - record.x, int(np.argmax(record.signals["closed"] == 1.0))
        total = record.sum / (2 * start.threshold("CD1"))
        inside = slice(first - round(BEFORE * RATE), first + round(AFTER * RATE))
        thin = slice(0, first + round(0.02 * RATE), 10)
        near = [one[inside].astype("f4") for one in (error, record.f_en, record.u)]
        return record.time[thin], -error[thin].astype("f4"), total[thin].astype("f4"), near

    # --- checks -------------------------------------------------------------------------------

    @check(at_most=1.0 - CLAIM_SHARE)
    def slow(self, outcome: DataArray) -> float:
        """share of slow starts on standing discs that end elsewhere, by the drive's own light"""
        one = outcome.sel(law=OWN, speed=list(SPEEDS[:2]), share=0.0)
        return float((one != CAPTURED).mean())

    @check(title="surface", at_most=0.0)
    def no_surface(self, outcome: DataArray) -> float:
        """starts by half of the drive's own light that end on the surface or in the dark"""
        one = outcome.sel(law=OWN)
        wrong = [OUTCOMES.index(name) for name in ("surface", "dark")]
        return float(one.isin(wrong).sum())

    @check(title="linear bound", at_most=0.05)
    def linear(self, answer: Dataset) -> DataArray:
        """relative excess of a simulated overshoot without noise over that of the linear loop"""
        return answer["quiet_overshoot"] / (answer["per_speed"] * answer["quiet_relative"]) - 1.0

    @check(title="escape", at_most=0.0)
    def escaped(self, relative: DataArray, overshoot: DataArray, escape: DataArray) -> float:
        """starts that pass the layer faster than any voltage brakes, and stay in the s-curve"""
        return float(((abs(relative) > escape) & (overshoot < S_CURVE_PEAK)).sum())

    @check(title="half the step", at_most=1e-3)
    def replayed(self, half_step: DataArray, quiet_overshoot: DataArray) -> DataArray:
        """relative change of an overshoot when the optics are followed twice as finely"""
        return abs(half_step / quiet_overshoot.isel(drive=0) - 1.0)

    # --- what is told -------------------------------------------------------------------------

    @metric
    def shares(self, outcome: DataArray) -> dict[str, float]:
        """Shares of outcomes, with 99 % intervals where a verdict may hang on them."""
        captured = outcome == CAPTURED
        cases = {
            "slow_still": captured.sel(law=OWN, share=0.0, speed=list(SPEEDS[:2])),
            "slow_red_book": captured.sel(law=OWN, share=1.0, speed=list(SPEEDS[:2])),
            "fast_still": captured.sel(law=OWN, share=0.0, speed=SPEEDS[-1]),
            "nominal_light": captured.sel(law=NOMINAL, share=0.0, speed=list(SPEEDS[:2])),
            "nominal_light_CD6": captured.sel(
                law=NOMINAL, share=0.0, speed=list(SPEEDS[:2]), drive="CD6"
            ),
            "low_threshold": captured.sel(law=LOW, share=0.0, speed=list(SPEEDS[:2])),
            "slow_inside": captured.sel(law=OWN, share=0.1, speed=list(SPEEDS[:2])),
        }
        numbers = {}
        for name, one in cases.items():
            for end in (found := share_interval(one))["summary"].values:
                numbers[f"captured_{name}_{end}"] = float(found.sel(summary=end))
        for law, name in ((LOW, "low_threshold"), (QUIET_LOW, "low_threshold_without_noise")):
            for kind in ("surface", "dark"):
                ends_so = outcome.sel(law=law) == OUTCOMES.index(kind)
                numbers[f"{kind}_{name}"] = float(ends_so.mean())
        return numbers

    @metric
    def linear_range(self, answer: Dataset) -> dict[str, float]:
        """Share of slow starts on discs at rest that stay in the linear range."""
        one = answer["overshoot"].sel(law=OWN, speed=list(SPEEDS[:2]), share=0.0)
        found = share_interval(one < S_CURVE_LINEAR)
        ends = found["summary"].values
        return {f"linear_slow_{end}": float(found.sel(summary=end)) for end in ends}

    @metric
    def speeds(self, answer: Dataset) -> dict[str, float]:
        """Speeds [m/s] between which captures become losses."""
        one = answer.sel(law=OWN)
        captured = one["outcome"] == CAPTURED
        size = abs(one["relative"])
        return {
            "held_least": float(answer["held"].min()),
            "held_most": float(answer["held"].max()),
            "escape_least": float(answer["escape"].min()),
            "escape_most": float(answer["escape"].max()),
            "fastest_captured": float(size.where(captured).max()),
            "slowest_lost": float(size.where(~captured).min()),
        }

    @table
    def starts(self, outcome: DataArray) -> tuple[list[str], list[list[str]]]:
        """Share of starts that end on the layer: mean and 99 % interval."""
        captured, rows = outcome == CAPTURED, []
        for law in LAWS:
            for share in SHARES:
                one = captured.sel(law=law, share=share)
                told = [
                    interval_text(share_interval(one.sel(speed=v)), form="{:.2f}") for v in SPEEDS
                ]
                rows.append([law, f"{share:g}", *told])
        return ["threshold", "disc / Red Book", *(f"{1e3 * v:g} mm/s" for v in SPEEDS)], rows

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Any]:
        return {
            "start-up": started(answer),
            "captured": by_speed(answer),
            "relative-speed": by_relative_speed(answer),
        }
