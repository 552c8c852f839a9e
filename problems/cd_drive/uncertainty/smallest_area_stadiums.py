"""Stadiums of the smallest area around the responses of the twelve drives (section 5.4)."""

from __future__ import annotations

from workbench import problem
from workbench.geometry import SmallestAreaStadium

from ..drive.plants import Gain
from ..drive.shared_parameters import TABLES, WINDOWS, Frequencies, Frequency
from ..drive.tables import Axis, Values
from .nyquist_points import nyquist_points


@problem("cd/{axis}/smallest-area-stadiums", axis=("focus", "radial"), data=TABLES)
def smallest_area_stadiums(
    axis: Axis,
    frequencies: Frequencies = 400,
    lowest: Frequency = 5.0,
    highest: Frequency = 5000.0,
    gain: Gain = "own",
    values: Values = "printed",
) -> SmallestAreaStadium:
    """Stadiums of the smallest area around the Nyquist points of twelve drives (section 5.4).

    This is the thesis' other criterion, besides the narrowest stadiums of cd/<axis>/stadiums.
    Method "narrowest" gives the latter, so that a comparison shows how much larger their area is.

    frequencies, gain, values: as in cd/<axis>/circles.
    """
    points = nyquist_points(axis, frequencies, lowest, highest, gain, values)
    return SmallestAreaStadium(points, windows=WINDOWS[axis])
