"""Total harmonic distortion of the experiments' inputs and outputs: were they linear (section 4.5)?

The output is the coil's current in open loop, the normalised error in closed loop. Section, figure
and equation numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players
(2003).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, figures, problem
from workbench.arrays import RealArray
from workbench.certificate import worst
from workbench.executor import Context
from workbench.heavy_types import DataArray, Dataset, Figure
from workbench.identification import SteppedSine, sine_fit, total_harmonic_distortion
from workbench.simulation import linear
from workbench.study import Study, array, check, dim, figure, metric, part, table

from ..drive.disc import Disc
from ..drive.plants import controller
from ..drive.shared_parameters import TABLES
from ..drive.tables import Axis, Values
from .bench_setup import PERIOD, RATE
from .experiment import STILL, Laboratory

LOOPS = ("open", "closed")
CHANNELS = ("input", "output")
PERIODS, DISCARDED = 20, 10
"""Periods played at each frequency, and those at its start that are not evaluated (section 4.6)."""
HARMONICS = 5
"""Harmonics evaluated: the fundamental and the four above it (section 4.6.4)."""
OPEN_BAND = {"focus": (10.0, 50.0), "radial": (10.0, 100.0)}
"""Lowest and highest frequency [Hz] in open loop (section 4.6.1)."""
CLOSED_BAND = (100.0, 2000.0)
"""Lowest and highest frequency [Hz] in closed loop (section 4.6.2)."""
OPEN_AMPLITUDE = 1.0
"""Amplitude [V] of the excitation in open loop."""
LARGEST_DISPLACEMENT = {"focus": 1.5e-6, "radial": 0.15e-6}
"""Largest amplitude [m] of the lens's displacement by the excitation in closed loop.

It is three quarters of the largest error at which a disc can be read.
"""
ORDINARY_DISC = Disc(warp=(100e-6,), eccentricity=(30e-6,))
"""A disc that deviates far less than the Red Book allows."""
RUN_UP = 0.5
"""Time [s] between the start of the loop and its first period."""


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
    says; the input's starts near 60 %, not 100 %, because that depends on the excitation's size.

    The same loop without noise and without a turning disc shows which part is distortion: hardly
    any in focus; in radial, where the error is a sine of the position, 2 % of the output and up to
    25 % of the input. The rest is noise at the harmonics. The controller passes it on where the
    loop suppresses the fundamental, and ten periods at a high frequency average little of it.

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

    @property
    def quantifier(self) -> str:
        return "at these frequencies, in one simulated record of each loop"

    loop, channel = dim(LOOPS), dim(CHANNELS)

    @part
    def grids(self) -> list[RealArray]:
        """Frequencies [Hz] in open and in closed loop."""
        bands = (OPEN_BAND[self.laboratory.axis], CLOSED_BAND)
        return [np.linspace(*band, self.frequencies) for band in bands]

    @array((loop, channel, "step"), "%", "total harmonic distortion")
    def thd(self, grids: list[RealArray], context: Context) -> RealArray:
        seeds = context.rng.integers(2**31, size=2)
        trials = zip((open_loop, closed_loop), grids, seeds, strict=True)
        return 100 * np.stack([trial(self.laboratory, grid, int(s)) for trial, grid, s in trials])

    @array((channel, "step"), "%", "THD in closed loop without disturbances")
    def distortion(self, grids: list[RealArray]) -> RealArray:
        quiet = replace(self.laboratory, noise=0.0, electronics=0.0, bits=None)
        return 100 * np.stack(closed_loop(quiet, grids[1], 0, STILL))

    frequency = array((loop, "step"), "Hz", value=lambda grids: grids)

    @check("open loop", at_most=1.0)
    def passed_on(self, thd: DataArray, frequency: DataArray) -> tuple[float, str]:
        """largest difference of the levels of input and output [%]"""
        levels, grid = thd.sel(loop="open"), frequency.sel(loop="open").values
        apart = abs(levels.sel(channel="input") - levels.sel(channel="output"))
        return worst(apart.values, lambda place: f"at {grid[place]:g} Hz")

    @check()
    def closed(self, thd: DataArray, distortion: DataArray) -> list[Check]:
        """Levels in closed loop as section 4.6.4 describes them."""
        given, output = (thd.sel(loop="closed", channel=name) for name in CHANNELS)
        quarter = max(given.size // 4, 1)
        first, last = float(given[:quarter].mean()), float(given[-quarter:].mean())
        falls = "mean level over the last quarter of the frequencies relative to the first"
        quiet = "largest level of the output without noise and disturbances [%]"
        most = float(distortion.sel(channel="output").max())
        return [
            Check("closed loop, output", "mean level [%]", float(output.mean()), 10.0),
            Check("closed loop, input falls", falls, last / first, 0.3),
            Check("closed loop, input ends low", "mean of the last quarter [%]", last, 10.0),
            Check("closed loop, distortion", quiet, most, 5.0),
        ]

    means = metric("{channel}_{loop}_percent", lambda thd: thd.mean("step"))
    first = metric("input_closed_first_percent", lambda thd: thd.loc["closed", "input"][0])
    last = metric("input_closed_last_percent", lambda thd: thd.loc["closed", "input"][-1])
    output_distortion_percent = metric(lambda distortion: distortion.sel(channel="output").max())

    @table
    def thd_(self, answer: Dataset) -> tuple[list[str], list[list[str]]]:
        rows = [
            [loop, f"{frequency:.1f}", f"{of_input:.2f}", f"{of_output:.2f}"]
            for loop, grid, levels in zip(LOOPS, answer["frequency"], answer["thd"], strict=True)
            for frequency, of_input, of_output in zip(grid.values, *levels.values, strict=True)
        ]
        return ["loop", "frequency [Hz]", "THD of input [%]", "of output [%]"], rows

    @figure
    def _thd(self, answer: Dataset) -> Figure:
        drawn, panels = figures.axes(1, 2, size=(9.0, 3.8), sharey=True)
        styles = dict(zip(CHANNELS, ("--", "-"), strict=True))
        for panel, loop in zip(panels, LOOPS, strict=True):
            one, title = answer.sel(loop=loop), f"{self.laboratory.axis}, {self.laboratory.drive}"
            for channel, style in styles.items():
                levels = one["thd"].sel(channel=channel)
                panel.plot(one["frequency"], levels, style, color=figures.BLUE, label=channel)
            figures.label(panel, "frequency [Hz]", title=f"{title}, {loop} loop")
        look: Any = {"color": figures.ORANGE, "linewidth": 0.9}
        for channel, style in styles.items():
            levels, name = answer["distortion"].sel(channel=channel), "without noise and disc"
            panels[1].plot(one["frequency"], levels, style, label=f"{channel} {name}", **look)
        figures.label(panels[0], y="THD [%]", log="y")
        panels[0].set_ylim(1e-3, 300.0)
        figures.legend_below(drawn, panels[1])
        return drawn


def open_loop(bench: Laboratory, frequency: RealArray, seed: int) -> tuple[RealArray, RealArray]:
    """THD of the control signal and of the coil's current at frequencies [Hz] (F,).

    Returns two arrays (F,) of ratios.
    """
    sweep = SteppedSine(frequency, PERIODS, OPEN_AMPLITUDE, RATE)
    record = bench.coil(np.concatenate([samples for _, samples in sweep]), seed)
    return _levels(record.u_m, sweep), _levels(record.v_r, sweep)


def closed_loop(
    bench: Laboratory, frequency: RealArray, seed: int, disc: Disc = ORDINARY_DISC
) -> tuple[RealArray, RealArray]:
    """THD of the control signal and of the normalised error at frequencies [Hz] (F,).

    Returns two arrays (F,) of ratios.
    """
    law = linear(controller(bench.axis), PERIOD)
    sweep = SteppedSine(frequency, PERIODS, closed_loop_amplitude(bench, frequency), RATE)
    rest = np.zeros(round(RUN_UP * RATE))
    excitation = np.concatenate([rest, *(samples for _, samples in sweep)])
    record = bench.closed_loop(law, excitation, disc=disc, seed=seed)
    return _levels(record.u_m[rest.size :], sweep), _levels(record.f_en[rest.size :], sweep)


def closed_loop_amplitude(bench: Laboratory, frequency: RealArray) -> float:
    """Amplitude [V] of the excitation: it moves the lens by at most `LARGEST_DISPLACEMENT`."""
    import control

    discrete = control.sample_system(control.ss(controller(bench.axis)), PERIOD, "bilinear")
    response = bench.response(frequency)
    K = discrete(np.exp(2j * np.pi * frequency * PERIOD))
    moved = np.abs(response["x"] / (1 - K * response["f_en"]))
    return LARGEST_DISPLACEMENT[bench.axis] / float(moved.max())


def _levels(signal: RealArray, sweep: SteppedSine) -> RealArray:
    """THD (F,) of a signal, its periods averaged at each frequency of a sweep."""
    ends = np.cumsum(sweep.lengths)
    averages = [
        sine_fit(signal[end - n : end], RATE, f, HARMONICS)[DISCARDED:PERIODS].mean(axis=0)
        for f, n, end in zip(sweep.frequencies, sweep.lengths, ends, strict=True)
    ]
    return total_harmonic_distortion(averages)
