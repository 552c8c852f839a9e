"""Lower bounds on the peak of every controller at 5X."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from workbench.arrays import RealArray
from workbench.executor import Context
from workbench.synthesis import (
    DualCertificate,
    highest_proven,
    hinf,
    largest_least_mu,
    regularised,
)

from ..control_problem import generalised
from ..design import NOISE
from ..loop_weights import BASIS, unit_uncertainty
from .uncertain_loop import UncertainLoop

BOUNDED = ("disturbance", "both")
"""Channels that no controller makes as small as it likes; K = 0 does the control channel."""
NEARLY = NOISE / 10
"""Noise with which the nominal optimum is looked for: less than a design should have."""
ABOVE = 1.002
"""Times the pointwise bound, where a set is nearly a point, is the least level to be proven."""


def lower_bounds(
    uncertain: UncertainLoop, omega: RealArray, best: float, context: Context
) -> dict[str, Any]:
    """Variables: by every frequency alone, by the nominal plant alone, and by both together.

    `omega` (F,) [rad/s], `best` a peak that a controller has.
    """
    pointwise = {
        name: largest_least_mu(partial(uncertain.weights, channel=name), omega) for name in BOUNDED
    }
    at_one, _ = largest_least_mu(partial(uncertain.weights, speed=1.0), omega)
    whole = generalised(uncertain.axis, unit_uncertainty(uncertain.model.nominal), uncertain.speed)
    optimal = hinf(regularised(whole.channel(("z_p", "z_u"), "w_p").nominal(), NEARLY))
    W = uncertain.weights(omega)
    nominal = W.performance * W.control / np.hypot(W.performance, W.control)
    ends = {
        "nominal": (float(nominal.max()), optimal.norm),
        "dynamic": (ABOVE * pointwise["both"][0], best),
    }
    proofs = []
    for name, (low, high) in ends.items():
        sets = uncertain.sets[name]
        found = highest_proven(sets, BASIS, low, high, context) if low < high else None
        proofs.append(found or DualCertificate(np.nan, np.full(BASIS.corners.shape, np.nan), BASIS))
    one = {"units": "1"}
    return {
        "pointwise_bound": (
            "bounded",
            [bound for bound, _ in pointwise.values()],
            one | {"long_name": "mu that every controller has at one frequency"},
        ),
        "pointwise_frequency": (
            "bounded",
            [at / (2 * np.pi) for _, at in pointwise.values()],
            {"units": "Hz", "long_name": "frequency of the pointwise bound"},
        ),
        "pointwise_bound_1X": ((), at_one, one | {"long_name": "pointwise bound of both at 1X"}),
        "nominal_norm": ((), optimal.norm, one | {"long_name": "norm of the H-infinity loop"}),
        "proven_level": (
            "proof",
            [proof.level for proof in proofs],
            one | {"long_name": "level that no controller reaches"},
        ),
        "proof_coefficients": (
            ("proof", "pole"),
            [proof.coefficients for proof in proofs],
            one | {"long_name": "h of the proof"},
        ),
        "proof": list(ends),
        "pole": ("pole", -BASIS.corners, {"units": "rad/s", "long_name": "pole of h"}),
    }
