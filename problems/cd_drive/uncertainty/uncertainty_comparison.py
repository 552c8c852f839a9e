"""The uncertainty models of an axis side by side, and what each costs (figure 5.16).

Figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product
from typing import Any, ClassVar

import numpy as np

from workbench import Check, Run, figures, problem, ref
from workbench.certificate import worst_value
from workbench.geometry import narrowest_stadium
from workbench.study import Study, array, check, dim, figure, metric, table
from workbench.types import ComplexArray, DataArray, Dataset, Figure, RealArray

from ..drive.plants import GAIN_VARIANTS, Gain, nominal_response
from ..drive.shared_parameters import TABLES, WINDOWS, Frequencies
from ..drive.tables import Axis
from .measured_drives import measured_drives

COVER_METHODS = ("steps", "joint")
COVER_SHAPES = ("circle", "stadium")
HIGH_FREQUENCY = 100.0
"""Frequency [Hz] above which the spread of the gain dominates the uncertainty."""
LEAST_RATIO = 2.0
"""Least ratio of the circle's radius to the stadium's half-width, where the circle is largest."""
LEAST_REMOVED = 0.5
"""Least share of the uncertainty above HIGH_FREQUENCY that the automatic gain control removes."""


def needs(axis: str, frequencies: int = 400, gain: Gain = "own", **_: Any) -> dict[str, Any]:
    """References to the runs of both covers by both methods, and of the parametric spread, on one
    grid.
    """
    choice: Any = {"frequencies": frequencies, "gain": gain}
    covers = {
        f"{shape}_{method}": ref(f"cd/{axis}/{shape}-cover", method=method, **choice)
        for shape, method in product(COVER_SHAPES, COVER_METHODS)
    }
    return covers | {"parametric": ref(f"cd/{axis}/parametric", frequencies=frequencies)}


@problem(
    "cd/{axis}/uncertainty-comparison",
    axis=("focus", "radial"),
    needs=needs,
    data=TABLES,
    added=("gain",),
)
def comparison(  # type: ignore[no-untyped-def]
    axis: Axis,
    circle_steps,
    circle_joint,
    stadium_steps,
    stadium_joint,
    parametric,
    frequencies: Frequencies = 400,
    gain: Gain = "own",
) -> UncertaintyComparison:
    """Parametric, complex and mixed uncertainty side by side (figure 5.16, section 5.6).

    Shown are the sizes of the sets and of the weights fitted to them, by the steps of the thesis
    and with a nominal chosen for small sets; and the three gain variants about the nominal of Table
    5.2.

    frequencies: number of frequencies, logarithmically spaced from 5 Hz to 5 kHz. gain: of the
    twelve drives, but for the three variants.
    """
    covers = (circle_steps, circle_joint, stadium_steps, stadium_joint)
    runs = dict(zip(product(COVER_SHAPES, COVER_METHODS), covers, strict=True))
    return UncertaintyComparison(axis, runs, parametric, gain)


@dataclass(frozen=True, eq=False)
class UncertaintyComparison(Study):
    """Sizes of every uncertainty model over the frequencies of the covers."""

    axis: Axis
    runs: dict[tuple[str, str], Run]
    spread: Run
    gain_of_drives: Gain

    headline: ClassVar[str] = "radius_over_width_at_peak"

    @property
    def quantifier(self) -> str:
        return "at the frequencies of the covers, for these 12 drives"

    by, gain, shape = dim(COVER_METHODS), dim(GAIN_VARIANTS), dim(COVER_SHAPES)
    quantity = dim("radius about", "width about", "W_c circle", "W_c stadium", "W_r")
    set = dim(lambda self: self.spread.answer["set"].values)

    @dim(unit="Hz", meaning="frequency")
    def frequency(self) -> RealArray:
        return np.asarray(self.runs["circle", "steps"].data["frequency"])

    @array(dims=(by, frequency), unit="1")
    def radius(self) -> list[RealArray]:
        return [self.runs["circle", method].answer.second.radius for method in COVER_METHODS]

    @array(dims=(by, quantity, frequency), unit="1")
    def size(self, frequency: DataArray) -> list[Any]:
        hertz, rows = frequency.values, []
        for method in COVER_METHODS:
            circle, stadium = (self.runs[shape, method].answer.model for shape in COVER_SHAPES)
            responses = [
                one.response(2 * np.pi * hertz)
                for one in (stadium.nominal, circle.W_c, stadium.W_c, stadium.W_r)
            ]
            about = _about(self.axis, hertz, self.gain_of_drives, responses[0])
            rows.append([*about, *map(np.abs, responses[1:])])
        return rows

    @array(dims=(gain, shape, frequency), unit="1")
    def variant(self, frequency: DataArray) -> list[Any]:
        printed = nominal_response(self.axis, frequency.values, antialiasing=False)
        return [_about(self.axis, frequency.values, gain, printed) for gain in GAIN_VARIANTS]

    parametric = array(
        dims=(set, frequency), unit="1", value=lambda self: self.spread.answer["deviation"].values
    )

    @check(title="never wider", at_most=1 + 1e-9)
    def never_wider(self, variant: DataArray) -> tuple[float, str]:
        """half-width of a stadium over the radius of the circle with the same centre"""
        return _worst(variant.sel(shape="stadium") / variant.sel(shape="circle"))

    @check(title="never wider, fitted", at_most=1 + 1e-9)
    def never_wider_fitted(self, size: DataArray) -> tuple[float, str]:
        """half-width of a stadium over the radius of the circle, both about their nominals"""
        return _worst(size.sel(quantity="width about") / size.sel(quantity="radius about"))

    @check()
    def numbers_as_stated(self, answer: Dataset) -> list[Check]:
        """The peak at the first resonance, and the reduction by stadiums and by gain control."""
        low, high = WINDOWS[self.axis]["first resonance"]
        numbers = self.metrics(answer)
        peak, ratio = numbers["peak_hz"], 1 / numbers["radius_over_width_at_peak"]
        left = numbers["median_radius_agc"] / numbers["median_radius_own"]
        narrower = "half-width over radius where the radius is largest"
        gains = f"median radius above {HIGH_FREQUENCY:g} Hz with AGC over that without"
        return [
            Check("peak above", "lower end of the resonance [Hz]", low, peak),
            Check("peak below", "frequency of the largest radius [Hz]", peak, high),
            Check("narrower", narrower, ratio, 1 / LEAST_RATIO),
            Check("gain spread", gains, left, 1 - LEAST_REMOVED),
        ]

    @metric
    def at_peak(self, variant: DataArray) -> dict[str, DataArray]:
        """The largest circle about the nominal of Table 5.2, and the stadium there."""
        own = variant.sel(gain="own")
        peak = own.sel(shape="circle").idxmax("frequency")
        radius, width = own.sel(frequency=float(peak))
        return {"radius_over_width_at_peak": radius / width, "peak_hz": peak}

    peaks = metric(
        template="{shape}_peak_{gain}", value=lambda variant: _named(variant).max("frequency")
    )
    medians = metric(
        template="median_{shape}_{gain}",
        value=lambda variant: (
            _named(variant).sel(frequency=slice(HIGH_FREQUENCY, None)).median("frequency")
        ),
    )
    radius_peak = metric("radius_peak_{by}", value=lambda radius: radius.max("frequency"))

    @metric("{quantity}_peak_{by}")
    def fitted_peaks(self, size: DataArray) -> DataArray:
        peaks = size.sel(quantity=["width about", "W_c circle", "W_c stadium"]).max("frequency")
        return peaks.assign_coords(quantity=["width", "circle_weight", "stadium_weight"])

    @table
    def peak_tables(self, answer: Dataset) -> dict[str, Any]:
        numbers = self.metrics(answer)

        def rows(labels: tuple[str, ...], *names: str) -> list[list[str]]:
            return [[one, *(f"{numbers[f'{n}_{one}']:.4f}" for n in names)] for one in labels]

        gains = ["gain", "radius peak", "width peak", f"median radius above {HIGH_FREQUENCY:g} Hz"]
        methods = ["method", "radius peak", "circle weight's", "width peak", "stadium weight's"]
        of_gains = ("radius_peak", "width_peak", "median_radius", "median_width")
        of_methods = ("radius_peak", "circle_weight_peak", "width_peak", "stadium_weight_peak")
        return {
            "gains": ([*gains, "median width"], rows(GAIN_VARIANTS, *of_gains)),
            "methods": (methods, rows(COVER_METHODS, *of_methods)),
        }

    @figure
    def sizes(self, answer: Dataset) -> Figure:
        """Figure 5.16 by either method: parametric, complex and mixed uncertainty."""
        drawn, panels = figures.axes(2, 1, size=(7.5, 7.5), sharex=True)
        frequency, reduced = answer["frequency"], answer["parametric"].sel(set="reduced")
        for panel, method in zip(panels, COVER_METHODS, strict=True):
            radius, size = answer["radius"].sel(by=method), answer["size"].sel(by=method)
            lines = (
                (reduced, "--", figures.GREEN, "parametric (Table 5.3)"),
                (radius, ":", figures.ORANGE, "complex: sets"),
                (size.sel(quantity="W_c circle"), "-", figures.ORANGE, "complex: weight"),
                (size.sel(quantity="width about"), ":", figures.BLUE, "mixed, width: sets"),
                (size.sel(quantity="W_c stadium"), "-", figures.BLUE, "mixed, width: weight"),
            )
            for one, style, colour, name in lines:
                panel.plot(frequency, one, style, color=colour, label=name)
            figures.label(
                panel, x="", y="relative size", title=f"{self.axis}, method {method}", log="xy"
            )
        figures.label(panels[-1], x="frequency [Hz]")
        figures.legend_below(drawn, panels[0], columns=3)
        return figures.with_figure_numbers(drawn, "5.12", "5.13", "5.16")

    @figure
    def gains(self, variant: DataArray) -> Figure:
        """The three gain variants about the nominal of Table 5.2."""
        drawn, panels = figures.axes(1, 2, size=(9.5, 4.4), sharex=True, sharey=True)
        for panel, shape, name in zip(panels, COVER_SHAPES, ("radius", "half-width"), strict=True):
            for gain in GAIN_VARIANTS:
                one = variant.sel(gain=gain, shape=shape)
                panel.plot(variant["frequency"], one, label=f"{gain} gain")
            figures.label(panel, x="frequency [Hz]", title=f"{shape}s: {name}", log="xy")
        figures.label(panels[0], y="relative size")
        figures.legend_below(drawn, panels[0])
        return drawn


def _about(axis: Axis, frequency: RealArray, gain: Gain, nominal: ComplexArray) -> list[RealArray]:
    """Radius of circles and half-width of stadiums about a nominal response."""
    measured = measured_drives(axis, frequency.size, frequency[0], frequency[-1], gain)
    away = measured.points / nominal[:, None] - 1
    return [np.abs(away).max(axis=1), narrowest_stadium(away, center=0.0).radius]


def _named(variant: DataArray) -> DataArray:
    """Sizes, with each shape renamed after the quantity that measures it."""
    return variant.assign_coords(shape=["radius", "width"])


def _worst(ratio: DataArray) -> tuple[float, str]:
    """The largest ratio, and the frequency at which it occurs."""
    frequency = ratio["frequency"].values
    return worst_value(ratio.values, lambda place: f"at {frequency[place[1]]:.4g} Hz")
