"""The twelve drives at a glance: responses, resonances and parameters."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, fields
from typing import Any, ClassVar

import numpy as np

from workbench import Check, figures, problem
from workbench.study import Study, array, check, dim, figure, metric, part, table
from workbench.types import DataArray, Dataset, Figure, RealArray

from .actuator import general_model, resonances, stack
from .derived_quantities import DERIVED
from .mass_on_spring import (
    DAMPING_RATIOS,
    RELATIVE_FREQUENCIES,
    figure_3_8,
    peak_off,
    relative_response,
)
from .nominal_table import compare_nominal
from .plants import (
    AMPLIFICATION,
    ATTENUATION,
    crossover,
    nominal_response,
    phase_margin,
    responses,
)
from .printed_equations import off_equation_3_10, off_table_3_2
from .shared_parameters import TABLES, WINDOWS, Frequencies, spread
from .tables import AXES, Axis, Drive, Values, drives

PARAMETERS = [f.name for f in fields(Drive) if f.name not in ("name", "axis")]
UNITS = {
    "L": "H", "R_measured": "ohm", "R": "ohm", "Bl": "N/A", "k": "N/m", "b": "N s/m",
    "k1": "N/m", "k2": "N/m", "b1": "N s/m", "b2": "N s/m", "m1": "kg", "m2": "kg",
    "K_opt": "V/m", "K_optn": "units/m",
}  # fmt: skip
RESONANCES = ("first", "parasitic zero", "parasitic pole")
STATED_RESONANCES = {"focus": (30.0, 500.0), "radial": (50.0, 900.0)}
"""First and parasitic resonance [Hz] as stated in section 4.6. It states about 800 Hz for the
radial parasitic resonance, but its own tables give 856 to 976 Hz.
"""
RESONANCE_TOLERANCE = 0.15
"""Largest accepted distance of a drive's resonance from the stated one, relative."""


@problem("cd/drives", data=TABLES)
def overview(frequencies: Frequencies = 300, values: Values = "printed") -> Drives:
    """Bode and Nyquist plots and parameters of the twelve measured drives (Tables A.1-A.3, 5.2).

    The responses from control voltage to normalised error are shown for all drives in both axes
    (24), with each drive's own optical gain, and with the gains equalised by the automatic gain
    control. Resonances of each drive, the parameter table, and Table 5.2 recomputed follow, and the
    response of a mass on a damped spring for several damping ratios (figure 3.8).

    frequencies: number of frequencies, logarithmically spaced from 5 Hz to 20 kHz; around each
    resonance there are 80 more. values: tables "printed" or "corrected".
    """
    bands = [band for axis in AXES for band in WINDOWS[axis].values()]
    dense = [np.linspace(low, high, 80) for low, high in bands]
    grid = np.unique(np.concatenate([np.geomspace(5.0, 20e3, frequencies), *dense]))
    return Drives(grid, values)


@dataclass(frozen=True, eq=False)
class Drives(Study):
    """Responses and resonances of all drives over a frequency grid [Hz]."""

    grid: RealArray
    values: Values

    headline: ClassVar[str] = "first_resonance_focus_hz"

    @property
    def quantifier(self) -> str:
        return "for these 12 drives of each axis"

    axis = dim(AXES)
    drive = dim(lambda twelve: [one.name for one in twelve["focus"]])
    frequency = dim(lambda self: self.grid, unit="Hz")
    kind = dim(RESONANCES)
    parameter = dim(PARAMETERS)
    unit = array(dims=parameter, value=lambda: UNITS, coordinate=True)
    quantity = dim(DERIVED)
    derived_unit = array(
        dims=quantity, value=lambda: [one.unit for one in DERIVED.values()], coordinate=True
    )

    @part
    def twelve(self) -> dict[Axis, tuple[Drive, ...]]:
        """The drives by axis."""
        return {axis: drives(axis, self.values) for axis in AXES}

    @array(dims=(axis, drive, frequency), unit="units/V", meaning="u to normalised error")
    def response(self) -> list[Any]:
        return [responses(axis, self.grid, "own", self.values) for axis in AXES]

    @array(dims=(axis, drive), unit="1", meaning="gain of the automatic gain control")
    def agc_gain(self) -> list[RealArray]:
        return [_agc_gain(axis, self.values) for axis in AXES]

    @array(dims=(axis, drive, frequency), unit="m/V", meaning="general actuator model, eq. 3.10")
    def actuator_general(self, twelve: dict[Axis, Any]) -> list[Any]:
        models = (stack([general_model(one) for one in twelve[axis]]) for axis in AXES)
        return [model.response(self.grid) for model in models]

    @array(dims=(axis, frequency), unit="units/V", meaning="nominal parameters of Table 5.2")
    def nominal(self) -> list[Any]:
        return [nominal_response(axis, self.grid) for axis in AXES]

    crossover = array(dims=axis, unit="Hz", value=lambda: [crossover(axis) for axis in AXES])

    @array(dims=(axis, drive, kind), unit="Hz", meaning="natural frequency")
    def resonance(self, twelve: dict[Axis, Any]) -> list[Any]:
        found = [[resonances(one) for one in twelve[axis]] for axis in AXES]
        return [[(r.first, r.parasitic_zero, r.parasitic_pole) for r in row] for row in found]

    @array(dims=(axis, drive, parameter))
    def parameters(self, twelve: dict[Axis, Any]) -> list[Any]:
        return [[[getattr(one, name) for name in PARAMETERS] for one in twelve[a]] for a in AXES]

    @array(dims=(axis, drive, quantity), meaning="what follows from the tables alone")
    def derived(self, twelve: dict[Axis, Any]) -> list[Any]:
        return [[[q.of(one) for q in DERIVED.values()] for one in twelve[a]] for a in AXES]

    zeta = dim(DAMPING_RATIOS, meaning="damping ratio")
    relative = dim(lambda: RELATIVE_FREQUENCIES, meaning="frequency over the natural one")
    spring_response = array(
        dims=(zeta, relative),
        unit="1",
        meaning="k x / F by equation 3.7",
        value=lambda zeta, relative: relative_response(zeta.values, relative.values),
    )

    @check(title="figure 3.8", at_most=0.01)
    def peaks(self, spring_response: DataArray) -> float:
        """relative distance of the peaks from their closed forms, in frequency and height"""
        return max(peak_off(spring_response))

    @check(title="Table 3.2", at_most=1e-9)
    def polynomials(self, response: DataArray, parameters: DataArray) -> DataArray:
        """relative distance of the derived responses from the printed polynomials"""
        return off_table_3_2(response, parameters)

    @check(title="equation 3.10", at_most=1e-9)
    def third_order(self, actuator_general: DataArray, parameters: DataArray) -> DataArray:
        """relative distance of the general model from the printed equation"""
        return off_equation_3_10(actuator_general, parameters)

    @check()
    def near_stated(self, resonance: DataArray) -> list[Check]:
        """Distance of the resonances from those that section 4.6 states."""
        found = []
        for axis, (first, parasitic) in STATED_RESONANCES.items():
            for name, kind, stated in (("first", 0, first), ("parasitic", 2, parasitic)):
                off = abs(resonance.sel(axis=axis).isel(kind=kind) / stated - 1)
                statement = f"relative distance from {stated:g} Hz"
                size, where = off.max(), f"of {off.idxmax('drive').item()}"
                title = f"{axis} {name} resonance"
                found.append(Check(title, statement, float(size), RESONANCE_TOLERANCE, where=where))
        return found

    @check(title="automatic gain control", at_most=0.05)
    def equalised(self, answer: Dataset) -> DataArray:
        """spread of the gains that it leaves at crossover, relative"""
        gain = abs(answer["response"] * answer["agc_gain"])
        return spread(gain.sel(frequency=answer["crossover"], method="nearest")).max()

    _middle = metric(
        template="{kind}_{axis}_hz",
        value=lambda resonance: _by_metric_name(resonance).median("drive"),
    )
    _range = metric(
        template="{kind}_{axis}_spread_hz",
        value=lambda resonance: (
            _by_metric_name(resonance).max("drive") - _by_metric_name(resonance).min("drive")
        ),
    )
    _gain = metric(
        template="gain_spread_{axis}",
        value=lambda parameters: spread(parameters.sel(parameter="K_optn")),
    )
    _crossover = metric("crossover_{axis}_hz", value=lambda crossover: crossover)
    _margin = metric(
        template=lambda: {f"phase_margin_{axis}_deg": phase_margin(axis) for axis in AXES}
    )
    table_3_2_off = metric(
        template=lambda response, parameters: off_table_3_2(response, parameters)
    )
    figure_3_8_off = metric(
        template=lambda spring_response: dict(
            zip(
                ("figure_3_8_frequency_off", "figure_3_8_height_off"),
                peak_off(spring_response),
                strict=True,
            )
        )
    )
    equation_3_10_off = metric(
        template=lambda actuator_general, parameters: off_equation_3_10(
            actuator_general, parameters
        )
    )

    @metric("K_total_by_eq_3_18_{axis}")
    def total_gain(self, parameters: DataArray) -> DataArray:
        K_optn = parameters.sel(parameter="K_optn")
        return ATTENUATION * AMPLIFICATION * (K_optn.min("drive") + K_optn.max("drive")) / 2

    @table
    def parameter_tables(self, parameters: DataArray) -> dict[str, Any]:
        heads = ["drive", "axis", *(f"{name} [{UNITS[name]}]" for name in PARAMETERS)]
        rows = [
            [str(one["drive"].item()), axis, *(f"{x:.7g}" for x in one.values)]
            for axis in AXES
            for one in parameters.sel(axis=axis)
        ]
        return {"parameters": (heads, rows), "table-5-2": _nominal_table(self.values)}

    @table
    def derived_table(self, derived: DataArray) -> dict[str, Any]:
        heads = ["quantity", "meaning", "axis", "least", "median", "most"]
        rows = [
            [f"{name} [{one.unit}]", one.meaning, axis]
            + [f"{x:.4g}" for x in derived.sel(axis=axis, quantity=name).quantile([0, 0.5, 1])]
            for name, one in DERIVED.items()
            for axis in AXES
        ]
        return {"derived": (heads, rows)}

    @figure
    def plots(self, answer: Dataset) -> dict[str, Figure]:
        own, nominal = answer["response"], answer["nominal"]
        return {
            "bode": _bode(own, nominal, "own optical gain"),
            "bode-agc": _bode(own * answer["agc_gain"], nominal, "gain equalised at crossover"),
            "nyquist": _nyquist(own, nominal),
            "figure-3-8": figure_3_8(answer),
        }


def _by_metric_name(resonance: DataArray) -> DataArray:
    """Resonances by the names of their metrics."""
    return resonance.assign_coords(kind=["first_resonance", *RESONANCES[1:]])


def _agc_gain(axis: Axis, values: Values) -> RealArray:
    """Factors (12,) by which the automatic gain control multiplies the drives' gains."""
    at = [crossover(axis)]
    wanted, own = (responses(axis, at, gain, values) for gain in ("agc", "own"))
    return np.asarray((wanted / own)[:, 0].real)


def _lines_with_styles(
    drives: DataArray, nominal: DataArray
) -> Iterator[tuple[DataArray, dict[str, Any]]]:
    """Each drive's response and the nominal one, with the style of its line."""
    from matplotlib import colormaps

    for i, one in enumerate(drives):
        colour, name = colormaps["viridis"](i / 11), str(one["drive"].item())
        yield one, {"color": colour, "linewidth": 0.9, "label": name}
    yield nominal, {"color": figures.BLACK, "linestyle": "--", "label": "nominal"}


def _bode(response: DataArray, nominal: DataArray, gain: str) -> Figure:
    drawn, panels = figures.axes(2, 2, size=(9.0, 6.2), sharex=True)
    for axis, magnitude, phase in zip(AXES, panels[:2], panels[2:], strict=True):
        for one, look in _lines_with_styles(response.sel(axis=axis), nominal.sel(axis=axis)):
            magnitude.plot(one["frequency"], abs(one), **look)
            phase.plot(one["frequency"], figures.phase(one.values), **look)
        figures.label(magnitude, title=f"{axis}, {gain}", log="y")
        figures.label(phase, x="frequency [Hz]", log="x")
        phase.set_yticks([-270, -180, -90, 0])
    figures.label(panels[0], y="magnitude [units/V]")
    figures.label(panels[2], y="phase [deg]")
    figures.legend_below(drawn, panels[0], columns=7)
    return drawn


def _nyquist(response: DataArray, nominal: DataArray) -> Figure:
    drawn, panels = figures.axes(2, 2, size=(9.0, 8.4))
    bands = [WINDOWS[axis]["parasitic resonance"] for axis in AXES]
    below = [(0.0, low / 2) for low, _ in bands]
    around = [(0.9 * low, 1.1 * high) for low, high in bands]
    for panel, axis, band in zip(panels, 2 * AXES, below + around, strict=True):
        part = {"axis": axis, "frequency": slice(*band)}
        for one, look in _lines_with_styles(response.sel(part), nominal.sel(part)):
            panel.plot(one.real, one.imag, **look)
            ends = one["frequency"].values[[0, -1]]
        figures.label(
            panel, x="real part [units/V]", title="{}, {:.0f} to {:.0f} Hz".format(axis, *ends)
        )
        panel.set_aspect("equal", adjustable="datalim")
        panel.locator_params(axis="x", nbins=6)
        panel.set_ylabel("imaginary part [units/V]")
    figures.legend_below(drawn, panels[0], columns=7)
    return figures.with_figure_numbers(drawn, "4.8")


def _nominal_table(values: Values) -> tuple[list[str], list[list[Any]]]:
    heads = ["axis", "parameter", "printed", "computed"]
    heads += ["tolerance printed", "computed", "follows", "note"]
    rows = [
        [
            axis, row.parameter, f"{row.printed_nominal:g}", f"{row.computed_nominal:g}",
            f"{row.printed_tolerance:.2%}", f"{row.computed_tolerance:.2%}", row.follows, row.note,
        ]
        for axis in AXES
        for row in compare_nominal(axis, values)
    ]  # fmt: skip
    return heads, rows
