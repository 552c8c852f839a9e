"""Limits of axes that no data can tell."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench.heavy_types import Axes

ROOM = 1.2
"""Factor by which a logarithmic axis reaches beyond its data."""
NOTHING = (1.0, 10.0)
"""Limits of a logarithmic axis that has no data."""


def mend_limits(panel: Axes) -> None:
    """Give limits to logarithmic axes that have none: a bar of NaN leaves Matplotlib without any.

    They reach over what is finite and positive in lines and bars.
    """
    for name, scale in (("x", panel.get_xscale()), ("y", panel.get_yscale())):
        low, high = sorted(getattr(panel, f"get_{name}lim")())
        if scale == "log" and not 0.0 < low < high < np.inf:
            data = _drawn(panel, name)
            ends = (data.min() / ROOM, data.max() * ROOM) if data.size else NOTHING
            getattr(panel, f"set_{name}lim")(*ends)


def _drawn(panel: Axes, name: str) -> Any:
    """The finite, positive numbers of lines and bars along an axis."""
    along = {"x": "horizontal", "y": "vertical"}[name]
    every = [np.zeros(0), *(np.ravel(getattr(line, f"get_{name}data")()) for line in panel.lines)]
    bars: list[Any] = [one for one in panel.containers if hasattr(one, "datavalues")]
    every += [np.ravel(one.datavalues) for one in bars if one.orientation == along]
    values = np.concatenate(every).astype(float)
    return values[np.isfinite(values) & (values > 0)]
