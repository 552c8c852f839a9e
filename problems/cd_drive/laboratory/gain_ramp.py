"""The controller's gain is raised and lowered until the loop fails (section 6.3.3, Table A.4).

Section and table numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players
(2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar, NamedTuple

import numpy as np
from pydantic import Field

from workbench import figures, problem
from workbench.executor import Context
from workbench.simulation import Cascade, Part, linear_controller, ramped_gain
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
    markdown_table,
    metric,
    part,
    table,
)
from workbench.types import DataArray, Dataset, Figure, RealArray, StateSpace

from ..drive.disc import Disc
from ..drive.margins import NearestMargins, nearest_margins
from ..drive.plants import Gain, controller
from ..drive.shared_parameters import TABLES
from ..drive.tables import Axis, drives, gain_margins, red_book
from .bench_setup import OUTPUT_LIMIT, PERIOD, RATE
from .experiment import MEASUREMENTS, Laboratory
from .printed_noise import Amplitude, Fixed, position_noise
from .record import Record

SETTLED, SPEED = 0.5, 2.0
"""Time [s] at which a ramp begins, and its slope [dB/s]."""
BEFORE = 0.05
"""Length [s] of the stretch before the end from which the oscillation is read."""
LOWEST = 60.0
"""Lowest frequency [Hz] of an oscillation of the loop; the disc's wobble is below it."""
SLACK = 1.0
"""Largest distance [dB] that a ramp may go beyond the model's limit: its change in half a second.
"""
DIRECTIONS = {"up": 1.0, "down": -1.0}
FARTHEST = {"up": 20.0, "down": 33.0}
"""Change of the gain [dB] at which a ramp is given up. It is beyond the model's limit on every
drive.
"""


class Ending(NamedTuple):
    """End of a ramp: change of the gain [dB], frequency before it [Hz], and whether u was at its
    limit.

    NaN if the loop did not fail.
    """

    change: float
    frequency: float
    full: float


@problem(
    "cd/{axis}/gain-ramp",
    axis=("focus", "radial"),
    data=(*TABLES, "data/gain_margins.csv", "data/red_book.csv"),
)
def gain_ramp(
    axis: Axis,
    deviation: Annotated[float, Field(ge=0, le=1)] = 0.2,
    draws: Annotated[int, Field(ge=1, le=1000)] = 3,
    gain: Gain = "own",
    delay: Annotated[float, Field(ge=0, le=2)] = 1.0,
    noise: Amplitude = "rms",
    noise_fixed: Fixed = "metres",
) -> GainRamp:
    """The gain raised and lowered by 2 dB/s until the loop fails (section 6.3.3, Table A.4).

    The ramps run on a turning disc, with noise, on each of the twelve drives. Upwards, a ramp ends
    if the control signal reaches its limit, or if focus or track is lost; downwards, only if it is
    lost. The results are compared with the change at which the model of the sampled loop becomes
    unstable, and with the measured margins of Table A.4. The frequency of the control signal just
    before the end is given, too.

    deviation: of the disc, over the Red Book's limits. draws: number of draws of the noise on each
    drive. gain, delay [samples]: as in the laboratory. noise, noise_fixed: reading of the printed
    amplitude of 0.15 um (`printed_noise`).
    """
    return GainRamp(axis, deviation, draws, gain, delay, noise, noise_fixed)


@dataclass(frozen=True)
class GainRamp(Study):
    """Ramps in both directions on every drive."""

    axis: Axis
    deviation: float
    draws: int
    gain: Gain
    delay: float
    noise: Amplitude
    noise_fixed: Fixed

    headline: ClassVar[str] = "change_up_mean"

    @property
    def quantifier(self) -> str:
        return f"for these 12 drives, in {self.draws} simulated draws on each"

    drive = dim(lambda self: [one.name for one in drives(self.axis)])
    direction = dim(DIRECTIONS)
    draw = dim(lambda self: range(self.draws))

    @array(dims=(drive, draw))
    def seed(self, context: Context) -> Any:
        return independent_seeds(context.rng, 12, self.draws)

    def bench(self, drive: str) -> Laboratory:
        """A drive on the bench, with the noise in the asked reading."""
        noise = position_noise(self.axis, drive, self.noise, self.noise_fixed)
        return Laboratory(self.axis, drive, gain=self.gain, delay=self.delay, noise=noise)

    def record(self, drive: str, direction: str, seed: int) -> Record:
        """Record of a ramp on a drive; it is played to its end even if the loop fails."""
        deviation = self.deviation * red_book(self.axis).deviation
        slope = DIRECTIONS[direction] * SPEED
        law = [
            Part("K", linear_controller(controller(self.axis), PERIOD), ["f_en"], outputs=["u_k"]),
            Part("ramp", ramped_gain(slope, SETTLED, PERIOD), ["u_k"], outputs=["u"]),
        ]
        return self.bench(drive).closed_loop(
            Cascade(MEASUREMENTS, law),
            duration=SETTLED + FARTHEST[direction] / SPEED,
            disc=Disc.along(self.axis, deviation),
            seed=seed,
        )

    def ending(self, direction: str, record: Record) -> Ending:
        """Where the ramp of a record ended."""
        full = abs(record.u) >= OUTPUT_LIMIT
        lost = np.zeros_like(full)
        at = np.array([round(event.time * RATE) for event in record.events], int)
        lost[at[at < len(lost)]] = True
        ends = np.flatnonzero((lost | full) if direction == "up" else lost)
        ends = ends[ends > SETTLED * RATE]
        if not ends.size:
            return Ending(np.nan, np.nan, np.nan)
        end = int(ends[0])
        change = DIRECTIONS[direction] * SPEED * (end / RATE - SETTLED)
        signal = record.u if direction == "up" else record.f_en
        return Ending(change, oscillation(signal[:end]), float(full[end]))

    @part
    def ended(self, context: Context, seed: DataArray) -> RealArray:
        """Endings (drives, draws, directions, 3)."""

        def endings(place: tuple[int, ...]) -> list[Ending]:
            one = seed[place]
            drive = str(one["drive"].values)
            return [self.ending(d, self.record(drive, d, int(one))) for d in DIRECTIONS]

        found = context.spread(endings, list(np.ndindex(seed.shape)), "ramps")
        return np.reshape(found, (*seed.shape, len(DIRECTIONS), len(Ending._fields)))

    @arrays((drive, draw, direction), change="dB", frequency="Hz", full="1")
    def endings(self, ended: RealArray) -> dict[str, RealArray]:
        """Change of the gain, frequency of the oscillation, and whether u was at its limit."""
        return {name: ended[..., n] for n, name in enumerate(Ending._fields)}

    @part
    def limits(self) -> list[NearestMargins]:
        """Stability margins of every drive's sampled loop, from its model."""
        return [nearest_margins(self.loop(one.name)) for one in drives(self.axis)]

    @arrays((drive, direction), model="dB", model_frequency="Hz")
    def by_model(self, limits: list[NearestMargins]) -> dict[str, Any]:
        """Change of the gain at which the model of the sampled loop becomes unstable, and its
        frequency [Hz].
        """
        return {
            "model": [20.0 * np.log10([one.increase, one.decrease]) for one in limits],
            "model_frequency": [[one.increase_hz, one.decrease_hz] for one in limits],
        }

    def loop(self, drive: str) -> StateSpace:
        """Loop transfer function of a drive on the bench, sampled."""
        import control

        law = control.sample_system(control.ss(controller(self.axis)), PERIOD, "bilinear")
        return -self.bench(drive).sampled_error() * law

    # --- checks -------------------------------------------------------------------------------

    ended_ = check(
        title="ramps end",
        statement="share of ramps that never end",
        value=lambda change: np.isnan(change).mean(),
        at_most=0.0,
    )

    @check(title="{direction} by the model", at_most=SLACK, each="direction")
    def within(self, change: DataArray, model: DataArray) -> DataArray:
        """how far a ramp goes on where the model is unstable [dB]"""
        return (abs(change) - abs(model)).max(["drive", "draw"])

    # --- what is told -------------------------------------------------------------------------

    changes = metric(
        template="change_{direction}_{summary}",
        value=lambda change: draws_summary(abs(change), "drive"),
    )
    frequencies = metric(
        template="frequency_{direction}_{summary}_hz",
        value=lambda frequency: draws_summary(frequency, "drive"),
    )
    share_full = metric(
        template="full_{direction}", value=lambda full: full.mean(["drive", "draw"])
    )
    models = metric("model_{direction}_mean", value=lambda model: abs(model).mean("drive"))
    model_frequencies = metric(
        template="model_frequency_{direction}_mean_hz",
        value=lambda model_frequency: model_frequency.mean("drive"),
    )

    @table
    def ramps(self, answer: Dataset) -> dict[str, str]:
        """Each drive: mean and 90 % range of the draws, the model's margin and the printed one."""
        printed = gain_margins() if self.axis == "focus" else {}
        rows = []
        for name in answer["drive"].values:
            one, cells = answer.sel(drive=name), []
            for direction in DIRECTIONS:
                at = one.sel(direction=direction)
                cells += [
                    interval_text(draws_summary(at["change"]), form="{:.1f}"),
                    f"{float(at['model']):.1f}",
                    interval_text(draws_summary(at["frequency"]), form="{:.0f}"),
                    f"{float(at['model_frequency']):.0f}",
                ]
            rows.append([str(name), *cells, f"{printed.get(str(name), np.nan):.1f}"])
        heads = ["drive", "up [dB]", "model", "at [Hz]", "model", "down [dB]", "model", "at [Hz]"]
        return {"gain-ramp": markdown_table([*heads, "model", "Table A.4 [dB]"], rows)}

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Figure]:
        """Changes of the gain at which ramps end, with the model's and the printed margins."""
        drawn, panels = figures.axes(2, 1, size=(8.0, 6.0), sharex=True)
        place = np.arange(12)
        for panel, direction in zip(panels, DIRECTIONS, strict=True):
            one = answer.sel(direction=direction)
            told = draws_summary(abs(one["change"])).transpose("summary", ...).values
            mean, low, high = told
            look: Any = {"fmt": "o", "capsize": 3, "color": figures.BLUE, "label": "ramp, 90 %"}
            panel.errorbar(place, mean, [mean - low, high - mean], **look)
            panel.plot(place, abs(one["model"]), "_", ms=14, color=figures.ORANGE, label="model")
            figures.label(panel, y="change of the gain [dB]", title=f"{self.axis}, {direction}")
        if self.axis == "focus":
            printed = [gain_margins()[str(name)] for name in answer["drive"].values]
            for panel in panels:
                panel.plot(place, printed, "x", color=figures.BLACK, label="Table A.4")
        panels[1].set_xticks(place, answer["drive"].values)
        figures.legend_below(drawn, panels[0])
        return {"gain-ramp": drawn}


def oscillation(signal: RealArray) -> float:
    """Strongest frequency [Hz] above LOWEST in the last stretch of a signal (N,)."""
    last = signal[-round(BEFORE * RATE) :]
    size = 8 * len(last)
    spectrum = abs(np.fft.rfft((last - last.mean()) * np.hanning(len(last)), size))
    frequency = np.fft.rfftfreq(size, PERIOD)
    spectrum[frequency < LOWEST] = 0.0
    return float(frequency[np.argmax(spectrum)])
