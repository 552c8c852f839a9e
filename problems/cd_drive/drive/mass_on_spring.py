"""A mass on a damped spring: its response for several damping ratios (equation 3.7, figure 3.8).

Equation and figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from workbench import figures
from workbench.types import ComplexArray, DataArray, Dataset, Figure, RealArray

DAMPING_RATIOS = (0.005, 0.05, 0.1, 0.3, 0.7, 1.0)
"""Damping ratios of figure 3.8; 0.05 and 0.005 are quality factors of 10 and 100."""
RELATIVE_FREQUENCIES = np.unique(
    np.concatenate([np.geomspace(0.1, 10.0, 401), np.linspace(0.9, 1.1, 401)])
)
"""Frequencies over the natural frequency, denser near it."""


def relative_response(zeta: ArrayLike, relative: ArrayLike) -> ComplexArray:
    """k x / F of equation 3.7 (Z, F) for damping ratios (Z,) at relative frequencies (F,)."""
    s = 1j * np.asarray(relative, float)
    damping = 2.0 * np.asarray(zeta, float)[:, None]
    response: ComplexArray = 1.0 / (s**2 + damping * s + 1.0)
    return response


def peak(zeta: ArrayLike) -> tuple[RealArray, RealArray]:
    """Relative frequency and height of the peak, each (Z,); NaN if there is no peak.

    These are sqrt(1 - 2 zeta^2) and 1 / (2 zeta sqrt(1 - zeta^2)), for zeta below 1 / sqrt(2).
    """
    ratio = np.asarray(zeta, float)
    below = np.where(ratio < np.sqrt(0.5), ratio, np.nan)
    return np.sqrt(1.0 - 2.0 * below**2), 1.0 / (2.0 * below * np.sqrt(1.0 - below**2))


def peak_off(curves: DataArray) -> tuple[float, float]:
    """Largest relative distances of the curves' peaks from those of `peak`: in frequency and
    height.
    """
    size = abs(curves)
    at, height = peak(curves["zeta"].values)
    frequency_off = abs(size.idxmax("relative").values / at - 1.0)
    height_off = abs(size.max("relative").values / height - 1.0)
    return float(np.nanmax(frequency_off)), float(np.nanmax(height_off))


def figure_3_8(answer: Dataset) -> Figure:
    """Magnitude and phase for every damping ratio."""
    drawn, (magnitude, phase) = figures.axes(2, 1, size=(7.2, 6.2), sharex=True)
    for zeta, one in zip(answer["zeta"].values, answer["spring_response"], strict=True):
        decibels = 20 * np.log10(abs(one))
        magnitude.plot(answer["relative"], decibels, label=rf"$\zeta$ = {zeta:g}")
        phase.plot(answer["relative"], np.degrees(np.angle(one)))
    title = "Figure 3.8: mass on a damped spring (equation 3.7)"
    figures.label(magnitude, y="k x / F [dB]", title=title)
    figures.label(phase, x=r"frequency / $\omega_n$", y="phase [deg]", log="x")
    phase.set_yticks([-180, -135, -90, -45, 0])
    figures.legend_below(drawn, magnitude, columns=6)
    return drawn
