"""Noise and distortion of a periodic record, told by the lines about each excited one.

Noise hardly differs between neighbouring lines, so that the scatter of a few periods at several of
them tells it better than at one.

A nonlinear plant answers a multisine at silent lines, too. What stands there and repeats in every
period is no noise, so periods do not scatter by it; and it stands at excited lines as well, where
it changes the response with the phases of the excitation. It is as large there as at silent lines
near by, here in proportion to the output.

Source: R. Pintelon, J. Schoukens, System Identification: A Frequency Domain Approach, 2nd edition,
2012, sections 2.5 and 4.3.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from workbench._core.arrays import ComplexArray, IntegerArray, RealArray
from workbench.identification.responses.periodic import PeriodicResponse

NEAR = 8
"""Lines about an excited one that tell its noise, and silent ones that tell its distortion."""
SURE = 3.0
"""Mean power beyond noise, over its own deviation, from which it counts as distortion."""


def with_neighbours(
    estimate: PeriodicResponse,
    u: ComplexArray,
    y: ComplexArray,
    lines: IntegerArray,
    chosen: IntegerArray,
) -> PeriodicResponse:
    """The estimate with the noise and the distortion that lines near by tell in its variance.

    A line whose own scatter is larger keeps it. Unchanged where too few lines are silent.

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
    left = unexplained(u, y, lines)
    silent = np.setdiff1d(np.arange(lines[0], lines[-1]), lines)
    if silent.size < NEAR or lines.size < 2:
        return estimate
    periods = u.shape[1]
    scatter = left.var(axis=1, ddof=1)
    every = np.arange(lines[0], lines[-1] + 1)
    noise = scatter[nearest(every, chosen) - lines[0]].mean(axis=1) / periods
    power = np.abs(u[chosen].mean(axis=1)) ** 2
    gain = np.abs(estimate.response[:, 0, 0]) ** 2
    near_by = noise / power + gain * distortion(left, y, lines, chosen)
    variance = np.maximum(estimate.variance[:, 0, 0], near_by)[:, None, None]
    degrees = 2.0 * NEAR * (periods - 1)
    return replace(estimate, variance=variance, covariance=variance, degrees=degrees)


def unexplained(u: ComplexArray, y: ComplexArray, lines: IntegerArray) -> ComplexArray:
    """What the response does not explain (lines from first to last excited, periods).

    Between excited lines it is interpolated.
    """
    G = y[lines].mean(axis=1) / u[lines].mean(axis=1)
    every = np.arange(lines[0], lines[-1] + 1)
    at, known = np.log(every), np.log(lines)
    between = np.interp(at, known, G.real) + 1j * np.interp(at, known, G.imag)
    left: ComplexArray = y[every] - between[:, None] * u[every]
    return left


def nearest(those: IntegerArray, chosen: IntegerArray) -> IntegerArray:
    """The `NEAR` members (F, NEAR) of a sorted set about each chosen number, as the ends allow."""
    first = np.clip(np.searchsorted(those, chosen) - NEAR // 2, 0, those.size - NEAR)
    found: IntegerArray = those[first[:, None] + np.arange(NEAR)]
    return found


def distortion(
    left: ComplexArray, y: ComplexArray, lines: IntegerArray, chosen: IntegerArray
) -> RealArray:
    """Power of distortion over that of the output (F,) at the chosen lines; 0 where none is sure.

    ``left`` is what the response leaves, as of `unexplained`.
    """
    silent = np.setdiff1d(np.arange(lines[0], lines[-1]), lines)
    size = np.interp(np.log(silent), np.log(lines), np.log(np.abs(y[lines].mean(axis=1))))
    relative = left[silent - lines[0]] * np.exp(-size)[:, None]
    noise = relative.var(axis=1, ddof=1) / y.shape[1]
    beyond = np.abs(relative.mean(axis=1)) ** 2 - noise
    near = np.searchsorted(silent, nearest(silent, chosen))
    mean = beyond[near].mean(axis=1)
    deviation = np.sqrt(np.sum(noise[near] ** 2, axis=1)) / NEAR
    return np.where(mean > SURE * deviation, mean, 0.0)
