"""Deviations of the plants of the parametric uncertainty from the nominal one (section 5.5).

The anti-aliasing filter is left out, as relative deviations do not depend on it. Equation, table
and figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players
(2003).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, problem
from workbench.executor import Context
from workbench.study import Study, array, arrays, dim, figure, metric, part, table
from workbench.types import ComplexArray, DataArray, Dataset, Figure, RealArray
from workbench.uncertainty import (
    Parameter,
    ParametricModel,
    factorial_response,
    level_deltas,
    random_deltas,
)

from ...drive.plants import nominal_response, responses
from ...drive.shared_parameters import TABLES, Frequencies, Frequency, grid
from ...drive.tables import Axis, Values, drives, nominal_table
from ..parametric_model import UNITS
from .checks import MODELS, boxes, pulled_out, spread_checks
from .figures import bode_figure, deviation_figure
from .search import climbed

GAINS: Any = ("own", "agc")
FREQUENCIES_AT_ONCE = 8
"""Number of frequencies whose responses of all 19683 plants are in memory together."""
SUFFIXES = {"nine": "", "without gain": "_no_gain", "reduced": "_reduced"}
"""Suffixes of the metrics' names for each set of plants."""


@problem(
    "cd/{axis}/parametric",
    axis=("focus", "radial"),
    data=(*TABLES, "data/reduced_tolerances.csv"),
)
def parametric_spread(
    axis: Axis,
    frequencies: Frequencies = 400,
    lowest: Frequency = 5.0,
    highest: Frequency = 5000.0,
    between: Annotated[int, Field(ge=0, le=20)] = 9,
    drawn: Annotated[int, Field(ge=1, le=100_000)] = 500,
    values: Values = "printed",
) -> ParametricSpread:
    """Parametric uncertainty and how far its plants deviate (Tables 5.2, 5.3, figure 5.16).

    The model's nine parameters become real perturbations. The largest relative deviation |G_p / G -
    1| is computed over all combinations of their minimum, nominal and maximum; then without the
    total gain, which the automatic gain control removes; then with the three parameters that
    represent all. The twelve drives are shown besides.

    Plants in the interior of the tolerances may exceed these combinations. For the nine parameters
    the excess is found by a search from the worst combination, for the three by a dense grid.

    frequencies: number of frequencies, logarithmically spaced from lowest to highest [Hz]. between:
    number of values of the three parameters that are tried between minimum and nominal, and between
    nominal and maximum. drawn: number of random combinations of the nine. values: tables of the
    drives, "printed" or "corrected".
    """
    return ParametricSpread(axis, grid(frequencies, lowest, highest), between, drawn, values)


@dataclass(frozen=True, eq=False)
class ParametricSpread(Study):
    """Relative deviations of the plants of an axis over a frequency grid [Hz]."""

    axis: Axis
    grid: RealArray
    between: int = 9
    samples: int = 500
    values: Values = "printed"

    headline: ClassVar[str] = "deviation_peak_reduced"

    @property
    def quantifier(self) -> str:
        return (
            f"at {len(self.grid)} frequencies, for combinations of minimum, nominal and maximum "
            f"and {self.samples} plants at random; between frequencies and for other plants nothing"
        )

    frequency = dim(lambda self: self.grid, unit="Hz")
    set = dim(lambda sets: list(sets))
    model, stage = dim(MODELS), dim("before reduction", "after reduction")
    parameter, gain = dim(UNITS), dim(GAINS)
    drive = dim(lambda self: [one.name for one in drives(self.axis, self.values)])
    unit = array(dims=parameter, value=lambda: UNITS, coordinate=True)

    models = part(lambda self: pulled_out(self.axis))
    sets = part(lambda self: boxes(self.axis))

    @array(dims=frequency, unit="units/V", meaning="f_en / u")
    def nominal(self) -> ComplexArray:
        return nominal_response(self.axis, self.grid, antialiasing=False)

    @part
    def extremes(
        self, models: dict[str, ParametricModel], nominal: DataArray, context: Context
    ) -> dict[str, Any]:
        """The largest deviations of all sets, and the plants that have them."""
        nine = models["nine"]
        random = random_deltas(nine.parameters, self.samples, context.rng)
        dense = np.linspace(-1.0, 1.0, 2 * self.between + 3)
        parts = []
        starts = range(0, len(self.grid), FREQUENCIES_AT_ONCE)
        for start in context.track(starts, "combinations"):
            part = slice(start, start + FREQUENCIES_AT_ONCE)
            omega, center = 2 * np.pi * self.grid[part], nominal.values[part]
            inside = factorial_response(models["reduced"], omega, dense)
            found = [_extremes(plants, center) for plants in _levels(models, omega)]
            beside = [_extremes(p, center)[0] for p in (inside, nine.response(omega, random))]
            parts.append((*map(np.array, zip(*found, strict=True)), *beside))
        names = ("deviation", "place", "least", "most", "interior", "drawn")
        columns = (np.concatenate(rows, axis=-1) for rows in zip(*parts, strict=True))
        return dict(zip(names, columns, strict=True))

    over_sets = arrays(
        (set, frequency),
        lambda extremes: extremes,
        deviation=("1", "largest |G_p / G - 1|"),
        least=("units/V", "least magnitude"),
        most=("units/V", "largest magnitude"),
    )
    beside = arrays(
        frequency,
        lambda extremes: extremes,
        interior=("1", "largest deviation, reduced, dense"),
        drawn=("1", "largest deviation, nine, at random"),
    )

    @array(dims=(set, frequency, parameter), unit="1", meaning="combination that deviates most")
    def delta(self, sets: dict[str, Any], extremes: dict[str, Any]) -> list[RealArray]:
        places = zip(sets.values(), extremes["place"], strict=True)
        return [_placed(level_deltas(box, 3)[i], box) for box, i in places]

    climb = part(
        lambda self, sets, delta: climbed(self.axis, sets["nine"], self.grid, delta.values[0])
    )
    sought = array(
        dims=frequency,
        unit="1",
        meaning="largest deviation found, nine",
        value=lambda climb: climb[0],
    )
    sought_delta = array(
        dims=(frequency, parameter), unit="1", meaning="that has it", value=lambda climb: climb[1]
    )

    @array(dims=(gain, drive, frequency), unit="units/V")
    def drives(self) -> list[Any]:
        return [responses(self.axis, self.grid, gain, self.values, False) for gain in GAINS]

    @array(dims=(drive, parameter), unit="1", meaning="of the drives")
    def drive_delta(self) -> RealArray:
        """Deltas of the drives (12, 9), with gains in proportion to K_optn."""
        twelve = drives(self.axis, self.values)
        gain = np.array([drive.K_optn for drive in twelve])
        table = nominal_table(self.axis)
        own = {"K_total": gain / ((gain.min() + gain.max()) / 2) * table["K_total"].nominal}
        own |= {n: np.array([getattr(d, n) for d in twelve]) for n in table if n not in own}
        return np.stack([(own[n] / p.nominal - 1) / p.tolerance for n, p in table.items()], axis=1)

    nominal_value = array(
        dims=parameter,
        value=lambda self: [one.nominal for one in nominal_table(self.axis).values()],
    )

    @array(dims=(model, parameter), unit="1", meaning="relative tolerance")
    def tolerance(self, models: dict[str, ParametricModel]) -> list[RealArray]:
        boxes = [one.parameters for one in models.values()]
        return [_placed([p.tolerance for p in box], box) for box in boxes]

    @array(dims=(model, stage, parameter), unit="1", meaning="repetitions")
    def copies(self, models: dict[str, ParametricModel]) -> RealArray:
        counts = [(np.array(list(m.repetitions.values())).T, m.parameters) for m in models.values()]
        return np.array([_placed(*one) for one in counts], int)

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        return spread_checks(self.axis, answer)

    @metric
    def deviation_sizes(self, answer: Dataset) -> dict[str, DataArray]:
        """Peak of the deviations of each set and of the drives, and their median above 100 Hz."""
        sizes = {("deviation", s): answer["deviation"].sel(set=n) for n, s in SUFFIXES.items()}
        away = _deviations(answer).max("drive")
        sizes |= {("drives", f"_{gain}"): away.sel(gain=gain) for gain in GAINS}
        high = (answer["frequency"] > 100).values
        return {
            name: value
            for (what, suffix), one in sizes.items()
            for name, value in (
                (f"{what}_peak{suffix}", one.max()),
                (f"{what}_peak{suffix}_hz", one.idxmax()),
                (f"{what}_median_above_100_hz{suffix}", one[high].median()),
            )
        }

    @metric
    def drives_beyond(self, answer: Dataset) -> dict[str, DataArray]:
        """Share of frequencies and drives with a larger deviation than that of a set."""
        beyond = (_deviations(answer) > answer["deviation"]).mean(("drive", "frequency"))
        return {
            f"drives_{gain}_beyond{suffix or '_nine'}": beyond.sel(gain=gain, set=name)
            for gain in GAINS
            for name, suffix in SUFFIXES.items()
        }

    @metric
    def other_plants(self, answer: Dataset) -> dict[str, DataArray]:
        """Excess of interior plants, deltas of the drives, and numbers of channels."""
        deviation = answer["deviation"]
        inside = answer["sought"] / deviation.sel(set="nine") - 1
        reduced = answer["interior"] / deviation.sel(set="reduced") - 1
        channels = answer["copies"].sel(stage="after reduction").sum("parameter")
        return {
            "interior_excess": inside.max(),
            "interior_excess_hz": inside.idxmax(),
            "interior_excess_reduced": reduced.max(),
            "interior_excess_reduced_hz": reduced.idxmax(),
            "drives_largest_delta": abs(answer["drive_delta"]).max(),
            "drawn_share": (answer["drawn"] / deviation.sel(set="nine")).max(),
            "channels": channels.sel(model="nine"),
            "channels_reduced": channels.sel(model="reduced"),
        }

    @table
    def tables_5_2_5_3(self, answer: Dataset) -> tuple[list[str], list[list[str]]]:
        heads = ["parameter", "nominal", "tolerance [%]", "repetitions, before reduction"]
        heads += ["Table 5.3 [%]", "repetitions, before reduction", "drives, largest delta"]
        rows = []
        for name in UNITS:
            one = answer.sel(parameter=name)
            row = [name, f"{float(one['nominal_value']):g} {UNITS[name]}"]
            for percent, (before, after) in zip(
                100 * one["tolerance"].values, one["copies"].values, strict=True
            ):
                row += [f"{percent:.3g}", f"{after}, {before}"] if after else ["-", "-"]
            rows.append([*row, f"{float(abs(one['drive_delta']).max()):.2f}"])
        return heads, rows

    @figure
    def deviations(self, answer: Dataset) -> dict[str, Figure]:
        return {"deviation": deviation_figure(answer), "bode": bode_figure(answer)}


def _levels(models: dict[str, ParametricModel], omega: RealArray) -> list[ComplexArray]:
    """Responses of all combinations of minimum, nominal and maximum, for each set of plants.

    "without gain" is the part of the nine in which K_total, the first parameter, is nominal.
    """
    three = np.array([-1.0, 0.0, 1.0])
    nine, reduced = (factorial_response(model, omega, three) for model in models.values())
    return [nine, nine[1], reduced]


def _extremes(
    plants: ComplexArray, center: ComplexArray
) -> tuple[RealArray, Any, RealArray, RealArray]:
    """Largest relative deviation (F,), the plant that has it, and least and largest magnitude."""
    each = plants.reshape(-1, len(center))
    away, size = abs(each / center - 1), abs(each)
    return away.max(axis=0), away.argmax(axis=0), size.min(axis=0), size.max(axis=0)


def _placed(values: Any, box: Sequence[Parameter]) -> RealArray:
    """Values (..., P) of a set's parameters, put among all nine (..., 9); the others are zero."""
    array = np.asarray(values, dtype=float)
    result = np.zeros((*array.shape[:-1], len(UNITS)))
    result[..., [list(UNITS).index(p.name) for p in box]] = array
    return result


def _deviations(answer: Dataset) -> DataArray:
    """Relative deviations (gain, drive, frequency) of the drives from the nominal."""
    return abs(answer["drives"] / answer["nominal"] - 1)
