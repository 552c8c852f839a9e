"""Figures of response fits: over frequency, and in the complex plane."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench import figures
from workbench._core.arrays import RealArray
from workbench._core.heavy_types import Figure
from workbench.fitting.rational import Rational
from workbench.fitting.response.data import Data

DRAWN_FREQUENCIES = 2000
"""Number of frequencies, besides those of the data, at which the fit is drawn."""


def bode(data: Data, answer: Rational, errors: RealArray) -> Figure:
    """Magnitude and phase of data and fit, and the weighted errors (F,), over frequency."""
    omega = _fine(data.omega)
    fit = answer.response(omega)
    figure, (magnitude, phase, error) = figures.axes(3, 1, size=(7.0, 7.0), sharex=True)
    dots: Any = {"marker": ".", "linestyle": "none", "color": figures.BLUE, "markersize": 4}
    magnitude.plot(data.omega, np.abs(data.response), label="data", **dots)
    magnitude.plot(omega, np.abs(fit), color=figures.ORANGE, label="fit")
    magnitude.set_yscale("log")
    magnitude.set_ylabel("magnitude [1]")
    turned = np.unwrap(np.angle(data.response))
    phase.plot(data.omega, np.degrees(turned), **dots)
    along = np.unwrap(np.angle(fit))
    along += 2 * np.pi * np.round((turned[0] - along[0]) / (2 * np.pi))  # on the data's sheet
    phase.plot(omega, np.degrees(along), color=figures.ORANGE)
    phase.set_ylabel("phase [deg]")
    error.plot(data.omega, errors, **{**dots, "color": figures.BLACK})
    error.axhline(errors.max(), color=figures.GREEN, linewidth=0.8)
    if errors.min() > 0:
        error.set_yscale("log")
    error.set_ylabel("weighted error [1]")
    error.set_xlabel("angular frequency [rad/s]")
    for panel in (magnitude, phase, error):
        panel.set_xscale("log")
    figures.legend_below(figure, magnitude)
    return figure


def nyquist(data: Data, answer: Rational) -> Figure:
    """Data and fit in the complex plane."""
    response, fit = data.response, answer.response(_fine(data.omega))
    figure, (plane,) = figures.axes(1, 1, size=(6.0, 5.0))
    plane.plot(response.real, response.imag, ".", color=figures.BLUE, markersize=4, label="data")
    plane.plot(fit.real, fit.imag, color=figures.ORANGE, label="fit")
    plane.set_aspect("equal", adjustable="datalim")
    plane.set_xlabel("real part [1]")
    plane.set_ylabel("imaginary part [1]")
    figures.legend_below(figure, plane)
    return figure


def _fine(omega: RealArray) -> np.ndarray:
    """The frequencies of the data and CURVE_POINTS others between them."""
    between = np.geomspace(omega[0], omega[-1], DRAWN_FREQUENCIES)
    return np.union1d(between[1:-1], omega)
