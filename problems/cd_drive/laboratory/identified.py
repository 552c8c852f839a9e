"""Twelve identified drives: every experiment of a drive fitted together by the fourth-order model.

Equation and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from scipy import stats

from workbench import Check, Run, Study, figures, problem, ref, solve
from workbench.arrays import RealArray
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.heavy_types import Dataset, Figure
from workbench.identification import FittedParameter, MeasuredResponse, ParameterFit

from ..drive.actuator import SERIES_RESISTANCE, specific_model, stack
from ..drive.plants import nominal_parameters
from ..drive.shared_parameters import TABLES, WINDOWS
from ..drive.tables import ActuatorParameters, Axis, Drive, drives
from ..drive.two_masses import Known, lens, lumped, seen

NAMES = ("R", "Bl", "k1", "k2", "b1", "b2", "m1", "m2")
MASS, GAIN = 0.001, 0.01
"""Relative standard deviations of the mass taken as known and of the identified optical gain."""
LIMITS = {"R": 0.001, "Bl": 0.01, "k1": 0.01, "k2": 0.08, "b1": 0.05, "m1": 0.01, "m2": 0.08}
"""Largest relative errors let pass. b2, a twentieth of b1, is reported only."""
RESPONSE = {"focus": 0.03, "radial": 0.06}
"""Largest relative error of a response let pass; a track's width leaves the radial experiment a
twentieth of the focus one's amplitude, over a tenth of its noise."""


def experiments(axis: str, **_: Any) -> dict[str, Any]:
    """What a drive is identified from: its own two experiments, and the scans of all."""
    names = [f"CD{number}" for number in range(1, 13)]
    return {
        "open_loops": [ref(f"cd/{axis}/open-loop", drive=name) for name in names],
        "closed_loops": [ref(f"cd/{axis}/closed-loop", drive=name) for name in names],
        "optical_gains": ref(f"cd/{axis}/optical-gain"),
    }


@problem(
    "cd/{axis}/identified",
    axis=("focus", "radial"),
    needs=experiments,
    data=TABLES,
    slow=True,
)
def identified(axis: Axis, open_loops, closed_loops, optical_gains) -> Identified:  # type: ignore[no-untyped-def]
    """Twelve drives identified from all their experiments, against the truth (figure 4.8).

    v_r/u of the open loop and the displacement of the closed loop, its optical gain identified too,
    are fitted together by the fourth-order model; only the mass that the first resonance sees is
    taken as known. That removes the bias of the lumped damper, which is not b1 + b2.
    """
    return Identified(axis, tuple(open_loops), tuple(closed_loops), optical_gains)


@dataclass(frozen=True, eq=False)
class Identified(Study):
    """The joint fits of twelve drives, from the runs of their experiments."""

    axis: Axis
    open_loops: tuple[Run, ...]
    closed_loops: tuple[Run, ...]
    optical_gains: Run

    headline: ClassVar[str] = "worst_response"

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        twelve = drives(self.axis)
        gains = self.optical_gains.data["gain"].sel(quantity="K_optn")
        fits = [
            self._fit(drive, float(gains.sel(drive=drive.name)), index)
            for index, drive in enumerate(context.track(twelve, "drives"))
        ]
        found = np.array([fit.answer[: len(NAMES)] for fit in fits])
        frequency = np.unique(
            np.concatenate(
                [np.geomspace(10, 2000, 200)]
                + [np.linspace(low, high, 200) for low, high in WINDOWS[self.axis].values()]
            )
        )
        models = [
            ActuatorParameters(**dict(zip(NAMES, row.tolist(), strict=True))) for row in found
        ]
        along = ("drive", "frequency")
        unit = {"units": "m/V"}
        table = [[getattr(drive, name) for name in NAMES] for drive in twelve]
        return xr.Dataset(
            {
                "identified": (along, _responses(models, frequency), unit),
                "true": (along, _responses(twelve, frequency), unit),
                "value": (("drive", "parameter"), found),
                "half_width": (("drive", "parameter"), [f.half_width[: len(NAMES)] for f in fits]),
                "table": (("drive", "parameter"), table),
                "lumped_b": ("drive", [_lumped_b(run) for run in self.open_loops]),
                "chi_square": ("drive", [fit.chi_square for fit in fits]),
            },
            coords={
                "drive": [drive.name for drive in twelve],
                "frequency": ("frequency", frequency, {"units": "Hz", "long_name": "frequency"}),
                "parameter": list(NAMES),
            },
        )

    def _fit(self, drive: Drive, gain: float, index: int) -> Fit:
        """The joint fit of one drive."""
        current, motion = self.open_loops[index].data, self.closed_loops[index].data
        degrees = float(current["variance"].attrs["degrees"])
        in_the_loop = 18.0  # ten periods: 2 (M - 1)
        quantile = stats.f.ppf(0.99, 2, in_the_loop)
        # The run scaled by the true gain, which an experimenter does not know.
        scale = drive.K_optn / gain
        data: list[Any] = [
            MeasuredResponse(
                _current,
                current["frequency"].values,
                current["response"].values,
                current["variance"].values,
                degrees,
                "v_r/u",
            ),
            MeasuredResponse(
                lambda p, s: lens(p, s, p["R"] + SERIES_RESISTANCE, p["Bl"]),
                motion["frequency"].values,
                motion["response"].values * scale,
                (motion["radius"].values * scale) ** 2 / quantile,
                in_the_loop,
                "x/v",
            ),
            Known(lambda p: seen(p)[2:], (lumped(drive).m, 1.0), (MASS, GAIN)),
        ]
        nominal = nominal_parameters(self.axis)
        start = {name: getattr(nominal, name) for name in NAMES} | {"gain": 1.0}
        parameters = {name: FittedParameter(v, v / 5, v * 5) for name, v in start.items()}
        parameters["b2"] = FittedParameter(nominal.b2, -20 * nominal.b2, 20 * nominal.b2)
        program = ParameterFit(data, parameters)
        solution = solve(program)
        if solution.certificate is None or not solution.certificate.valid:
            failures = solution.certificate.failures if solution.certificate else ()
            raise SolverError("; ".join([f"{drive.name}: {solution.message}", *failures]))
        answer = np.asarray(solution.answer)
        return Fit(answer, program.intervals(answer, 0.99), program.chi_square(answer)[0])

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        errors = abs(answer["value"] / answer["table"] - 1)
        found = []
        for name, limit in LIMITS.items():
            one = errors.sel(parameter=name)
            worst = str(answer["drive"].values[int(np.argmax(one.values))])
            statement = "largest relative error over the drives"
            found.append(Check(name, statement, float(one.max()), limit, f"of {worst}"))
        statement = "largest relative error of a response, over drives and frequencies"
        return [*found, Check("response", statement, _worst_response(answer), RESPONSE[self.axis])]

    def metrics(self, answer: Dataset) -> dict[str, float]:
        errors = abs(answer["value"] / answer["table"] - 1)
        total = answer["table"].sel(parameter=["b1", "b2"]).sum("parameter")
        joint = answer["value"].sel(parameter=["b1", "b2"]).sum("parameter")
        inside = abs(answer["value"] - answer["table"]) <= answer["half_width"]
        return {
            "worst_response": _worst_response(answer),
            **{f"error_{n}": float(errors.sel(parameter=n).max()) for n in NAMES},
            "covered": float(inside.mean()),
            "bias_b_lumped": float((answer["lumped_b"] / total - 1).mean()),
            "bias_b_joint": float((joint / total - 1).mean()),
            "chi_square": float(answer["chi_square"].max()),
        }

    def tables(self, answer: Dataset) -> dict[str, str]:
        lines = [
            "| drive | " + " | ".join(f"{name} | error" for name in NAMES) + " |",
            "| --- |" + " ---: | ---: |" * len(NAMES),
        ]
        for drive in answer["drive"].values:
            row = answer.sel(drive=drive)
            error = row["value"] / row["table"] - 1
            cells = (
                f"{float(row['value'].sel(parameter=n)):.4g} | {float(error.sel(parameter=n)):+.2%}"
                for n in NAMES
            )
            lines.append(f"| {drive} | " + " | ".join(cells) + " |")
        return {"parameters": "\n".join(lines) + "\n"}

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        figure, panels = figures.axes(1, 2, size=(9.5, 5.0))
        for panel, (caption, (low, high)) in zip(panels, WINDOWS[self.axis].items(), strict=True):
            part = answer.sel(frequency=slice(0.7 * low, 1.3 * high)) * 1e3
            for i in range(part.sizes["drive"]):
                once = i == 0
                truth, fit = part["true"].isel(drive=i), part["identified"].isel(drive=i)
                panel.plot(
                    fit.real, fit.imag, color=figures.BLUE, label="identified" if once else None
                )
                panel.plot(
                    truth.real, truth.imag, "--", color=figures.ORANGE, linewidth=0.9,
                    label="true" if once else None,
                )  # fmt: skip
            panel.set_title(f"{self.axis}, {caption}")
            panel.set_aspect("equal", adjustable="datalim")
            panel.set_xlabel("real part of x/v [mm/V]")
            panel.locator_params(axis="x", nbins=6)
        panels[0].set_ylabel("imaginary part [mm/V]")
        figures.legend_below(figure, panels[0])
        return {"nyquist": figure}


@dataclass(frozen=True)
class Fit:
    """Parameters in the order of NAMES and the gain, half-widths, chi-square per degree."""

    answer: RealArray
    half_width: RealArray
    chi_square: float


def _current(p: Mapping[str, Any], s: Any) -> Any:
    """v_r/u: the current through the resistor, of the motion's back-EMF."""
    total = p["R"] + SERIES_RESISTANCE
    moved = lens({**p, "gain": 1.0}, s, total, p["Bl"])
    return (1 - p["Bl"] * s * moved) * (SERIES_RESISTANCE / total)


def _responses(parameters: Sequence[ActuatorParameters], frequency: RealArray) -> Any:
    return stack([specific_model(one) for one in parameters]).response(frequency)


def _worst_response(answer: Dataset) -> float:
    return float((abs(answer["identified"] - answer["true"]) / abs(answer["true"])).max())


def _lumped_b(run: Run) -> float:
    return float(run.data["estimate"].sel(parameter="b"))
