"""The arm's parasitic resonance, measured while the loop holds the focus (sections 4.3.2, 4.6.2).

Equation and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Annotated, Any, ClassVar

import numpy as np
from pydantic import Field
from scipy import stats
from scipy.ndimage import uniform_filter1d

from workbench import Check, Study, problem, solve
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.identification import (
    IdentificationWarning,
    MeasuredResponse,
    Parameter,
    ParameterFit,
    PeriodicResponse,
    SteppedSine,
    from_periods,
    sine_fit,
)
from workbench.simulation import linear, sampled

from .actuator import SERIES_RESISTANCE, Complex, Real
from .bench_setup import PERIOD, RATE
from .disc import Disc
from .drives import ANTIALIASING, controller, nominal_parameters
from .laboratory import Laboratory
from .photo_diodes import PITCH
from .record import Record
from .red_book import ACCEPTABLE_ERROR
from .sets import TABLES
from .tables import Axis, Drive, Values, red_book

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

PERIODS, USED = 20, 10
"""Played at each frequency, and the last of them that are evaluated (section 4.6.2)."""
SETTLING = 0.5
"""Time [s] for the disc to run up and the loop to settle."""
SWING = {"focus": 1.0e-6, "radial": 0.05e-6}
"""Amplitude of the error that the excitation aims at [m]: half the focus diodes' linear range, and
where the sine of the radial ones has lost half a per cent."""
DRIVE = 4.0
"""Largest excitation, and share of it in u [V]; the rest up to 10 V is for the loop's noise."""
WOBBLE, ROTATION, HARMONICS = 0.2, 6.0, 3
"""The disc's deviation as a share of the Red Book's, its rotation [Hz], harmonics taken out."""
POOL = 50.0
"""Band [Hz] over which the colour of the noise, and what a fit missed, is alike."""
FITTED = ("m1", "m2", "k1", "k2", "b1", "b2")
LIMITS = {"m1": 0.008, "m2": 0.12, "k1": 0.015, "k2": 0.12, "b1": 0.06, "b2": 6.0}
"""Relative errors that pass at FINE steps, wider by the root of coarser ones. Of b2, a twentieth of
the damping, the experiment says no more than that it is small."""
FINE = 2.0
"""Frequency step of the thesis [Hz]."""
DOUBT = 1e-3
"""p-value of either test of the fit below which the model's order is not believed."""


@dataclass(frozen=True)
class Lumped:
    """What is known before the loop is closed.

    Resistance R of the whole circuit [ohm] and force factor Bl [N/A]; spring k [N/m], damper
    b [N s/m] and mass m [kg] that the first resonance shows; gain: that of the optics over the one
    assumed. deviation: relative standard deviations of k, b, m and gain.
    """

    R: float
    Bl: float
    k: float
    b: float
    m: float
    gain: float = 1.0
    deviation: tuple[float, float, float, float] = (0.003, 0.015, 0.001, 0.01)

    def drawn(self, rng: np.random.Generator) -> Lumped:
        """k, b and m as an experiment of this accuracy would find them."""
        k, b, m = (1 + np.array(self.deviation[:3]) * rng.standard_normal(3)).tolist()
        return replace(self, k=k * self.k, b=b * self.b, m=m * self.m)


def lumped(drive: Drive) -> Lumped:
    """What an experiment near the first resonance sees of the fourth-order model."""
    k, b, m, _ = _seen({name: getattr(drive, name) for name in FITTED} | {"gain": 1.0})
    return Lumped(drive.R + SERIES_RESISTANCE, drive.Bl, k, b, m)


def _seen(p: Mapping[str, Any]) -> list[Any]:
    """k, b, m at rest, where the arm follows the lens by rho = k2 / (k1 + k2); and the gain."""
    rho = p["k2"] / (p["k1"] + p["k2"])
    k = p["k1"] * p["k2"] / (p["k1"] + p["k2"])
    b = p["b1"] * rho**2 + p["b2"] * (1 - rho) ** 2
    return [k, b, p["m1"] + p["m2"] * rho**2, p["gain"]]


@dataclass(frozen=True)
class Known:
    """The lumped values as data of the fit, weighted by their accuracy."""

    lumped: Lumped
    name: ClassVar[str] = "lumped values"
    degrees: ClassVar[float] = np.inf
    weighted: ClassVar[bool] = True
    count: ClassVar[int] = 4
    size: ClassVar[float] = 0.0

    def _errors(self, values: Mapping[str, Any]) -> list[Any]:
        one = self.lumped
        known = zip(_seen(values), (one.k, one.b, one.m, one.gain), one.deviation, strict=True)
        return [(value / given - 1) / deviation for value, given, deviation in known]

    def residuals(self, values: Mapping[str, float]) -> Real:
        return np.array(self._errors(values))

    def expression(self, names: Sequence[str], vector: Any) -> Any:
        import casadi as ca

        return ca.vertcat(*self._errors({name: vector[i] for i, name in enumerate(names)}))


def lens(p: Mapping[str, Any], s: Any, R: float, Bl: float) -> Any:
    """x / coil voltage [m/V] of the specific model (Table 3.2), times the gain."""
    link, arm = p["b2"] * s + p["k2"], p["m2"] * s**2 + (p["b1"] + p["b2"]) * s + p["k1"] + p["k2"]
    force = p["m1"] * s**2 + link - link**2 / arm + s * (Bl**2 / R)
    return p["gain"] * (Bl / R) / force


@problem("cd/{axis}/closed-loop", axis=("focus", "radial"), data=(*TABLES, "data/red_book.csv"))
def closed_loop(
    axis: Axis,
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
    return ClosedLoop(bench, frequency, disturbances)


@dataclass(frozen=True, eq=False)
class ClosedLoop(Study):
    """A stepped sine in the loop of a drive on the bench, and the fit of its physical parameters.

    lumped: of the open-loop experiment; None: drawn about the drive's own.
    """

    bench: Laboratory
    frequency: Real
    disturbances: bool = True
    lumped: Lumped | None = None

    headline: ClassVar[str] = "chi_square"

    def compute(self, context: Context) -> xr.Dataset:
        import xarray as xr

        bench, frequency = self.bench, self.frequency
        known = self.lumped or lumped(bench.parameters).drawn(context.rng)
        sine = excitation(bench, frequency)
        record = self._play(sine, int(context.rng.integers(2**31)))
        with warnings.catch_warnings(record=True) as heard:
            warnings.simplefilter("always", IdentificationWarning)
            raw = measure(record, self._error(record), sine, self.disturbances)
        chain = _chain(bench, frequency)
        estimate = replace(
            raw,
            response=raw.response / chain[:, None, None],
            variance=raw.variance / abs(chain[:, None, None]) ** 2,
        )
        fit = _fit(estimate, known, bench)
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
        in_step = neighbours_p(misfit / estimate.radius()[:, 0, 0], _pooled(frequency))
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

    def _error(self, record: Record) -> Real:
        """The error of linear diodes: the radial ones see a sine of known period, the pitch."""
        if self.bench.axis == "focus":
            return record.f_en
        peak = self.bench.parameters.K_optn * PITCH / (2 * np.pi)
        straight: Real = peak * np.arcsin(np.clip(record.f_en / peak, -1.0, 1.0))
        return straight

    def _play(self, sine: SteppedSine, seed: int) -> Record:
        axis = self.bench.axis
        size = (WOBBLE * red_book(axis).deviation,) if self.disturbances else ()
        disc = Disc(
            warp=size if axis == "focus" else (),
            eccentricity=size if axis == "radial" else (),
            rotation=ROTATION,
        )
        rest = np.zeros(round(SETTLING * RATE))
        played = np.concatenate([rest, *(signal for _, signal in sine)])
        law = linear(controller(axis), PERIOD)
        return self.bench.closed_loop(law, played, disc=disc, seed=seed)

    def checks(self, answer: xr.Dataset, tolerance: float) -> list[Check]:
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

    def metrics(self, answer: xr.Dataset) -> dict[str, float]:
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

    def tables(self, answer: xr.Dataset) -> dict[str, str]:
        lines = ["| parameter | fitted | 99 %, +- | true | error |", "| --- |" + " ---: |" * 4]
        for name, error in _errors(answer).items():
            one = answer.sel(parameter=name)
            value, half, true = (float(one[key]) for key in ("value", "half_width", "table"))
            lines.append(f"| {name} | {value:.4g} | {half:.2g} | {true:.4g} | {error:+.2%} |")
        notes = [f"- {note}" for note in answer.attrs["notes"].splitlines()]
        return {"parameters": "\n".join([*lines, "", *notes]) + "\n"}

    def figures(self, answer: xr.Dataset) -> dict[str, Figure]:
        from .closed_loop_figures import bode

        return {"figure-4-5": bode(answer, f"{self.bench.drive}, {self.bench.axis}")}


def excitation(bench: Laboratory, frequency: Real) -> SteppedSine:
    """The stepped sine whose amplitudes [V] swing the error by SWING, or u by DRIVE at most."""
    import control

    law = control.sample_system(control.ss(controller(bench.axis)), PERIOD, "bilinear")
    plant = -bench.response(frequency)["f_en"]  # the sign of eq. 3.16
    gain = law(np.exp(2j * np.pi * frequency * PERIOD), squeeze=False)[0, 0]
    sensitivity = 1 / (1 + plant * gain)
    wanted = SWING[bench.axis] * bench.parameters.K_optn / abs(plant * sensitivity)
    allowed = DRIVE / np.maximum(1.0, abs(sensitivity))
    return SteppedSine(frequency, PERIODS, np.minimum(wanted, allowed), RATE)


def measure(record: Record, error: Real, sine: SteppedSine, turning: bool) -> PeriodicResponse:
    """f_en/u_m with its region, errors in variables; without the harmonics of a disc's rotation.

    Those are coherent: the scatter of ten periods of a sine says little of them. Nor are successive
    periods independent, so `colour` corrects the variance of their mean.
    """
    start = round(SETTLING * RATE)
    signals = np.stack([record.u_m, error])[:, start:]
    if turning:
        turns = 2 * np.pi * ROTATION * np.outer(np.arange(1, HARMONICS + 1), record.time[start:])
        waves = np.vstack([np.ones((1, turns.shape[1])), np.cos(turns), np.sin(turns)])
        signals = signals - np.linalg.solve(waves @ waves.T, waves @ signals.T).T @ waves
    ends = np.cumsum(sine.lengths)
    parts = np.split(signals, ends[:-1], axis=1)
    pairs = [
        sine_fit(part, RATE, frequency)[:, PERIODS - USED : PERIODS, 0]
        for part, frequency in zip(parts, sine.frequencies, strict=True)
    ]
    u, y = np.moveaxis(np.array(pairs), 1, 0)
    estimate = from_periods(sine.frequencies, u, y)
    scatter = y - estimate.response[:, 0] * u
    ratio = uniform_filter1d(colour(scatter), _pooled(sine.frequencies), mode="nearest")
    return replace(estimate, variance=estimate.variance * ratio[:, None, None])


def colour(scatter: Complex) -> Real:
    """Noise at a frequency over what single periods see about it; scatter (F, M), ratio (F,).

    One period resolves no less than an octave, their mean a tenth of it: where the noise is not
    white, and where a period's end is the next one's start, its variance is another. It is taken
    from the lines next to the excited one, f (1 +- 1 / M).
    """
    periods = scatter.shape[1]
    beside = np.mean(abs(np.fft.fft(scatter, axis=1)[:, [1, -1]]) ** 2, axis=1) / periods
    ratio: Real = beside / (np.sum(abs(scatter) ** 2, axis=1) / (periods - 1))
    return ratio


def neighbours_p(residual: Complex, lags: int) -> float:
    """p-value of residuals (F,) that resemble their neighbours, up to `lags` away, by chance.

    Every frequency has noise of its own. A resonance that the model lacks leaves a bulge that is
    lost in the chi-square of all frequencies. Directions alone count, not how large a noise was.
    """
    turn = residual / abs(residual)
    products = [np.sum(turn[lag:] * turn[:-lag].conj()).real for lag in range(1, lags + 1)]
    pairs = np.sum(len(residual) - np.arange(1, lags + 1))
    return float(stats.norm.sf(np.sum(products) / np.sqrt(pairs / 2)))


def _pooled(frequency: Real) -> int:
    """Steps of frequency in POOL."""
    return max(1, round(POOL / float(np.mean(np.diff(frequency)))))


def _chain(bench: Laboratory, frequency: Real) -> Complex:
    """What stands between x / coil voltage and f_en / u_m: gains, hold, delay and filters.

    u_m is sampled behind its filter, exactly; what the lens aliases is below 1e-4.
    """
    import control

    s = 2j * np.pi * frequency
    hold = (1 - np.exp(-s * PERIOD)) / (s * PERIOD) * np.exp(-s * PERIOD * bench.delay)
    control_signal = sampled(control.ss(-ANTIALIASING, ANTIALIASING, 1.0, 0.0), PERIOD, bench.delay)
    u_m = control_signal(np.exp(s * PERIOD), squeeze=False)[0, 0]
    gain = -bench.parameters.K_optn * bench.coil_gain
    chain: Complex = gain * hold * ANTIALIASING / (s + ANTIALIASING) / u_m
    return chain


def _fit(estimate: PeriodicResponse, known: Lumped, bench: Laboratory) -> ParameterFit:
    """Six parameters and the gain, started at the nominal drive's.

    b2 may become negative: a bound at zero would hide how little the data say of it.
    """
    arm = nominal_parameters(bench.axis)
    start = {name: getattr(arm, name) for name in FITTED} | {"gain": known.gain}
    parameters = {name: Parameter(value, value / 5, value * 5) for name, value in start.items()}
    parameters["b2"] = Parameter(arm.b2, -20 * arm.b2, 20 * arm.b2)
    measured = MeasuredResponse.of(lambda p, s: lens(p, s, known.R, known.Bl), estimate)
    return ParameterFit([measured, Known(known)], parameters)


def _errors(answer: xr.Dataset) -> dict[str, float]:
    errors = answer["value"] / answer["table"] - 1
    return dict(zip(FITTED, errors.values.tolist(), strict=True))


def _none(value: Any) -> tuple[float, float]:
    """A value that must be zero, and that limit."""
    return float(value), 0.0
