"""Axes that can be drawn whatever the numbers are: infinite or NaN limits and bars are left out."""

from __future__ import annotations

from functools import cache
from typing import Any

import numpy as np

from workbench._core.heavy_types import Axes

ROOM = 1.2
"""Factor by which a logarithmic axis extends beyond its data."""
NOTHING = (1.0, 10.0)
"""Limits of a logarithmic axis that has no data."""


@cache
def finite_axes() -> Any:
    """The workbench's class of axes: infinite or NaN numbers do not set limits."""
    from matplotlib import axes

    plain: Any = axes.Axes

    class FiniteAxes(plain):
        def set_xlim(self, left: Any = None, right: Any = None, **rest: Any) -> Any:
            return super().set_xlim(_finite_limits(left), _finite_limits(right), **rest)

        def set_ylim(self, bottom: Any = None, top: Any = None, **rest: Any) -> Any:
            return super().set_ylim(_finite_limits(bottom), _finite_limits(top), **rest)

        def errorbar(self, x: Any, y: Any, yerr: Any = None, xerr: Any = None, **rest: Any) -> Any:
            """As Matplotlib's, but a mean may lie outside its interval.

            On that side there is no bar.
            """
            up, across = (None if one is None else np.maximum(one, 0.0) for one in (yerr, xerr))
            return super().errorbar(x, y, up, across, **rest)

    return FiniteAxes


def _finite_limits(end: Any) -> Any:
    """One limit, or both; None in place of a number that is not finite."""
    if np.iterable(end):
        return tuple(_finite_limits(one) for one in end)
    return end if end is None or np.isfinite(end) else None


def mend_limits(panel: Axes) -> None:
    """Set limits of logarithmic axes that have none; Matplotlib sets none for a bar of NaN.

    The limits enclose the finite, positive numbers of lines and bars.
    """
    for name, scale in (("x", panel.get_xscale()), ("y", panel.get_yscale())):
        low, high = sorted(getattr(panel, f"get_{name}lim")())
        if scale == "log" and not 0.0 < low < high < np.inf:
            data = _positive_data(panel, name)
            ends = (data.min() / ROOM, data.max() * ROOM) if data.size else NOTHING
            getattr(panel, f"set_{name}lim")(*ends)


def _positive_data(panel: Axes, name: str) -> Any:
    """The finite, positive numbers of lines and bars along an axis."""
    along = {"x": "horizontal", "y": "vertical"}[name]
    every = [np.zeros(0), *(np.ravel(getattr(line, f"get_{name}data")()) for line in panel.lines)]
    bars: list[Any] = [one for one in panel.containers if hasattr(one, "datavalues")]
    every += [np.ravel(one.datavalues) for one in bars if one.orientation == along]
    values = np.concatenate(every).astype(float)
    return values[np.isfinite(values) & (values > 0)]
