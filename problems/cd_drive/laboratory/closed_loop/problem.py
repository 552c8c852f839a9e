"""The arm's parasitic resonance, measured while the loop holds the focus (sections 4.3.2, 4.6.2).

Equation and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

import warnings
from dataclasses import dataclass, replace
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, Run, Study, problem, ref, solve
from workbench.arrays import RealArray
from workbench.bench.declare import Ref
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.heavy_types import Dataset, Figure
from workbench.identification import (
    IdentificationWarning,
    SteppedSine,
)
from workbench.simulation import linear

from ...drive.disc import Disc
from ...drive.photo_diodes import PITCH
from ...drive.plants import controller
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis, Values, red_book
from ...drive.two_masses import FITTED, Lumped, distributed, lens, lumped
from ..bench_setup import PERIOD, RATE
from ..experiment import Laboratory
from ..in_the_loop import (
    ROTATION,
    SETTLING,
    WOBBLE,
    chain,
    excitation,
    measure,
    neighbours_p,
    pooled,
)
from ..record import Record
from .figures import bode

LIMITS = {"m1": 0.008, "m2": 0.12, "k1": 0.015, "k2": 0.12, "b1": 0.06, "b2": 6.0}
"""Relative errors that pass at FINE steps, wider by the root of coarser ones. Of b2, a twentieth of
the damping, the experiment says no more than that it is small."""
FINE = 2.0
"""Frequency step of the thesis [Hz]."""
DOUBT = 1e-3
"""p-value of either test of the fit below which the model's order is not believed."""


def experiment(axis: str, drive: str, values: str, **_: Any) -> dict[str, Ref]:
    """The open-loop experiment on the same drive."""
    return {"open_loop": ref(f"cd/{axis}/open-loop", drive=drive, values=values)}


@problem(
    "cd/{axis}/closed-loop",
    axis=("focus", "radial"),
    needs=experiment,
    data=(*TABLES, "data/red_book.csv"),
)
def closed_loop(
    axis: Axis,
    open_loop: Run,
    drive: str = "CD1",
    disturbances: bool = True,
    mismatch: Annotated[float, Field(ge=0, lt=1)] = 0.0,
    step_hz: Annotated[float, Field(ge=1, le=100)] = FINE,
    values: Values = "printed",
) -> ClosedLoop:
    """Actuator measured in closed loop, and its two masses on two springs fitted (figure 4.5).

    A stepped sine adds to the controller's output from 100 to 2000 Hz; f_en/u_m, both measured,
    is the plant whatever the loop does. What the open-loop experiment found is distributed over
    m1, m2, k1, k2, b1, b2 so that the parasitic resonance fits.

    drive: "CD1" to "CD12", or "nominal". disturbances: the disc turns and wobbles by a fifth of
    what the Red Book allows; measurement noise is always there. mismatch of the arm's halves:
    above 0 there are two parasitic resonances, one more than the model has. step_hz: between
    frequencies. values: tables "printed" or "corrected".
    """
    frequency = np.arange(100.0, 2000.0 + step_hz / 2, step_hz)
    bench = Laboratory(axis, drive, values, mismatch=mismatch)
    known = Lumped.found(open_loop.data, lumped(bench.parameters).m)
    return ClosedLoop(bench, frequency, disturbances, known)


@dataclass(frozen=True, eq=False)
class ClosedLoop(Study):
    """A stepped sine in the loop of a drive on the bench, and the fit of its physical parameters.

    lumped: of the open-loop experiment; None: drawn about the drive's own.
    """

    bench: Laboratory
    frequency: RealArray
    disturbances: bool = True
    lumped: Lumped | None = None

    headline: ClassVar[str] = "chi_square"

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        bench, frequency = self.bench, self.frequency
        known = self.lumped or lumped(bench.parameters).drawn(context.rng)
        sine = excitation(bench, frequency)
        record = self._play(sine, int(context.rng.integers(2**31)))
        with warnings.catch_warnings(record=True) as heard:
            warnings.simplefilter("always", IdentificationWarning)
            raw = measure(record, self._error(record), sine, self.disturbances)
        to_volts = chain(bench, frequency)
        estimate = replace(
            raw,
            response=raw.response / to_volts[:, None, None],
            variance=raw.variance / abs(to_volts[:, None, None]) ** 2,
        )
        fit = distributed(estimate, known, bench.axis)
        solution = solve(fit, options=context.options)
        if solution.answer is None or solution.certificate is None:
            raise SolverError(f"the fit gave no answer: {solution.message}")
        found = solution.answer
        ratio, p = fit.chi_square(found)
        names = dict(zip(fit.names, found.tolist(), strict=True))
        model, unit = lens(names, 2j * np.pi * frequency, known.R, known.Bl), {"units": "m/V"}
        own = bench.parameters
        error = abs(record.x_cd - record.x)[round(SETTLING * RATE) :]
        signals = ("u", "u_m", "d1", "d2")  # the coil's current is not recorded
        misfit = estimate.response[:, 0, 0] - model
        in_step = neighbours_p(misfit / estimate.radius()[:, 0, 0], pooled(frequency))
        notes = [str(one.message) for one in heard] + fit.notes(found)
        if in_step < DOUBT:
            notes.append(
                f"neighbouring frequencies miss the model in the same direction (p = {in_step:.1g})"
                ": it lacks something, for instance order, and the intervals do not hold"
            )
        return xr.Dataset(
            {
                "response": ("frequency", estimate.response[:, 0, 0], unit),
                "radius": ("frequency", estimate.radius()[:, 0, 0], unit),
                "true": ("frequency", bench.actuator.response(frequency), unit),
                "fitted": ("frequency", model, unit),
                "excitation": ("frequency", sine.amplitude, {"units": "V"}),
                "value": ("parameter", [names[name] for name in FITTED]),
                "half_width": ("parameter", fit.intervals(found)[: len(FITTED)]),
                "table": ("parameter", [getattr(own, name) for name in FITTED]),
                "gain": names["gain"],
                "chi_square": ratio,
                "chi_square_p": p,
                "neighbours_p": in_step,
                "independent_p": raw.assumptions.independent,
                "unproven": len(solution.certificate.failures),
                "events": len(record.events),
                "saturated": sum(record.saturation[name] for name in signals),
                "largest_error": ((), float(error.max()), {"units": "m"}),
            },
            coords={
                "frequency": ("frequency", frequency, {"units": "Hz"}),
                "parameter": list(FITTED),
            },
            attrs={"notes": "\n".join(notes)},
        )

    def _error(self, record: Record) -> RealArray:
        """The error of linear diodes: the radial ones see a sine of known period, the pitch."""
        if self.bench.axis == "focus":
            return record.f_en
        peak = self.bench.parameters.K_optn * PITCH / (2 * np.pi)
        straight: RealArray = peak * np.arcsin(np.clip(record.f_en / peak, -1.0, 1.0))
        return straight

    def _play(self, sine: SteppedSine, seed: int) -> Record:
        axis = self.bench.axis
        size = WOBBLE * red_book(axis).deviation if self.disturbances else 0.0
        disc = Disc.along(axis, size, rotation=ROTATION)
        rest = np.zeros(round(SETTLING * RATE))
        played = np.concatenate([rest, *(signal for _, signal in sine)])
        law = linear(controller(axis), PERIOD)
        return self.bench.closed_loop(law, played, disc=disc, seed=seed)

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        axis = self.bench.axis
        found = [
            Check("loop", "times that it was lost or regained", *_none(answer["events"])),
            Check("saturation", "share of saturated samples", *_none(answer["saturated"])),
            Check(
                "linear range",
                "largest error [m]",
                float(answer["largest_error"]),
                ACCEPTABLE_ERROR[axis],
            ),
            Check("fit", "checks of the fit that fail", *_none(answer["unproven"])),
        ]
        if self.bench.mismatch > 0.0:
            return found  # the model's order is wrong on purpose: metrics and notes say so
        wider = max(1.0, float(np.mean(np.diff(self.frequency))) / FINE) ** 0.5
        return [
            *found,
            *(
                Check(name, "relative error", abs(error), LIMITS[name] * wider)
                for name, error in _errors(answer).items()
            ),
            Check(
                "order",
                "chi-square of the fit, its probability",
                1.0 - float(answer["chi_square_p"]),
                1.0 - DOUBT,
            ),
            Check(
                "smooth misfit",
                "residuals alike at neighbouring frequencies, its probability",
                1.0 - float(answer["neighbours_p"]),
                1.0 - DOUBT,
            ),
        ]

    def metrics(self, answer: Dataset) -> dict[str, float]:
        held = abs(answer["value"] - answer["table"]) <= answer["half_width"]
        size = abs(answer["true"])
        off = {name: abs(answer[name] - answer["true"]) for name in ("response", "fitted")}
        return {
            **{f"error_{name}": abs(error) for name, error in _errors(answer).items()},
            "covered": float(held.mean()),
            "covered_response": float((off["response"] <= answer["radius"]).mean()),
            "error_fitted": float((off["fitted"] / size).max()),
            "half_width_m2": float((answer["half_width"] / answer["value"]).sel(parameter="m2")),
            "chi_square": float(answer["chi_square"]),
            "chi_square_p": float(answer["chi_square_p"]),
            "neighbours_p": float(answer["neighbours_p"]),
            "wrong_order": float(min(answer["chi_square_p"], answer["neighbours_p"]) < DOUBT),
            "independent_p": float(answer["independent_p"]),
            "gain": float(answer["gain"]),
            "radius_median": float((answer["radius"] / size).median()),
            "largest_error_um": 1e6 * float(answer["largest_error"]),
        }

    def tables(self, answer: Dataset) -> dict[str, str]:
        lines = ["| parameter | fitted | 99 %, +- | true | error |", "| --- |" + " ---: |" * 4]
        for name, error in _errors(answer).items():
            one = answer.sel(parameter=name)
            value, half, true = (float(one[key]) for key in ("value", "half_width", "table"))
            lines.append(f"| {name} | {value:.4g} | {half:.2g} | {true:.4g} | {error:+.2%} |")
        notes = [f"- {note}" for note in answer.attrs["notes"].splitlines()]
        return {"parameters": "\n".join([*lines, "", *notes]) + "\n"}

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        return {"figure-4-5": bode(answer, f"{self.bench.drive}, {self.bench.axis}")}


def _errors(answer: Dataset) -> dict[str, float]:
    errors = answer["value"] / answer["table"] - 1
    return dict(zip(FITTED, errors.values.tolist(), strict=True))


def _none(value: Any) -> tuple[float, float]:
    """A value that must be zero, and that limit."""
    return float(value), 0.0
