"""Does a multisine test linearity faster than sines of growing size (section 4.5)?

Equation and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import problem
from workbench._core.arrays import RealArray
from workbench._core.heavy_types import DataArray, Dataset, Figure
from workbench.executor import Context
from workbench.identification import LineDistortion
from workbench.simulation import bootstrap_weights, percentile_interval
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
    metric,
    part,
    table,
)

from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis, Values
from ..experiment import Laboratory
from ..unknowns import DRIVES
from .figures import linearity_tests
from .runs import EVALUATED, LENGTHS, SIZES, DistortionTests

KINDS = ("odd", "even")
RECORDS = 1 + len(SIZES)
"""Number of records in a draw: one with the multisine, and those with the sines."""
LEVEL = 0.01
"""Significance level at which distortion counts as found."""
CONFIDENCE, SAMPLES = 0.95, 2000
"""Confidence of the interval of a ratio of times, and number of bootstrap samples of the draws for
it.
"""
FOUND = 1e-3
"""Noise-free level of distortion, over the linear output, from which it should be found."""
UNBIASED = 4.0
"""Largest accepted mean error, over its standard deviation."""
MOST_ALARMS = 0.1
"""Largest accepted share of the draws that find even distortion although there is none."""


@problem("cd/{axis}/multisine-linearity", axis=("focus", "radial"), data=TABLES)
def multisine_linearity(
    axis: Axis,
    drive: str = "CD1",
    draws: Annotated[int, Field(ge=4, le=1000)] = 12,
    values: Values = "printed",
) -> MultisineLinearity:
    """Distortion in closed loop by a multisine or by sines of growing size, and their times.

    Both excite the loop of `linearity` from 100 to 2000 Hz and move the nominal lens by the same
    distance. The multisine has odd lines of equal size, of which every fourth is silent: odd and
    even distortion of the normalised error appears at silent lines. The sines have four sizes, 40
    frequencies and 20 periods, of which the last ten are evaluated: distortion appears at their
    harmonics up to the fifth. Each method measures a level of its own; its error is the difference
    from the level that it measures without noise. Times are compared at equal errors of the squared
    level, absolute, or relative to its noise-free value.

    drive: CD1 ... CD12. draws: number of draws of the noise and of the multisine's phases. values:
    tables "printed" or "corrected".
    """
    return MultisineLinearity(DistortionTests(Laboratory(axis, drive, values)), draws)


@dataclass(frozen=True, eq=False)
class MultisineLinearity(Study):
    """Both tests of linearity, over the draws."""

    tests: DistortionTests
    draws: int

    headline: ClassVar[str] = "time_ratio_absolute"

    @property
    def quantifier(self) -> str:
        drive = self.tests.laboratory.drive
        return f"on {drive}, in {self.draws} simulated draws"

    kind, size, length, count = dim(KINDS), dim(SIZES), dim(LENGTHS), dim(EVALUATED)
    draw = dim(lambda self: range(self.draws))

    @array(dims=(draw, "record"))
    def seed(self, context: Context) -> Any:
        every = independent_seeds(context.rng, self.draws, RECORDS, len(DRIVES))
        return every[..., DRIVES.index(self.tests.laboratory.drive)]

    time = array(
        dims=length, unit="s", meaning="of the multisine", value=lambda self: self.tests.times[0]
    )
    series_time = array(
        dims=count, unit="s", meaning="of all sines", value=lambda self: self.tests.times[1]
    )

    @part
    def played(self, seed: DataArray, context: Context) -> list[Any]:
        """Distortions of each draw: by the multisine, by the multisine without noise, and by the
        sines.
        """
        self.tests.sweeps  # noqa: B018  (made once, before threads ask for it)

        def one(seeds: list[int]) -> tuple[Any, Any, Any]:
            first, *others = seeds
            tests = self.tests
            return (
                tests.by_multisine(first), tests.multisine_truth(first), tests.by_sines(others)
            )  # fmt: skip

        return context.spread(one, seed.values.tolist(), "draws")

    @arrays((draw, length, kind), by_multisine="1", by_multisine_p="1")
    def multisine(self, played: list[Any]) -> dict[str, RealArray]:
        """Squared levels over the linear output's, and their p-values under noise alone."""
        found = [[both(one) for one in multisine] for multisine, _, _ in played]
        squares, p = np.moveaxis(np.array(found), 2, 0)
        return {"by_multisine": squares, "by_multisine_p": p}

    @arrays((draw, size, count, kind), by_sines="1", by_sines_p="1")
    def sines(self, played: list[Any]) -> dict[str, RealArray]:
        """Squared levels over the fundamentals', and their p-values under noise alone."""
        found = [[[both(one) for one in row] for row in sines] for _, _, sines in played]
        squares, p = np.moveaxis(np.array(found), 3, 0)
        return {"by_sines": squares, "by_sines_p": p}

    multisine_truth = array(
        dims=(draw, kind), unit="1", meaning="square without noise, by the multisine"
    )(lambda played: [both(truth)[0] for _, truth, _ in played])
    sines_truth = array(dims=(size, kind), unit="1", meaning="square without noise, by sines")(
        lambda self: [both(one)[0] for one in self.tests.sines_truth()]
    )

    # --- checks -------------------------------------------------------------------------------

    @check(title="even", at_most=FOUND)
    def no_even(self, answer: Dataset) -> float:
        """level of even distortion without noise, over the linear output"""
        parts = (answer["multisine_truth"], answer["sines_truth"])
        return max(float(abs(one.sel(kind="even")).max()) ** 0.5 for one in parts)

    @check(title="bias", at_most=UNBIASED)
    def bias(self, answer: Dataset) -> float:
        """mean error of a square over its standard deviation, of the longest experiments"""
        errors = [self.errors(answer, "multisine").isel(length=-1)]
        errors.append(self.errors(answer, "sines").isel(count=-1))
        every = [one.mean("draw") / (one.std("draw", ddof=1) / self.draws**0.5) for one in errors]
        return max(float(abs(one).max()) for one in every)

    @check(title="false alarms", at_most=MOST_ALARMS)
    def alarms(self, answer: Dataset) -> float:
        """share of the draws in which the longest experiments find even distortion"""
        every = [answer["by_multisine_p"].isel(length=-1)]
        every.append(answer["by_sines_p"].isel(size=-1, count=-1))
        return max(float((one.sel(kind="even") < LEVEL).mean("draw")) for one in every)

    # --- what is told -------------------------------------------------------------------------

    def errors(self, answer: Dataset, method: str) -> DataArray:
        """Errors of the squared levels (draw, length or count, kind); for the sines, of the largest
        size.
        """
        if method == "multisine":
            return answer["by_multisine"] - answer["multisine_truth"]
        return (answer["by_sines"] - answer["sines_truth"]).isel(size=-1)

    @metric
    def levels(self, answer: Dataset) -> dict[str, float]:
        """Levels [%] without noise: of the multisine as rms over the draws, of the sines at each
        size.
        """
        numbers: dict[str, float] = {}
        for kind in KINDS:
            squares = answer["multisine_truth"].sel(kind=kind)
            numbers[f"{kind}_multisine_percent"] = 100 * float(squares.mean()) ** 0.5
            for size in SIZES:
                one = float(answer["sines_truth"].sel(kind=kind, size=size))
                numbers[f"{kind}_sines_{round(100 * size)}_percent"] = 100 * one**0.5
        return numbers

    found_by_multisine = metric(
        template="found_multisine_{length}_{kind}",
        value=lambda by_multisine_p: (by_multisine_p < LEVEL).mean("draw"),
    )
    found_by_sines = metric(
        template="found_sines_{count}_{kind}",
        value=lambda by_sines_p: (by_sines_p.isel(size=-1) < LEVEL).mean("draw"),
    )

    @metric
    def durations(self, answer: Dataset) -> dict[str, float]:
        """Time of the multisine over that of the sines at equal rms errors of the squared odd
        level.

        It is compared with the series of four sizes, and with its largest size alone. The ends are
        those of a bootstrap interval over the draws. Absolute errors are divided by the square of
        the linear output. Relative errors are divided by the noise-free square, if there is
        something to find.
        """
        multisine, sines = (
            self.errors(answer, name).sel(kind="odd") for name in ("multisine", "sines")
        )
        truths = {"absolute": (1.0, 1.0)}
        own = float(answer["multisine_truth"].sel(kind="odd").mean())
        other = float(answer["sines_truth"].sel(kind="odd").isel(size=-1))
        if min(own, other) > FOUND**2:
            truths["relative"] = (own, other)
        drawn = bootstrap_weights(np.zeros(self.draws, int), SAMPLES, np.random.default_rng(0))
        weights = np.vstack([np.full(self.draws, 1.0 / self.draws), drawn])
        numbers: dict[str, float] = {}
        series = float(answer["series_time"][-1])
        wholes = {"time_ratio": series, "time_ratio_one_size": series / len(SIZES)}
        rms = [np.sqrt(weights @ one.values**2) for one in (multisine, sines.isel(count=-1))]
        for name, (first, second) in truths.items():
            needed = time_for(rms[1] / second, rms[0] / first, answer["time"].values)
            for words, whole in wholes.items():
                low, high = percentile_interval(needed[1:] / whole, confidence=CONFIDENCE)
                key = f"{words}_{name}"
                numbers |= {key: float(needed[0] / whole), f"{key}_low": float(low)}
                numbers[f"{key}_high"] = float(high)
        return numbers

    @table
    def linearity(self, answer: Dataset) -> tuple[list[str], list[list[str]]]:
        """Squared levels, in percent squared, and how often distortion is found."""
        heads = ["method", "evaluated periods", "time [s]", "odd [%^2]", "even [%^2]", "odd found"]
        rows = []
        for length in LENGTHS:
            one = answer.sel(length=length)
            rows.append(["multisine", str(length), f"{float(one['time']):.2f}"])
            rows[-1] += self._table_cells(one["by_multisine"], one["by_multisine_p"])
        for count in EVALUATED:
            one = answer.sel(count=count).isel(size=-1)
            rows.append(["sines", str(count), f"{float(one['series_time']):.2f}"])
            rows[-1] += self._table_cells(one["by_sines"], one["by_sines_p"])
        return heads, rows

    def _table_cells(self, squares: DataArray, p: DataArray) -> list[str]:
        cells = [
            interval_text(draws_summary(1e4 * squares.sel(kind=kind)), form="{:.2f}")
            for kind in KINDS
        ]
        return [*cells, f"{float((p.sel(kind='odd') < LEVEL).mean()):.0%}"]

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Figure]:
        one = self.tests.laboratory
        errors = {name: self.errors(answer, name) for name in ("multisine", "sines")}
        return {"tests": linearity_tests(answer, errors, f"{one.drive} {one.axis}")}


def both(one: LineDistortion) -> tuple[tuple[float, float], tuple[float, float]]:
    """Squared levels (odd, even), divided by the square of the excited lines, and their
    p-values.
    """
    linear = one.excited**2
    return (one.odd_square / linear, one.even_square / linear), (one.odd_p, one.even_p)


def time_for(target: RealArray, errors: RealArray, times: RealArray) -> RealArray:
    """Times (S,) at which errors (S, T) over the times (T,) fall to the targets (S,).

    The power law that fits the errors best is used. It is steep enough to extrapolate to targets
    outside.
    """
    x = np.log(times)
    slope, offset = np.polyfit(x, np.log(errors).T, 1)
    found: RealArray = np.exp((np.log(target) - offset) / slope)
    return found
