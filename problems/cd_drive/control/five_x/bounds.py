"""Lower bounds on the peak of every controller at 5X."""

from __future__ import annotations

from functools import partial
from typing import Any

import numpy as np

from workbench.arrays import RealArray
from workbench.executor import Context
from workbench.fitting.rational import Rational
from workbench.synthesis import hinf, regularised
from workbench.uncertainty import GeneralisedPlant, UncertaintyModel

from ..control_problem import generalised
from ..design import NOISE
from ..dual_bound import POLES, Proof, highest_proven
from ..least_mu import largest_least_mu
from ..rank_one import NONE
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
    optimal = hinf(regularised(nominal_plant(uncertain), NEARLY))
    W = uncertain.weights(omega)
    nominal = W.performance * W.control / np.hypot(W.performance, W.control)
    ends = {
        "nominal": (float(nominal.max()), optimal.norm),
        "dynamic": (ABOVE * pointwise["both"][0], best),
    }
    proofs = []
    for name, (low, high) in ends.items():
        found = highest_proven(uncertain.sets[name], low, high, context) if low < high else None
        proofs.append(found or Proof(np.nan, np.full(POLES.shape, np.nan)))
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
        "pole": ("pole", -POLES, {"units": "rad/s", "long_name": "pole of h"}),
    }


def nominal_plant(uncertain: UncertainLoop) -> GeneralisedPlant:
    """Without uncertainty, w_p to both outputs."""
    import control

    none = UncertaintyModel(uncertain.model.nominal, Rational(NONE, NONE, 1.0))
    plant = generalised(uncertain.axis, none, uncertain.speed).channel(("z_p", "z_u"), "w_p")
    P = plant.system
    system = control.ss(P.A, P.B[:, 1:], P.C[1:], P.D[1:, 1:])
    return GeneralisedPlant(system, None, plant.controls, plant.measurements)
