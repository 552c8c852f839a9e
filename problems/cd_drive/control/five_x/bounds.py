"""Lower bounds on the peak of every controller at 5X."""

from __future__ import annotations

import numpy as np

from workbench.executor import Context
from workbench.synthesis import DualCertificate, LoopFunctions, highest_certificate, regularise
from workbench.types import RealArray
from workbench.uncertainty import GeneralisedPlant

from ..control_problem import generalised
from ..design import MEASUREMENT_NOISE
from ..loop_weights import BASIS, unit_uncertainty
from .uncertain_loop import UncertainLoop

BOUNDED = ("disturbance", "both")
"""Channels with a lower bound on mu for every controller; for the control channel it is 0, by K =
0.
"""
PROOFS = ("nominal", "dynamic")
"""Bounds over all frequencies: for the nominal plant, and for the uncertain one."""
LEAST_NOISE = MEASUREMENT_NOISE / 10
"""Measurement noise in the synthesis of the nominal optimum; smaller than a design should have."""
START_FACTOR = 1.002
"""Least level to be proven, over the pointwise bound, at which a set would shrink to a point."""


def nominal_plant(uncertain: UncertainLoop) -> GeneralisedPlant:
    """The plant of H-infinity synthesis for the nominal drive, with both channels."""
    whole = generalised(uncertain.axis, unit_uncertainty(uncertain.model.nominal), uncertain.speed)
    return regularise(
        whole.channel(performance=("z_p", "z_u"), exogenous="w_p").nominal(), LEAST_NOISE
    )


def nominal_level(uncertain: UncertainLoop, omega: RealArray) -> float:
    """Lower bound for every controller of the nominal plant, at frequencies [rad/s] (F,)."""
    W = uncertain.weights(omega)
    nominal = W.performance * W.control / np.hypot(W.performance, W.control)
    return float(nominal.max())


def proof_between(
    loop: LoopFunctions, low: float, high: float, context: Context
) -> DualCertificate:
    """Highest level between two levels that is proven for every controller; NaN if
    there is none.
    """
    found = highest_certificate(loop, BASIS, low, high, context) if low < high else None
    return found or DualCertificate(np.nan, np.full(BASIS.corners.shape, np.nan), BASIS)
