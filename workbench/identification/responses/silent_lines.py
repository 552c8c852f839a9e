"""Noise and distortion of a periodic record, estimated from the lines near each excited one.

Noise hardly differs between neighbouring lines, so the scatter of a few periods at several lines
gives a better estimate than that at one line.

A nonlinear plant responds to a multisine at silent lines too. A response there that repeats in
every period is not noise, and does not make periods scatter. Distortion is also at excited lines,
where it changes the response with the phases of the excitation. Its size there is that at silent
lines near by, over the plant's gain: that of a signal added to the input. In a closed loop the
controller makes the input small at low frequencies, but not this signal.

Source: R. Pintelon, J. Schoukens, System Identification: A Frequency Domain Approach, 2nd edition,
2012, sections 2.5 and 4.3.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from workbench._core.arrays import ComplexArray, IntegerArray, RealArray
from workbench.identification.responses.periodic import PeriodicResponse

NEAR = 8
"""Number of neighbouring lines that determine an excited line's noise, and of silent ones for its
distortion.
"""
SURE = 3.0
"""Mean power minus noise, in its own standard deviations, above which it counts as distortion."""


def with_neighbours(
    estimate: PeriodicResponse,
    u: ComplexArray,
    y: ComplexArray,
    lines: IntegerArray,
    chosen: IntegerArray,
) -> PeriodicResponse:
    """The estimate, its variance extended by the noise and distortion of neighbouring lines.

    A line with larger scatter of its own keeps that. The estimate is unchanged if too few lines are
    silent.

    Parameters
    ----------
    estimate
        The estimate of one input and one output, at the chosen lines (F,).
    u, y
        Amplitudes (all lines, periods).
    lines
        Excited lines.
    chosen
        The lines that are estimated.
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
    near_by = (noise + gain * distortion(left, u, y, lines, chosen)) / power
    variance = np.maximum(estimate.variance[:, 0, 0], near_by)[:, None, None]
    degrees = 2.0 * NEAR * (periods - 1)
    return replace(estimate, variance=variance, covariance=variance, degrees=degrees)


def unexplained(u: ComplexArray, y: ComplexArray, lines: IntegerArray) -> ComplexArray:
    """The part that the response does not explain (lines from first to last excited, periods).

    Between excited lines it is interpolated.
    """
    G = y[lines].mean(axis=1) / u[lines].mean(axis=1)
    every = np.arange(lines[0], lines[-1] + 1)
    at, known = np.log(every), np.log(lines)
    between = np.interp(at, known, G.real) + 1j * np.interp(at, known, G.imag)
    left: ComplexArray = y[every] - between[:, None] * u[every]
    return left


def nearest(those: IntegerArray, chosen: IntegerArray) -> IntegerArray:
    """The `NEAR` nearest members (F, NEAR) of a sorted set to each chosen number."""
    first = np.clip(np.searchsorted(those, chosen) - NEAR // 2, 0, those.size - NEAR)
    found: IntegerArray = those[first[:, None] + np.arange(NEAR)]
    return found


def distortion(
    left: ComplexArray,
    u: ComplexArray,
    y: ComplexArray,
    lines: IntegerArray,
    chosen: IntegerArray,
) -> RealArray:
    """Power (F,) of the input that would cause the distortion at chosen lines; 0 if none is
    certain.

    ``left`` is the unexplained part, as from `unexplained`.
    """
    silent = np.setdiff1d(np.arange(lines[0], lines[-1]), lines)
    gain = np.abs(y[lines].mean(axis=1) / u[lines].mean(axis=1))
    between = np.interp(np.log(silent), np.log(lines), np.log(gain))
    added = left[silent - lines[0]] * np.exp(-between)[:, None]
    noise = added.var(axis=1, ddof=1) / y.shape[1]
    beyond = np.abs(added.mean(axis=1)) ** 2 - noise
    near = np.searchsorted(silent, nearest(silent, chosen))
    mean = beyond[near].mean(axis=1)
    deviation = np.sqrt(np.sum(noise[near] ** 2, axis=1)) / NEAR
    return np.where(mean > SURE * deviation, mean, 0.0)
