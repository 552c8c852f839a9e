"""How far the plants of the parametric uncertainty deviate from the nominal (section 5.5).

Relative deviations do not depend on the anti-aliasing filter, which is left out. Equation, table
and figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players
(2003).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, Study, problem
from workbench.errors import InputError
from workbench.executor import Context
from workbench.program import worst
from workbench.uncertainty.factorial import factorial_response
from workbench.uncertainty.parameters import Parameter, levels, samples, vertices
from workbench.uncertainty.parametric import ParametricModel

from .actuator import Complex, Real, specific_model, stack
from .drives import nominal_response, responses
from .parametric import COPIES, UNITS, parametric_plant, uncertain_parameters
from .parametric_figures import bode_figure, deviation_figure
from .sets import TABLES, Frequencies, Frequency
from .tables import ActuatorParameters, Axis, Values, drives, nominal_table

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

MODELS = {"nine": False, "reduced": True}
GAINS: Any = ("own", "agc")
AGREE = 1e-9
"""Relative distance of responses that counts as rounding."""
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
    that stand for all. Beside them the twelve drives, and how much combinations in the interior
    exceed those.

    frequencies: how many, logarithmically spaced from lowest to highest [Hz]. between: values
    between minimum, nominal and maximum that are tried of the three parameters; drawn: random
    combinations of the nine. values: tables of the drives, "printed" or "corrected".
    """
    if not lowest < highest:
        raise InputError(f"lowest={lowest} Hz must lie below highest={highest} Hz")
    grid = np.geomspace(lowest, highest, frequencies)
    return ParametricSpread(axis, grid, between, drawn, values)


@dataclass(frozen=True, eq=False)
class ParametricSpread(Study):
    """Relative deviations of the plants of an axis over a frequency grid [Hz]."""

    axis: Axis
    frequency: Real
    between: int = 9
    drawn: int = 500
    values: Values = "printed"

    headline: ClassVar[str] = "deviation_peak_reduced"

    def compute(self, context: Context) -> xr.Dataset:
        import xarray as xr

        models = {name: parametric_plant(self.axis, small) for name, small in MODELS.items()}
        nine = models["nine"]
        random = samples(nine.parameters, self.drawn, context.rng)
        dense = np.linspace(-1.0, 1.0, 2 * self.between + 3)
        nominal = nominal_response(self.axis, self.frequency, antialiasing=False)
        parts = []
        for start in context.track(range(0, len(nominal), CHUNK), "combinations"):
            part = slice(start, start + CHUNK)
            omega, center = 2 * np.pi * self.frequency[part], nominal[part]
            sets = _levels(models, omega)
            inside = factorial_response(models["reduced"], omega, dense)
            found = [_extremes(plants, center) for plants in sets]
            beside = [_extremes(p, center)[0] for p in (inside, nine.response(omega, random))]
            parts.append((*map(np.array, zip(*found, strict=True)), *beside))
        deviation, place, least, most, inside, aside = (
            np.concatenate(rows, axis=-1) for rows in zip(*parts, strict=True)
        )
        boxes = self.boxes()
        worst_deltas = [
            _placed(levels(box, 3)[i], box) for box, i in zip(boxes.values(), place, strict=True)
        ]
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
                "set": list(boxes),
                "model": list(MODELS),
                "stage": ["before reduction", "after reduction"],
                "parameter": list(UNITS),
                "unit": ("parameter", list(UNITS.values())),
                "gain": list(GAINS),
                "drive": [drive.name for drive in drives(self.axis, self.values)],
            },
        )

    def boxes(self) -> dict[str, tuple[Parameter, ...]]:
        """Uncertain parameters of each set."""
        nine, three = (uncertain_parameters(self.axis, small) for small in MODELS.values())
        return {"nine": nine, "without gain": nine[1:], "reduced": three}

    def plants(self, deltas: Real, box: Sequence[Parameter], frequency: Real) -> Complex:
        """Responses at deltas (N, P) by the actuator's equations, which know no LFT: (N, F)."""
        table = {name: entry.nominal for name, entry in nominal_table(self.axis).items()}
        gains, actuators = [], []
        for row in deltas:
            values = table | {p.name: float(p.at(d)) for p, d in zip(box, row, strict=True)}
            gains.append(values.pop("K_total"))
            actuators.append(specific_model(ActuatorParameters(**values)))
        return np.array(gains)[:, None] * stack(actuators).response(frequency)

    def _drive_deltas(self) -> Real:
        """Deltas of the drives (12, 9), their gains in proportion to K_optn."""
        twelve = drives(self.axis, self.values)
        gain = np.array([drive.K_optn for drive in twelve])
        table = nominal_table(self.axis)
        own = {"K_total": gain / ((gain.min() + gain.max()) / 2) * table["K_total"].nominal}
        own |= {n: np.array([getattr(d, n) for d in twelve]) for n in table if n not in own}
        return np.stack([(own[n] / p.nominal - 1) / p.tolerance for n, p in table.items()], axis=1)

    def checks(self, answer: xr.Dataset, tolerance: float) -> list[Check]:
        hertz = answer["frequency"].values
        found = answer["deviation"].values
        models = {name: parametric_plant(self.axis, small) for name, small in MODELS.items()}
        off = max(self._disagreement(model, hertz[::20]) for model in models.values())
        copies = answer["copies"].sel(stage="after reduction")
        wanted = [[COPIES[n] * (n in m.repetitions) for n in UNITS] for m in models.values()]
        claimed, claim = worst(self._claims(answer), lambda p: f"at {hertz[p[1]]:.6g} Hz")
        missed, miss = worst(
            self._missed(found[:, ::20], hertz[::20]), lambda p: f"at {hertz[20 * p[1]]:.6g} Hz"
        )
        return [
            Check("pulled out", "relative distance from the actuator's equations", off, AGREE),
            Check(
                "repetitions",
                "how many differ from one each, two of Bl",
                float(abs(copies.values - wanted).sum()),
                0.0,
            ),
            Check(
                "well posed",
                "least det(I - M11 Delta) of the vertices, its sign changed",
                -min(map(_least_determinant, models.values())),
                -AGREE,
            ),
            Check("largest deviations", "distance from the plants named", claimed, AGREE, claim),
            Check("vertices", "deviation of a vertex beyond the largest", missed, AGREE, miss),
        ]

    def _disagreement(self, model: ParametricModel, hertz: Real) -> float:
        deltas = samples(model.parameters, 20, np.random.default_rng(1))
        found = model.response(2 * np.pi * hertz, deltas)[..., 0, 0]
        return float(abs(found / self.plants(deltas, model.parameters, hertz) - 1).max())

    def _claims(self, answer: xr.Dataset) -> Real:
        """Distance of each largest deviation from that of the plant said to have it (3, F)."""
        hertz, nominal = answer["frequency"].values, answer["nominal"].values
        result = np.array(answer["deviation"].values)
        for i, (name, box) in enumerate(self.boxes().items()):
            rows = answer["delta"].sel(set=name, parameter=[p.name for p in box]).values
            which, back = np.unique(rows, axis=0, return_inverse=True)
            plants = self.plants(which, box, hertz)[back.ravel(), np.arange(len(hertz))]
            result[i] -= abs(plants / nominal - 1)
        return abs(result)

    def _missed(self, found: Real, hertz: Real) -> Real:
        """By how much a vertex deviates more than what was found the largest (3, F)."""
        nominal = nominal_response(self.axis, hertz, antialiasing=False)
        plants = [self.plants(vertices(box), box, hertz) for box in self.boxes().values()]
        return np.array([abs(each / nominal - 1).max(axis=0) for each in plants]) - found

    def metrics(self, answer: xr.Dataset) -> dict[str, float]:
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
        excess = answer["interior"].values / over["reduced"] - 1
        after = answer["copies"].sel(stage="after reduction").sum("parameter")
        return numbers | {
            "drives_largest_delta": float(abs(answer["drive_delta"]).max()),
            "interior_excess": float(excess.max()),
            "interior_excess_hz": float(hertz[excess.argmax()]),
            "drawn_share": float((answer["drawn"].values / over["nine"]).max()),
            "channels": float(after.sel(model="nine")),
            "channels_reduced": float(after.sel(model="reduced")),
        }

    def tables(self, answer: xr.Dataset) -> dict[str, str]:
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

    def figures(self, answer: xr.Dataset) -> dict[str, Figure]:
        return {"deviation": deviation_figure(answer), "bode": bode_figure(answer)}


def _levels(models: dict[str, ParametricModel], omega: Real) -> list[Complex]:
    """All plants of minimum, nominal and maximum, a set each; K_total is the first of the nine."""
    three = np.array([-1.0, 0.0, 1.0])
    nine, reduced = (factorial_response(model, omega, three) for model in models.values())
    return [nine, nine[1], reduced]


def _extremes(plants: Complex, center: Complex) -> tuple[Real, Any, Real, Real]:
    """Largest relative deviation, whose it is, least and largest magnitude (F,) of plants."""
    each = plants.reshape(-1, len(center))
    away, size = abs(each / center - 1), abs(each)
    return away.max(axis=0), away.argmax(axis=0), size.min(axis=0), size.max(axis=0)


def _placed(values: Any, box: Sequence[Parameter]) -> Real:
    """Values (..., P) of a set's parameters among all nine (..., 9), zero for the certain ones."""
    array = np.asarray(values, dtype=float)
    result = np.zeros((*array.shape[:-1], len(UNITS)))
    result[..., [list(UNITS).index(p.name) for p in box]] = array
    return result


def _least_determinant(model: ParametricModel) -> float:
    r = model.structure.rows
    counts = [block.rows for block in model.structure]
    delta = np.repeat(vertices(model.parameters), counts, axis=-1)
    loops = np.eye(r) - model.system.D[:r, :r] * delta[:, None, :]
    return float(np.linalg.det(loops).min())


def _median(values: Real) -> float:
    return float(np.median(values)) if values.size else float("nan")


def _one(name: str) -> dict[str, str]:
    return {"units": "1", "long_name": name}
