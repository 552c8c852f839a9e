"""How far the plants of the parametric uncertainty deviate from the nominal (section 5.5).

Relative deviations do not depend on the anti-aliasing filter, which is left out. Equation, table
and figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players
(2003).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, Study, problem
from workbench.arrays import ComplexArray, RealArray
from workbench.executor import Context
from workbench.heavy_types import Dataset, Figure
from workbench.uncertainty.parametric.factorial import factorial_response
from workbench.uncertainty.parametric.model import ParametricModel
from workbench.uncertainty.parametric.parameters import Parameter, levels, samples

from ...drive.plants import nominal_response, responses
from ...drive.shared_parameters import TABLES, Frequencies, Frequency, grid
from ...drive.tables import Axis, Values, drives, nominal_table
from ..parametric_model import UNITS
from .checks import MODELS, boxes, pulled_out, spread_checks
from .figures import bode_figure, deviation_figure
from .search import climbed

GAINS: Any = ("own", "agc")
CHUNK = 8
"""Frequencies at a time, at each of which all 19683 plants are held."""


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

    The nine parameters, pulled out of the model as real perturbations; the largest relative
    deviation |G_p / G - 1| over all combinations of their minimum, nominal and maximum; the same
    without the total gain, which the automatic gain control removes, and with the three parameters
    that stand for all. Beside them the twelve drives, and how much plants in the interior of the
    tolerances exceed those combinations: of the nine by a search that starts from the worst of
    them, of the three by a dense grid.

    frequencies: how many, logarithmically spaced from lowest to highest [Hz]. between: values
    between minimum, nominal and maximum that are tried of the three parameters; drawn: random
    combinations of the nine. values: tables of the drives, "printed" or "corrected".
    """
    return ParametricSpread(axis, grid(frequencies, lowest, highest), between, drawn, values)


@dataclass(frozen=True, eq=False)
class ParametricSpread(Study):
    """Relative deviations of the plants of an axis over a frequency grid [Hz]."""

    axis: Axis
    frequency: RealArray
    between: int = 9
    drawn: int = 500
    values: Values = "printed"

    headline: ClassVar[str] = "deviation_peak_reduced"

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        models = pulled_out(self.axis)
        nine = models["nine"]
        random = samples(nine.parameters, self.drawn, context.rng)
        dense = np.linspace(-1.0, 1.0, 2 * self.between + 3)
        nominal = nominal_response(self.axis, self.frequency, antialiasing=False)
        parts = []
        for start in context.track(range(0, len(nominal), CHUNK), "combinations"):
            part = slice(start, start + CHUNK)
            omega, center = 2 * np.pi * self.frequency[part], nominal[part]
            inside = factorial_response(models["reduced"], omega, dense)
            found = [_extremes(plants, center) for plants in _levels(models, omega)]
            beside = [_extremes(p, center)[0] for p in (inside, nine.response(omega, random))]
            parts.append((*map(np.array, zip(*found, strict=True)), *beside))
        deviation, place, least, most, inside, aside = (
            np.concatenate(rows, axis=-1) for rows in zip(*parts, strict=True)
        )
        sets = boxes(self.axis)
        worst_deltas = [
            _placed(levels(box, 3)[i], box) for box, i in zip(sets.values(), place, strict=True)
        ]
        sought, sought_delta = climbed(self.axis, sets["nine"], self.frequency, worst_deltas[0])
        drives_found = [
            responses(self.axis, self.frequency, gain, self.values, antialiasing=False)
            for gain in GAINS
        ]
        tolerances = [
            _placed([p.tolerance for p in m.parameters], m.parameters) for m in models.values()
        ]
        copies = [
            _placed(np.array(list(m.repetitions.values())).T, m.parameters) for m in models.values()
        ]
        over, unit = ("set", "frequency"), {"units": "units/V"}
        return xr.Dataset(
            {
                "nominal": ("frequency", nominal, unit | {"long_name": "f_en / u"}),
                "deviation": (over, deviation, _one("largest |G_p / G - 1|")),
                "delta": (
                    (*over, "parameter"),
                    worst_deltas,
                    _one("combination that deviates most"),
                ),
                "least": (over, least, unit | {"long_name": "least magnitude"}),
                "most": (over, most, unit | {"long_name": "largest magnitude"}),
                "interior": ("frequency", inside, _one("largest deviation, reduced, dense")),
                "drawn": ("frequency", aside, _one("largest deviation, nine, at random")),
                "sought": ("frequency", sought, _one("largest deviation found, nine")),
                "sought_delta": (("frequency", "parameter"), sought_delta, _one("that has it")),
                "drives": (("gain", "drive", "frequency"), drives_found, unit),
                "drive_delta": (
                    ("drive", "parameter"),
                    self._drive_deltas(),
                    _one("of the drives"),
                ),
                "nominal_value": (
                    "parameter",
                    [entry.nominal for entry in nominal_table(self.axis).values()],
                ),
                "tolerance": (("model", "parameter"), tolerances, _one("relative tolerance")),
                "copies": (
                    ("model", "stage", "parameter"),
                    np.array(copies, int),
                    _one("repetitions"),
                ),
            },
            coords={
                "frequency": ("frequency", self.frequency, {"units": "Hz"}),
                "set": list(sets),
                "model": list(MODELS),
                "stage": ["before reduction", "after reduction"],
                "parameter": list(UNITS),
                "unit": ("parameter", list(UNITS.values())),
                "gain": list(GAINS),
                "drive": [drive.name for drive in drives(self.axis, self.values)],
            },
        )

    def _drive_deltas(self) -> RealArray:
        """Deltas of the drives (12, 9), their gains in proportion to K_optn."""
        twelve = drives(self.axis, self.values)
        gain = np.array([drive.K_optn for drive in twelve])
        table = nominal_table(self.axis)
        own = {"K_total": gain / ((gain.min() + gain.max()) / 2) * table["K_total"].nominal}
        own |= {n: np.array([getattr(d, n) for d in twelve]) for n in table if n not in own}
        return np.stack([(own[n] / p.nominal - 1) / p.tolerance for n, p in table.items()], axis=1)

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        return spread_checks(self.axis, answer)

    def metrics(self, answer: Dataset) -> dict[str, float]:
        hertz = answer["frequency"].values
        over = {str(n): answer["deviation"].sel(set=n).values for n in answer["set"].values}
        shown = {"nine": "", "without gain": "_no_gain", "reduced": "_reduced"}
        numbers: dict[str, float] = {}
        for name, suffix in shown.items():
            numbers[f"deviation_peak{suffix}"] = float(over[name].max())
            numbers[f"deviation_peak{suffix}_hz"] = float(hertz[over[name].argmax()])
            numbers[f"deviation_median_above_100_hz{suffix}"] = _median(over[name][hertz > 100])
        away = abs(answer["drives"] / answer["nominal"] - 1)
        for gain in GAINS:
            one = away.sel(gain=gain)
            most = one.max("drive").values
            numbers[f"drives_peak_{gain}"] = float(most.max())
            numbers[f"drives_peak_{gain}_hz"] = float(hertz[most.argmax()])
            numbers[f"drives_median_above_100_hz_{gain}"] = _median(most[hertz > 100])
            for name, suffix in shown.items():
                beyond = one.values > over[name]
                numbers[f"drives_{gain}_beyond{suffix or '_nine'}"] = float(beyond.mean())
        inside = {"": ("sought", "nine"), "_reduced": ("interior", "reduced")}
        for suffix, (variable, name) in inside.items():
            excess = answer[variable].values / over[name] - 1
            numbers[f"interior_excess{suffix}"] = float(excess.max())
            numbers[f"interior_excess{suffix}_hz"] = float(hertz[excess.argmax()])
        after = answer["copies"].sel(stage="after reduction").sum("parameter")
        return numbers | {
            "drives_largest_delta": float(abs(answer["drive_delta"]).max()),
            "drawn_share": float((answer["drawn"].values / over["nine"]).max()),
            "channels": float(after.sel(model="nine")),
            "channels_reduced": float(after.sel(model="reduced")),
        }

    def tables(self, answer: Dataset) -> dict[str, str]:
        lines = [
            "| parameter | nominal | tolerance [%] | repetitions, before reduction "
            "| Table 5.3 [%] | repetitions, before reduction | drives, largest delta |",
            "| --- |" + " ---: |" * 6,
        ]
        for name in UNITS:
            one = answer.sel(parameter=name)
            cells = []
            for model in MODELS:
                before, after = one["copies"].sel(model=model).values
                percent = 100 * float(one["tolerance"].sel(model=model))
                cells.append(f"{percent:.3g} | {after}, {before}" if after else "- | -")
            most = float(abs(one["drive_delta"]).max())
            nominal = f"{float(one['nominal_value']):g} {UNITS[name]}"
            lines.append(f"| {name} | {nominal} | {' | '.join(cells)} | {most:.2f} |")
        return {"tables-5-2-5-3": "\n".join(lines) + "\n"}

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        return {"deviation": deviation_figure(answer), "bode": bode_figure(answer)}


def _levels(models: dict[str, ParametricModel], omega: RealArray) -> list[ComplexArray]:
    """All plants of minimum, nominal and maximum, a set each; K_total is the first of the nine."""
    three = np.array([-1.0, 0.0, 1.0])
    nine, reduced = (factorial_response(model, omega, three) for model in models.values())
    return [nine, nine[1], reduced]


def _extremes(
    plants: ComplexArray, center: ComplexArray
) -> tuple[RealArray, Any, RealArray, RealArray]:
    """Largest relative deviation, whose it is, least and largest magnitude (F,) of plants."""
    each = plants.reshape(-1, len(center))
    away, size = abs(each / center - 1), abs(each)
    return away.max(axis=0), away.argmax(axis=0), size.min(axis=0), size.max(axis=0)


def _placed(values: Any, box: Sequence[Parameter]) -> RealArray:
    """Values (..., P) of a set's parameters among all nine (..., 9), zero for the certain ones."""
    array = np.asarray(values, dtype=float)
    result = np.zeros((*array.shape[:-1], len(UNITS)))
    result[..., [list(UNITS).index(p.name) for p in box]] = array
    return result


def _median(values: RealArray) -> float:
    return float(np.median(values)) if values.size else float("nan")


def _one(name: str) -> dict[str, str]:
    return {"units": "1", "long_name": name}
