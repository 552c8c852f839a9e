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

from workbench import figures, problem
from workbench.executor import Context
from workbench.identification import SteppedSine, sine_fit, total_harmonic_distortion
from workbench.simulation import linear_controller
from workbench.study import (
    CLAIM_SHARE,
    Study,
    array,
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
from workbench.types import ComplexArray, DataArray, Dataset, Figure, RealArray

from ..drive.disc import Disc
from ..drive.plants import controller
from ..drive.shared_parameters import TABLES
from ..drive.tables import Axis, Values
from .bench_setup import PERIOD, RATE
from .experiment import STILL, Laboratory
from .printed_noise import Amplitude, Fixed, position_noise

LOOPS = ("open", "closed")
CHANNELS = ("input", "output")
PERIODS, DISCARDED = 20, 10
"""Number of periods played at each frequency, and of those at the start that are not evaluated
(section 4.6).
"""
HARMONICS, MOST_HARMONICS = 5, 8
"""Number of harmonics evaluated: the fundamental and the four above it (section 4.6.4); and as many
as are always below half the sampling frequency, to see whether four are enough.
"""
OPEN_BAND = {"focus": (10.0, 50.0), "radial": (10.0, 100.0)}
"""Lowest and highest frequency [Hz] in open loop (section 4.6.1)."""
CLOSED_BAND = (100.0, 2000.0)
"""Lowest and highest frequency [Hz] in closed loop (section 4.6.2)."""
OPEN_AMPLITUDE = 1.0
"""Amplitude [V] of the excitation in open loop."""
LARGEST_DISPLACEMENT = {"focus": 1.5e-6, "radial": 0.15e-6}
"""Largest amplitude [m] of the lens's displacement that the excitation causes in closed loop.

It is three quarters of the largest error at which a disc can be read.
"""
ORDINARY_DISC = Disc(warp=(100e-6,), eccentricity=(30e-6,))
"""A disc with far smaller deviations than the Red Book allows."""
RUN_UP = 0.5
"""Time [s] from the start of the loop to its first period."""


@problem(
    "cd/{axis}/linearity",
    axis=("focus", "radial"),
    data=TABLES,
    added=("delay", "noise", "noise_fixed"),
)
def linearity(
    axis: Axis,
    drive: str = "CD1",
    frequencies: Annotated[int, Field(ge=4, le=1000)] = 40,
    draws: Annotated[int, Field(ge=1, le=1000)] = 12,
    values: Values = "printed",
    delay: Annotated[float, Field(ge=0, le=2)] = 1.0,
    noise: Amplitude = "rms",
    noise_fixed: Fixed = "metres",
) -> Linearity:
    """Harmonic distortion of input and output in open and closed loop (figure 4.9).

    THD by eq. 4.26 is computed from the fundamental and the first four harmonics of averaged
    periods. In open loop the channels are u and the coil's current, from 10 to 50 Hz (focus) or 100
    Hz (radial). In closed loop, under the reference controller, they are the whole control signal
    and the normalised error, from 100 to 2000 Hz. There the input's level falls to a few percent.
    It starts near 60 % instead of the text's 100 %, because it depends on the size of the
    excitation. The output's level stays around 5 % in the median, as the text says; noise raises
    single frequencies of a record to ten times that.

    The same loop without noise and without a turning disc shows how much is distortion: hardly any
    in focus; radially, where the error is a sine of the position, 2 % of the output and up to 25 %
    of the input. The rest is noise at the harmonics. The controller passes it on at frequencies
    where the loop suppresses the fundamental, and ten periods at a high frequency average out
    little of it.

    The excitation is designed for the nominal drive, whichever drive is measured.

    drive: CD1 ... CD12. frequencies: number of frequencies in each loop, evenly spaced. draws:
    number of draws of the noise. values: tables "printed" or "corrected". delay [samples]: of the
    computer. noise, noise_fixed: reading of the printed amplitude of 0.15 um (`printed_noise`).
    """
    size = position_noise(axis, drive, noise, noise_fixed)
    bench = Laboratory(axis, drive, values, delay=delay, noise=size)
    return Linearity(bench, frequencies, draws)


@dataclass(frozen=True, eq=False)
class Linearity(Study):
    """Stepped sines on a drive, in open and in closed loop."""

    laboratory: Laboratory
    frequencies: int
    draws: int

    headline: ClassVar[str] = "output_closed_median_percent_mean"

    @property
    def quantifier(self) -> str:
        return f"at these frequencies, in {self.draws} simulated draws of each loop"

    loop, channel = dim(LOOPS), dim(CHANNELS)
    draw = dim(lambda self: range(self.draws))
    harmonics = dim(range(2, MOST_HARMONICS + 1))

    @part
    def grids(self) -> list[RealArray]:
        """Frequencies [Hz] in open and in closed loop."""
        bands = (OPEN_BAND[self.laboratory.axis], CLOSED_BAND)
        return [np.linspace(*band, self.frequencies) for band in bands]

    @array(dims=(draw, loop))
    def seed(self, context: Context) -> Any:
        return independent_seeds(context.rng, self.draws, len(LOOPS))

    @part
    def spectra(self, grids: list[RealArray], seed: DataArray, context: Context) -> Any:
        """Harmonics (draw, loop, channel, step, MOST_HARMONICS) of every record."""
        trials = dict(zip(LOOPS, zip((open_loop, closed_loop), grids, strict=True), strict=True))

        def played(place: tuple[int, ...]) -> ComplexArray:
            one = seed[place]
            trial, grid = trials[str(one["loop"].values)]
            return trial(self.laboratory, grid, int(one))

        found = context.spread(played, list(np.ndindex(seed.shape)), "records")
        return np.reshape(found, (*seed.shape, *np.shape(found)[1:]))

    thd = array(dims=(draw, loop, channel, "step"), unit="%", meaning="total harmonic distortion")(
        lambda spectra: percent(spectra[..., :HARMONICS]).astype("f4")
    )

    @array(dims=(channel, "step"), unit="%", meaning="THD in closed loop without disturbances")
    def distortion(self, grids: list[RealArray]) -> RealArray:
        quiet = replace(self.laboratory, noise=0.0, electronics=0.0, bits=None)
        return percent(closed_loop(quiet, grids[1], 0, STILL)[..., :HARMONICS])

    @array(dims=(harmonics, loop, channel), unit="%", meaning="mean THD with so many harmonics")
    def by_harmonics(self, spectra: ComplexArray) -> RealArray:
        counts = range(2, MOST_HARMONICS + 1)
        return np.array([percent(spectra[..., :n]).mean(axis=(0, 3)) for n in counts])

    frequency = array(dims=(loop, "step"), unit="Hz", value=lambda grids: grids)

    # --- checks -------------------------------------------------------------------------------

    @check(title="{words}", at_most=1.0 - CLAIM_SHARE, each="words")
    def as_described(self, thd: DataArray) -> DataArray:
        """share of the draws in which the levels are not as section 4.6.4 describes them"""
        import xarray as xr

        share = [1.0 - share_of_draws(holds) for holds in described(thd).values()]
        return xr.DataArray(share, {"words": list(described(thd))}, "words")

    distortion_small = check(
        title="closed loop, distortion",
        statement="largest level of the output without noise and disturbances [%]",
        value=lambda distortion: distortion.sel(channel="output").max(),
        at_most=5.0,
    )

    # --- what is told -------------------------------------------------------------------------

    means = metric(
        template="{channel}_{loop}_percent_{summary}",
        value=lambda thd: draws_summary(thd.mean("step")),
    )
    medians = metric(
        template="{channel}_{loop}_median_percent_{summary}",
        value=lambda thd: draws_summary(thd.median("step")),
    )
    most = metric(
        template="{channel}_{loop}_largest_percent_{summary}",
        value=lambda thd: draws_summary(thd.max("step")),
    )
    first = metric(
        template="input_closed_first_percent_{summary}",
        value=lambda thd: draws_summary(thd.sel(loop="closed", channel="input").isel(step=0)),
    )
    last = metric(
        template="input_closed_last_percent_{summary}",
        value=lambda thd: draws_summary(thd.sel(loop="closed", channel="input").isel(step=-1)),
    )
    with_harmonics = metric(
        template="{channel}_{loop}_{harmonics}_harmonics_percent",
        value=lambda by_harmonics: by_harmonics,
    )
    output_distortion_percent = metric(
        template=lambda distortion: distortion.sel(channel="output").max()
    )

    @table
    def thd_(self, answer: Dataset) -> tuple[list[str], list[list[str]]]:
        told, rows = draws_summary(answer["thd"]), []
        for loop in LOOPS:
            for n, frequency in enumerate(answer["frequency"].sel(loop=loop).values):
                one = told.sel(loop=loop).isel(step=n)
                cells = [interval_text(one.sel(channel=name), form="{:.2f}") for name in CHANNELS]
                rows.append([loop, f"{frequency:.1f}", *cells])
        return ["loop", "frequency [Hz]", "THD of input [%]", "of output [%]"], rows

    @figure
    def _thd(self, answer: Dataset) -> Figure:
        drawn, panels = figures.axes(1, 2, size=(9.0, 3.8), sharey=True)
        styles = dict(zip(CHANNELS, ("--", "-"), strict=True))
        told = draws_summary(answer["thd"])
        for panel, loop in zip(panels, LOOPS, strict=True):
            one, title = answer.sel(loop=loop), f"{self.laboratory.axis}, {self.laboratory.drive}"
            for channel, style in styles.items():
                mean, low, high = told.sel(loop=loop, channel=channel).transpose("summary", ...)
                look: Any = {"color": figures.BLUE, "alpha": 0.15, "linewidth": 0.0}
                panel.fill_between(one["frequency"], low, high, **look)
                panel.plot(one["frequency"], mean, style, color=figures.BLUE, label=channel)
            figures.label(panel, x="frequency [Hz]", title=f"{title}, {loop} loop")
        look = {"color": figures.ORANGE, "linewidth": 0.9}
        for channel, style in styles.items():
            levels, name = answer["distortion"].sel(channel=channel), "without noise and disc"
            panels[1].plot(one["frequency"], levels, style, label=f"{channel} {name}", **look)
        figures.label(panels[0], y=f"THD, {self.draws} draws [%]", log="y")
        panels[0].set_ylim(1e-3, 300.0)
        figures.legend_below(drawn, panels[1])
        return figures.with_figure_numbers(drawn, "4.9")


def described(thd: DataArray) -> dict[str, DataArray]:
    """For each draw whether the levels are as section 4.6.4 describes them, by statement."""
    opened, closed = thd.sel(loop="open"), thd.sel(loop="closed")
    apart = abs(opened.sel(channel="input") - opened.sel(channel="output")).max("step")
    given, output = (closed.sel(channel=name) for name in CHANNELS)
    quarter = max(given.sizes["step"] // 4, 1)
    begins = given.isel(step=slice(quarter)).mean("step")
    ends = given.isel(step=slice(-quarter, None)).mean("step")
    return {
        "open loop: input and output within 1 %": apart <= 1.0,
        "closed loop: output below 10 % in the mean": output.mean("step") <= 10.0,
        "closed loop: input falls to 0.3": ends <= 0.3 * begins,
        "closed loop: input ends below 10 %": ends <= 10.0,
    }


def open_loop(bench: Laboratory, frequency: RealArray, seed: int) -> ComplexArray:
    """Harmonics (2, F, MOST_HARMONICS) of the control signal and of the coil's current."""
    sweep = SteppedSine(frequency, PERIODS, OPEN_AMPLITUDE, 1 / RATE)
    record = bench.coil(np.concatenate([samples for _, samples in sweep]), seed)
    return np.array([averages(one, sweep) for one in (record.u_m, record.v_r)])


def closed_loop(
    bench: Laboratory, frequency: RealArray, seed: int, disc: Disc = ORDINARY_DISC
) -> ComplexArray:
    """Harmonics (2, F, MOST_HARMONICS) of the control signal and of the normalised error."""
    law = linear_controller(controller(bench.axis), PERIOD)
    sweep = SteppedSine(frequency, PERIODS, closed_loop_amplitude(bench.axis, frequency), 1 / RATE)
    rest = np.zeros(round(RUN_UP * RATE))
    excitation = np.concatenate([rest, *(samples for _, samples in sweep)])
    record = bench.closed_loop(law, excitation, disc=disc, seed=seed)
    return np.array([averages(one[rest.size :], sweep) for one in (record.u_m, record.f_en)])


def closed_loop_amplitude(axis: Axis, frequency: RealArray) -> float:
    """Amplitude [V] of the excitation that moves the nominal lens by `LARGEST_DISPLACEMENT`."""
    return LARGEST_DISPLACEMENT[axis] / float(abs(displacement(axis, frequency)).max())


def displacement(axis: Axis, frequency: RealArray) -> ComplexArray:
    """Response (F,) from an excitation in closed loop to the nominal lens [m/V]."""
    import control

    discrete = control.sample_system(control.ss(controller(axis)), PERIOD, "bilinear")
    response = Laboratory(axis, "nominal").response(frequency)
    K = discrete(np.exp(2j * np.pi * frequency * PERIOD))
    moved: ComplexArray = response["x"] / (1 - K * response["f_en"])
    return moved


def averages(signal: RealArray, sweep: SteppedSine) -> ComplexArray:
    """Harmonics (F, MOST_HARMONICS) of a signal, averaged over the periods of each frequency."""
    ends = np.cumsum(sweep.lengths)
    return np.array(
        [
            sine_fit(signal[end - n : end], 1 / RATE, f, harmonics=MOST_HARMONICS)[
                DISCARDED:PERIODS
            ].mean(axis=0)
            for f, n, end in zip(sweep.frequencies_hz, sweep.lengths, ends, strict=True)
        ]
    )


def percent(harmonics: ComplexArray) -> RealArray:
    """THD [%] (...,) of harmonics (..., H), the fundamental first."""
    return 100.0 * total_harmonic_distortion(harmonics)
