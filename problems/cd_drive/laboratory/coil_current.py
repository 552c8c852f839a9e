"""The coil's current of a drive that is excited in open loop, and the lumped model fitted to it.

A resistor r in series with the coil measures its current. The back-EMF makes the current depend on
the motion, so that |v_r / u| has a dip at the first resonance (eq. 4.17). The optics are not used.
Equation and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np

from workbench import solve
from workbench.errors import SolverError
from workbench.identification import (
    FittedParameter,
    MeasuredResponse,
    ParameterFit,
    PeriodicResponse,
    SteppedSine,
    periodic_response,
    sine_fit,
)
from workbench.types import ComplexArray, RealArray

from ..drive.actuator import SERIES_RESISTANCE
from ..drive.tables import Axis
from ..drive.two_masses import lumped
from .bench_setup import RATE
from .experiment import CoilSignals, Laboratory
from .known_values import MASS_POWER, NORMAL_99, RATIO_DEVIATION, independent
from .unknowns import MASS_DEVIATION, Told, corner_ratio

PERIODS, DISCARDED = 20, 10
"""Number of periods played at each frequency, and of those at the start that the mean leaves out
(section 4.6.1).
"""
LOWEST, HIGHEST = 10, {"focus": 50.0, "radial": 100.0}
"""First and last frequency [Hz] of the sweep (section 4.6.1)."""
RESONANCE = {"focus": 30.0, "radial": 50.0}
"""First resonance [Hz] at which the fits start."""
FOUND = ("R", "Bl", "k", "b", "m")
"""Parameters that the fit returns. The mass is not fitted: it is the told one."""
DEGREES = 2 * (PERIODS - DISCARDED - 1) - 2
"""Degrees of freedom of the variances. Besides the mean of the periods, an amplitude of the
transient is estimated.
"""


class LumpedFit(NamedTuple):
    """Values (5,) of `FOUND`, their covariance (5, 5), and chi-square per degree of freedom."""

    values: RealArray
    covariance: RealArray
    chi_square: float

    @property
    def half_width(self) -> RealArray:
        """Half-widths (5,) of the confidence intervals."""
        found: RealArray = NORMAL_99 * np.sqrt(np.diag(self.covariance))
        return found


class Current(NamedTuple):
    """Amplitudes (F, PERIODS) of u and v_r, and the largest share of saturated samples."""

    u: ComplexArray
    v: ComplexArray
    saturation: float

    def corrected(self, told: Told, frequency: RealArray) -> Current:
        """The amplitudes as an experimenter has them, who corrects the filters by the told
        corners.
        """
        s = 2j * np.pi * frequency[:, None]
        u, v = corner_ratio(told.control_corner, s), corner_ratio(told.current_corner, s)
        return self._replace(v=self.v * u / v)


@dataclass(frozen=True, eq=False)
class CoilExperiment:
    """A stepped sine with an amplitude [V] and a frequency step [Hz], on the coil of a drive.

    resonance [Hz]: first resonance at which the fit of the lumped model starts. None: that of a new
    drive. series_resistance: of the resistor that measures the current [ohm].
    """

    laboratory: Laboratory
    step: float
    amplitude: float
    resonance: float | None = None
    series_resistance: float = SERIES_RESISTANCE

    @property
    def axis(self) -> Axis:
        return self.laboratory.axis

    @property
    def mass(self) -> float:
        """m_eff [kg]: effective mass of the first resonance, which both masses determine."""
        return float(lumped(self.laboratory.parameters).m)

    @property
    def frequency(self) -> RealArray:
        """Frequencies [Hz] (F,) of the sweep."""
        count = round((HIGHEST[self.axis] - LOWEST) / self.step)
        grid: RealArray = LOWEST + self.step * np.arange(count + 1.0)
        return grid

    @cached_property
    def _sweep(self) -> SteppedSine:
        return SteppedSine(self.frequency, PERIODS, self.amplitude, 1 / RATE)

    @cached_property
    def _signals(self) -> CoilSignals:
        """The signals without noise, which are the same in all draws."""
        played = np.concatenate([samples for _, samples in self._sweep])
        return self.laboratory.coil_signals(played, self.series_resistance)

    def played(self, seed: int) -> Current:
        """Amplitudes of the measured signals.

        Both channels pass through the same hold and delay, which cancel in their ratio.
        """
        record, lengths = self._signals.measured(seed), self._sweep.lengths
        pieces = list(zip(self.frequency, lengths, np.cumsum(lengths), strict=True))
        u, v = (
            np.array(
                [sine_fit(one[end - n : end], 1 / RATE, f)[:PERIODS, 0] for f, n, end in pieces]
            )
            for one in (record.u_m, record.v_r / self.laboratory.coil_gain)
        )
        return Current(u, v, max(record.saturation.values()))

    def exact(self) -> ComplexArray:
        """v_r/u without noise (F,)."""
        channels = self.laboratory.response(self.frequency)
        ratio: ComplexArray = channels["v_r"] / channels["u_m"] / self.laboratory.coil_gain
        return ratio

    def settled(self, raw: PeriodicResponse, current: Current, mass: float) -> PeriodicResponse:
        """v_r/u without the transient of the first resonance; the mass [kg] is the told one."""
        v = without_transient(current.v, self.frequency, self._pole(raw, mass), DISCARDED)
        return periodic_response(self.frequency, current.u, v, transients=DISCARDED)

    def fit(
        self, response: ComplexArray, variance: RealArray, degrees: float, mass: float
    ) -> LumpedFit:
        """Fit of the lumped model of eq. 4.17, for a mass [kg] that is known with
        `MASS_DEVIATION`.
        """

        def model(p: Any, s: Any) -> Any:
            """v_r/u by equation 4.17."""
            total = p["R"] + r
            held = mass * s**2 + p["b"] * s + p["k"]
            return r / total * held / (held + p["Bl"] ** 2 / total * s)

        r = self.series_resistance
        resonance = RESONANCE[self.axis] if self.resonance is None else self.resonance
        stiffness = mass * (2 * np.pi * resonance) ** 2
        start = {
            "R": FittedParameter(15.0, lower=1.0, upper=100.0),
            "Bl": FittedParameter(0.2, lower=0.01, upper=2.0),
            "k": FittedParameter(stiffness, lower=1.0, upper=1e3),
            "b": FittedParameter(0.01, lower=1e-4, upper=1.0),
        }
        program = self._program(model, start, (response, variance, degrees))
        answer, count = solved(program), len(start)
        values = np.append(answer[:count], mass)
        covariance = np.zeros((len(FOUND), len(FOUND)))
        covariance[:count, :count] = program.covariance(answer)[:count, :count]
        # An error of the mass scales the other parameters, and no residual shows it.
        common = MASS_DEVIATION * np.array([MASS_POWER[name] for name in FOUND]) * values
        covariance += np.outer(common, common)
        return LumpedFit(values, covariance, program.chi_square(answer)[0])

    def by_equations(self, response: ComplexArray, variance: RealArray, mass: float) -> RealArray:
        """R, Bl, k, b by equations 4.20-4.23 from the fitted coefficients of eq. 4.19."""
        resonance = (2 * np.pi * RESONANCE[self.axis]) ** 2
        start = {
            "A": FittedParameter(0.07, lower=1e-3, upper=1.0),
            "a1": FittedParameter(15.0, lower=0.1, upper=1e3),
            "a2": FittedParameter(resonance, lower=0.1 * resonance, upper=10 * resonance),
            "b1": FittedParameter(20.0, lower=0.1, upper=1e3),
        }
        program = self._program(rational_current, start, (response, variance, DEGREES))
        A, a1, a2, b1 = solved(program)[:4]
        r = self.series_resistance
        return np.array([r * (1 - A) / A, np.sqrt(mass * r / A * (b1 - a1)), mass * a2, mass * a1])

    def _program(
        self,
        model: Callable[[Any, Any], Any],
        start: dict[str, FittedParameter],
        measured: tuple[ComplexArray, RealArray, float],
    ) -> ParameterFit:
        """Program that fits a model of v_r/u, multiplied by the ratio of both channels' filters."""

        def filtered(p: Any, s: Any) -> Any:
            return model(p, s) * corner_ratio(p["corner"], s)

        values, variance, degrees = measured
        response = MeasuredResponse(
            filtered, self.frequency, values, variance=variance, degrees=degrees, name="v_r/u"
        )
        known = independent({"corner": (1.0, RATIO_DEVIATION)}, "corners")
        return ParameterFit(
            [response, known], start | {"corner": FittedParameter(1.0, lower=0.2, upper=5.0)}
        )

    def _pole(self, raw: PeriodicResponse, mass: float) -> complex:
        """Pole [rad/s] of the first resonance."""
        measured = raw.response[:, 0, 0], raw.variance[:, 0, 0], raw.degrees
        R, Bl, k, b, m = self.fit(*measured, mass).values
        half = (b + Bl**2 / (R + self.series_resistance)) / m / 2
        return complex(-half, np.sqrt(k / m - half**2))


def rational_current(p: Any, s: Any) -> Any:
    """v_r/u by the rational structure of equation 4.19."""
    held = s**2 + p["a1"] * s + p["a2"]
    return p["A"] * held / (s**2 + p["b1"] * s + p["a2"])


def without_transient(
    amplitudes: ComplexArray, frequency: RealArray, pole: complex, discarded: int
) -> ComplexArray:
    """Amplitudes (F, periods) from which the decaying transient of a resonance is removed.

    From one period of a sine at f [Hz] to the next, a decaying mode at the pole [rad/s] is
    multiplied by exp((pole - j 2 pi f) / f). Its amplitude is fitted by least squares together with
    the constant one, without the first `discarded` periods.
    """
    periods = np.arange(amplitudes.shape[1])
    turn = np.exp((pole / frequency - 2j * np.pi)[:, None] * periods)
    kept = slice(discarded, None)
    centred = turn[:, kept] - turn[:, kept].mean(axis=1, keepdims=True)
    weight = (amplitudes[:, kept] * centred.conj()).sum(axis=1) / (abs(centred) ** 2).sum(axis=1)
    result: ComplexArray = amplitudes - weight[:, None] * turn
    return result


def solved(program: ParameterFit, failed: str = "the fit failed") -> RealArray:
    """The fitted parameters. Without a proof raises SolverError, with a message that begins with
    ``failed``.
    """
    solution = solve(program)
    if solution.certificate is None or not solution.certificate.valid:
        failures = solution.certificate.failures if solution.certificate else ()
        raise SolverError("; ".join([f"{failed}: {solution.message}", *failures]))
    return np.asarray(solution.answer)
