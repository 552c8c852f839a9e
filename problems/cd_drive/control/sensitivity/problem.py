"""Sensitivity and margins of the reference controller on the twelve drives (section 6.3.3).

Figure, table and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import astuple, dataclass, fields
from typing import Annotated, ClassVar

import numpy as np
from pydantic import Field
from scipy.optimize import brentq

from workbench import Check, Study, problem
from workbench.arrays import RealArray
from workbench.executor import Context
from workbench.heavy_types import Dataset, Figure, StateSpace
from workbench.mu import peak
from workbench.structure import Full, Structure

from ...drive.plants import Gain
from ...drive.red_book import ACCEPTABLE_ERROR, envelope
from ...drive.shared_parameters import TABLES, Frequencies
from ...drive.tables import Axis, Values, gain_margins
from ..control_problem import performance_weight
from ..loops import (
    SCALES,
    Margins,
    bands,
    bandwidths,
    loop_response,
    margins,
    open_loop,
    plants,
)
from .checks import independent_checks, thesis_checks
from .report import WORDS, figures_of, gain_margin_db, tables_of

LOOPS = ("continuous", "sampled", "delayed")
LOW, HIGH = 1.0, 15e3
"""Ends of the frequencies shown [Hz]."""
WIDE = np.geomspace(1e-5, HIGH, 3000)
"""Frequencies [Hz] among which the ends of bands are looked for."""
BANDWIDTH = 1330.0
"""Closed-loop bandwidth of the simulations in section 6.3.3 [Hz]."""
LONGEST = 4.0
"""Delay [samples] up to which one is looked for that explains a number of the thesis."""
TOLERANCE = 1e-3
"""Of the certified peak, relative."""


@problem("cd/{axis}/sensitivity", axis=("focus", "radial"), data=(*TABLES, "data/gain_margins.csv"))
def sensitivity(
    axis: Axis,
    gain: Gain = "own",
    values: Values = "printed",
    frequencies: Frequencies = 400,
    delay: Annotated[float, Field(ge=0, le=10)] = 0.5,
) -> Sensitivity:
    """Sensitivity and margins of the reference controller on twelve drives (figure 6.6, Table A.4).

    |S| against 1/W_p at the controller's own gain and at a third of it, the largest |W_p S|
    certified over all frequencies in continuous time, and the Red Book's own limit beside it.
    Gain and phase margins and bandwidths in continuous time, sampled at 35 kHz, and sampled with a
    further delay.

    gain, values: as in cd/<axis>/circles. frequencies: how many, logarithmically spaced from 1 Hz
    to 15 kHz. delay: of the third loop, samples beyond the hold, whose own is half a sample.
    """
    return Sensitivity(axis, gain, values, frequencies, delay)


@dataclass(frozen=True)
class Sensitivity(Study):
    """Loops of the twelve drives and of the nominal one."""

    axis: Axis
    gain: Gain
    values: Values
    frequencies: int
    delay: float

    headline: ClassVar[str] = "max_weighted_S"

    def loops(self, loop: str) -> dict[str, StateSpace]:
        """L of every drive, by name, the nominal one last."""
        delay = {"continuous": None, "sampled": 0.0, "delayed": self.delay}[loop]
        return self.delayed(delay)

    def delayed(self, delay: float | None) -> dict[str, StateSpace]:
        systems = plants(self.axis, self.gain, self.values)
        return {name: open_loop(self.axis, system, delay) for name, system in systems.items()}

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        frequency = np.geomspace(LOW, HIGH, self.frequencies)
        every = {loop: self.loops(loop) for loop in LOOPS}
        weight = performance_weight(self.axis)
        found = [
            [peak_of(weight, system, scale) for system in every["continuous"].values()]
            for scale in context.track(list(SCALES.values()), "certified peaks")
        ]
        fails = [
            [failing(weight, system, scale) for system in every["continuous"].values()]
            for scale in SCALES.values()
        ]
        most = max(1, *(len(one) for row in fails for one in row))
        missing = [(math.nan, math.nan)]
        margin = [[margins(system) for system in every[loop].values()] for loop in LOOPS]
        widths = [[bandwidths(system) for system in every[loop].values()] for loop in LOOPS]
        L = [[loop_response(one, frequency) for one in every[loop].values()] for loop in LOOPS]
        measured = gain_margins() if self.axis == "focus" else {}
        drives = list(every["continuous"])
        size = abs(loop_response(weight, frequency))
        dims = ("loop", "drive")
        units = dict.fromkeys([field.name for field in fields(Margins)], "1")
        units |= {"decrease_hz": "Hz", "increase_hz": "Hz", "crossover_hz": "Hz", "phase": "deg"}
        data = {
            name: (dims, [[astuple(one)[k] for one in row] for row in margin], {"units": unit})
            for k, (name, unit) in enumerate(units.items())
        }
        return xr.Dataset(
            {
                **data,
                "L": ((*dims, "frequency"), np.array(L), {"units": "1"}),
                "permitted": ("frequency", 1 / size, {"units": "1", "long_name": "1/|W_p|"}),
                "red_book": (
                    "frequency",
                    ACCEPTABLE_ERROR[self.axis] / envelope(self.axis, frequency),
                    {"units": "1", "long_name": "acceptable error over largest deviation"},
                ),
                "weighted": (
                    ("scale", "drive", "bound"),
                    [[(p[0], p[1]) for p in row] for row in found],
                    {"units": "1", "long_name": "largest |W_p S|"},
                ),
                "weighted_hz": (
                    ("scale", "drive"),
                    [[p[2] for p in row] for row in found],
                    {"units": "Hz"},
                ),
                "fails_hz": (
                    ("scale", "drive", "band", "end"),
                    [[one + missing * (most - len(one)) for one in row] for row in fails],
                    {"units": "Hz", "long_name": "ends of bands in which |W_p S| > 1"},
                ),
                "bandwidth": (
                    (*dims, "definition"),
                    [[list(one.values()) for one in row] for row in widths],
                    {"units": "Hz"},
                ),
                "measured_db": (
                    "drive",
                    [measured.get(drive, math.nan) for drive in drives],
                    {"units": "dB", "long_name": "gain margin, Table A.4"},
                ),
                "explaining_delay": (
                    "number",
                    self._delays() if measured else [math.nan, math.nan],
                    {"units": "samples", "long_name": "delay that explains a number of the thesis"},
                ),
            },
            coords={
                "scale": list(SCALES),
                "loop": list(LOOPS),
                "drive": drives,
                "frequency": ("frequency", frequency, {"units": "Hz", "long_name": "frequency"}),
                "bound": ["lower", "upper"],
                "end": ["low", "high"],
                "definition": list(widths[0][0]),
                "number": ["Table A.4", "bandwidth"],
            },
        )

    def _delays(self) -> list[float]:
        """Delays [samples] at which Table A.4's mean and the bandwidth are what they are said."""
        table = np.mean(list(gain_margins().values()))

        def margin_off(delay: float) -> float:
            loops = list(self.delayed(delay).values())[:-1]
            return float(np.mean([margins(loop).gain_db for loop in loops]) - table)

        def bandwidth_off(delay: float) -> float:
            return bandwidths(self.delayed(delay)["nominal"])["T"] - BANDWIDTH

        return [_zero(margin_off), _zero(bandwidth_off)]

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        every, numbers = {loop: self.loops(loop) for loop in LOOPS}, self.metrics(answer)
        found = independent_checks(answer, every, self.axis, self.gain, self.values, numbers)
        return found + (thesis_checks(answer, numbers) if self.axis == "focus" else [])

    def metrics(self, answer: Dataset) -> dict[str, float]:
        twelve = answer.isel(drive=slice(-1))
        upper = twelve["weighted"].sel(bound="upper").max("drive")
        numbers = {
            "max_weighted_S": float(upper.sel(scale="full")),
            "max_weighted_S_third": float(upper.sel(scale="third")),
            "third_fails_below_hz": float(twelve["fails_hz"].sel(scale="third", end="high").max()),
            "weight_laxer_than_red_book": float((answer["permitted"] / answer["red_book"]).max()),
        }
        for scale, factor in SCALES.items():
            size = abs(1 / (1 + factor * twelve["L"])).max("drive")
            for loop in LOOPS:
                error = (size.sel(loop=loop) / answer["red_book"]).max()
                numbers[f"red_book_error_{scale}_{loop}"] = float(error)
            for loop in LOOPS[1:]:
                weighted = (size.sel(loop=loop) / answer["permitted"]).max()
                numbers[f"max_weighted_S_{scale}_{loop}_at_points"] = float(weighted)
        nominal = answer.sel(drive="nominal")
        for loop in LOOPS:
            one, many = nominal.sel(loop=loop), twelve.sel(loop=loop)
            numbers |= {
                f"gain_margin_{loop}_db": float(gain_margin_db(many).min()),
                f"phase_margin_{loop}_deg": float(many["phase"].min()),
                f"lower_limit_{loop}_hz": float(one["decrease_hz"]),
                f"upper_limit_{loop}_hz": float(one["increase_hz"]),
            }
            for definition in answer["definition"].values:
                width = float(one["bandwidth"].sel(definition=definition))
                numbers[f"bandwidth_{definition}_{loop}_hz"] = width
        if self.axis == "focus":
            for loop in LOOPS:
                off = gain_margin_db(twelve.sel(loop=loop)) - twelve["measured_db"]
                numbers[f"above_table_a4_{loop}_db"] = float(off.mean())
            delayed = gain_margin_db(twelve.sel(loop="delayed")).values
            correlation = np.corrcoef(delayed, twelve["measured_db"].values)[0, 1]
            numbers["correlation_with_table_a4"] = float(correlation)
            delay = answer["explaining_delay"]
            numbers["delay_of_table_a4_samples"] = float(delay.sel(number="Table A.4"))
            numbers["delay_of_bandwidth_samples"] = float(delay.sel(number="bandwidth"))
        return numbers

    def red_book_bands(self) -> dict[str, list[tuple[float, float]]]:
        """Bands [Hz] in which W_p is laxer than the Red Book, and |S| of a drive exceeds that."""
        weight, loops = performance_weight(self.axis), list(self.loops("continuous").values())[:-1]

        def needed(frequency: RealArray) -> RealArray:
            ratio: RealArray = envelope(self.axis, frequency) / ACCEPTABLE_ERROR[self.axis]
            return ratio

        def laxer(frequency: RealArray) -> RealArray:
            curve: RealArray = needed(frequency) / abs(loop_response(weight, frequency)) - 1
            return curve

        def beyond(scale: float) -> Callable[[RealArray], RealArray]:
            def curve(frequency: RealArray) -> RealArray:
                size = [abs(1 / (1 + scale * loop_response(one, frequency))) for one in loops]
                worst: RealArray = np.max(size, axis=0) * needed(frequency) - 1
                return worst

            return curve

        grid = WIDE[WIDE >= LOW]
        found = {"W_p laxer than the Red Book": bands(laxer, grid)}
        for scale, factor in SCALES.items():
            found[f"Red Book exceeded, {WORDS[scale]}"] = bands(beyond(factor), grid)
        return found

    def tables(self, answer: Dataset) -> dict[str, str]:
        return tables_of(answer, self.red_book_bands())

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        return figures_of(answer, self.axis)


def peak_of(weight: StateSpace, loop: StateSpace, scale: float) -> tuple[float, float, float]:
    """Certified bounds of the largest |W_p S| over all frequencies, and its frequency [Hz]."""
    import control

    S = control.feedback(1, scale * loop)
    found = peak(control.ss(weight * S), Structure([Full(1, 1)]), TOLERANCE)
    return found.lower, found.upper, found.omega / (2 * math.pi)


def failing(weight: StateSpace, loop: StateSpace, scale: float) -> list[tuple[float, float]]:
    """Bands [Hz] in which |W_p S| is above 1."""

    def level(frequency: RealArray) -> RealArray:
        S = 1 / (1 + scale * loop_response(loop, frequency))
        size: RealArray = np.log(abs(loop_response(weight, frequency) * S))
        return size

    return bands(level, WIDE)


def _zero(curve: Callable[[float], float]) -> float:
    """Where a curve of the delay [samples] is zero, NaN where it is not."""
    if curve(0.0) * curve(LONGEST) > 0:
        return math.nan
    return float(brentq(curve, 0.0, LONGEST, xtol=1e-4))
