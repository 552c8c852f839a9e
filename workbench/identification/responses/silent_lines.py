"""Distortion of a periodic record, told by the lines that the excitation leaves silent.

A nonlinear plant answers a multisine at other lines, too. What stands there and repeats in every
period is no noise, so periods do not scatter by it; and it stands at excited lines as well, where
it changes the response with the phases of the excitation. It is as large there as at silent lines
near by (R. Pintelon, J. Schoukens, System Identification: A Frequency Domain Approach, 2nd edition,
2012, section 4.3), here in proportion to the output.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from workbench.arrays import ComplexArray, IntegerArray, RealArray
from workbench.identification.responses.periodic import PeriodicResponse

NEAR = 8
"""Silent lines next to an excited one that tell its distortion."""
SURE = 3.0
"""Mean power beyond noise, over its own deviation, from which it counts as distortion."""


def with_distortion(
    estimate: PeriodicResponse,
    u: ComplexArray,
    y: ComplexArray,
    lines: IntegerArray,
    chosen: IntegerArray,
) -> PeriodicResponse:
    """The estimate with the distortion's power in its variance.

    Parameters
    ----------
    estimate
        Of one input and one output, at the chosen lines (F,).
    u, y
        Amplitudes (all lines, periods).
    lines
        Excited lines.
    chosen
        Those that are estimated.
    """
    share = distortion(u, y, lines, chosen)
    added = (share * np.abs(estimate.response[:, 0, 0]) ** 2)[:, None, None]
    return replace(
        estimate, variance=estimate.variance + added, covariance=estimate.covariance + added
    )


def distortion(
    u: ComplexArray, y: ComplexArray, lines: IntegerArray, chosen: IntegerArray
) -> RealArray:
    """Power of distortion over that of the output (F,) at the chosen lines; 0 where none is sure.

    Parameters as of `with_distortion`.
    """
    none = np.zeros(chosen.size)
    silent = np.setdiff1d(np.arange(lines[0], lines[-1]), lines)
    periods = u.shape[1]
    if silent.size < NEAR or periods < 2:
        return none
    at, known = np.log(silent), np.log(lines)
    G = y[lines].mean(axis=1) / u[lines].mean(axis=1)
    between = np.interp(at, known, G.real) + 1j * np.interp(at, known, G.imag)
    left = y[silent] - between[:, None] * u[silent]
    size = np.exp(np.interp(at, known, np.log(np.abs(y[lines].mean(axis=1)))))
    noise = left.var(axis=1, ddof=1) / periods / size**2
    beyond = np.abs(left.mean(axis=1)) ** 2 / size**2 - noise
    # The NEAR silent lines about each chosen one, as near to it as the ends allow.
    first = np.searchsorted(silent, chosen) - NEAR // 2
    near = np.clip(first, 0, silent.size - NEAR)[:, None] + np.arange(NEAR)
    mean = beyond[near].mean(axis=1)
    deviation = np.sqrt(np.sum(noise[near] ** 2, axis=1)) / NEAR
    return np.where(mean > SURE * deviation, mean, none)
