"""The uncertainty models of an axis side by side, and what each costs (figure 5.16).

Figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar, get_args

import numpy as np

from workbench import Check, Run, Study, figures, problem, ref
from workbench.executor import Context
from workbench.fitting.rational import Rational
from workbench.heavy_types import Dataset, Figure
from workbench.program import worst
from workbench.uncertainty.covers.sets import (
    circles_about_nominal,
    deviations,
    stadiums_about_nominal,
)
from workbench.uncertainty.covers.storage import rational

from ..drive.plants import Gain, nominal_response
from ..drive.shared_parameters import TABLES, WINDOWS, Frequencies
from ..drive.tables import Axis
from .measured_drives import measured_drives

GAINS: tuple[Gain, ...] = get_args(Gain)
METHODS = ("steps", "joint")
COVERS = ("circle", "stadium")
HIGH = 100.0
"""Frequency [Hz] above which the gain spread is most of the uncertainty."""
NARROWER = 2.0
"""How many times narrower than the circle the stadium is at least, where the circle is largest."""
REMOVED = 0.5
"""Share of the uncertainty above HIGH that the automatic gain control must remove at least."""


def needs(axis: str, frequencies: int = 400, **_: Any) -> dict[str, Any]:
    """Both covers by both methods, and the parametric spread, on one grid."""
    covers = {
        f"{shape}_{method}": ref(f"cd/{axis}/{shape}-cover", method=method, frequencies=frequencies)
        for shape in COVERS
        for method in METHODS
    }
    return covers | {"parametric": ref(f"cd/{axis}/parametric", frequencies=frequencies)}


@problem("cd/{axis}/uncertainty-comparison", axis=("focus", "radial"), needs=needs, data=TABLES)
def comparison(  # type: ignore[no-untyped-def]
    axis: Axis,
    circle_steps,
    circle_joint,
    stadium_steps,
    stadium_joint,
    parametric,
    frequencies: Frequencies = 400,
) -> Comparison:
    """Parametric, complex and mixed uncertainty side by side (figure 5.16, section 5.6).

    Sizes of the sets and of the weights fitted to them, by the steps of the thesis and with the
    nominal chosen for small sets; the three gain variants about the nominal of Table 5.2.

    frequencies: how many, logarithmically spaced from 5 Hz to 5 kHz.
    """
    runs = {
        ("circle", "steps"): circle_steps,
        ("circle", "joint"): circle_joint,
        ("stadium", "steps"): stadium_steps,
        ("stadium", "joint"): stadium_joint,
    }
    return Comparison(axis, runs, parametric)


@dataclass(frozen=True, eq=False)
class Comparison(Study):
    """Sizes of every uncertainty model over the frequencies of the covers."""

    axis: Axis
    runs: dict[tuple[str, str], Run]
    parametric: Run

    headline: ClassVar[str] = "radius_over_width_at_peak"

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        data = {key: run.data for key, run in self.runs.items()}
        frequency = data["circle", "steps"]["frequency"].values
        omega = 2 * np.pi * frequency
        sizes = np.zeros((len(METHODS), 5, frequency.size))
        for k, method in enumerate(METHODS):
            circle, stadium = data["circle", method], data["stadium", method]
            nominal, W_r = rational(stadium, "nominal"), rational(stadium, "W_r")
            assert nominal is not None and W_r is not None
            about = _about(self.axis, frequency, "own", nominal.response(omega))
            widths = _weight(circle, omega), _weight(stadium, omega)
            sizes[k] = [about[0], about[1], *widths, np.abs(W_r.response(omega))]
        printed = nominal_response(self.axis, frequency, antialiasing=False)
        variants = [_about(self.axis, frequency, gain, printed) for gain in GAINS]
        spread = self.parametric.data["deviation"]
        radii = [data["circle", method]["second_radius"].values for method in METHODS]
        unit = {"units": "1"}
        return xr.Dataset(
            {
                "radius": (("by", "frequency"), radii, unit),
                "size": (("by", "quantity", "frequency"), sizes, unit),
                "variant": (("gain", "shape", "frequency"), np.array(variants), unit),
                "parametric": (("set", "frequency"), spread.values, unit),
            },
            coords={
                "by": list(METHODS),
                "quantity": ["radius about", "width about", "W_c circle", "W_c stadium", "W_r"],
                "gain": list(GAINS),
                "shape": list(COVERS),
                "set": spread["set"].values,
                "frequency": ("frequency", frequency, {"units": "Hz", "long_name": "frequency"}),
            },
        )

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        frequency = answer["frequency"].values
        variant, size = answer["variant"], answer["size"]
        pairs = (
            variant.sel(shape="stadium") / variant.sel(shape="circle"),
            size.sel(quantity="width about") / size.sel(quantity="radius about"),
        )
        (ratio, place), (joint, where) = (
            worst(pair.values, lambda i: f"at {frequency[i[1]]:.4g} Hz") for pair in pairs
        )
        low, high = WINDOWS[self.axis]["first resonance"]
        peak = self._peak(answer)
        numbers = self.metrics(answer)
        return [
            Check("never wider", "half-width over radius, same centre", ratio, 1 + 1e-9, place),
            Check("never wider, fitted", "the same about nominals", joint, 1 + 1e-9, where),
            Check("peak above", "lower end of the resonance [Hz]", low, peak),
            Check("peak below", "frequency of the largest radius [Hz]", peak, high),
            Check(
                "narrower",
                "half-width over radius where the radius is largest",
                1 / numbers["radius_over_width_at_peak"],
                1 / NARROWER,
            ),
            Check(
                "gain spread",
                f"median radius above {HIGH:g} Hz with AGC over that without",
                numbers["median_radius_agc"] / numbers["median_radius_own"],
                1 - REMOVED,
            ),
        ]

    def _peak(self, answer: Dataset) -> float:
        """Frequency [Hz] of the largest circle about the nominal of Table 5.2."""
        return float(answer["variant"].sel(gain="own", shape="circle").idxmax("frequency"))

    def metrics(self, answer: Dataset) -> dict[str, float]:
        own = answer["variant"].sel(gain="own").sel(frequency=self._peak(answer))
        numbers = {
            "radius_over_width_at_peak": float(own.sel(shape="circle") / own.sel(shape="stadium")),
            "peak_hz": self._peak(answer),
        }
        high = answer["variant"].sel(frequency=slice(HIGH, None)).median("frequency")
        for gain in GAINS:
            one = answer["variant"].sel(gain=gain)
            numbers[f"radius_peak_{gain}"] = float(one.sel(shape="circle").max())
            numbers[f"width_peak_{gain}"] = float(one.sel(shape="stadium").max())
            for shape, name in (("circle", "radius"), ("stadium", "width")):
                numbers[f"median_{name}_{gain}"] = float(high.sel(gain=gain, shape=shape))
        for method in METHODS:
            one = answer["size"].sel(by=method)
            numbers[f"radius_peak_{method}"] = float(answer["radius"].sel(by=method).max())
            numbers[f"width_peak_{method}"] = float(one.sel(quantity="width about").max())
            for shape in COVERS:
                peak = float(one.sel(quantity=f"W_c {shape}").max())
                numbers[f"{shape}_weight_peak_{method}"] = peak
        return numbers

    def tables(self, answer: Dataset) -> dict[str, str]:
        numbers = self.metrics(answer)
        gains = [
            f"| gain | radius peak | width peak | median radius above {HIGH:g} Hz | median width |",
            "| --- |" + " ---: |" * 4,
        ]
        for gain in GAINS:
            names = ("radius_peak", "width_peak", "median_radius", "median_width")
            cells = (f"{numbers[f'{name}_{gain}']:.4f}" for name in names)
            gains.append(f"| {gain} | {' | '.join(cells)} |")
        methods = [
            "| method | radius peak | circle weight's | width peak | stadium weight's |",
            "| --- |" + " ---: |" * 4,
        ]
        for method in METHODS:
            names = ("radius_peak", "circle_weight_peak", "width_peak", "stadium_weight_peak")
            cells = (f"{numbers[f'{name}_{method}']:.4f}" for name in names)
            methods.append(f"| {method} | {' | '.join(cells)} |")
        return {"gains": "\n".join(gains) + "\n", "methods": "\n".join(methods) + "\n"}

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        return {"sizes": self._sizes(answer), "gains": self._gains(answer)}

    def _sizes(self, answer: Dataset) -> Figure:
        """Figure 5.16 by either method: parametric, complex and mixed uncertainty."""
        figure, panels = figures.axes(2, 1, size=(7.5, 7.5), sharex=True)
        frequency = answer["frequency"]
        for panel, method in zip(panels, METHODS, strict=True):
            one = answer["size"].sel(by=method)
            panel.loglog(
                frequency,
                answer["parametric"].sel(set="reduced"),
                "--",
                color=figures.GREEN,
                label="parametric (Table 5.3)",
            )
            for raw, fit, colour, label in (
                (answer["radius"].sel(by=method), "W_c circle", figures.ORANGE, "complex"),
                (one.sel(quantity="width about"), "W_c stadium", figures.BLUE, "mixed, width"),
            ):
                panel.loglog(frequency, raw, ":", color=colour, label=f"{label}: sets")
                panel.loglog(
                    frequency, one.sel(quantity=fit), color=colour, label=f"{label}: weight"
                )
            panel.set_title(f"{self.axis}, method {method}")
            panel.set_ylabel("relative size")
        panels[-1].set_xlabel("frequency [Hz]")
        figures.legend_below(figure, panels[0], columns=3)
        return figure

    def _gains(self, answer: Dataset) -> Figure:
        """The three gain variants about the nominal of Table 5.2."""
        figure, panels = figures.axes(1, 2, size=(9.5, 4.4), sharex=True, sharey=True)
        for panel, shape, name in zip(panels, COVERS, ("radius", "half-width"), strict=True):
            for gain in GAINS:
                one = answer["variant"].sel(gain=gain, shape=shape)
                panel.loglog(answer["frequency"], one, label=f"{gain} gain")
            panel.set_title(f"{shape}s: {name}")
            panel.set_xlabel("frequency [Hz]")
        panels[0].set_ylabel("relative size")
        figures.legend_below(figure, panels[0])
        return figure


def _about(axis: Axis, frequency: np.ndarray, gain: Gain, nominal: np.ndarray) -> list[np.ndarray]:
    """Radius of circles and half-width of stadiums about a nominal response."""
    measured = measured_drives(axis, frequency.size, frequency[0], frequency[-1], gain)
    away = deviations(measured.points, nominal, "multiplicative", measured)
    return [circles_about_nominal(away).radius, stadiums_about_nominal(away).radius]


def _weight(data: Dataset, omega: np.ndarray) -> np.ndarray:
    W_c = rational(data, "W_c")
    assert isinstance(W_c, Rational)
    return np.abs(W_c.response(omega))
