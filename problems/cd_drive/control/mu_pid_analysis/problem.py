"""Robust performance of the reference controller under three uncertainty models (section 6.3).

Figure and section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from typing import Any, Literal

from workbench import problem, ref

from ...drive.plants import GAIN_VARIANTS
from ...drive.shared_parameters import TABLES, Frequencies
from ...drive.tables import Axis
from .study import COVERS, MuPidAnalysis


def needs(
    axis: str, frequencies: int = 400, cover: Literal["steps", "joint"] = "steps", **_: Any
) -> dict[str, Any]:
    """References to the circles and stadiums of the three gain variants."""
    return {
        f"{form}_{gain}": ref(
            f"cd/{axis}/{form}-cover", method=cover, frequencies=frequencies, gain=gain
        )
        for form in COVERS
        for gain in GAIN_VARIANTS
    }


@problem("cd/{axis}/mu-pid-analysis", axis=("focus", "radial"), needs=needs, data=TABLES)
def mu_pid_analysis(  # type: ignore[no-untyped-def]
    axis: Axis,
    circle_own,
    circle_equal,
    circle_agc,
    stadium_own,
    stadium_equal,
    stadium_agc,
    frequencies: Frequencies = 400,
    cover: Literal["steps", "joint"] = "steps",
) -> MuPidAnalysis:
    """The mu-PID's robust performance by parametric, circle and stadium uncertainty (6.3.1, 6.3.2).

    Peaks are certified between frequencies, at disc speeds 1X and 5X, for the disturbance channel
    w_p -> z_p, the control channel w_u -> z_u and both together, and for the three gain variants of
    the drives (figures 6.4 and 6.5). Mu of the sets themselves, before weights are fitted to them,
    is given for comparison, and at 5X the gain at which both channels are equally bad.

    frequencies: number of frequencies of the covers, from 5 Hz to 5 kHz. cover: models by the
    "steps" of the thesis, or the "joint" ones.
    """
    runs = {
        ("circle", "own"): circle_own,
        ("circle", "equal"): circle_equal,
        ("circle", "agc"): circle_agc,
        ("stadium", "own"): stadium_own,
        ("stadium", "equal"): stadium_equal,
        ("stadium", "agc"): stadium_agc,
    }
    return MuPidAnalysis(axis, runs)
