"""Stability while controllers switch, which the thesis leaves open (sections 8.5 to 8.7).

Section and figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from typing import Annotated

from pydantic import Field

from workbench import Run, problem, ref

from ...drive.plants import Gain
from ...drive.shared_parameters import TABLES
from ...drive.tables import Axis
from .study import SwitchingStability


@problem(
    "cd/{axis}/switching-stability",
    slow=True,
    axis=("focus", "radial"),
    needs=lambda axis, **_: {"lower": ref(f"cd/{axis}/lower-bandwidth")},
    data=TABLES,
)
def switching_stability(
    axis: Axis,
    lower: Run,
    defect_mm: Annotated[float, Field(gt=0, le=10)] = 2.5,
    delay: Annotated[float, Field(ge=0, le=5)] = 1.0,
    displacement: Annotated[float, Field(ge=0, le=10)] = 0.0,
    gain: Gain = "own",
    common: bool = False,
) -> SwitchingStability:
    """Whether the loop stays stable while surface defects switch its controller (figure 8.10).

    In clean parts K (eq. 6.12) is in the loop. While a defect passes it is replaced by nothing (the
    reference strategy), by K (1 - F) with F a first-order high-pass of 450 Hz (strategy C, figure
    8.6), or by K' of `cd/<axis>/lower-bandwidth`; the integrator is shared.

    - Margins of K, K (1 - F) and K', and the share of the parametric set that each tolerates.
    - Dwell times by LMIs: the shortest distance between defects for which any sequence of defects
      up to the longest is stable, of each drive, beside the longest that a periodic switching
      makes unstable, found among all pairs of stays: one less than what is proven where the proof
      is tight; from K to K' and back over all of the parametric set, cell by cell: at any
      time in focus, even over twice its extent, with a millimetre between defects radially.
    - The true error at sampling instants, bounded for every sequence of defects by these functions
      and simulated, for a disc that moves in one harmonic of the Red Book's envelope at a time; the
      strategies in the virtual laboratory beside it, at 9 Hz.

    defect_mm: longest defect [mm]; 2.5 is what the error correction repairs. delay: of the computer
    [samples]; with the parametric set it is always 1. displacement: largest false displacement by
    defects, over the acceptable error. gain: of the twelve loops. common: whether one set of
    functions for all drives is searched, too, in the coordinates of each drive's resonances (takes
    minutes).
    """
    K = lower.answer.K
    return SwitchingStability(axis, K, defect_mm / 1e3, delay, displacement, gain, common)
