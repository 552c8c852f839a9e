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
    - Dwell times by LMIs, for each drive: the shortest distance between defects at which any
      sequence of defects up to the longest is proven stable, and the longest distance that a
      periodic switching makes unstable, searched among all pairs of stays. If the proof is tight,
      the second is one sample less than the first. Switching from K to K' and back is proven for
      the whole parametric set, cell by cell: at any time in focus, even for twice the set's
      extent; radially with a millimetre between defects.
    - The true error at sampling instants, for a disc that moves in one harmonic of the Red Book's
      envelope at a time: bounded by the functions of the proofs for every sequence of defects, and
      simulated. It is compared with the strategies in the virtual laboratory at 9 Hz.

    defect_mm: longest defect [mm]; 2.5 is what the error correction repairs. delay: of the computer
    [samples]; with the parametric set it is always 1. displacement: largest false displacement by
    defects, over the acceptable error. gain: of the twelve loops. common: whether one set of
    functions for all drives is searched, too, in the coordinates of each drive's resonances (takes
    minutes).
    """
    K = lower.answer.K
    return SwitchingStability(axis, K, defect_mm / 1e3, delay, displacement, gain, common)
