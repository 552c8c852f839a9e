"""The controller of a running loop is changed: what does the step of the command cause (section
3.6.1)?

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
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
    figure,
    independent_seeds,
    interval_text,
    metric,
    part,
    share_interval,
    table,
)
from workbench.study.draws import SURE

from ...drive.photo_diodes import CAPTURE
from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis, drives
from ...laboratory.bench_setup import RATE
from .figures import after_change, one_change
from .runs import AFTER, WAYS, Change, Changed, linear_step, simulated_step

ANGLES = tuple(n / 12 for n in range(12))
"""Angles of the disc at which the controller is changed [revolutions]."""
SHARES = (0.1, 0.3, 1.0)
"""Deviations of the disc over what the Red Book allows."""
STEPS = (0.25, 0.5, 1.0, 2.0, 4.0, 8.0)
"""Steps of the command [V] on a disc at rest."""
QUIET: dict[str, Any] = {"noise": 0.0, "electronics": 0.0, "bits": None}
"""A laboratory without noise, whose converters do not round."""
SMALL = 0.05
"""Step [V] that is small enough for the optics to be linear."""
BUMPLESS = WAYS[-1]
SHOWN = 5e-3
"""Time [s] before and after a change that figures show."""


@problem(
    "cd/{axis}/controller-change", axis=("focus", "radial"), data=(*TABLES, "data/red_book.csv")
)
def controller_change(
    axis: Axis,
    old_db: Annotated[float, Field(ge=-12, le=6)] = -3.0,
    draws: Annotated[int, Field(ge=1, le=1000)] = 2,
) -> ControllerChange:
    """The controller is changed while the disc turns: with a step of its command, and without.

    The player's own controller is replaced by that of the laboratory. Until then the new controller
    has been at rest, has run in parallel, or has followed the old one's command. The change is made
    at twelve angles of the disc, on every drive, with three deviations. A step of the command
    alone, on a disc at rest, serves for comparison.

    Assumed: the old controller, which the thesis does not print, is the reference controller with
    less gain. Computed: the largest error per volt of a step, in each drive's linear loop.
    Simulated: shares of changes that lose the loop, with 99 % Clopper-Pearson intervals.

    old_db: gain of the old controller over the reference one's [dB]. draws: number of draws of the
    noise, for every drive, angle, disc and way.
    """
    return ControllerChange(axis, old_db, draws)


@dataclass(frozen=True)
class ControllerChange(Study):
    """Changes in every way, at every angle, on every disc and drive."""

    axis: Axis
    old_db: float
    draws: int

    headline: ClassVar[str] = "lost_in_parallel_mean"

    @property
    def quantifier(self) -> str:
        return f"for these 12 drives, in {self.draws} simulated draws of each change"

    way, share = dim(WAYS), dim(SHARES, meaning="deviation over the Red Book's")
    angle = dim(ANGLES, unit="1", meaning="revolutions of the disc")
    step = dim(STEPS, unit="V")
    drive = dim(lambda self: [one.name for one in drives(self.axis)])
    draw = dim(lambda self: range(self.draws))

    seed = array(
        dims=(drive, draw),
        value=lambda self, context: independent_seeds(context.rng, 12, self.draws),
    )

    @part
    def met(self, context: Context, seed: DataArray) -> RealArray:
        """Changes (ways, shares, angles, drives, draws, 4)."""

        def one(place: tuple[int, ...]) -> list[Changed]:
            at = seed[place]
            name, number = str(at["drive"].values), int(at)
            return [
                Change(self.axis, self.old_db, share).changed(way, name, angle, number)
                for way in WAYS
                for share in SHARES
                for angle in ANGLES
            ]

        found = context.spread(one, list(np.ndindex(seed.shape)), "changes")
        shape = *seed.shape, len(WAYS), len(SHARES), len(ANGLES), len(Changed._fields)
        return np.moveaxis(np.reshape(found, shape), (0, 1), (3, 4))

    told = arrays(
        (way, share, angle, drive, draw),
        lambda met: {name: met[..., n].astype("f4") for n, name in enumerate(Changed._fields)},
        difference=("V", "of the commands of both controllers at the change"),
        largest=("m", "largest error after the change"),
        before=("m", "largest error before it, in the same time"),
        lost=("1", "whether focus or track is lost"),
    )
    per_volt = array(
        dims=drive,
        unit="m/V",
        meaning="largest error per volt of a step, linear loop",
        value=lambda self, drive: [linear_step(self.axis, str(one)) for one in drive.values],
    )

    @array(dims=drive, unit="m/V", meaning="the same of a small step, simulated without noise")
    def small_step(self, drive: DataArray) -> list[float]:
        names = [str(one) for one in drive.values]
        return [simulated_step(self.axis, one, SMALL, 0, **QUIET) / SMALL for one in names]

    @array(dims=(step, drive, draw), unit="m", meaning="largest error after a step of the command")
    def stepped(self, seed: DataArray) -> Any:
        found = [
            [
                [simulated_step(self.axis, name, volts, int(one)) for one in seed.sel(drive=name)]
                for name in seed["drive"].values.tolist()
            ]
            for volts in STEPS
        ]
        return np.array(found, np.float32)

    time = dim(
        lambda: np.arange(-round(SHOWN * RATE), round(SHOWN * RATE)) / RATE,
        unit="s",
        meaning="time from the change",
    )

    @arrays((way, time), shown_error="m", shown_u="V")
    def shown(self) -> dict[str, Any]:
        """One record of every way, at a quarter of a revolution."""
        change, rows = Change(self.axis, self.old_db, SHARES[1]), []
        first = round(change.time(0.25) * RATE)
        inside = slice(first - round(SHOWN * RATE), first + round(SHOWN * RATE))
        for way in WAYS:
            one = change.record(way, "CD1", 0.25, 1)
            rows.append([(one.x_cd - one.x)[inside], one.u[inside]])
        error, command = np.transpose(np.array(rows, np.float32), (1, 0, 2))
        return {"shown_error": error, "shown_u": command}

    # --- checks -------------------------------------------------------------------------------

    @check(title="without a bump", at_most=1.0 - SURE)
    def held(self, lost: DataArray) -> float:
        """share of changes without a bump that lose the loop"""
        return float(lost.sel(way=BUMPLESS).mean())

    @check(title="less error", at_most=1.0)
    def less(self, largest: DataArray) -> DataArray:
        """mean largest error after a change without a bump over that of the other ways"""
        mean = largest.mean(["share", "angle", "drive", "draw"])
        return mean.sel(way=BUMPLESS) / mean.sel(way=list(WAYS[:2]))

    @check(title="linear", at_most=0.02)
    def linear(self, small_step: DataArray, per_volt: DataArray) -> DataArray:
        """relative difference of a small simulated step's error from that of the linear loop"""
        return abs(small_step / per_volt - 1.0)

    # --- what is told -------------------------------------------------------------------------

    @metric
    def losses(self, lost: DataArray) -> dict[str, float]:
        """Shares of changes that lose the loop, with 99 % intervals."""
        numbers = {}
        for way in WAYS:
            name = way.replace(" ", "_")
            cases = {f"lost_{name}": lost.sel(way=way)}
            cases |= {f"lost_{name}_share_{one:g}": lost.sel(way=way, share=one) for one in SHARES}
            for key, one in cases.items():
                for end in (found := share_interval(one > 0.0))["summary"].values:
                    numbers[f"{key}_{end}"] = float(found.sel(summary=end))
        return numbers

    @metric
    def sizes(self, answer: Dataset) -> dict[str, float]:
        """Largest errors over the capture range, and the largest steps that the loop survives."""
        over = answer["largest"] / CAPTURE[self.axis]
        numbers = {
            f"largest_{way.replace(' ', '_')}_over_capture": float(over.sel(way=way).max())
            for way in WAYS
        }
        stood = (answer["stepped"] < CAPTURE[self.axis]).all(["drive", "draw"])
        volts = [float(one) for one in answer["step"].values if bool(stood.sel(step=one))]
        least = CAPTURE[self.axis] / answer["per_volt"].max()
        return numbers | {
            "step_stood_V": max(volts, default=0.0),
            "step_to_capture_linear_V": float(least),
            "difference_largest_V": float(abs(answer["difference"].sel(way=WAYS[1])).max()),
        }

    @table
    def changes(self, answer: Dataset) -> tuple[list[str], list[list[str]]]:
        """Every way on every disc: share of losses with its 99 % interval, and errors."""
        rows = []
        for way in WAYS:
            for share in SHARES:
                one = answer.sel(way=way, share=share)
                told = interval_text(share_interval(one["lost"] > 0.0), form="{:.3f}")
                sizes = [f"{1e6 * float(one[name].median()):.3g}" for name in ("before", "largest")]
                rows.append([way, f"{share:g}", told, *sizes])
        return ["new controller", "disc / Red Book", "lost", "before [um]", "after [um]"], rows

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Any]:
        return {
            "change": one_change(answer, self.axis),
            "angles": after_change(answer, self.axis, 1e3 * AFTER),
        }
