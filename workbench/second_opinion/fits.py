"""Fitted functions, checked by their realisations: no pole, zero or root is computed."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.certificate import THIS_SYSTEM, Check, worst_value
from workbench.executor.effort import tries
from workbench.second_opinion.powers import growth
from workbench.second_opinion.responses import plain_response

POINTS_BETWEEN = 8
"""Number of frequencies tried between neighbouring data."""
SIGN_ROUNDING = 0.1
"""Largest distance of the trace of a sign function from an integer that counts as rounding."""
RESPONSE_ROUNDING = 1e-6
"""Largest difference, relative to the data, between the responses of a realisation and of the
roots.
"""


def realisation_agrees(
    system: Any, omega: RealArray, fitted: ComplexArray, size: RealArray
) -> Check:
    """Check that a realisation has the same response as the roots of a fit.

    Parameters
    ----------
    system
        StateSpace of the fit, of one input and one output.
    omega
        Frequencies [rad/s] (F,).
    fitted
        Response (F,) by the roots.
    size
        Sizes (F,) of the data.
    """
    apart = np.abs(plain_response(system, omega)[:, 0, 0] - fitted)
    value, where = worst_value(
        apart / np.maximum(np.maximum(size, np.abs(fitted)), np.finfo(float).tiny),
        lambda i: f"at {omega[i]:.6g} rad/s",
    )
    statement = "response of a realisation less that of the roots, relative to the larger of both"
    over = f"at {omega.size} frequencies"
    name, statement = "realisation", f"{statement} data and fit"
    return Check(name, statement, value, RESPONSE_ROUNDING, where=where, over=over)


def within(
    system: Any, omega: RealArray, data: ComplexArray, weight: RealArray, error: float
) -> Check:
    """Check that the distance of a realisation from data (F,) is at most a weighted error."""
    value, where = worst_value(
        weight * np.abs(plain_response(system, omega)[:, 0, 0] - data),
        lambda i: f"at {omega[i]:.6g} rad/s",
    )
    statement = "largest weighted distance of a realisation from the data over the limit, less 1"
    return Check("realised error", statement, value / error - 1, RESPONSE_ROUNDING, where=where)


def covers(system: Any, omega: RealArray, magnitude: RealArray) -> Check:
    """Check that a realisation lies above data (F,), interpolated linearly on log-log scales."""
    count = tries(POINTS_BETWEEN) * (omega.size - 1) + 1
    place, index = np.linspace(0, omega.size - 1, count), np.arange(omega.size)
    grid = np.exp(np.interp(place, index, np.log(omega)))
    data = np.exp(np.interp(place, index, np.log(magnitude)))
    short = data / np.abs(plain_response(system, grid)[:, 0, 0]) - 1
    value, where = worst_value(short, lambda i: f"at {grid[i]:.6g} rad/s")
    statement = "data over the realisation, also between the data, less 1"
    over = f"at {count} frequencies, between the data too"
    return Check("sampled cover", statement, value, RESPONSE_ROUNDING, where=where, over=over)


def decays(system: Any, name: str) -> Check:
    """Check that powers of the transition matrix of a realisation do not grow."""
    rate, rounding = growth(system.A, system.dt)
    statement = "logarithmic growth per sample by a power of the transition matrix, less rounding"
    return Check(name, statement, rate - rounding, 0.0, over=THIS_SYSTEM)


def growing_modes(system: Any, count: int, name: str) -> Check:
    """Check that this many modes of a realisation grow, by the trace of the matrix sign
    function.
    """
    from scipy.linalg import signm

    A = np.asarray(system.A)
    found = (len(A) + float(np.trace(signm(A / np.abs(A).max(initial=1.0))).real)) / 2
    statement = f"modes that grow, by the trace of sign(A), more or fewer than {count}"
    return Check(f"{name} grows", statement, abs(found - count), SIGN_ROUNDING, over=THIS_SYSTEM)


def inverse_decays(fit: Any, name: str) -> Check:
    """As `decays`, for a realisation of the inverse of a fit (a `Rational`)."""
    statement = "logarithmic growth of the inverse per sample, less rounding"
    return replace(decays(fit.inverse().state_space(), name), statement=statement)
