"""Magnitude fit by SLICOT: Bode's relation adds the minimum phase, then SB10YD fits both."""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import RealArray
from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.executor import Context
from workbench.fitting.magnitude.gain import target_of, with_best_gain
from workbench.fitting.magnitude.program import MagnitudeFit
from workbench.fitting.rational import Rational
from workbench.fitting.slicot import sb10yd
from workbench.program import Claim, method
from workbench.solvers import Outcome, slycot_missing


def _without_slycot(program: MagnitudeFit) -> str | None:
    """Why the routine cannot be used; None if it can."""
    return slycot_missing()


@method(MagnitudeFit, "sb10yd", optimal=False, unfit=_without_slycot, accuracy=ANY_ACCURACY_ALIKE)
def _sb10yd(program: MagnitudeFit, context: Context) -> Claim:
    """SLICOT SB10YD on the minimum-phase response of the magnitude, then the best gain."""
    none = np.zeros(0, dtype=complex)
    fit = Rational(none, none, 1.0) if program.order == 0 else fit_with_phase(program)
    return with_best_gain(target_of(program), fit.zeros, fit.poles), Outcome.SOLVED, ""


def fit_with_phase(program: MagnitudeFit) -> Rational:
    """SB10YD's fit to magnitude and minimum phase, of order one or more, with a gain of its own."""
    phase = minimum_phase(program.omega, program.magnitude)
    response = program.magnitude * np.exp(1j * phase)
    fit: Rational = sb10yd(program.omega, response, program.order, minimum_phase=True)
    return fit


def minimum_phase(omega: RealArray, magnitude: RealArray) -> RealArray:
    """Phase [rad] (F,) of the minimum-phase response of a magnitude (F,) at ``omega`` [rad/s].

    Bode's relation, phase(u) = 1/pi integral of (d log m / d log omega) log coth(|v - u| / 2) dv,
    is evaluated exactly for the interpolant of the data that is linear in log-log scale and
    continues its outer slopes.
    """
    from scipy.special import spence

    u, level = np.log(omega), np.log(magnitude)
    steps = np.diff(u)  # zero if frequencies differ only by rounding: such slopes do not count
    slopes = np.divide(np.diff(level), steps, out=np.zeros_like(steps), where=steps > 0)
    slopes = np.concatenate([slopes[:1], slopes, slopes[-1:]])
    away = np.abs(u[None] - u[:, None])
    z = np.exp(-away)
    # integral of log coth(t / 2) from 0 to |v - u|, by dilogarithms
    integral = np.pi**2 / 4 - (spence(1 - z) - spence(1 + z))
    integral *= np.sign(u[None] - u[:, None])
    end = np.full((u.size, 1), np.pi**2 / 4)
    return np.asarray(np.diff(np.hstack([-end, integral, end]), axis=1) @ slopes / np.pi)
