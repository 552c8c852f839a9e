"""Nominal models of the three uncertainty forms, side by side (figures 5.10 and 5.11).

Figure, table and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from workbench import Check, Run, Study, figures, problem, ref
from workbench.executor import Context
from workbench.heavy_types import DataArray, Dataset, Figure
from workbench.uncertainty.covers.storage import rational

from ..drive.plants import nominal_response
from ..drive.shared_parameters import TABLES, WINDOWS, Frequencies
from ..drive.tables import Axis

FORMS = ("parametric", "complex", "mixed")
CLOSE = {False: 2.0, True: 4.0}
"""Difference [dB] outside and inside the resonances up to which nominal models agree closely."""


def steps_of_covers(axis: str, frequencies: int = 400, **_: Any) -> dict[str, Any]:
    """Both covers by the steps of the thesis."""
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

    Midrange parameters of Table 5.2; a fourth-order function through the centres of the smallest
    circles; one through the centres of the narrowest stadiums. Three ways that know more or less
    of the drives, and their distance in dB inside and outside the resonances.

    frequencies: how many, logarithmically spaced from 5 Hz to 5 kHz.
    """
    return NominalModels(axis, circles, stadiums)


@dataclass(frozen=True, eq=False)
class NominalModels(Study):
    """The three nominal models over the frequencies of the covers."""

    axis: Axis
    circles: Run
    stadiums: Run

    headline: ClassVar[str] = "difference_db"

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        frequency = self.circles.data["frequency"].values
        omega = 2 * np.pi * frequency
        models = {
            "complex": rational(self.circles.data, "nominal"),
            "mixed": rational(self.stadiums.data, "nominal"),
        }
        found = [nominal_response(self.axis, frequency, antialiasing=False)]
        found += [model.response(omega) for model in models.values() if model is not None]
        roots = {
            f"{name}_{kind}": (f"{name}_{kind}", getattr(model, kind), {"units": "rad/s"})
            for name, model in models.items()
            for kind in ("zeros", "poles")
        }
        unit = {"units": "units/V", "long_name": "nominal response"}
        drives = self.circles.data["response"]
        return xr.Dataset(
            {
                "nominal": (("form", "frequency"), np.stack(found), unit),
                "response": (("frequency", "drive"), drives.values, {"units": "units/V"}),
                **roots,
            },
            coords={
                "form": list(FORMS),
                "frequency": ("frequency", frequency, {"units": "Hz", "long_name": "frequency"}),
                "drive": drives["plant"].values,
            },
        )

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        found = []
        for inside, place in ((False, "outside"), (True, "inside")):
            difference, where = self._difference(answer, inside)
            statement = f"largest difference of two nominal magnitudes {place} the resonances [dB]"
            place = f"agreement {place}"
            found.append(Check(place, statement, difference, CLOSE[inside], f"at {where:.4g} Hz"))
        return found

    def metrics(self, answer: Dataset) -> dict[str, float]:
        outside, _ = self._difference(answer, inside=False)
        inside, where = self._difference(answer, inside=True)
        resonance = abs(answer["nominal"]).idxmax("frequency")
        return {
            "difference_db": outside,
            "difference_at_resonances_db": inside,
            "difference_at_resonances_hz": where,
            **{f"resonance_{form}_hz": float(resonance.sel(form=form)) for form in FORMS},
        }

    def _difference(self, answer: Dataset, inside: bool) -> tuple[float, float]:
        """Largest difference of two magnitudes [dB], and its frequency [Hz]."""
        level: DataArray = 20 * np.log10(abs(answer["nominal"]))  # type: ignore[assignment]
        spread = (level.max("form") - level.min("form")).where(
            self._near_resonance(answer) == inside, drop=True
        )
        return float(spread.max()), float(spread.idxmax())

    def _near_resonance(self, answer: Dataset) -> DataArray:
        frequency = answer["frequency"]
        windows = [(frequency >= a) & (frequency <= b) for a, b in WINDOWS[self.axis].values()]
        return windows[0] | windows[1]

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        figure, (top, bottom) = figures.axes(2, 1, size=(7.0, 6.0), sharex=True)
        frequency = answer["frequency"].values
        for k, drive in enumerate(answer["response"].values.T):
            label = "twelve drives" if k == 0 else None
            top.loglog(frequency, abs(drive), color="0.75", linewidth=0.6, label=label)
            bottom.semilogx(frequency, figures.phase(drive), color="0.75", linewidth=0.6)
        for form, style in zip(FORMS, ("--", ":", "-"), strict=True):
            response = answer["nominal"].sel(form=form).values
            top.loglog(frequency, abs(response), style, label=form)
            bottom.semilogx(frequency, figures.phase(response), style)
        top.set_ylabel("magnitude [units/V]")
        bottom.set_ylabel("phase [deg]")
        bottom.set_xlabel("frequency [Hz]")
        top.set_title(f"{self.axis} nominal models")
        figures.legend_below(figure, top)
        return {"bode": figure}
