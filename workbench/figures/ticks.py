"""Labels of the ticks of logarithmic axes."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from workbench._core.heavy_types import Axes

NARROW_AXIS = 1.7
"""Logarithmic axes of at most so many decades also have labels between powers of ten."""
NARROWEST_AXIS = 0.5
"""Logarithmic axes of at most so many decades have a label at every tick."""
FEWEST = 2
"""Fewest labels at 1, 2 and 5 times powers of ten; if there are fewer, every tick is labelled."""
PLAIN_DECADES = (-3, 4)
"""Exponents of ten that are written as plain numbers, if no tick of the axis lies beyond them."""


def house_ticks(panel: Axes) -> None:
    """Label the ticks of all logarithmic axes in one way; ticks with given texts keep them."""
    from matplotlib.ticker import LogFormatter

    scales = ((panel.get_xscale(), panel.xaxis), (panel.get_yscale(), panel.yaxis))
    for scale, ticked in scales:
        if scale == "log" and isinstance(ticked.get_major_formatter(), LogFormatter):
            ticked.set_major_formatter(_log_tick(ticked, minor=False))
            ticked.set_minor_formatter(_log_tick(ticked, minor=True))


def _log_tick(axis: Any, minor: bool) -> Any:
    """Label of a logarithmic tick: powers of ten, and on a narrow axis 2 and 5 times those."""
    from matplotlib.ticker import FuncFormatter

    def decades() -> tuple[float, float]:
        low, high = np.log10(np.maximum(np.sort(axis.get_view_interval()), np.finfo(float).tiny))
        return float(low), float(high)

    def narrow() -> bool:
        low, high = decades()
        return high - low <= NARROW_AXIS

    def labelled() -> tuple[int, ...]:
        low, high = decades()
        usual = math.log10(2), math.log10(5), 1.0
        seen = sum(math.floor(high - at + 1e-9) - math.ceil(low - at - 1e-9) + 1 for at in usual)
        return tuple(range(2, 10)) if high - low <= NARROWEST_AXIS or seen < FEWEST else (2, 5)

    def plain() -> bool:
        low, high = decades()
        first = math.floor(low) if narrow() else math.ceil(low - 1e-9)
        return first >= PLAIN_DECADES[0] and math.floor(high + 1e-9) <= PLAIN_DECADES[1]

    def text(value: float, place: int | None = None) -> str:
        exponent = math.floor(math.log10(value) + 1e-9)
        digit = round(value / 10.0**exponent)
        if minor and not (digit in labelled() and narrow()):
            return ""
        if plain():
            return f"{value:g}"
        factor = "" if digit == 1 else rf"{digit}\times"
        return rf"${factor}10^{{{exponent}}}$"

    return FuncFormatter(text)
