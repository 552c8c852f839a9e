"""Uncertainty sets on the open loop: which of them contain the point -1 (section 6.3.5).

A circle times a complex number is a circle, a stadium a stadium, turned by its argument. Figure and
section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any, ClassVar

import numpy as np

from workbench import Check, Run, Study, problem, ref
from workbench.arrays import ComplexArray, RealArray
from workbench.executor import Context
from workbench.geometry import (
    NarrowestStadium,
    Stadium,
    around_nominal,
    multiplied,
    signed_distance,
    signed_distance_bounds,
)
from workbench.heavy_types import Dataset, Figure
from workbench.program import worst
from workbench.uncertainty.covers.sets import circles_about_nominal, stadiums_about_nominal
from workbench.uncertainty.covers.storage import rational, shape

from ...drive.plants import ANTIALIASING, Gain, controller, nominal_response
from ...drive.shared_parameters import TABLES, WINDOWS, Frequencies
from ...drive.tables import Axis
from .figures import clearances, planes

SHAPES = ("stadium", "circle")
METHODS = ("steps", "joint")
STEPS = ("second", "third", "fitted")
SAME = "Table 5.2"
"""Sets that circles and stadiums are compared by: both about one nominal, that of the thesis."""
KINDS = ("first", *(f"{method} {step}" for method, step in product(METHODS, STEPS)), SAME)
"""Sets: free of a nominal; of the covers; about the nominal of Table 5.2, not fitted."""
HIGH = (200.0, 2000.0)
"""Frequencies [Hz] of the lower graphs of figure 6.8."""
CRITICAL = -1.0 + 0.0j
INSIDE = 1e-9
"""Excess of a point beyond its set, relative to the radius, that counts as rounding."""
TIGHT = 1e-4
"""How far bounds of a distance from either side may be apart, relative to centre and length."""


def both_covers(axis: str, frequencies: int = 400, gain: Gain = "own", **_: Any) -> dict[str, Any]:
    """Covers by stadiums and circles, by both methods, on one grid."""
    return {
        f"{shape}_{method}": ref(
            f"cd/{axis}/{shape}-cover", method=method, frequencies=frequencies, gain=gain
        )
        for shape in SHAPES
        for method in METHODS
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

    First sets, sets of the covers, and sets about the nominal of Table 5.2, times controller and
    anti-aliasing filter; how far -1 is from them around the first resonance and from 200 to 2000
    Hz. That is said of the frequencies given, nothing of those between: the narrowest stadium turns
    quickly near a resonance, and a coarse grid misses where it sweeps over -1.

    frequencies: how many, logarithmically spaced from 5 Hz to 5 kHz. gain: as in cd/<axis>/circles.
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

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        data = self.runs["circle", "steps"].data
        frequency, response = data["frequency"].values, data["response"].values
        known = known_factor(self.axis, frequency)
        sets = {
            (kind, form): multiplied(known, self._sets(kind, form))
            for kind in KINDS
            for form in SHAPES
        }
        parts = {
            name: np.array([[getattr(sets[kind, form], name) for form in SHAPES] for kind in KINDS])
            for name in ("center", "radius", "half_length", "angle")
        }
        distance = np.array(
            [[signed_distance(CRITICAL, sets[kind, form]) for form in SHAPES] for kind in KINDS]
        )
        dims = ("kind", "shape", "frequency")
        return xr.Dataset(
            {
                **{
                    name: (dims, value, {"units": "rad" if name == "angle" else "1"})
                    for name, value in parts.items()
                },
                "distance": (
                    dims,
                    distance,
                    {"units": "1", "long_name": "distance of -1 from the set, negative inside"},
                ),
                "L": (
                    ("drive", "frequency"),
                    (response * known[:, None]).T,
                    {"units": "1", "long_name": "open loop"},
                ),
            },
            coords={
                "kind": list(KINDS),
                "shape": list(SHAPES),
                "frequency": ("frequency", frequency, {"units": "Hz", "long_name": "frequency"}),
                "drive": data["response"]["plant"].values,
            },
        )

    def _sets(self, kind: str, form: str) -> Stadium:
        """Sets of plants u [V] -> f_en [units] without the anti-aliasing filter."""
        method, _, step = kind.partition(" ")
        if kind == "first":
            return shape(self.runs[form, "steps"].data, "first")
        if method in METHODS:
            data = self.runs[form, method].data
            if step == "fitted":
                return shape(data, "fitted")
            model = rational(data, "nominal")
            assert model is not None
            nominal = model.response(2 * np.pi * data["frequency"].values)
            return around_nominal(nominal, shape(data, step))
        data = self.runs[form, "steps"].data
        nominal = nominal_response(self.axis, data["frequency"].values, antialiasing=False)
        away = data["response"].values / nominal[:, None] - 1
        of = circles_about_nominal if form == "circle" else stadiums_about_nominal
        return around_nominal(nominal, of(away))

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        names, frequency = [*product(KINDS, SHAPES)], answer["frequency"].values
        drives = NarrowestStadium(answer["L"].values.T)
        inside, bounds = [], []
        for kind, form in names:
            one = answer.sel(kind=kind, shape=form)
            stadium = stored(one)
            inside.append(drives.excess(stadium))
            low, high = signed_distance_bounds(CRITICAL, stadium)
            size = abs(stadium.center - CRITICAL) + stadium.half_length
            beyond = np.maximum(low - one["distance"].values, one["distance"].values - high)
            bounds.append([beyond / size, (high - low) / size])

        def place(index: tuple[int, ...]) -> str:
            kind, form = names[index[0]]
            return f"{kind} {form} at {frequency[index[-1]]:.4g} Hz"

        excess, where = worst(np.array(inside), place)
        beyond, there = worst(np.array(bounds)[:, 0], place)
        apart, somewhere = worst(np.array(bounds)[:, 1], place)
        found = [
            Check(
                "drives inside", "distance of L of a drive beyond its set", excess, INSIDE, where
            ),
            Check("distances", "distance of -1 beyond its bounds, relative", beyond, 1e-12, there),
            Check("bounds", "how far these are apart, relative", apart, TIGHT, somewhere),
        ]
        return found + (self._claims(answer) if self.axis == "focus" else [])

    def _claims(self, answer: Dataset) -> list[Check]:
        """What section 6.3.5 says, of sets about one nominal; what holds where that does not."""
        numbers = self.metrics(answer)
        return [
            Check(
                "circles contain -1",
                "smallest distance of -1 from the circles about 30 Hz",
                numbers["distance_circle_low"],
                0.0,
            ),
            Check(
                "stadiums contain -1 at fewer frequencies",
                "how many, which the thesis says are none, below that of the circles",
                numbers["contains_stadium"],
                numbers["contains_circle"] - 1,
            ),
            Check(
                "stadiums further from -1",
                "their smallest distance from 200 to 2000 Hz as a divisor of the circles'",
                numbers["distance_circle_high"] / numbers["distance_stadium_high"],
                1.0,
            ),
        ]

    def metrics(self, answer: Dataset) -> dict[str, float]:
        numbers = {}
        for kind, form in product(KINDS, SHAPES):
            one = answer["distance"].sel(kind=kind, shape=form)
            after = "" if kind == SAME else "_" + kind.replace(" ", "_")
            for band, (low, high) in self._bands.items():
                part = one.sel(frequency=slice(low, high))
                nearest = float(part.min()) if part.size else float("nan")
                numbers[f"distance_{form}_{band}{after}"] = nearest
            numbers[f"contains_{form}{after}"] = int((one <= 0).sum())
        return numbers

    @property
    def _bands(self) -> dict[str, tuple[float, float]]:
        return {"low": WINDOWS[self.axis]["first resonance"], "high": HIGH}

    def tables(self, answer: Dataset) -> dict[str, str]:
        (a, b), (c, d) = self._bands.values()
        lines = [
            "| sets | shape | contain -1 at | between [Hz] "
            f"| distance {a:g} to {b:g} Hz | distance {c:g} to {d:g} Hz |",
            "| --- | --- |" + " ---: |" * 4,
        ]
        for kind, form in product(KINDS, SHAPES):
            one = answer["distance"].sel(kind=kind, shape=form)
            at = one["frequency"].values[one.values <= 0]
            where = f"{at[0]:.1f} and {at[-1]:.1f}" if at.size else "-"
            low, high = (one.sel(frequency=slice(*band)) for band in self._bands.values())
            cells = [f"{float(part.min()):.4g}" if part.size else "-" for part in (low, high)]
            lines.append(f"| {kind} | {form} | {at.size} | {where} | {' | '.join(cells)} |")
        return {"distances": "\n".join(lines) + "\n"}

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        drawn = {"figure-6-8": SAME, "steps": "steps second", "joint": "joint second"}
        found = {name: planes(answer.sel(kind=kind), HIGH) for name, kind in drawn.items()}
        return found | {"clearance": clearances(answer, list(KINDS))}


def known_factor(axis: Axis, frequency: RealArray) -> ComplexArray:
    """K AAF at `frequency` [Hz] (F,): (F,), what the sets of plants are multiplied by."""
    s = 2j * np.pi * frequency
    K: ComplexArray = controller(axis)(s)
    return K * ANTIALIASING / (s + ANTIALIASING)


def stored(answer: Dataset) -> Stadium:
    """Sets of one kind and shape."""
    names = ("center", "radius", "half_length", "angle")
    return Stadium(*(answer[name].values for name in names))
