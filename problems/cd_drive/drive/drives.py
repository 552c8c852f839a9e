"""The twelve drives at a glance: responses, resonances, parameters."""

from __future__ import annotations

from dataclasses import dataclass, fields
from typing import Any, ClassVar, get_args

import numpy as np

from workbench import Check, Study, figures, problem
from workbench.executor import Context
from workbench.heavy_types import Axes, DataArray, Dataset, Figure

from .actuator import general_model, resonances, stack, transfer_coefficients
from .nominal_table import compare_nominal
from .plants import ANTIALIASING, crossover, nominal_response, phase_margin, responses
from .shared_parameters import TABLES, WINDOWS, Frequencies
from .tables import ActuatorParameters, Axis, Drive, Values, drives

AXES: tuple[Axis, ...] = get_args(Axis)
PARAMETERS = [f.name for f in fields(Drive) if f.name not in ("name", "axis")]
UNITS = {
    "L": "H", "R_measured": "ohm", "R": "ohm", "Bl": "N/A", "k": "N/m", "b": "N s/m",
    "k1": "N/m", "k2": "N/m", "b1": "N s/m", "b2": "N s/m", "m1": "kg", "m2": "kg",
    "K_opt": "V/m", "K_optn": "units/m",
}  # fmt: skip
RESONANCES = ("first", "parasitic zero", "parasitic pole")
EXPECTED = {"focus": (30.0, 500.0), "radial": (50.0, 900.0)}
"""Where section 4.6 puts the first and the parasitic resonance [Hz]; it says about 800 for the
radial one, which its own tables put between 856 and 976."""
AROUND = 0.15
"""How far, relatively, a drive's resonance may be from there."""


@problem("cd/drives", data=TABLES)
def overview(frequencies: Frequencies = 300, values: Values = "printed") -> Drives:
    """Bode and Nyquist plots and parameters of the twelve measured drives (Tables A.1-A.3, 5.2).

    All 24 responses (focus and radial) from control voltage to normalised error, with the optical
    gain of each drive and with the gain spread removed as the automatic gain control does; the
    resonances of each; the parameter table; Table 5.2 recomputed.

    frequencies: how many, logarithmically spaced from 5 Hz to 20 kHz; around each resonance there
    are 80 more. values: tables "printed" or "corrected".
    """
    bands = [band for axis in AXES for band in WINDOWS[axis].values()]
    dense = [np.linspace(low, high, 80) for low, high in bands]
    grid = np.unique(np.concatenate([np.geomspace(5.0, 20e3, frequencies), *dense]))
    return Drives(grid, values)


@dataclass(frozen=True, eq=False)
class Drives(Study):
    """Responses and resonances of all drives over a frequency grid [Hz]."""

    frequency: np.ndarray
    values: Values

    headline: ClassVar[str] = "first_resonance_focus_hz"

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        grid = ("axis", "drive", "frequency")
        unit = {"units": "units/V"}
        twelve = {axis: drives(axis, self.values) for axis in AXES}

        own = np.stack([responses(axis, self.frequency, "own", self.values) for axis in AXES])
        found = [[resonances(drive) for drive in twelve[axis]] for axis in AXES]
        general = [stack([general_model(d) for d in twelve[axis]]) for axis in AXES]
        return xr.Dataset(
            {
                "response": (grid, own, unit | {"long_name": "u to normalised error"}),
                "agc_gain": (
                    ("axis", "drive"),
                    np.stack([_agc_gain(axis, self.values) for axis in AXES]),
                    {"units": "1", "long_name": "gain of the automatic gain control"},
                ),
                "actuator_general": (
                    grid,
                    np.stack([model.response(self.frequency) for model in general]),
                    {"units": "m/V", "long_name": "general actuator model, eq. 3.10"},
                ),
                "nominal": (
                    ("axis", "frequency"),
                    np.stack([nominal_response(axis, self.frequency) for axis in AXES]),
                    unit | {"long_name": "nominal parameters of Table 5.2"},
                ),
                "crossover": (("axis",), [crossover(axis) for axis in AXES], {"units": "Hz"}),
                "resonance": (
                    ("axis", "drive", "kind"),
                    [[(r.first, r.parasitic_zero, r.parasitic_pole) for r in row] for row in found],
                    {"units": "Hz", "long_name": "natural frequency"},
                ),
                "parameters": (
                    ("axis", "drive", "parameter"),
                    [[[getattr(d, p) for p in PARAMETERS] for d in twelve[a]] for a in AXES],
                ),
            },
            coords={
                "axis": list(AXES),
                "drive": [drive.name for drive in twelve["focus"]],
                "frequency": ("frequency", self.frequency, {"units": "Hz"}),
                "kind": list(RESONANCES),
                "parameter": PARAMETERS,
                "unit": ("parameter", [UNITS[p] for p in PARAMETERS]),
            },
        )

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        polynomial = _from_table_3_2(answer)
        shape = answer["response"] / answer["response"].isel(frequency=0)
        off = float(np.max(np.abs(shape / (polynomial / polynomial.isel(frequency=0)) - 1)))
        return [
            Check(
                "Table 3.2",
                "relative distance of the derived responses from the printed polynomials",
                off,
                1e-9,
            ),
            *(self._near(answer, axis, kind) for axis in AXES for kind in (0, 2)),
            Check(
                "automatic gain control",
                "spread of the gains that it leaves at crossover, relative",
                _spread_at_crossover(answer),
                0.05,
            ),
        ]

    def _near(self, answer: Dataset, axis: Axis, kind: int) -> Check:
        expected = EXPECTED[axis][0 if kind == 0 else 1]
        found = answer["resonance"].sel(axis=axis).isel(kind=kind)
        off = abs(found / expected - 1)
        worst = str(answer["drive"].values[int(np.argmax(off.values))])
        return Check(
            f"{axis} {'first' if kind == 0 else 'parasitic'} resonance",
            f"relative distance from {expected:g} Hz",
            float(off.max()),
            AROUND,
            f"of {worst}",
        )

    def metrics(self, answer: Dataset) -> dict[str, float]:
        numbers = {}
        for axis in AXES:
            one = answer.sel(axis=axis)
            for kind in RESONANCES:
                name = kind.replace(" ", "_") + ("_resonance" if kind == "first" else "")
                found = one["resonance"].sel(kind=kind)
                numbers[f"{name}_{axis}_hz"] = float(found.median())
                numbers[f"{name}_{axis}_spread_hz"] = float(found.max() - found.min())
            gains = one["parameters"].sel(parameter="K_optn")
            numbers[f"gain_spread_{axis}"] = float(
                (gains.max() - gains.min()) / (gains.max() + gains.min())
            )
            numbers[f"crossover_{axis}_hz"] = float(one["crossover"])
            numbers[f"phase_margin_{axis}_deg"] = phase_margin(axis)
        return numbers

    def tables(self, answer: Dataset) -> dict[str, str]:
        return {"parameters": _parameter_table(answer), "table-5-2": _nominal_table(self.values)}

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        return {
            "bode": _bode(answer, answer["response"], "own optical gain"),
            "bode-agc": _bode(
                answer, answer["response"] * answer["agc_gain"], "gain equalised at crossover"
            ),
            "nyquist": _nyquist(answer),
        }


def _agc_gain(axis: Axis, values: Values) -> np.ndarray:
    """What the automatic gain control multiplies each drive's own gain by, shape (12,)."""
    at = [crossover(axis)]
    wanted, own = (responses(axis, at, gain, values) for gain in ("agc", "own"))
    return (wanted / own)[:, 0].real


def _from_table_3_2(data: Dataset) -> DataArray:
    """Responses by the polynomials of Table 3.2, from the stored parameters, gain apart."""
    s = 2j * np.pi * data["frequency"].values
    result = data["response"].copy()
    for axis in AXES:
        for drive in data["drive"].values:
            row = data["parameters"].sel(axis=axis, drive=drive)
            names = [field.name for field in fields(ActuatorParameters)]
            numbers = {name: float(row.sel(parameter=name)) for name in names}
            num, den = transfer_coefficients(ActuatorParameters(**numbers))
            values = np.polyval(num, s) / np.polyval(den, s) * ANTIALIASING / (s + ANTIALIASING)
            result.loc[{"axis": axis, "drive": drive}] = values
    return result


def _spread_at_crossover(data: Dataset) -> float:
    spreads = []
    for axis in AXES:
        gained = abs(data["response"] * data["agc_gain"]).sel(axis=axis)
        at = gained.sel(frequency=float(data["crossover"].sel(axis=axis)), method="nearest")
        spreads.append(float((at.max() - at.min()) / (at.max() + at.min())))
    return max(spreads)


def _bode(data: Dataset, response: DataArray, gain: str) -> Figure:
    figure, panels = figures.axes(2, 2, size=(9.0, 6.2), sharex=True)
    for column, axis in enumerate(AXES):
        magnitude, phase = panels[column], panels[2 + column]
        for i, drive in enumerate(data["drive"].values):
            _bode_line(magnitude, phase, data, response.sel(axis=axis, drive=drive), i)
        nominal = data["nominal"].sel(axis=axis)
        _bode_line(magnitude, phase, data, nominal, None)
        magnitude.set_title(f"{axis}, {gain}")
        magnitude.set_yscale("log")
        phase.set_xscale("log")
        phase.set_xlabel("frequency [Hz]")
        phase.set_yticks([-270, -180, -90, 0])
    panels[0].set_ylabel("magnitude [units/V]")
    panels[2].set_ylabel("phase [deg]")
    figures.legend_below(figure, panels[0], columns=7)
    return figure


def _bode_line(
    magnitude: Axes, phase: Axes, data: Dataset, response: DataArray, drive: int | None
) -> None:
    line = _line(data, drive)
    magnitude.plot(data["frequency"], abs(response), **line)
    phase.plot(data["frequency"], figures.phase(response.values), **line)


def _line(data: Dataset, drive: int | None) -> dict[str, Any]:
    """Colour and label of a drive's line, or of the nominal plant's."""
    from matplotlib import colormaps

    if drive is None:
        return {"color": figures.BLACK, "linestyle": "--", "label": "nominal"}
    name = str(data["drive"].values[drive])
    return {"color": colormaps["viridis"](drive / 11), "linewidth": 0.9, "label": name}


def _nyquist(data: Dataset) -> Figure:
    figure, panels = figures.axes(2, 2, size=(9.0, 8.4))
    for column, axis in enumerate(AXES):
        low, high = WINDOWS[axis]["parasitic resonance"]
        for row, band in enumerate(((0.0, low / 2), (0.9 * low, 1.1 * high))):
            panel = panels[2 * row + column]
            part = data.sel(axis=axis, frequency=slice(*band))
            for i in range(part.sizes["drive"]):
                response = part["response"].isel(drive=i)
                panel.plot(response.real, response.imag, **_line(data, i))
            panel.plot(part["nominal"].real, part["nominal"].imag, **_line(data, None))
            panel.set_aspect("equal", adjustable="datalim")
            frequency = part["frequency"].values
            panel.set_title(f"{axis}, {frequency[0]:.0f} to {frequency[-1]:.0f} Hz")
            panel.set_xlabel("real part [units/V]")
            panel.locator_params(axis="x", nbins=6)
        panels[column].set_ylabel("imaginary part [units/V]")
        panels[2 + column].set_ylabel("imaginary part [units/V]")
    figures.legend_below(figure, panels[0], columns=7)
    return figure


def _parameter_table(data: Dataset) -> str:
    heads = [f"{p} [{UNITS[p]}]" for p in PARAMETERS]
    lines = [
        "| drive | axis | " + " | ".join(heads) + " |",
        "| --- | --- |" + " ---: |" * len(heads),
    ]
    for axis in AXES:
        for drive in data["drive"].values:
            row = data["parameters"].sel(axis=axis, drive=drive).values
            lines.append(f"| {drive} | {axis} | " + " | ".join(f"{x:.7g}" for x in row) + " |")
    return "\n".join(lines) + "\n"


def _nominal_table(values: Values) -> str:
    lines = [
        "| axis | parameter | printed | computed | tolerance printed | computed | follows | note |",
        "| --- | --- | ---: | ---: | ---: | ---: | --- | --- |",
    ]
    for axis in AXES:
        lines += [
            f"| {axis} | {row.parameter} | {row.printed_nominal:g} | {row.computed_nominal:g} "
            f"| {row.printed_tolerance:.2%} | {row.computed_tolerance:.2%} "
            f"| {'yes' if row.follows else 'no'} | {row.note} |"
            for row in compare_nominal(axis, values)
        ]
    return "\n".join(lines) + "\n"
