"""Lower bounds on the peak of every controller at 5X."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import numpy as np

from workbench.arrays import RealArray
from workbench.executor import Context
from workbench.synthesis import (
    DualCertificate,
    LargestLeastMu,
    highest_proven,
    hinf,
    largest_least_mu,
    regularised,
)

from ..control_problem import generalised
from ..design import MEASUREMENT_NOISE
from ..loop_weights import BASIS, unit_uncertainty
from .uncertain_loop import UncertainLoop

BOUNDED = ("disturbance", "both")
"""Channels whose mu no controller makes arbitrarily small; K = 0 makes the control channel 0."""
PROOFS = ("nominal", "dynamic")
"""Bounds over all frequencies: for the nominal plant, and for the uncertain one."""
LEAST_NOISE = MEASUREMENT_NOISE / 10
"""Measurement noise in the synthesis of the nominal optimum; less than a design should have."""
START_FACTOR = 1.002
"""Least level to be proven over the pointwise bound, at which a set would shrink to a point."""


class LowerBounds(NamedTuple):
    """Levels of mu that no controller stays below, by three kinds of reasoning."""

    pointwise: list[LargestLeastMu]
    """For each channel of BOUNDED: mu that every controller has at one frequency [rad/s]."""
    pointwise_1x: float
    """The same for both channels at the disc's nominal speed."""
    nominal_norm: float
    """Norm of the loop by H-infinity synthesis for the nominal plant."""
    proofs: list[DualCertificate]
    """Certificates over all frequencies, for each of PROOFS; NaN where none was found."""


def lower_bounds(
    uncertain: UncertainLoop, omega: RealArray, best: float, context: Context
) -> LowerBounds:
    """Lower bounds by each frequency alone, by the nominal plant alone, and by both together.

    `omega` (F,) [rad/s]; `best` is a peak of mu that some controller has.
    """
    pointwise = [largest_least_mu(partial(uncertain.weights, channel=c), omega) for c in BOUNDED]
    at_one = largest_least_mu(partial(uncertain.weights, speed=1.0), omega).lower
    whole = generalised(uncertain.axis, unit_uncertainty(uncertain.model.nominal), uncertain.speed)
    optimal = hinf(regularised(whole.channel(("z_p", "z_u"), "w_p").nominal(), LEAST_NOISE))
    W = uncertain.weights(omega)
    nominal = W.performance * W.control / np.hypot(W.performance, W.control)
    ends = {
        "nominal": (float(nominal.max()), optimal.norm),
        "dynamic": (START_FACTOR * pointwise[BOUNDED.index("both")].lower, best),
    }
    proofs = []
    for name in PROOFS:
        loop, (low, high) = uncertain.loops[name], ends[name]
        found = highest_proven(loop, BASIS, low, high, context) if low < high else None
        proofs.append(found or DualCertificate(np.nan, np.full(BASIS.corners.shape, np.nan), BASIS))
    return LowerBounds(pointwise, at_one, optimal.norm, proofs)
