"""The closed loop of plant and controller, seen from signals added in its channels."""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.systems.axis_poles import pole_may_be_at
from workbench.systems.balancing import singular
from workbench.systems.realisation import worst_pole
from workbench.uncertainty.algebra.connections import append, feedback, not_well_posed
from workbench.uncertainty.algebra.system import UncertainSystem, with_channels


def names_of_channels(G: UncertainSystem, K: UncertainSystem) -> dict[int, str]:
    """Names of the channels of `returned_loop` at which the loop is opened, by index."""
    m, p = G.ninputs, G.noutputs
    if m == p == 1 and not K.nstates and not K.elements:  # L alone: one place to open it
        return {m: "loop"}
    return dict(enumerate(channel_names(m, p)))


def matched_pair(plant: Any, controller: Any) -> tuple[UncertainSystem, UncertainSystem]:
    """Plant and controller; a number stands for as many channels as the plant has."""
    G, K = with_channels(plant, "plant"), with_channels(controller, "controller")
    constant = not K.nstates and not K.elements
    if K.value.shape == (1, 1) and constant and G.ninputs == G.noutputs:
        K = K * np.eye(G.ninputs)
    need_matching(G, K)
    return G, K


def need_matching(plant: Any, controller: Any) -> None:
    """Raise InputError unless inputs and outputs of plant and controller match."""
    if (controller.noutputs, controller.ninputs) != (plant.ninputs, plant.noutputs):
        raise InputError(
            f"plant has {plant.noutputs} outputs and {plant.ninputs} inputs, controller "
            f"{controller.noutputs} and {controller.ninputs}; they must fit each other"
        )


def returned_loop(G: UncertainSystem, K: UncertainSystem) -> UncertainSystem:
    """The closed loop u = -K y, from signals added to (u, y) to (u, y) before the addition."""
    m, p = G.ninputs, G.noutputs
    if singular(np.eye(p) + G.value.blocks[3] @ K.value.blocks[3]):
        raise not_well_posed("plant", G, "controller", K)
    # (u, y) before the addition is append(-K, G) times (y, u) after it.
    swap = np.block([[np.zeros((p, m)), np.eye(p)], [np.eye(m), np.zeros((m, p))]])
    closed = feedback(append(-K, G), swap, sign=1)
    return closed @ swap


def need_stable_loop(loop: StateSpace) -> None:
    """Raise InputError unless the nominal closed loop is stable."""
    worst, beyond = worst_pole(loop)
    if beyond >= 0:
        raise InputError(
            f"the closed loop is unstable at the nominal: it has a pole at {worst:.6g}; the loop "
            "is closed with negative feedback, u = -K y"
        )
    _need_clearly_stable(loop)


def _need_clearly_stable(loop: StateSpace) -> None:
    """Raise InputError if rounding of the entries of a stable loop may make it unstable."""
    poles = loop.poles()
    boundary = np.exp(1j * np.angle(poles)) if loop.dt else 1j * poles.imag
    for pole, point in zip(poles, boundary, strict=True):
        if pole_may_be_at(complex(point), loop.A):
            raise InputError(
                "the closed loop may be unstable at the nominal: rounding of its coefficients "
                f"moves its pole at {pole:.6g} to the boundary; give plant and controller as "
                "state-space systems, or sample more slowly"
            )


def channel_names(inputs: int, outputs: int) -> list[str]:
    return [
        *(f"input {k + 1}" if inputs > 1 else "input" for k in range(inputs)),
        *(f"output {k + 1}" if outputs > 1 else "output" for k in range(outputs)),
    ]


def opened_channel(returned: UncertainSystem, channel: int) -> UncertainSystem:
    """L of a channel, from S - 1: the other channels stay closed."""
    closed = returned[[channel], [channel]]
    # v = (S - 1) q = -L (v + q), so L = -(S - 1) / S, since the returned signal is fed back
    # positively.
    opened: UncertainSystem = -1.0 * feedback(closed, 1.0, sign=-1)
    return opened
