"""Nominal models of the three uncertainty forms, side by side (figures 5.10 and 5.11).

Figure, table and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from workbench import Check, Run, figures, problem, ref
from workbench.fitting import Rational
from workbench.study import Study, array, check, dim, figure, metric
from workbench.types import DataArray, Dataset, Figure, RealArray

from ..drive.plants import nominal_response
from ..drive.shared_parameters import TABLES, WINDOWS, Frequencies
from ..drive.tables import Axis
from .covered import covered_responses

NOMINAL_FORMS = ("parametric", "complex", "mixed")
CLOSE = {"outside": 2.0, "inside": 4.0}
"""Largest accepted difference [dB] of two nominal magnitudes, outside and inside the resonances."""


def steps_of_covers(axis: str, frequencies: int = 400, **_: Any) -> dict[str, Any]:
    """References to the runs of both covers by the thesis' method "steps"."""
    return {
        f"{shape}s": ref(f"cd/{axis}/{shape}-cover", method="steps", frequencies=frequencies)
        for shape in ("circle", "stadium")
    }


@problem(
    "cd/{axis}/nominal",
    axis=("focus", "radial"),
    needs=steps_of_covers,
    data=TABLES,
)
def nominal(axis: Axis, circles, stadiums, frequencies: Frequencies = 400) -> NominalModels:  # type: ignore[no-untyped-def]
    """Nominal models of parametric, complex and mixed uncertainty agree (figures 5.10, 5.11).

    Three nominal models are compared in dB, inside and outside the resonances: that of the midrange
    parameters of Table 5.2, a fourth-order function fitted to the centres of the smallest circles,
    and one fitted to the centres of the narrowest stadiums.

    frequencies: number of frequencies, logarithmically spaced from 5 Hz to 5 kHz.
    """
    return NominalModels(axis, circles, stadiums)


@dataclass(frozen=True, eq=False)
class NominalModels(Study):
    """The three nominal models over the frequencies of the covers."""

    axis: Axis
    circles: Run
    stadiums: Run

    headline: ClassVar[str] = "difference_db"

    @property
    def quantifier(self) -> str:
        return "at the frequencies of the covers"

    form = dim(NOMINAL_FORMS)
    drive = dim(lambda self: self.circles.data["plant"].values)

    @dim(unit="Hz", meaning="frequency")
    def frequency(self) -> RealArray:
        return np.asarray(self.circles.data["frequency"])

    @property
    def fitted(self) -> list[Rational]:
        """Nominal transfer functions of the complex and the mixed form."""
        return [self.circles.answer.model.nominal, self.stadiums.answer.model.nominal]

    @array(dims=(form, frequency), unit="units/V", meaning="nominal response")
    def nominal(self, frequency: DataArray) -> list[Any]:
        printed = nominal_response(self.axis, frequency.values, antialiasing=False)
        return [printed, *(one.response(2 * np.pi * frequency.values) for one in self.fitted)]

    response = array(
        dims=("frequency", "drive"),
        unit="units/V",
        value=lambda self: covered_responses(self.circles).values,
    )
    complex_zeros = array(
        dims="complex_zeros", unit="rad/s", value=lambda self: self.fitted[0].zeros
    )
    complex_poles = array(
        dims="complex_poles", unit="rad/s", value=lambda self: self.fitted[0].poles
    )
    mixed_zeros = array(dims="mixed_zeros", unit="rad/s", value=lambda self: self.fitted[1].zeros)
    mixed_poles = array(dims="mixed_poles", unit="rad/s", value=lambda self: self.fitted[1].poles)

    def difference(self, nominal: DataArray) -> dict[str, DataArray]:
        """Largest difference [dB] of two magnitudes (F,) outside and inside the resonances."""
        hertz, level = nominal["frequency"], 20 * np.log10(abs(nominal))
        between: Any = level.max("form") - level.min("form")  # type: ignore[arg-type]
        first, second = ((hertz >= a) & (hertz <= b) for a, b in WINDOWS[self.axis].values())
        masks = {"outside": ~(first | second), "inside": first | second}
        return {place: between.where(mask, drop=True) for place, mask in masks.items()}

    @check()
    def agreement(self, nominal: DataArray) -> list[Check]:
        """The three models agree closely."""
        statement = "largest difference of two nominal magnitudes {} the resonances [dB]"
        worst = [
            (place, float(one.max()), f"at {float(one.idxmax()):.4g} Hz")
            for place, one in self.difference(nominal).items()
        ]
        return [
            Check(f"agreement {place}", statement.format(place), size, CLOSE[place], where=where)
            for place, size, where in worst
        ]

    @metric
    def differences(self, nominal: DataArray) -> dict[str, DataArray]:
        difference = self.difference(nominal)
        return {
            "difference_db": difference["outside"].max(),
            "difference_at_resonances_db": difference["inside"].max(),
            "difference_at_resonances_hz": difference["inside"].idxmax(),
        }

    resonances = metric(
        template="resonance_{form}_hz", value=lambda nominal: abs(nominal).idxmax("frequency")
    )

    @figure
    def bode(self, answer: Dataset) -> Figure:
        drawn, (top, bottom) = figures.axes(2, 1, size=(7.0, 6.0), sharex=True)
        grey: Any = {"color": "0.75", "linewidth": 0.6}
        lines = [(one, "-", grey) for one in answer["response"].transpose("drive", ...)]
        styles = zip(answer["nominal"], ("--", ":", "-"), NOMINAL_FORMS, strict=True)
        lines += [(one, style, {"label": form}) for one, style, form in styles]
        for one, style, look in lines:
            top.plot(answer["frequency"], abs(one), style, **look)
            bottom.plot(answer["frequency"], figures.phase(one.values), style, **look)
        top.lines[0].set_label("twelve drives")
        figures.label(top, y="magnitude [units/V]", title=f"{self.axis} nominal models", log="xy")
        figures.label(bottom, x="frequency [Hz]", y="phase [deg]")
        figures.legend_below(drawn, top)
        return figures.with_figure_numbers(drawn, {"focus": "5.10", "radial": "5.11"}[self.axis])
