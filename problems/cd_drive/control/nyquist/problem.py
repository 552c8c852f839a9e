"""Uncertainty sets on the open loop: which of them contain the point -1 (section 6.3.5).

A circle times a complex number is a circle, and a stadium is a stadium turned by the number's
argument. Figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any, ClassVar

import numpy as np

from workbench import Check, Run, problem, ref
from workbench.certificate import worst_value
from workbench.geometry import (
    NarrowestStadium,
    Stadium,
    multiplied_sets,
    narrowest_stadium,
    sets_around_nominal,
    signed_distance,
    signed_distance_bounds,
)
from workbench.study import Study, array, arrays, check, dim, figure, metric, part, table
from workbench.types import ComplexArray, DataArray, Dataset, Figure, RealArray
from workbench.uncertainty import cover_function, cover_sets

from ...drive.plants import ANTIALIASING, Gain, controller, nominal_response
from ...drive.shared_parameters import TABLES, WINDOWS, Frequencies
from ...drive.tables import Axis
from ...uncertainty.covered import covered_responses
from ...uncertainty.uncertainty_comparison import COVER_METHODS
from .figures import clearances, planes

SHAPES = ("stadium", "circle")
STEPS = ("second", "third", "fitted")
SAME = "Table 5.2"
"""Sets by which circles and stadiums are compared: both about the nominal plant of the thesis."""
KINDS = ("first", *(f"{method} {step}" for method, step in product(COVER_METHODS, STEPS)), SAME)
"""Sets with free centres; sets of the covers; and unfitted sets about the nominal of Table 5.2."""
HIGH = (200.0, 2000.0)
"""Frequencies [Hz] of the lower graphs of figure 6.8."""
CRITICAL = -1.0 + 0.0j
"""The critical point of the Nyquist criterion."""
CONTAINMENT_SLACK = 1e-9
"""Largest distance of a drive's point outside its set, relative to the radius."""
BOUND_GAP = 1e-4
"""Largest accepted gap between the bounds of a distance, over the distance of the set's far end."""
PARTS = ("center", "radius", "half_length", "angle")
"""Fields of a stadium, stored as arrays."""


def both_covers(axis: str, frequencies: int = 400, gain: Gain = "own", **_: Any) -> dict[str, Any]:
    """References to covers by stadiums and circles, by both methods, on one grid."""
    return {
        f"{shape}_{method}": ref(
            f"cd/{axis}/{shape}-cover", method=method, frequencies=frequencies, gain=gain
        )
        for shape in SHAPES
        for method in COVER_METHODS
    }


@problem("cd/{axis}/nyquist", axis=("focus", "radial"), needs=both_covers, data=TABLES)
def nyquist(  # type: ignore[no-untyped-def]
    axis: Axis,
    stadium_steps,
    stadium_joint,
    circle_steps,
    circle_joint,
    frequencies: Frequencies = 400,
    gain: Gain = "own",
) -> Nyquist:
    """Nyquist plots of the open loop with stadiums and with circles (figure 6.8).

    First sets, sets of the covers, and sets about the nominal of Table 5.2 are multiplied by
    controller and anti-aliasing filter. Their distances from -1 are found around the first
    resonance and from 200 to 2000 Hz. The results hold at the given frequencies only: the narrowest
    stadium turns quickly near a resonance, and a coarse grid can miss the moment at which it sweeps
    over -1.

    frequencies: number of frequencies, logarithmically spaced from 5 Hz to 5 kHz. gain: as in
    cd/<axis>/circles.
    """
    runs = {
        ("stadium", "steps"): stadium_steps,
        ("stadium", "joint"): stadium_joint,
        ("circle", "steps"): circle_steps,
        ("circle", "joint"): circle_joint,
    }
    return Nyquist(axis, runs)


@dataclass(frozen=True, eq=False)
class Nyquist(Study):
    """Sets of the open loop over the frequencies of the covers."""

    axis: Axis
    runs: dict[tuple[str, str], Run]

    headline: ClassVar[str] = "contains_stadium"

    @property
    def quantifier(self) -> str:
        return "at the frequencies of the covers, for these 12 drives"

    kind, shape, drive = dim(KINDS), dim(SHAPES), dim(lambda measured: measured["plant"].values)
    frequency = dim(lambda measured: measured["frequency"].values, unit="Hz", meaning="frequency")

    measured = part(lambda self: covered_responses(self.runs["circle", "steps"]))
    factor = part(lambda self, frequency: known_factor(self.axis, frequency.values))

    @part
    def sets(self, factor: ComplexArray) -> list[list[Stadium]]:
        """Sets of the open loop by kind and shape."""
        return [
            [multiplied_sets(factor, self._sets(kind, form)) for form in SHAPES] for kind in KINDS
        ]

    along = (kind, shape, frequency)
    geometry = arrays(
        along,
        lambda sets: {
            name: [[getattr(one, name) for one in row] for row in sets] for name in PARTS
        },
        **dict.fromkeys(PARTS, "1") | {"angle": "rad"},
    )
    distance = array(dims=along, unit="1", meaning="distance of -1 from the set, negative inside")(
        lambda sets: [[signed_distance(CRITICAL, one) for one in row] for row in sets]
    )
    L = array(dims=(drive, frequency), unit="1", meaning="open loop")(
        lambda measured, factor: (measured.values * factor[:, None]).T
    )

    def _sets(self, kind: str, form: str) -> Stadium:
        """Sets of plants u [V] -> f_en [units] without the anti-aliasing filter."""
        method, _, step = kind.partition(" ")
        if kind == "first":
            return cover_sets(self.runs[form, "steps"].data, "first")
        if method in COVER_METHODS:
            data = self.runs[form, method].data
            if step == "fitted":
                return cover_sets(data, "fitted")
            model = cover_function(data, "nominal")
            assert model is not None
            nominal = model.response(2 * np.pi * data["frequency"].values)
            return sets_around_nominal(nominal, cover_sets(data, step))
        drives = covered_responses(self.runs[form, "steps"])
        nominal = nominal_response(self.axis, drives["frequency"].values, antialiasing=False)
        away = drives.values / nominal[:, None] - 1
        return sets_around_nominal(nominal, _around_zero(away, form))

    @check()
    def geometry_holds(self, answer: Dataset) -> list[Check]:
        """Drives are in their sets, and distances are between bounds from both sides."""
        names, frequency = [*product(KINDS, SHAPES)], answer["frequency"].values
        drives = NarrowestStadium(answer["L"].values.T)
        outside, beyond, gap = [], [], []
        for kind, form in names:
            one = answer.sel(kind=kind, shape=form)
            stadium = stored(one)
            outside.append(drives.excess(stadium))
            low, high = signed_distance_bounds(CRITICAL, stadium)
            size = abs(stadium.center - CRITICAL) + stadium.half_length
            distance = one["distance"].values
            beyond.append(np.maximum(low - distance, distance - high) / size)
            gap.append((high - low) / size)

        def place(index: tuple[int, ...]) -> str:
            kind, form = names[index[0]]
            return f"{kind} {form} at {frequency[index[-1]]:.4g} Hz"

        found = []
        for title, statement, values, limit in (
            (
                "drives inside",
                "largest distance of a drive's L beyond its set [1]",
                outside,
                CONTAINMENT_SLACK,
            ),
            ("distances", "distance of -1 beyond its bounds, relative", beyond, 1e-12),
            ("bounds", "distance of the two bounds from each other, relative", gap, BOUND_GAP),
        ):
            largest, where = worst_value(np.array(values), place)
            found.append(Check(title, statement, largest, limit, where=where))
        return found

    @check()
    def claims(self, answer: Dataset) -> list[Check] | None:
        """Statements of section 6.3.5 on sets around one nominal; if one fails, what holds
        instead.
        """
        if self.axis != "focus":
            return None
        numbers = self.metrics(answer)
        circles, stadiums = numbers["contains_circle"], numbers["contains_stadium"]
        smallest = "smallest distance of -1 from a circle about 30 Hz [1], negative if inside"
        fewer = "number of frequencies at which a stadium contains -1 (0 in the thesis)"
        further = "smallest distance of -1 from a circle over that from a stadium, 200 to 2000 Hz"
        ratio = numbers["distance_circle_high"] / numbers["distance_stadium_high"]
        return [
            Check("circles contain -1", smallest, numbers["distance_circle_low"], 0.0),
            Check("stadiums contain -1 at fewer frequencies", fewer, stadiums, circles - 1),
            Check("stadiums further from -1", further, ratio, 1.0),
        ]

    @metric
    def of_kinds(self, distance: DataArray) -> dict[str, float]:
        """Smallest distance of -1 in each band, and the number of frequencies at which a set
        contains -1.
        """
        numbers = {}
        for kind, form in product(KINDS, SHAPES):
            one = distance.sel(kind=kind, shape=form)
            after = "" if kind == SAME else "_" + kind.replace(" ", "_")
            for band, ends in self._bands.items():
                numbers[f"distance_{form}_{band}{after}"] = _least(one, ends)
            numbers[f"contains_{form}{after}"] = int((one <= 0).sum())
        return numbers

    @property
    def _bands(self) -> dict[str, tuple[float, float]]:
        return {"low": WINDOWS[self.axis]["first resonance"], "high": HIGH}

    @table
    def distances(self, distance: DataArray) -> tuple[list[str], list[list[str]]]:
        bands = self._bands.values()
        heads = ["sets", "shape", "contain -1 at", "between [Hz]"]
        rows = []
        for kind, form in product(KINDS, SHAPES):
            one = distance.sel(kind=kind, shape=form)
            at = one["frequency"].values[one.values <= 0]
            where = f"{at[0]:.1f} and {at[-1]:.1f}" if at.size else "-"
            least = [_least(one, ends) for ends in bands]
            cells = ["-" if np.isnan(value) else f"{value:.4g}" for value in least]
            rows.append([kind, form, str(at.size), where, *cells])
        return [*heads, *(f"distance {low:g} to {high:g} Hz" for low, high in bands)], rows

    @figure
    def drawn(self, answer: Dataset) -> dict[str, Figure]:
        drawn = {"figure-6-8": SAME, "steps": "steps second", "joint": "joint second"}
        found = {name: planes(answer.sel(kind=kind), HIGH) for name, kind in drawn.items()}
        return found | {"clearance": clearances(answer, list(KINDS))}


def _least(distance: DataArray, ends: tuple[float, float]) -> float:
    """Smallest distance in a band of frequencies [Hz]; NaN if none was computed."""
    part = distance.sel(frequency=slice(*ends))
    return float(part.min()) if part.size else float("nan")


def known_factor(axis: Axis, frequency: RealArray) -> ComplexArray:
    """K AAF at `frequency` [Hz] (F,): (F,), the factor on the sets of plants."""
    s = 2j * np.pi * frequency
    K: ComplexArray = controller(axis)(s)
    return K * ANTIALIASING / (s + ANTIALIASING)


def stored(answer: Dataset) -> Stadium:
    """Sets of one kind and shape."""
    return Stadium(*(answer[name].values for name in PARTS))


def _around_zero(points: ComplexArray, form: str) -> Stadium:
    """The smallest circle, or the narrowest stadium, centred at 0 around each set of points."""
    if form == "stadium":
        return narrowest_stadium(points, center=0.0)
    zero = np.zeros(len(points))
    return Stadium(zero.astype(complex), np.abs(points).max(axis=1), zero, zero)
