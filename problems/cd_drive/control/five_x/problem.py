"""Robust performance at five times the disc's nominal speed (section 6.3.2, figure 6.5).

Figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from typing import Any

from workbench import Run, problem, ref

from ...drive.plants import Gain
from ...drive.shared_parameters import TABLES, Frequencies
from ...drive.tables import Axis
from ..design import CoverMethod, cover_of
from .study import FiveX
from .uncertain_loop import SPEED


def needs(
    axis: str, frequencies: int = 400, cover: CoverMethod = "steps", gain: Gain = "own", **_: Any
) -> dict[str, Any]:
    """References to the stadium cover, and to the controller designed with it for 5X."""
    choice: Any = {"form": "stadium", "cover": cover, "frequencies": frequencies, "gain": gain}
    designed = ref(f"cd/{axis}/controller", method="dk", speed=SPEED, after="", **choice)
    return cover_of(axis, **choice) | {"designed": designed}


@problem("cd/{axis}/five-x", slow=True, axis=("focus", "radial"), needs=needs, data=TABLES)
def five_x(
    axis: Axis,
    covered: Run,
    designed: Run,
    frequencies: Frequencies = 400,
    cover: CoverMethod = "steps",
    gain: Gain = "own",
) -> FiveX:
    """What controllers reach at 5X with stadium uncertainty, and what none can (6.3.2, fig. 6.5).

    Peaks are certified for the mu-PID, with its own gain and with the gain that makes both channels
    equally bad, for the mu controller of full order, and for one of ninth order. In the thesis all
    of them are above 1, and it concludes that this hardware cannot be driven at 5X. Whether any
    controller can do it is answered by lower bounds on the peak of every linear controller: for the
    nominal plant, for each frequency by itself, and for both together.

    The controller of full order is by D-K iteration, which reaches 2.26 (focus) and 2.54 (radial);
    (mu, D)-K iteration ends at 57.7 and 2.57 (cover "steps", 120 frequencies). A search among all
    controllers of ninth order, from the reduced one (`cd/focus/controller` by "fixed" with order=9
    and after="dk"), reaches 2.293.

    frequencies: number of frequencies of the cover, from 5 Hz to 5 kHz. cover: by the "steps" of
    the thesis, or "joint". gain: of the twelve drives.
    """
    return FiveX(axis, covered, designed)
