"""Sensitivity and margins of the reference controller on the twelve drives (section 6.3.3).

Figure, table and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field
from scipy.optimize import brentq

from workbench import Check, problem
from workbench.executor import Context
from workbench.mu import Peak, PeakChecker, peak
from workbench.structure import Full, Structure
from workbench.study import Study, answers, array, arrays, check, dim, figure, metric, part, table
from workbench.synthesis import PEAK_TOLERANCE
from workbench.systems import bandwidths, loop_response, positive_bands
from workbench.types import DataArray, Dataset, Figure, RealArray, StateSpace

from ...drive.margins import MARGIN_UNITS, each_margin, nearest_margins
from ...drive.plants import Gain
from ...drive.red_book import ACCEPTABLE_ERROR, envelope
from ...drive.shared_parameters import TABLES, Frequencies
from ...drive.tables import Axis, Values, gain_margins
from ..control_problem import performance_weight
from ..loops import SCALES, open_loop, plants
from .checks import limit_checks, peak_checks, red_book_check, thesis_checks
from .report import (
    WORDS,
    bandwidths_table,
    gain_margin_db,
    margins_figure,
    margins_table,
    sensitivity_figure,
    twelve,
    weighted_table,
)

Systems = dict[str, dict[str, StateSpace]]
"""Loop transfer functions by loop and drive."""
Labelled = dict[tuple[str, str], StateSpace]
"""W_p S by scale of the gain and drive."""
ONE = Structure([Full(1, 1)])
"""Structure for which mu of a single signal is its magnitude."""
LOOPS = ("continuous", "sampled", "delayed")
LOW, HIGH = 1.0, 15e3
"""Ends of the frequency range shown [Hz]."""
BAND_SEARCH = np.geomspace(1e-5, HIGH, 3000)
"""Frequencies [Hz] on which the ends of bands are searched."""
CLOSED_LOOP_BANDWIDTH = 1330.0
"""Closed-loop bandwidth of the simulations in section 6.3.3 [Hz]."""
LONGEST_TRIED_DELAY = 4.0
"""Largest delay [samples] tried to explain a number of the thesis."""


@problem("cd/{axis}/sensitivity", axis=("focus", "radial"), data=(*TABLES, "data/gain_margins.csv"))
def sensitivity(
    axis: Axis,
    gain: Gain = "own",
    values: Values = "printed",
    frequencies: Frequencies = 400,
    delay: Annotated[float, Field(ge=0, le=10)] = 0.5,
) -> Sensitivity:
    """Sensitivity and margins of the reference controller on twelve drives (figure 6.6, Table A.4).

    |S| is compared with 1/W_p at the controller's own gain and at a third of it. The largest |W_p
    S| is certified over all frequencies in continuous time, and compared with the Red Book's own
    limit. Gain and phase margins and bandwidths are given in continuous time, sampled at 35 kHz,
    and sampled with a further delay.

    gain, values: as in cd/<axis>/circles. frequencies: number of frequencies, logarithmically
    spaced from 1 Hz to 15 kHz. delay: of the third loop, in samples beyond the hold, which itself
    delays by half a sample.
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

    @property
    def quantifier(self) -> str:
        return "for these 12 drives and the nominal one"

    def loops(self, loop: str) -> dict[str, StateSpace]:
        """Loop transfer function of every drive, by name; the nominal one is last."""
        delay = {"continuous": None, "sampled": 0.0, "delayed": self.delay}[loop]
        return self.delayed(delay)

    def delayed(self, delay: float | None) -> dict[str, StateSpace]:
        """The same with a delay [samples] beyond that of the hold; with None in continuous time."""
        systems = plants(self.axis, self.gain, self.values)
        return {name: open_loop(self.axis, system, delay) for name, system in systems.items()}

    # --- arrays -------------------------------------------------------------------------------

    loop, scale = dim(LOOPS), dim(SCALES)
    bound, end = dim("lower", "upper"), dim("low", "high")
    definition, number = dim("S", "crossover", "T"), dim("Table A.4", "bandwidth")
    drive = dim(lambda systems: list(systems["continuous"]))
    frequency = dim(
        lambda self: np.geomspace(LOW, HIGH, self.frequencies), unit="Hz", meaning="frequency"
    )

    systems = part(lambda self: {loop: self.loops(loop) for loop in LOOPS})
    rows = part(lambda systems: [list(one.values()) for one in systems.values()])
    margin = arrays((loop, drive), lambda rows: each_margin(rows), **MARGIN_UNITS)
    bandwidth = array(dims=(loop, drive, definition), unit="Hz")(
        lambda rows: [[[*bandwidths(L).values()] for L in row] for row in rows]
    )
    L = array(dims=(loop, drive, frequency), unit="1")(
        lambda rows, frequency: np.array(
            [[loop_response(L, frequency.values) for L in row] for row in rows], np.complex64
        )
    )

    @arrays(
        frequency,
        permitted=("1", "1/|W_p|"),
        red_book=("1", "acceptable error over largest deviation"),
    )
    def limits(self, frequency: DataArray) -> dict[str, RealArray]:
        weight = performance_weight(self.axis)
        return {
            "permitted": 1 / abs(loop_response(weight, frequency.values)),
            "red_book": ACCEPTABLE_ERROR[self.axis] / envelope(self.axis, frequency.values),
        }

    @part
    def weighted_loops(self, systems: Systems) -> Labelled:
        """W_p S in continuous time by scale of the gain and drive."""
        weight, loops = performance_weight(self.axis), systems["continuous"]
        return {
            (scale, drive): weighted_sensitivity(weight, L, factor)
            for scale, factor in SCALES.items()
            for drive, L in loops.items()
        }

    @answers
    def peaks(self, weighted_loops: Labelled, context: Context) -> dict[Any, Peak]:
        """Certified largest |W_p S| over all frequencies, in continuous time."""
        cases = context.track(list(weighted_loops), "certified peaks")
        return {case: peak(weighted_loops[case], ONE, tolerance=PEAK_TOLERANCE) for case in cases}

    @peaks.checkers
    def of_the_loops(self, weighted_loops: Labelled) -> dict[Any, PeakChecker]:
        """Checker that certifies each peak."""
        return {case: PeakChecker(loop, ONE) for case, loop in weighted_loops.items()}

    weighted = array(dims=(scale, drive, bound), unit="1", meaning="largest |W_p S|")(
        lambda peaks: by_scale([(each.lower, each.upper) for each in peaks.values()])
    )
    weighted_hz = array(dims=(scale, drive), unit="Hz")(
        lambda peaks: by_scale([each.omega / (2 * math.pi) for each in peaks.values()])
    )

    @array(
        dims=(scale, drive, "band", end), unit="Hz", meaning="ends of bands in which |W_p S| > 1"
    )
    def fails_hz(self, systems: Systems) -> list[list[Any]]:
        weight, loops = performance_weight(self.axis), systems["continuous"].values()
        found = [[failing(weight, L, factor) for L in loops] for factor in SCALES.values()]
        most = max(1, *(len(one) for row in found for one in row))
        missing = [(math.nan, math.nan)]
        return [[one + missing * (most - len(one)) for one in row] for row in found]

    @array(dims=drive, unit="dB", meaning="gain margin, Table A.4")
    def measured_db(self, drive: DataArray) -> list[float]:
        measured = gain_margins() if self.axis == "focus" else {}
        return [measured.get(name, math.nan) for name in drive.values]

    @array(dims=number, unit="samples", meaning="delay that explains a number of the thesis")
    def explaining_delay(self) -> list[float]:
        """Delays that give the mean gain margin of Table A.4, and the stated bandwidth."""
        if self.axis != "focus":
            return [math.nan, math.nan]
        printed = float(np.mean(list(gain_margins().values())))

        def margin(delay: float) -> float:
            loops = list(self.delayed(delay).values())[:-1]
            return float(np.mean([nearest_margins(loop).gain_db for loop in loops]))

        return [
            _zero(lambda delay: margin(delay) - printed),
            _zero(
                lambda delay: (
                    bandwidths(self.delayed(delay)["nominal"])["T"] - CLOSED_LOOP_BANDWIDTH
                )
            ),
        ]

    # --- metrics ------------------------------------------------------------------------------

    max_weighted = metric(
        template="max_weighted_S", value=lambda weighted: _highest(weighted, "full")
    )
    max_third = metric(
        template="max_weighted_S_third", value=lambda weighted: _highest(weighted, "third")
    )
    third_fails_below_hz = metric(
        template=lambda fails_hz: twelve(fails_hz).sel(scale="third", end="high").max()
    )
    weight_laxer_than_red_book = metric(
        template=lambda permitted, red_book: (permitted / red_book).max()
    )

    @metric
    def at_points(self, answer: Dataset) -> dict[str, float]:
        """Largest |S| of twelve drives over its limit, at the frequencies shown."""
        numbers = {}
        for scale, factor in SCALES.items():
            size = abs(1 / (1 + factor * twelve(answer["L"]))).max("drive")
            for loop in LOOPS:
                one = size.sel(loop=loop)
                numbers[f"red_book_error_{scale}_{loop}"] = float((one / answer["red_book"]).max())
                if loop != "continuous":
                    name = f"max_weighted_S_{scale}_{loop}_at_points"
                    numbers[name] = float((one / answer["permitted"]).max())
        return numbers

    least_gain_margin = metric(
        template="gain_margin_{loop}_db",
        value=lambda increase, decrease: twelve(gain_margin_db(increase, decrease)).min("drive"),
    )
    least_phase_margin = metric(
        template="phase_margin_{loop}_deg", value=lambda phase: twelve(phase).min("drive")
    )
    lower_limit = metric(
        template="lower_limit_{loop}_hz", value=lambda decrease_hz: decrease_hz.sel(drive="nominal")
    )
    upper_limit = metric(
        template="upper_limit_{loop}_hz", value=lambda increase_hz: increase_hz.sel(drive="nominal")
    )
    nominal_bandwidth = metric(
        template="bandwidth_{definition}_{loop}_hz",
        value=lambda bandwidth: bandwidth.sel(drive="nominal"),
    )

    @metric
    def beside_table_a4(self, answer: Dataset) -> dict[str, float] | None:
        """Margins of the focus loops, the measured ones, and the delays that explain the
        difference.
        """
        if self.axis != "focus":
            return None
        margin = twelve(gain_margin_db(answer["increase"], answer["decrease"]))
        measured, delay = twelve(answer["measured_db"]), answer["explaining_delay"]
        above = {
            f"above_table_a4_{loop}_db": float((margin.sel(loop=loop) - measured).mean())
            for loop in LOOPS
        }
        correlation = np.corrcoef(margin.sel(loop="delayed").values, measured.values)[0, 1]
        return above | {
            "correlation_with_table_a4": float(correlation),
            "delay_of_table_a4_samples": float(delay.sel(number="Table A.4")),
            "delay_of_bandwidth_samples": float(delay.sel(number="bandwidth")),
        }

    # --- checks, tables and figures -----------------------------------------------------------

    @check()
    def found_otherwise(self, answer: Dataset) -> list[Check]:
        limits = limit_checks(answer, {loop: self.loops(loop) for loop in LOOPS})
        return limits + peak_checks(answer, self.axis, self.gain, self.values)

    @check()
    def said(self, answer: Dataset) -> list[Check]:
        """The Red Book's limit, and the statements of section 6.3.3 about the focus loop."""
        numbers = self.metrics(answer)
        thesis = thesis_checks(answer, numbers) if self.axis == "focus" else []
        return [red_book_check(numbers), *thesis]

    margin_table = table(lambda answer: {"margins": margins_table(answer)})
    weighted_sensitivity = table(lambda answer: weighted_table(answer))
    bandwidths = table(lambda bandwidth: bandwidths_table(bandwidth))

    @table
    def red_book_table(self) -> dict[str, Any]:
        rows = [
            (statement, ", ".join(f"{low:.1f} to {high:.1f}" for low, high in found) or "none")
            for statement, found in self.red_book_bands().items()
        ]
        return {"red-book": (["statement", "bands [Hz]"], rows)}

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Figure]:
        return {
            "sensitivity": sensitivity_figure(answer, self.axis),
            "margins": margins_figure(answer, self.axis),
        }

    def red_book_bands(self) -> dict[str, list[tuple[float, float]]]:
        """Bands [Hz] in which W_p permits more than the Red Book, and |S| of a drive exceeds the
        latter.
        """
        weight, loops = performance_weight(self.axis), list(self.loops("continuous").values())[:-1]

        def needed(frequency: RealArray) -> Any:
            return envelope(self.axis, frequency) / ACCEPTABLE_ERROR[self.axis]

        def exceeded(frequency: RealArray, factor: float) -> Any:
            S = [abs(1 / (1 + factor * loop_response(L, frequency))) for L in loops]
            return np.max(S, axis=0) * needed(frequency) - 1

        grid = BAND_SEARCH[BAND_SEARCH >= LOW]
        laxer = positive_bands(lambda f: needed(f) / abs(loop_response(weight, f)) - 1, grid)
        return {"W_p laxer than the Red Book": laxer} | {
            f"Red Book exceeded, {WORDS[scale]}": positive_bands(
                partial(exceeded, factor=factor), grid
            )
            for scale, factor in SCALES.items()
        }


def weighted_sensitivity(weight: StateSpace, loop: StateSpace, scale: float) -> StateSpace:
    """W_p S of a loop whose gain is scaled."""
    import control

    return control.ss(weight * control.feedback(1, scale * loop))


def by_scale(values: list[Any]) -> RealArray:
    """Values of all scales and drives, with an axis for each."""
    found = np.array(values)
    return found.reshape(len(SCALES), -1, *found.shape[1:])


def failing(weight: StateSpace, loop: StateSpace, scale: float) -> list[tuple[float, float]]:
    """Bands [Hz] in which |W_p S| is above 1."""

    def level(frequency: RealArray) -> Any:
        S = 1 / (1 + scale * loop_response(loop, frequency))
        return np.log(abs(loop_response(weight, frequency) * S))

    return positive_bands(level, BAND_SEARCH)


def _zero(curve: Callable[[float], float]) -> float:
    """Delay [samples] at which a curve is zero; NaN if there is none up to LONGEST_TRIED_DELAY."""
    if curve(0.0) * curve(LONGEST_TRIED_DELAY) > 0:
        return math.nan
    return float(brentq(curve, 0.0, LONGEST_TRIED_DELAY, xtol=1e-4))


def _highest(weighted: DataArray, scale: str) -> DataArray:
    return twelve(weighted).sel(scale=scale, bound="upper").max()
