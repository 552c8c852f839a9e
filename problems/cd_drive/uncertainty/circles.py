"""The first circles of chapter 5, around the responses of the twelve drives."""

from __future__ import annotations

from workbench import problem
from workbench.geometry import SmallestCircle

from ..drive.plants import Gain
from ..drive.shared_parameters import TABLES, WINDOWS, Frequencies, Frequency
from ..drive.tables import Axis, Values
from .nyquist_points import nyquist_points


@problem("cd/{axis}/circles", axis=("focus", "radial"), data=TABLES)
def circles(
    axis: Axis,
    frequencies: Frequencies = 400,
    lowest: Frequency = 5.0,
    highest: Frequency = 5000.0,
    gain: Gain = "own",
    values: Values = "printed",
) -> SmallestCircle:
    """Smallest circles around the Nyquist points of twelve drives (section 5.3.1, figure 5.6).

    At each frequency the twelve responses from control voltage to normalised error are a set of
    points; the smallest circle around them is the first set of the complex uncertainty model.

    frequencies: number of frequencies, logarithmically spaced from lowest to highest [Hz]. gain:
    "own" optical gain of each drive, "equal" for all, or equalised at crossover as the automatic
    gain control does ("agc"). values: tables "printed" or "corrected".
    """
    points = nyquist_points(axis, frequencies, lowest, highest, gain, values)
    return SmallestCircle(points, windows=WINDOWS[axis])
