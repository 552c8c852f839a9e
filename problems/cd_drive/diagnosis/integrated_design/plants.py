"""Plants of a loop for which controller and filter are designed, separately or together.

    y = D d + W f + N n - G u,     e = D d - G u,
    z_p = e (leakage allowed) / (error allowed),     z_u = u / 100,     z_f = W f - u_f

D d is the disc's deviation by the Red Book, N n the measurement noise and W f a defect. D and N are
divided by the allowed leakage, W by the allowed relative error. z_p is the loop's error over the
acceptable one, z_u is as in section 6.3. The unit of length is the allowed leakage.
"""

from __future__ import annotations

import numpy as np

from workbench.certify import certified_norm
from workbench.systems import realisation
from workbench.types import StateSpace
from workbench.uncertainty import GeneralisedPlant, generalised_plant

from ...drive.plants import nominal_parameters, plant, total_gain
from ...drive.red_book import ACCEPTABLE_ERROR
from ...drive.tables import Axis
from ...laboratory.bench_setup import NOISE
from ..fault_filter.loop import disc_weight
from ..fault_filter.peers import defect_weight

ERROR, LEAKAGE = 0.3, {"focus": 0.5e-6, "radial": 0.05e-6}
"""Allowed relative error, and allowed leakage of the disc [m]: a quarter of the loop's acceptable
error.
"""
CONTROL = 0.01
"""W_u K_optn of section 6.3."""


def drive(axis: Axis) -> StateSpace:
    """The nominal drive with its anti-aliasing filter: u to the part of y that it subtracts."""
    import control

    return control.ss(plant(nominal_parameters(axis), total_gain(axis)))


def weights(axis: Axis) -> tuple[StateSpace, StateSpace]:
    """W of defects (eq. 7.32 over the allowed error), and D of the disc (over the
    allowed leakage).
    """
    return defect_weight() / ERROR, disc_weight(axis) / LEAKAGE[axis]


def control_plant(axis: Axis) -> GeneralisedPlant:
    """(d, n) -> (z_p, z_u) with u from y, for a controller alone."""
    _, D, N = _signals(axis)
    return generalised_plant(
        [(drive(axis), "u", "x"), *_performance(axis), D, N],
        {"e": "x_cd - x", "y": "x_cd + noise - x"},
        exogenous=["d", "n"],
        control="u",
        performance=["z_p", "z_u"],
        measurement="y",
    )


def filter_plant(axis: Axis, K: StateSpace) -> GeneralisedPlant:
    """(d, n, f) -> z_f with u_f from y, for a filter beside a controller."""
    return generalised_plant(
        [(drive(axis), "u", "x"), (K, "y", "u"), *_signals(axis)],
        {"y": "x_cd + f_sd + noise - x", "z_f": "f_sd - u_f"},
        exogenous=["d", "n", "f"],
        control="u_f",
        performance="z_f",
        measurement="y",
    )


def joint_plant(axis: Axis, share: float) -> GeneralisedPlant:
    """(d, n, f) -> (z_p, z_u, share z_f) with u and u_f from y, for both in one synthesis."""
    return generalised_plant(
        [
            (drive(axis), "u", "x"),
            *_performance(axis),
            *_signals(axis),
            (_constant(share), "z", "z_f"),
        ],
        {"e": "x_cd - x", "y": "x_cd + f_sd + noise - x", "z": "f_sd - u_f"},
        exogenous=["d", "n", "f"],
        control=["u", "u_f"],
        performance=["z_p", "z_u", "z_f"],
        measurement="y",
    )


def channel_norm(loop: StateSpace, outputs: list[int], inputs: list[int]) -> float:
    """Certified H-infinity norm of some channels of a closed loop."""
    D = np.asarray(loop.D)[np.ix_(outputs, inputs)]
    return certified_norm(realisation((loop.A, loop.B[:, inputs], loop.C[outputs], D), 0.0))


def carried_over(axis: Axis, F: StateSpace, K: StateSpace, other: StateSpace) -> StateSpace:
    """F (1 + G other) / (1 + G K): the filter with `other` that is equivalent to F with K."""
    import control

    G = drive(axis)
    return control.ss(F * control.feedback(1, G * K) * (1 + G * other))


Block = tuple[StateSpace, str, str]


def _signals(axis: Axis) -> tuple[Block, Block, Block]:
    """Weights of defect, disc and noise."""
    W, D = weights(axis)
    return (
        (W, "f", "f_sd"),
        (D, "d", "x_cd"),
        (_constant(NOISE[axis] / LEAKAGE[axis]), "n", "noise"),
    )


def _performance(axis: Axis) -> list[Block]:
    error = _constant(LEAKAGE[axis] / ACCEPTABLE_ERROR[axis])
    return [(error, "e", "z_p"), (_constant(CONTROL), "u", "z_u")]


def _constant(value: float) -> StateSpace:
    import control

    return control.ss([], [], [], [[value]])
