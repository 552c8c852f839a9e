"""The first stadiums of chapter 5, around the responses of the twelve drives."""

from __future__ import annotations

import numpy as np

from workbench import problem
from workbench.geometry import NarrowestStadium

from ..drive.plants import Gain
from ..drive.shared_parameters import TABLES, WINDOWS, Frequencies, Frequency
from ..drive.tables import Axis, Values
from .nyquist_points import nyquist_points


@problem("cd/{axis}/stadiums", axis=("focus", "radial"), data=TABLES)
def stadiums(
    axis: Axis,
    frequencies: Frequencies = 400,
    lowest: Frequency = 5.0,
    highest: Frequency = 5000.0,
    gain: Gain = "own",
    values: Values = "printed",
    angle: float | None = None,
) -> NarrowestStadium:
    """Narrowest stadiums around the Nyquist points of twelve drives (section 5.4.1, figure 5.8).

    At each frequency the twelve responses from control voltage to normalised error are a set of
    points; the narrowest stadium around them is the first set of the mixed uncertainty model.

    frequencies, gain, values: as in cd/<axis>/circles. angle [rad]: one direction for all
    stadiums, which makes the problem convex; free by default.
    """
    points = nyquist_points(axis, frequencies, lowest, highest, gain, values)
    given = None if angle is None else np.asarray(angle)
    return NarrowestStadium(points, center=None, angle=given, windows=WINDOWS[axis])
