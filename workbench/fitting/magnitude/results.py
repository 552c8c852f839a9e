"""Datasets and figures of magnitude fits."""

from __future__ import annotations

import numpy as np

from workbench import figures as style
from workbench._core.arrays import RealArray
from workbench._core.heavy_types import Dataset, Figure
from workbench.fitting.rational import Rational
from workbench.fitting.storage import rational_variables

CURVE_POINTS = 10
"""Number of points of the drawn curve in each interval of the data."""


def magnitude_dataset(
    omega: RealArray, magnitude: RealArray, weight: RealArray, answer: Rational
) -> Dataset:
    """Data (F,) at omega [rad/s], the fitted magnitude, and the fit's roots and gain."""
    import xarray as xr

    plain = {"units": "1"}
    fitted = np.abs(answer.response(omega))
    variables = {
        "magnitude": ("omega", magnitude, plain | {"long_name": "magnitude to fit"}),
        "weight": ("omega", weight, plain | {"long_name": "weight of the error"}),
        "fit": ("omega", fitted, plain | {"long_name": "magnitude of the fit"}),
        **rational_variables(answer, "the fit"),
    }
    attributes = {"units": "rad/s", "long_name": "angular frequency"}
    return xr.Dataset(variables, coords={"omega": ("omega", omega, attributes)})


def figures(
    omega: RealArray,
    magnitude: RealArray,
    weight: RealArray,
    answer: Rational,
    *,
    worst: float,
    bound: float,
    cover: bool,
) -> dict[str, Figure]:
    """Magnitudes over frequency, and the weighted relative error between its bounds.

    Parameters
    ----------
    omega, magnitude, weight
        The data (F,), frequencies in rad/s.
    answer
        The fit.
    worst
        Largest weighted relative error of the fit.
    bound
        Lower bound on the error of every fit of the same order.
    cover
        Whether the fit covers the data, so that its error has one sign.
    """
    figure, (top, below) = style.axes(2, 1, size=(7.0, 5.6), sharex=True)
    hertz = omega / (2 * np.pi)
    steps = np.arange((hertz.size - 1) * CURVE_POINTS + 1) / CURVE_POINTS
    dense = np.exp(np.interp(steps, np.arange(hertz.size), np.log(hertz)))
    top.loglog(hertz, magnitude, ".", color=style.BLACK, markersize=3, label="data")
    fitted = np.abs(answer.response(2 * np.pi * dense))
    top.loglog(dense, fitted, color=style.BLUE, label=f"fit of order {answer.order}")
    top.set_ylabel("magnitude [1]")

    relative = np.abs(answer.response(omega)) / magnitude - 1
    below.semilogx(hertz, weight * relative, color=style.BLUE)
    signs = (1,) if cover else (1, -1)
    for sign in signs:
        below.axhline(sign * worst, color=style.ORANGE)
        below.axhline(sign * bound, color=style.GREEN, linestyle="--")
    # lines of the lower panel, named in the one legend
    top.plot([], [], color=style.ORANGE, label="worst error")
    top.plot([], [], color=style.GREEN, linestyle="--", label="no fit is better than")
    if cover:
        below.axhline(0, color=style.BLACK, linewidth=0.8)
    below.set_ylabel("weighted relative error [1]")
    below.set_xlabel("frequency [Hz]")
    style.legend_below(figure, top)
    return {"magnitude": figure}
