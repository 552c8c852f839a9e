"""Open-loop identification: the actuator's parameters from the current in its coil (section 4.3.1).

A resistor r in series with the coil measures the current, and the back-EMF makes the current tell
of the motion: v_r / u has a peak at the first resonance (eq. 4.17). No optics take part.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import Check, Study, figures, problem, solve
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.heavy_types import Dataset, Figure
from workbench.identification import (
    FittedParameter,
    MeasuredResponse,
    ParameterFit,
    SteppedSine,
    from_periods,
    sine_fit,
)

from ..drive.actuator import SERIES_RESISTANCE
from ..drive.shared_parameters import TABLES
from ..drive.tables import Axis, Values
from ..drive.two_masses import lumped
from .bench_setup import RATE
from .experiment import Laboratory

PERIODS, DISCARDED = 20, 10
"""Played and left out at each frequency (section 4.6.1)."""
HIGHEST = {"focus": 50.0, "radial": 100.0}
"""Where the sweep from 10 Hz ends [Hz] (section 4.6.1)."""
PARAMETERS = {"R": "ohm", "Bl": "N/A", "k": "N/m", "b": "N s/m"}
WANTED = {"R": 0.01, "Bl": 0.01, "k": 0.01, "b": 0.05}
"""Largest relative errors let pass; the thesis states accuracies of 1 %, and 5 % of b."""
CONFIDENCE = 0.99


@problem("cd/{axis}/open-loop", axis=("focus", "radial"), data=TABLES)
def open_loop(
    axis: Axis,
    drive: str = "CD1",
    step: Annotated[float, Field(gt=0, le=5)] = 0.1,
    amplitude: Annotated[float, Field(gt=0, le=10)] = 1.0,
    values: Values = "printed",
) -> OpenLoop:
    """R, Bl, k and b of a drive from its coil's current, by stepped sine (figure 4.4).

    v_r/u is measured from 10 to 50 Hz (focus) or 100 Hz (radial), 20 periods at each frequency of
    which the last 10 count, and fitted by the lumped model of eq. 4.17, the mass taken as known:
    physical parameters directly, and by eq. 4.20-4.23 from the rational structure of eq. 4.19.
    Judged against the lumped fit to the noise-free response of the same drive.

    drive: CD1 ... CD12. step [Hz] of the frequencies. amplitude [V] of the excitation. values:
    tables "printed" or "corrected".
    """
    return OpenLoop(Laboratory(axis, drive, values), step, amplitude)


@dataclass(frozen=True, eq=False)
class OpenLoop(Study):
    """A stepped-sine experiment on the coil of a drive, and the lumped fits to it."""

    laboratory: Laboratory
    step: float
    amplitude: float

    headline: ClassVar[str] = "error_b"

    @property
    def mass(self) -> float:
        """m_eff [kg]: both masses as the first resonance sees them, taken as known."""
        return lumped(self.laboratory.parameters).m

    @property
    def frequency(self) -> np.ndarray:
        count = round((HIGHEST[self.laboratory.axis] - 10) / self.step)
        return 10 + self.step * np.arange(count + 1)

    def compute(self, context: Context) -> Dataset:
        import xarray as xr

        laboratory, frequency = self.laboratory, self.frequency
        sweep = SteppedSine(frequency, PERIODS, self.amplitude, RATE)
        record = laboratory.coil(
            np.concatenate([samples for _, samples in sweep]), int(context.rng.integers(2**31))
        )
        ends = np.cumsum(sweep.lengths)
        parts = [slice(end - n, end) for n, end in zip(sweep.lengths, ends, strict=True)]
        # Both channels pass the same hold, delay and filter, which cancel in their ratio.
        u, v = (
            np.array(
                [
                    sine_fit(signal[part], RATE, f)[:PERIODS, 0]
                    for part, f in zip(parts, frequency, strict=True)
                ]
            )
            for signal in (record.u_m, record.v_r / laboratory.coil_gain)
        )
        raw = from_periods(frequency, u, v, transients=DISCARDED)
        settled = without_transient(v, frequency, self._pole(raw.response[:, 0, 0]), DISCARDED)
        estimate = from_periods(frequency, u, settled, transients=DISCARDED)
        # One amplitude of the transient was estimated beside the mean of the periods.
        spent = (PERIODS - DISCARDED - 1) / (PERIODS - DISCARDED - 2)
        response, variance = estimate.response[:, 0, 0], spent * estimate.variance[:, 0, 0]
        degrees = estimate.degrees - 2
        channels = laboratory.response(frequency)
        exact = channels["v_r"] / channels["u_m"] / laboratory.coil_gain

        found, half_width, chi = self._fit(response, variance, degrees)
        truth, _, _ = self._fit(exact, variance, np.inf)
        names = list(PARAMETERS)
        data = {
            "response": (("frequency",), response, {"units": "V/V", "long_name": "v_r/u measured"}),
            "variance": (("frequency",), variance, {"units": "1", "degrees": degrees}),
            "radius": (("frequency",), _radius(variance, degrees), {"units": "V/V"}),
            "exact": (("frequency",), exact, {"units": "V/V", "long_name": "v_r/u noise-free"}),
            "periods": (("frequency", "period"), (v / u)[:, DISCARDED:], {"units": "V/V"}),
            "estimate": (("parameter",), found),
            "half_width": (("parameter",), half_width, {"long_name": "of the 99 % interval"}),
            "by_equations": (("parameter",), self._by_equations(response, variance, degrees)),
            "truth": (
                ("parameter",),
                truth,
                {"long_name": "lumped fit to the noise-free response"},
            ),
            "table": (("parameter",), self._table(), {"long_name": "printed table, b = b1 + b2"}),
            "chi_square": ((), chi, {"long_name": "of the fit, per degree of freedom"}),
            "assumption_p": (
                ("assumption",),
                [getattr(estimate.assumptions, name) for name in ASSUMPTIONS],
            ),
            "transient_p": ((), raw.assumptions.independent),
            "saturation": ((), max(record.saturation.values()), {"units": "1"}),
        }
        coords = {
            "frequency": ("frequency", frequency, {"units": "Hz", "long_name": "frequency"}),
            "parameter": names,
            "unit": ("parameter", list(PARAMETERS.values())),
            "assumption": list(ASSUMPTIONS),
        }
        return xr.Dataset(data, coords=coords)

    # --- fits -----------------------------------------------------------------------------------

    def _fit(
        self, response: np.ndarray, variance: np.ndarray | None, degrees: float
    ) -> tuple[np.ndarray, np.ndarray, float]:
        """R, Bl, k, b, the half-widths of their intervals, and chi-square per degree of freedom."""
        resonance = 30.0 if self.laboratory.axis == "focus" else 50.0
        start = {
            "R": FittedParameter(15.0, 1.0, 100.0),
            "Bl": FittedParameter(0.2, 0.01, 2.0),
            "k": FittedParameter(self.mass * (2 * np.pi * resonance) ** 2, 1.0, 1e3),
            "b": FittedParameter(0.01, 1e-4, 1.0),
        }
        measured = MeasuredResponse(
            self._model, self.frequency, response, variance, degrees, name="v_r/u"
        )
        program = ParameterFit([measured], start)
        values = _solved(program)
        return values, _half_widths(program, values), program.chi_square(values)[0]

    def _model(self, p: Any, s: Any) -> Any:
        """Equation 4.17."""
        m, r = self.mass, SERIES_RESISTANCE
        total = p["R"] + r
        held = m * s**2 + p["b"] * s + p["k"]
        return r / total * held / (held + p["Bl"] ** 2 / total * s)

    def _by_equations(
        self, response: np.ndarray, variance: np.ndarray, degrees: float
    ) -> np.ndarray:
        """R, Bl, k, b by equations 4.20-4.23 from the fitted coefficients of eq. 4.19."""

        def rational(p: Any, s: Any) -> Any:
            held = s**2 + p["a1"] * s + p["a2"]
            return p["A"] * held / (s**2 + p["b1"] * s + p["a2"])

        resonance = (2 * np.pi * (30.0 if self.laboratory.axis == "focus" else 50.0)) ** 2
        start = {
            "A": FittedParameter(0.07, 1e-3, 1.0),
            "a1": FittedParameter(15.0, 0.1, 1e3),
            "a2": FittedParameter(resonance, 0.1 * resonance, 10 * resonance),
            "b1": FittedParameter(20.0, 0.1, 1e3),
        }
        measured = MeasuredResponse(rational, self.frequency, response, variance, degrees)
        A, a1, a2, b1 = _solved(ParameterFit([measured], start))
        m, r = self.mass, SERIES_RESISTANCE
        return np.array([r * (1 - A) / A, np.sqrt(m * r / A * (b1 - a1)), m * a2, m * a1])

    def _pole(self, response: np.ndarray) -> complex:
        """The first resonance's pole [rad/s], from a first fit."""
        R, Bl, k, b = self._fit(response, None, np.inf)[0]
        half = (b + Bl**2 / (R + SERIES_RESISTANCE)) / self.mass / 2
        return complex(-half, np.sqrt(k / self.mass - half**2))

    def _table(self) -> np.ndarray:
        """What the printed table says: R, Bl, the series spring, b1 + b2."""
        p = self.laboratory.parameters
        return np.array([p.R, p.Bl, p.k1 * p.k2 / (p.k1 + p.k2), p.b1 + p.b2])

    # --- what the run shows ---------------------------------------------------------------------

    def checks(self, answer: Dataset, tolerance: float) -> list[Check]:
        errors = self._errors(answer)
        fits = [
            Check(
                f"error of {name}", "relative, against the noise-free lumped fit", e, WANTED[name]
            )
            for name, e in errors.items()
        ]
        apart = abs(answer["by_equations"] / answer["estimate"] - 1).max()
        return [
            *fits,
            Check(
                "equations 4.20-4.23",
                "relative distance of their parameters from those of the direct fit",
                float(apart),
                1e-4,
            ),
            Check(
                "saturation",
                "share of samples at a converter's limit",
                _of(answer, "saturation"),
                0.0,
            ),
        ]

    def _errors(self, answer: Dataset) -> dict[str, float]:
        relative = abs(answer["estimate"] / answer["truth"] - 1)
        return {name: float(relative.sel(parameter=name)) for name in PARAMETERS}

    def metrics(self, answer: Dataset) -> dict[str, float]:
        inside = abs(answer["estimate"] - answer["truth"]) <= answer["half_width"]
        bias = answer["truth"] / answer["table"] - 1
        return {
            **{f"error_{name}": error for name, error in self._errors(answer).items()},
            "covered": float(inside.mean()),
            **{f"bias_{name}": float(bias.sel(parameter=name)) for name in PARAMETERS},
            "chi_square": _of(answer, "chi_square"),
            "transient_p": _of(answer, "transient_p"),
            **{
                f"{name}_p": float(answer["assumption_p"].sel(assumption=name))
                for name in ASSUMPTIONS
            },
        }

    def tables(self, answer: Dataset) -> dict[str, str]:
        head = (
            "| parameter | estimate | 99 % interval | by eq. 4.20-4.23 | noise-free fit | table "
            "| bias of the lumped model |\n| --- | ---: | ---: | ---: | ---: | ---: | ---: |\n"
        )
        lines = []
        for name, unit in PARAMETERS.items():
            row = answer.sel(parameter=name)
            estimate, truth, table = (_of(row, key) for key in ("estimate", "truth", "table"))
            lines.append(
                f"| {name} [{unit}] | {estimate:.6g} | +- {_of(row, 'half_width') / estimate:.2%} "
                f"| {_of(row, 'by_equations'):.6g} | {truth:.6g} | {table:.6g} "
                f"| {truth / table - 1:+.2%} |\n"
            )
        return {"parameters": head + "".join(lines)}

    def figures(self, answer: Dataset) -> dict[str, Figure]:
        figure, panels = figures.axes(2, 2, size=(9.0, 6.0), sharex=True)
        frequency = answer["frequency"].values
        periods = answer["periods"].values
        response, radius = answer["response"].values, answer["radius"].values
        for column, (shown, title) in enumerate(
            ((periods, "ten periods each"), (response[:, None], "mean and 99 % interval"))
        ):
            magnitude, phase = panels[column], panels[2 + column]
            line: dict[str, Any] = {"linestyle": "none", "marker": ".", "markersize": 1.5}
            line["rasterized"] = True  # thousands of points
            if column:
                line = {"linewidth": 1.0, "label": "measured"}
                exact = answer["exact"].values
                magnitude.plot(frequency, abs(exact), "--", color=figures.BLACK, label="noise-free")
                phase.plot(frequency, np.degrees(np.angle(exact)), "--", color=figures.BLACK)
                band = np.degrees(radius / abs(response))
                angle = np.degrees(np.angle(response))
                shade: dict[str, Any] = {"color": figures.ORANGE, "alpha": 0.5, "linewidth": 0}
                magnitude.fill_between(
                    frequency, abs(response) - radius, abs(response) + radius,
                    label="99 % interval", **shade,
                )  # fmt: skip
                phase.fill_between(frequency, angle - band, angle + band, **shade)
            magnitude.plot(frequency, abs(shown), color=figures.BLUE, **line)
            phase.plot(frequency, np.degrees(np.angle(shown)), color=figures.BLUE, **line)
            laboratory = self.laboratory
            magnitude.set_title(f"{laboratory.drive} {laboratory.axis}, {title}")
            phase.set_xlabel("frequency [Hz]")
        panels[0].set_ylabel("|v_r/u| [V/V]")
        panels[2].set_ylabel("phase [deg]")
        figures.legend_below(figure, panels[1])
        return {"bode": figure}


ASSUMPTIONS = ("circular", "normal", "independent")
"""What the interval assumes of the noise, each with the p-value of a test."""


def without_transient(
    amplitudes: np.ndarray, frequency: np.ndarray, pole: complex, discarded: int
) -> np.ndarray:
    """Amplitudes (F, periods) less what still rings of a resonance after the discarded periods.

    A decaying mode at the pole turns, from period to period of a sine at f, by
    exp((pole - j 2 pi f) / f). Its amplitude is fitted beside the constant one by least squares.
    """
    periods = np.arange(amplitudes.shape[1])
    turn = np.exp((pole / frequency - 2j * np.pi)[:, None] * periods)
    kept = slice(discarded, None)
    centred = turn[:, kept] - turn[:, kept].mean(axis=1, keepdims=True)
    weight = (amplitudes[:, kept] * centred.conj()).sum(axis=1) / (abs(centred) ** 2).sum(axis=1)
    return amplitudes - weight[:, None] * turn


def _solved(program: ParameterFit) -> np.ndarray:
    solution = solve(program)
    if solution.certificate is None or not solution.certificate.valid:
        failures = solution.certificate.failures if solution.certificate else ()
        raise SolverError("; ".join([f"the fit failed: {solution.message}", *failures]))
    return np.asarray(solution.answer)


def _half_widths(program: ParameterFit, values: np.ndarray) -> np.ndarray:
    return np.asarray(program.intervals(values, CONFIDENCE))


def _radius(variance: np.ndarray, degrees: float) -> np.ndarray:
    from scipy import stats

    return np.sqrt(stats.f.ppf(CONFIDENCE, 2, degrees) * variance)


def _of(data: Dataset, name: str) -> float:
    return float(data[name])
