"""Was the experiment linear? Total harmonic distortion of what went in and what came out (4.5).

In open loop the coil's current is the output, in closed loop the normalised error. Section, figure
and equation numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players
(2003).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, Study, figures, problem
from workbench.arrays import RealArray
from workbench.executor import Context
from workbench.heavy_types import DataArray, Dataset, Figure
from workbench.identification import SteppedSine, sine_fit, total_harmonic_distortion
from workbench.program import worst
from workbench.simulation import linear

from ..drive.disc import Disc
from ..drive.plants import controller
from ..drive.shared_parameters import TABLES
from ..drive.tables import Axis, Values
from .bench_setup import PERIOD, RATE
from .experiment import STILL, Laboratory

LOOPS = ("open", "closed")
CHANNELS = ("input", "output")
PERIODS, DISCARDED = 20, 10
"""Played and left out at each frequency (section 4.6)."""
HARMONICS = 5
"""The fundamental and the first four harmonics above it (section 4.6.4)."""
BANDS = {"focus": (10.0, 50.0), "radial": (10.0, 100.0)}
"""Of the open loop [Hz]; the closed one is measured over `CLOSED` (sections 4.6.1, 4.6.2)."""
CLOSED = (100.0, 2000.0)
AMPLITUDE = 1.0
"""Of the excitation in open loop [V]."""
LARGEST_ERROR = {"focus": 1.5e-6, "radial": 0.15e-6}
"""Largest amplitude of the displacement that the excitation makes in closed loop [m].

Three quarters of the largest error at which a disc can be read.
"""
DISC = Disc(warp=(100e-6,), eccentricity=(30e-6,))
"""An ordinary disc: well within what the Red Book allows."""
RUN_UP = 0.5
"""Time the loop has before its first period [s]."""


@problem("cd/{axis}/linearity", axis=("focus", "radial"), data=TABLES)
def linearity(
    axis: Axis,
    drive: str = "CD1",
    frequencies: Annotated[int, Field(ge=4, le=1000)] = 40,
    values: Values = "printed",
) -> Linearity:
    """Harmonic distortion of input and output in open and closed loop (figure 4.9).

    THD by eq. 4.26 from the fundamental and the first four harmonics of averaged periods. Open
    loop: from u to the coil's current, 10 to 50 Hz (focus) or 100 Hz (radial). Closed loop, under
    the reference controller: from the whole control signal to the normalised error, 100 to 2000 Hz.
    There the input's level falls to a few percent and the output's stays around 5 %, as the text
    says; the input's starts near 60 %, not 100 %, which is a matter of the excitation's size. The
    same loop without noise and a turning disc shows what of it is distortion: in focus hardly any,
    in radial, where the error is a sine of the position, 2 % of the output and up to 25 % of the
    input. The rest is noise at the harmonics, which the controller passes on where the loop
    suppresses the fundamental, and of which ten periods at a high frequency average little.

    drive: CD1 ... CD12. frequencies: how many in each loop, evenly spaced. values: tables
    "printed" or "corrected".
    """
    return Linearity(Laboratory(axis, drive, values), frequencies)


@dataclass(frozen=True, eq=False)
class Linearity(Study):
    """Stepped sines on a drive, in open and in closed loop."""

    laboratory: Laboratory
    frequencies: int

    headline: ClassVar[str] = "output_closed_percent"

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        seeds = [int(seed) for seed in context.rng.integers(2**31, size=2)]
        bands = (BANDS[self.laboratory.axis], CLOSED)
        grids = [np.linspace(*band, self.frequencies) for band in bands]
        levels = [
            measure(self.laboratory, grid, seed)
            for measure, grid, seed in zip((open_loop, closed_loop), grids, seeds, strict=True)
        ]
        quiet = replace(self.laboratory, noise=0.0, electronics=0.0, bits=None)
        return xr.Dataset(
            {
                "thd": (
                    ("loop", "channel", "step"),
                    100 * np.stack(levels),
                    {"units": "%", "long_name": "total harmonic distortion"},
                ),
                "distortion": (
                    ("channel", "step"),
                    100 * np.stack(closed_loop(quiet, grids[1], 0, STILL)),
                    {"units": "%", "long_name": "THD in closed loop without disturbances"},
                ),
                "frequency": (("loop", "step"), np.stack(grids), {"units": "Hz"}),
            },
            coords={"loop": list(LOOPS), "channel": list(CHANNELS)},
        )

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        opened, closed = (answer["thd"].sel(loop=loop) for loop in LOOPS)
        apart = abs(opened.sel(channel="input") - opened.sel(channel="output"))
        grid = answer["frequency"].sel(loop="open").values
        most, where = worst(apart.values, lambda place: f"at {grid[place]:g} Hz")
        first, last = (_quarter(closed.sel(channel="input"), end) for end in (0, -1))
        output = closed.sel(channel="output")
        return [
            Check(
                "open loop",
                "largest difference of the levels of input and output [%]",
                most,
                1.0,
                where,
            ),
            Check("closed loop, output", "mean level [%]", float(output.mean()), 10.0),
            Check(
                "closed loop, input falls",
                "mean level over the last quarter of the frequencies relative to the first",
                last / first,
                0.3,
            ),
            Check("closed loop, input ends low", "mean of the last quarter [%]", last, 10.0),
            Check(
                "closed loop, distortion",
                "largest level of the output without noise and disturbances [%]",
                float(answer["distortion"].sel(channel="output").max()),
                5.0,
            ),
        ]

    def metrics(self, answer: Dataset) -> dict[str, float]:
        numbers = {
            f"{channel}_{loop}_percent": float(answer["thd"].sel(loop=loop, channel=channel).mean())
            for loop in LOOPS
            for channel in CHANNELS
        }
        closed = answer["thd"].sel(loop="closed", channel="input")
        return numbers | {
            "input_closed_first_percent": float(closed[0]),
            "input_closed_last_percent": float(closed[-1]),
            "output_distortion_percent": float(answer["distortion"].sel(channel="output").max()),
        }

    def tables(self, answer: Dataset) -> dict[str, str]:
        lines = [
            "| loop | frequency [Hz] | THD of input [%] | of output [%] |",
            "| --- | ---: | ---: | ---: |",
        ]
        for loop in LOOPS:
            one = answer.sel(loop=loop)
            for f, levels in zip(one["frequency"].values, one["thd"].values.T, strict=True):
                lines.append(f"| {loop} | {f:.1f} | {levels[0]:.2f} | {levels[1]:.2f} |")
        return {"thd": "\n".join(lines) + "\n"}

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        figure, panels = figures.axes(1, 2, size=(9.0, 3.8), sharey=True)
        for panel, loop in zip(panels, LOOPS, strict=True):
            one = answer.sel(loop=loop)
            for channel, style in zip(CHANNELS, ("--", "-"), strict=True):
                levels = one["thd"].sel(channel=channel)
                panel.plot(one["frequency"], levels, style, color=figures.BLUE, label=channel)
            panel.set_title(f"{self.laboratory.axis}, {self.laboratory.drive}, {loop} loop")
            panel.set_xlabel("frequency [Hz]")
        closed = answer["frequency"].sel(loop="closed")
        for channel, style in zip(CHANNELS, ("--", "-"), strict=True):
            label = f"{channel} without noise and disc"
            levels = answer["distortion"].sel(channel=channel)
            panels[1].plot(closed, levels, style, color=figures.ORANGE, linewidth=0.9, label=label)
        panels[0].set_yscale("log")
        panels[0].set_ylim(1e-3, 300.0)
        panels[0].set_ylabel("THD [%]")
        figures.legend_below(figure, panels[1])
        return {"thd": figure}


def open_loop(bench: Laboratory, frequency: RealArray, seed: int) -> tuple[RealArray, RealArray]:
    """THD of control signal and coil current at `frequency` [Hz] (F,): each (F,), as a ratio."""
    sweep = SteppedSine(frequency, PERIODS, AMPLITUDE, RATE)
    record = bench.coil(np.concatenate([samples for _, samples in sweep]), seed)
    return _levels(record.u_m, sweep), _levels(record.v_r, sweep)


def closed_loop(
    bench: Laboratory, frequency: RealArray, seed: int, disc: Disc = DISC
) -> tuple[RealArray, RealArray]:
    """THD of control signal and normalised error at `frequency` [Hz] (F,): each (F,), a ratio."""
    law = linear(controller(bench.axis), PERIOD)
    sweep = SteppedSine(frequency, PERIODS, closed_loop_amplitude(bench, frequency), RATE)
    rest = np.zeros(round(RUN_UP * RATE))
    excitation = np.concatenate([rest, *(samples for _, samples in sweep)])
    record = bench.closed_loop(law, excitation, disc=disc, seed=seed)
    return _levels(record.u_m[rest.size :], sweep), _levels(record.f_en[rest.size :], sweep)


def closed_loop_amplitude(bench: Laboratory, frequency: RealArray) -> float:
    """Amplitude of the excitation [V] that moves the lens by `LARGEST_ERROR`, at most."""
    import control

    discrete = control.sample_system(control.ss(controller(bench.axis)), PERIOD, "bilinear")
    response = bench.response(frequency)
    K = discrete(np.exp(2j * np.pi * frequency * PERIOD))
    moved = np.abs(response["x"] / (1 - K * response["f_en"]))
    return LARGEST_ERROR[bench.axis] / float(moved.max())


def _levels(signal: RealArray, sweep: SteppedSine) -> RealArray:
    """THD of the averaged periods at each frequency of a sweep."""
    ends = np.cumsum(sweep.lengths)
    averages = [
        sine_fit(signal[end - n : end], RATE, f, HARMONICS)[DISCARDED:PERIODS].mean(axis=0)
        for f, n, end in zip(sweep.frequencies, sweep.lengths, ends, strict=True)
    ]
    return total_harmonic_distortion(averages)


def _quarter(levels: DataArray, end: int) -> float:
    """Mean of the first (0) or the last (-1) quarter."""
    quarter = max(levels.size // 4, 1)
    return float((levels[:quarter] if end == 0 else levels[-quarter:]).mean())
