"""Open-loop identification: the actuator's parameters from the current in its coil (section 4.3.1).

A resistor r in series with the coil measures its current. The back-EMF makes the current depend on
the motion, so that |v_r / u| has a dip at the first resonance (eq. 4.17). The optics take no part.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import Field

from workbench import figures, problem, solve
from workbench.arrays import ComplexArray, RealArray
from workbench.errors import SolverError
from workbench.executor import Context
from workbench.heavy_types import DataArray, Dataset, Figure
from workbench.identification import (
    FittedParameter,
    MeasuredResponse,
    ParameterFit,
    PeriodicResponse,
    SteppedSine,
    from_periods,
    sine_fit,
)
from workbench.study import Study, array, arrays, check, dim, figure, metric, part, table

from ..drive.actuator import SERIES_RESISTANCE
from ..drive.shared_parameters import TABLES
from ..drive.tables import Axis, Values
from ..drive.two_masses import lumped
from .bench_setup import RATE
from .experiment import Laboratory

PERIODS, DISCARDED = 20, 10
"""Periods played at each frequency, and those at its start left out of the mean (section 4.6.1)."""
LOWEST, HIGHEST = 10, {"focus": 50.0, "radial": 100.0}
"""First and last frequency [Hz] of the sweep (section 4.6.1)."""
RESONANCE = {"focus": 30.0, "radial": 50.0}
"""First resonance [Hz] from which the fits start."""
PARAMETERS = {"R": "ohm", "Bl": "N/A", "k": "N/m", "b": "N s/m"}
"""Parameters of the lumped model and their units."""
ERROR_TOLERANCE = {"R": 0.01, "Bl": 0.01, "k": 0.01, "b": 0.05}
"""Largest relative error of each parameter: the accuracies that the thesis states."""
ASSUMPTIONS = ("circular", "normal", "independent")
"""Assumptions of the intervals about the noise, each tested with a p-value."""
DEGREES = 2 * (PERIODS - DISCARDED - 1) - 2
"""Degrees of freedom of the variances: an amplitude of the transient was estimated beside the mean
of the periods."""
CONFIDENCE = 0.99
"""Probability with which an interval covers the true value."""


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
    def quantifier(self) -> str:
        return "for this one drive, in one simulated experiment"

    @property
    def mass(self) -> float:
        """m_eff [kg]: both masses as the first resonance sees them, taken as known."""
        return lumped(self.laboratory.parameters).m

    @property
    def grid(self) -> np.ndarray:
        """Frequencies [Hz] of the sweep."""
        count = round((HIGHEST[self.laboratory.axis] - LOWEST) / self.step)
        return LOWEST + self.step * np.arange(count + 1)

    frequency = dim(lambda self: self.grid, unit="Hz", meaning="frequency")
    parameter, assumption = dim(PARAMETERS), dim(ASSUMPTIONS)
    unit = array(parameter, value=lambda: PARAMETERS, coordinate=True)

    @part
    def measured(self, context: Context) -> tuple[ComplexArray, ComplexArray, float]:
        """Amplitudes (F, PERIODS) of u and v_r, and the largest share of saturated samples.

        Both channels pass the same hold, delay and filter, which cancel in their ratio.
        """
        sweep = SteppedSine(self.grid, PERIODS, self.amplitude, RATE)
        played = np.concatenate([samples for _, samples in sweep])
        record = self.laboratory.coil(played, int(context.rng.integers(2**31)))
        pieces = list(zip(self.grid, sweep.lengths, np.cumsum(sweep.lengths), strict=True))
        u, v = (
            np.array([sine_fit(one[end - n : end], RATE, f)[:PERIODS, 0] for f, n, end in pieces])
            for one in (record.u_m, record.v_r / self.laboratory.coil_gain)
        )
        return u, v, max(record.saturation.values())

    @part
    def raw(self, measured: Any) -> PeriodicResponse:
        """v_r/u with what still rings of the resonance."""
        return from_periods(self.grid, *measured[:2], transients=DISCARDED)

    @part
    def settled(self, measured: Any, raw: PeriodicResponse) -> PeriodicResponse:
        """v_r/u without what still rings of the resonance."""
        v = without_transient(measured[1], self.grid, self._pole(raw.response[:, 0, 0]), DISCARDED)
        return from_periods(self.grid, measured[0], v, transients=DISCARDED)

    response = array(frequency, "V/V", "v_r/u measured", lambda settled: settled.response[:, 0, 0])
    variance = array(
        frequency,
        "1",
        value=lambda settled: (DEGREES + 2) / DEGREES * settled.variance[:, 0, 0],
        degrees=DEGREES,
    )
    radius = array(frequency, "V/V", value=lambda variance: _radius(variance.values, DEGREES))

    @array(frequency, "V/V", "v_r/u noise-free")
    def exact(self) -> ComplexArray:
        channels = self.laboratory.response(self.grid)
        ratio: ComplexArray = channels["v_r"] / channels["u_m"] / self.laboratory.coil_gain
        return ratio

    @array((frequency, "period"), "V/V")
    def periods(self, measured: Any) -> Any:
        return (measured[1] / measured[0])[:, DISCARDED:]

    saturation = array((), "1", value=lambda measured: measured[2])

    @arrays(
        parameter,
        estimate="",
        half_width=("", "of the 99 % interval"),
        by_equations="",
        truth=("", "lumped fit to the noise-free response"),
        table=("", "printed table, b = b1 + b2"),
    )
    def fits(self, fit: Any, response: Any, variance: Any, exact: Any) -> dict[str, RealArray]:
        p = self.laboratory.parameters
        return {
            "estimate": fit[0],
            "half_width": fit[1],
            "by_equations": self._by_equations(response.values, variance.values),
            "truth": self._fit(exact.values, variance.values, np.inf)[0],
            "table": np.array([p.R, p.Bl, p.k1 * p.k2 / (p.k1 + p.k2), p.b1 + p.b2]),
        }

    @part
    def fit(self, response: DataArray, variance: DataArray) -> tuple[RealArray, RealArray, float]:
        return self._fit(response.values, variance.values, DEGREES)

    chi_square = array((), "", "of the fit, per degree of freedom", lambda fit: fit[2])
    assumption_p = array(
        assumption, value=lambda settled: [getattr(settled.assumptions, n) for n in ASSUMPTIONS]
    )
    transient_p = array(value=lambda raw: raw.assumptions.independent)

    check_errors = check(
        "error of {parameter}",
        "relative, against the noise-free lumped fit",
        lambda estimate, truth: abs(estimate / truth - 1),
        at_most=ERROR_TOLERANCE,
        each="parameter",
    )
    check_equations = check(
        "equations 4.20-4.23",
        "relative distance of their parameters from those of the direct fit",
        lambda by_equations, estimate: abs(by_equations / estimate - 1).max(),
        at_most=1e-4,
    )
    check_saturation = check(
        "saturation", "share of samples at a converter's limit", lambda saturation: saturation,
        at_most=0.0,
    )  # fmt: skip

    errors = metric("error_{parameter}", lambda estimate, truth: abs(estimate / truth - 1))
    covered = metric(
        lambda estimate, truth, half_width: (abs(estimate - truth) <= half_width).mean()
    )
    biases = metric("bias_{parameter}", lambda answer: answer["truth"] / answer["table"] - 1)
    tests = metric("{assumption}_p", lambda assumption_p: assumption_p)
    scalars = metric(lambda answer: {n: answer[n] for n in ("chi_square", "transient_p")})

    @table
    def parameters(self, answer: Dataset) -> tuple[list[str], list[list[str]]]:
        heads = ["parameter", "estimate", "99 % interval", "by eq. 4.20-4.23", "noise-free fit"]
        rows = []
        for name, unit in PARAMETERS.items():
            row = answer.sel(parameter=name)
            estimate, truth, printed = (float(row[key]) for key in ("estimate", "truth", "table"))
            cells = [f"{estimate:.6g}", f"+- {float(row['half_width']) / estimate:.2%}"]
            cells += [f"{one:.6g}" for one in (float(row["by_equations"]), truth, printed)]
            rows.append([f"{name} [{unit}]", *cells, f"{truth / printed - 1:+.2%}"])
        return [*heads, "table", "bias of the lumped model"], rows

    @figure
    def bode(self, answer: Dataset) -> Figure:
        drawn, panels = figures.axes(2, 2, size=(9.0, 6.0), sharex=True)
        frequency, response = answer["frequency"].values, answer["response"].values
        radius, exact = answer["radius"].values, answer["exact"].values

        def plot(column: int, values: ComplexArray, *style: str, **look: Any) -> None:
            parts = (abs(values), np.degrees(np.angle(values)))
            for panel, one in zip(panels[column::2], parts, strict=True):
                panel.plot(frequency, one, *style, **look)

        # Rasterized, as there are thousands of points.
        dots: Any = {"linestyle": "none", "marker": ".", "markersize": 1.5, "rasterized": True}
        plot(0, answer["periods"].values, color=figures.BLUE, **dots)
        plot(1, exact, "--", color=figures.BLACK, label="noise-free")
        angle, lead = np.degrees(np.angle(response)), np.degrees(radius / abs(response))
        bands = ((abs(response), radius), (angle, lead))
        for panel, (middle, half) in zip(panels[1::2], bands, strict=True):
            panel.fill_between(
                frequency, middle - half, middle + half, label="99 % interval",
                color=figures.ORANGE, alpha=0.5, linewidth=0,
            )  # fmt: skip
        plot(1, response, color=figures.BLUE, linewidth=1.0, label="measured")
        for column, title in enumerate(("ten periods each", "mean and 99 % interval")):
            title = f"{self.laboratory.drive} {self.laboratory.axis}, {title}"
            figures.label(panels[column], title=title)
            figures.label(panels[2 + column], "frequency [Hz]")
        figures.label(panels[0], y="$|v_r/u|$ [V/V]")
        figures.label(panels[2], y="phase [deg]")
        figures.legend_below(drawn, panels[1])
        return drawn

    def _fit(
        self, response: ComplexArray, variance: RealArray | None, degrees: float
    ) -> tuple[RealArray, RealArray, float]:
        """R, Bl, k, b, the half-widths of their intervals, and chi-square per degree of freedom."""
        stiffness = self.mass * (2 * np.pi * RESONANCE[self.laboratory.axis]) ** 2
        start = {
            "R": FittedParameter(15.0, 1.0, 100.0),
            "Bl": FittedParameter(0.2, 0.01, 2.0),
            "k": FittedParameter(stiffness, 1.0, 1e3),
            "b": FittedParameter(0.01, 1e-4, 1.0),
        }
        measured = MeasuredResponse(
            self._model, self.grid, response, variance, degrees, name="v_r/u"
        )
        program = ParameterFit([measured], start)
        values = solved(program)
        widths = np.asarray(program.intervals(values, CONFIDENCE))
        return values, widths, program.chi_square(values)[0]

    def _model(self, p: Any, s: Any) -> Any:
        """v_r/u of the lumped model by equation 4.17."""
        m, r = self.mass, SERIES_RESISTANCE
        total = p["R"] + r
        held = m * s**2 + p["b"] * s + p["k"]
        return r / total * held / (held + p["Bl"] ** 2 / total * s)

    def _by_equations(self, response: ComplexArray, variance: RealArray) -> RealArray:
        """R, Bl, k, b by equations 4.20-4.23 from the fitted coefficients of eq. 4.19."""

        def rational(p: Any, s: Any) -> Any:
            held = s**2 + p["a1"] * s + p["a2"]
            return p["A"] * held / (s**2 + p["b1"] * s + p["a2"])

        resonance = (2 * np.pi * RESONANCE[self.laboratory.axis]) ** 2
        start = {
            "A": FittedParameter(0.07, 1e-3, 1.0),
            "a1": FittedParameter(15.0, 0.1, 1e3),
            "a2": FittedParameter(resonance, 0.1 * resonance, 10 * resonance),
            "b1": FittedParameter(20.0, 0.1, 1e3),
        }
        measured = MeasuredResponse(rational, self.grid, response, variance, DEGREES)
        A, a1, a2, b1 = solved(ParameterFit([measured], start))
        m, r = self.mass, SERIES_RESISTANCE
        return np.array([r * (1 - A) / A, np.sqrt(m * r / A * (b1 - a1)), m * a2, m * a1])

    def _pole(self, response: ComplexArray) -> complex:
        """Pole [rad/s] of the first resonance, by a fit without weights."""
        R, Bl, k, b = self._fit(response, None, np.inf)[0]
        half = (b + Bl**2 / (R + SERIES_RESISTANCE)) / self.mass / 2
        return complex(-half, np.sqrt(k / self.mass - half**2))


def without_transient(
    amplitudes: ComplexArray, frequency: RealArray, pole: complex, discarded: int
) -> ComplexArray:
    """Amplitudes (F, periods) without what still rings of a resonance after discarded periods.

    A decaying mode at the pole [rad/s] turns, from period to period of a sine at f [Hz], by
    exp((pole - j 2 pi f) / f). Its amplitude is fitted beside the constant one by least squares.
    """
    periods = np.arange(amplitudes.shape[1])
    turn = np.exp((pole / frequency - 2j * np.pi)[:, None] * periods)
    kept = slice(discarded, None)
    centred = turn[:, kept] - turn[:, kept].mean(axis=1, keepdims=True)
    weight = (amplitudes[:, kept] * centred.conj()).sum(axis=1) / (abs(centred) ** 2).sum(axis=1)
    result: ComplexArray = amplitudes - weight[:, None] * turn
    return result


def solved(program: ParameterFit, failed: str = "the fit failed") -> RealArray:
    """The fitted parameters; raises SolverError, its text begun by ``failed``, without a proof."""
    solution = solve(program)
    if solution.certificate is None or not solution.certificate.valid:
        failures = solution.certificate.failures if solution.certificate else ()
        raise SolverError("; ".join([f"{failed}: {solution.message}", *failures]))
    return np.asarray(solution.answer)


def _radius(variance: RealArray, degrees: float) -> RealArray:
    """Radius of the regions that cover a response, from the variance of its estimate."""
    from scipy import stats

    return np.sqrt(stats.f.ppf(CONFIDENCE, 2, degrees) * variance)
