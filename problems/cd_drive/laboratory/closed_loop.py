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

from workbench import Check, Run, figures, problem, ref, solve
from workbench.arrays import RealArray
from workbench.bench.declare import Ref
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.heavy_types import DataArray, Dataset, Figure
from workbench.identification import IdentificationWarning, PeriodicResponse, SteppedSine
from workbench.simulation import linear
from workbench.study import Study, check, figure, metric, table
from workbench.tables import markdown

from ..drive.disc import Disc
from ..drive.photo_diodes import TRACK_PITCH
from ..drive.plants import controller
from ..drive.red_book import ACCEPTABLE_ERROR
from ..drive.shared_parameters import TABLES
from ..drive.tables import Axis, Values, red_book
from ..drive.two_masses import FITTED, Lumped, lens, lumped, two_mass_fit
from .bench_setup import PERIOD, RATE
from .experiment import Laboratory
from .in_the_loop import (
    DISC_SHARE,
    LOOP_SETTLING,
    ROTATION,
    excitation,
    measure,
    measurement_chain,
    neighbours_p,
    pool_steps,
)
from .record import Record

LIMITS = {"m1": 0.008, "m2": 0.12, "k1": 0.015, "k2": 0.12, "b1": 0.06, "b2": 6.0}
"""Largest relative errors at frequency steps of FINE_STEP; they grow with the square root of the
step. b2 is a twentieth of the damping: the experiment tells no more than that it is small."""
FINE_STEP = 2.0
"""Frequency step of the thesis [Hz]."""
LEAST_P = 1e-3
"""p-value of either test of the fit below which the model's order is rejected."""
RECORDED = ("u", "u_m", "d1", "d2")
"""Signals whose converters must not saturate; the coil's current is not recorded."""


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
    step_hz: Annotated[float, Field(ge=1, le=100)] = FINE_STEP,
    values: Values = "printed",
) -> ClosedLoop:
    """Actuator measured in closed loop, and its two masses on two springs fitted (figure 4.5).

    A stepped sine from 100 to 2000 Hz is added to the controller's output. The ratio f_en/u_m of
    two measured signals is the plant's response, whatever the loop does. The lumped parameters of
    the open-loop experiment are distributed over m1, m2, k1, k2, b1, b2 so that the parasitic
    resonance fits.

    drive: "CD1" to "CD12", or "nominal". disturbances: the disc turns and wobbles by a fifth of
    what the Red Book allows; there is always measurement noise. mismatch of the arm's halves:
    above 0 there are two parasitic resonances, one more than the model has. step_hz: distance of
    the frequencies [Hz]. values: tables "printed" or "corrected".
    """
    frequency = np.arange(100.0, 2000.0 + step_hz / 2, step_hz)
    bench = Laboratory(axis, drive, values, mismatch=mismatch)
    known = Lumped.from_open_loop(open_loop.answer, lumped(bench.parameters).m)
    return ClosedLoop(bench, frequency, disturbances, known)


@dataclass(frozen=True, eq=False)
class ClosedLoop(Study):
    """A stepped sine in the loop of a drive on the bench, and the fit of its physical parameters.

    grid: frequencies [Hz] (F,). lumped: parameters from the open-loop experiment; None draws them
    about the drive's own.
    """

    bench: Laboratory
    grid: RealArray
    disturbances: bool = True
    lumped: Lumped | None = None

    headline: ClassVar[str] = "chi_square"

    @property
    def quantifier(self) -> str:
        return "for this one drive, in one simulated experiment"

    @property
    def limits(self) -> dict[str, float]:
        """Largest relative errors of the parameters, given the step of the frequencies."""
        wider = max(1.0, float(np.mean(np.diff(self.grid))) / FINE_STEP) ** 0.5
        return {name: limit * wider for name, limit in LIMITS.items()}

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        bench = self.bench
        known = self.lumped or lumped(bench.parameters).drawn(context.rng)
        sine = excitation(bench, self.grid)
        record = self._play(sine, int(context.rng.integers(2**31)))
        raw, notes = self._measure(record, sine)
        to_volts = measurement_chain(bench, self.grid)[:, None, None]
        variance = raw.variance / abs(to_volts) ** 2
        estimate = replace(raw, response=raw.response / to_volts, variance=variance)
        response, radius = estimate.response[:, 0, 0], estimate.radius()[:, 0, 0]

        fit = two_mass_fit(estimate, known, bench.axis)
        solution = solve(fit, options=context.options)
        if solution.answer is None or solution.certificate is None:
            raise SolverError(f"the fit gave no answer: {solution.message}")
        found = solution.answer
        values = dict(zip(fit.names, found.tolist(), strict=True))
        model = lens(values, 2j * np.pi * self.grid, known.R, known.Bl)
        chi_square, p = fit.chi_square(found)
        in_step = neighbours_p((response - model) / radius, pool_steps(self.grid))
        notes += fit.notes(found)
        if in_step < LEAST_P:
            notes.append(
                f"neighbouring frequencies miss the model in the same direction (p = {in_step:.1g})"
                ": it lacks something, for instance order, and the intervals do not hold"
            )
        unit, error = {"units": "m/V"}, abs(record.x_cd - record.x)[round(LOOP_SETTLING * RATE) :]
        return xr.Dataset(
            {
                "response": ("frequency", response, unit),
                "radius": ("frequency", radius, unit),
                "true": ("frequency", bench.actuator.response(self.grid), unit),
                "fitted": ("frequency", model, unit),
                "excitation": ("frequency", sine.amplitude, {"units": "V"}),
                "value": ("parameter", [values[name] for name in FITTED]),
                "half_width": ("parameter", fit.intervals(found)[: len(FITTED)]),
                "table": ("parameter", [getattr(bench.parameters, name) for name in FITTED]),
                "gain": values["gain"],
                "chi_square": chi_square,
                "chi_square_p": p,
                "neighbours_p": in_step,
                "independent_p": raw.assumptions.independent,
                "unproven": len(solution.certificate.failures),
                "events": len(record.events),
                "saturated": sum(record.saturation[name] for name in RECORDED),
                "largest_error": ((), float(error.max()), {"units": "m"}),
            },
            {"frequency": ("frequency", self.grid, {"units": "Hz"}), "parameter": list(FITTED)},
            {"notes": "\n".join(notes)},
        )

    def _play(self, sine: SteppedSine, seed: int) -> Record:
        """The signals of the experiment: the loop settles, then the sine is played."""
        axis = self.bench.axis
        size = DISC_SHARE * red_book(axis).deviation if self.disturbances else 0.0
        disc = Disc.along(axis, size, rotation=ROTATION)
        rest = np.zeros(round(LOOP_SETTLING * RATE))
        played = np.concatenate([rest, *(signal for _, signal in sine)])
        law = linear(controller(axis), PERIOD)
        return self.bench.closed_loop(law, played, disc=disc, seed=seed)

    def _measure(self, record: Record, sine: SteppedSine) -> tuple[PeriodicResponse, list[str]]:
        """f_en/u_m with its region, and the warnings of its estimation."""
        with warnings.catch_warnings(record=True) as heard:
            warnings.simplefilter("always", IdentificationWarning)
            raw = measure(record, self._error(record), sine, self.disturbances)
        return raw, [str(one.message) for one in heard]

    def _error(self, record: Record) -> RealArray:
        """The error of linear diodes: the radial ones see a sine whose period is the pitch."""
        if self.bench.axis == "focus":
            return record.f_en
        peak = self.bench.parameters.K_optn * TRACK_PITCH / (2 * np.pi)
        straight: RealArray = peak * np.arcsin(np.clip(record.f_en / peak, -1.0, 1.0))
        return straight

    @check()
    def experiment(self, answer: Dataset) -> list[Check]:
        """The loop held, in the linear range of diodes and converters, and the fit is proven."""
        acceptable, error = ACCEPTABLE_ERROR[self.bench.axis], float(answer["largest_error"])
        lost, saturated, failed = (
            float(answer[name]) for name in ("events", "saturated", "unproven")
        )
        return [
            Check("loop", "times that it was lost or regained", lost, 0.0),
            Check("saturation", "share of saturated samples", saturated, 0.0),
            Check("linear range", "largest error [m]", error, acceptable),
            Check("fit", "checks of the fit that fail", failed, 0.0),
        ]

    @check("{parameter}", each="parameter", at_most=lambda self: self.limits)
    def parameters_close(self, answer: Dataset) -> DataArray | None:
        """relative error"""
        return abs(_errors(answer)) if self._order_is_right else None

    @check("order", at_most=1.0 - LEAST_P)
    def order(self, chi_square_p: DataArray) -> DataArray | None:
        """chi-square of the fit, its probability"""
        return 1.0 - chi_square_p if self._order_is_right else None

    @check("smooth misfit", at_most=1.0 - LEAST_P)
    def smooth_misfit(self, neighbours_p: DataArray) -> DataArray | None:
        """residuals alike at neighbouring frequencies, its probability"""
        return 1.0 - neighbours_p if self._order_is_right else None

    @property
    def _order_is_right(self) -> bool:
        """Whether the model has the order of the bench; if not, metrics and notes tell it."""
        return self.bench.mismatch <= 0.0

    errors = metric("error_{parameter}", lambda answer: abs(_errors(answer)))

    @metric
    def numbers(self, answer: Dataset) -> dict[str, Any]:
        names = ("chi_square", "chi_square_p", "neighbours_p", "independent_p", "gain")
        held = abs(answer["value"] - answer["table"]) <= answer["half_width"]
        true, size, radius = answer["true"], abs(answer["true"]), answer["radius"]
        return {
            "covered": held.mean(),
            "covered_response": (abs(answer["response"] - true) <= radius).mean(),
            "error_fitted": (abs(answer["fitted"] - true) / size).max(),
            "half_width_m2": (answer["half_width"] / answer["value"]).sel(parameter="m2"),
            **{name: answer[name] for name in names},
            "wrong_order": min(answer["chi_square_p"], answer["neighbours_p"]) < LEAST_P,
            "radius_median": (radius / size).median(),
            "largest_error_um": 1e6 * answer["largest_error"],
        }

    @table
    def parameters(self, answer: Dataset) -> str:
        heads, rows = ["parameter", "fitted", "99 %, +-", "true", "error"], []
        for name, error in zip(FITTED, _errors(answer).values, strict=True):
            one = answer.sel(parameter=name)
            value, half, true = (float(one[key]) for key in ("value", "half_width", "table"))
            rows.append([name, f"{value:.4g}", f"{half:.2g}", f"{true:.4g}", f"{error:+.2%}"])
        notes = [f"- {note}" for note in answer.attrs["notes"].splitlines()]
        return "\n".join([markdown(heads, rows), *notes]) + "\n"

    @figure
    def figure_4_5(self, answer: Dataset) -> Figure:
        return _bode(answer, f"{self.bench.drive}, {self.bench.axis}")


def _errors(answer: Dataset) -> DataArray:
    """Relative errors of the fitted parameters."""
    return answer["value"] / answer["table"] - 1


def _bode(answer: Dataset, title: str) -> Figure:
    """Magnitude, phase and error: measured with the 99 % region, fitted, true."""
    drawn, (magnitude, phase, error) = figures.axes(3, 1, size=(7.0, 8.0), sharex=True)
    frequency, measured = answer["frequency"].values, answer["response"].values
    fitted, true, radius = (answer[name].values for name in ("fitted", "true", "radius"))
    size = abs(measured)
    share = np.minimum(radius / size, 1.0)
    lead = np.degrees(np.arcsin(share))
    dots: Any = {"marker": ".", "markersize": 2.5, "linestyle": "none", "color": figures.BLUE}
    region: Any = {"color": figures.SKY, "alpha": 0.4, "linewidth": 0.0}
    # The measured phase is unwrapped about the fitted one: noise then cannot make it jump.
    around = figures.phase(fitted)
    measured_phase = around + np.degrees(np.angle(measured / fitted))

    low, high = size * (1 - 0.999 * share), size * (1 + share)
    magnitude.fill_between(frequency, low, high, label="99 % region", **region)
    magnitude.plot(frequency, size, label="measured", **dots)
    phase.fill_between(frequency, measured_phase - lead, measured_phase + lead, **region)
    phase.plot(frequency, measured_phase, **dots)
    lines = (("true", true, figures.BLACK, "--"), ("fitted", fitted, figures.ORANGE, "-"))
    for name, response, color, style in lines:
        own = around + np.degrees(np.angle(response / fitted))
        magnitude.plot(frequency, abs(response), style, color=color, label=name)
        phase.plot(frequency, own, style, color=color)
        error.plot(frequency, abs(response - measured) / radius, ".", markersize=2.5, color=color)
    error.axhline(1.0, color=figures.BLACK, linewidth=0.8)
    magnitude.set_ylim(0.5 * abs(true).min(), 2.0 * abs(true).max())
    around_true = around + np.degrees(np.angle(true / fitted))
    phase.set_ylim(around_true.min() - 40.0, around_true.max() + 40.0)
    figures.label(magnitude, y="x / coil voltage [m/V]", title=title, log="y")
    figures.label(phase, y="phase [deg]")
    figures.label(error, "frequency [Hz]", "distance / radius [1]", log="x")
    ticks = [100, 200, 500, 1000, 2000]
    error.set_xticks(ticks, [str(tick) for tick in ticks])
    error.minorticks_off()
    error.set_ylim(0.0, None)
    figures.legend_below(drawn, magnitude)
    return drawn
