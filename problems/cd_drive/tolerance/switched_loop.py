"""The sampled loop of a drive while surface defects switch its controller (chapter 8).

With w the disc's deviation, x the lens, both in um, and AAF the anti-aliasing filter,

    eps = k AAF (w - x)    measured error [units],   u = z + C_i f + D_i eps,   z' = a z + b_i eps.

z is the integrator. f are the fast states of every controller and filter, which run all the time.
Both controllers have the same slow pole a. The integrator is shared, so that u keeps its slow part
when the controller changes. While a defect passes, the strategy replaces the controller K of the
clean parts:

    open    the reference strategy of section 8.2: eps = 0 to K, whose states run on
    filter  figure 8.6 as the thesis has it: K (1 - F), F a first-order high-pass of 450 Hz
    lower   figure 8.6 designed as one: K' of `cd/<axis>/lower-bandwidth`
    none    K goes on

Section and figure numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of
CD-players (2003).
"""

from __future__ import annotations

from typing import Literal

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.simulation import sampled_model
from workbench.synthesis import (
    SampledPlant,
    discretise,
    dropout_modes,
    filtering_modes,
    replacement_modes,
    unswitched_modes,
)
from workbench.systems.realisation import modal_form

from ..diagnosis.stand_in import low_pass
from ..drive.actuator import specific_model
from ..drive.plants import ANTIALIASING
from ..drive.tables import ActuatorParameters
from ..laboratory.bench_setup import PERIOD

Strategy = Literal["none", "open", "filter", "lower"]
MICRO = 1e-6
"""A micrometre [m]."""


def lens_model(
    parameters: ActuatorParameters, K_total: float, K_optn: float, delay: float
) -> SampledPlant:
    """Sampled plant of a drive: u [V] -> lens, and lens behind the anti-aliasing filter [um].

    K_optn: gain [units/m] from the filtered error to the measured one. delay [samples].
    """
    import control

    moving = specific_model(parameters).state_space()
    A4, B4, C4 = modal_form(moving.A, moving.B, K_total / (K_optn * MICRO) * moving.C)
    n = len(A4)
    A = np.zeros((n + 1, n + 1))
    A[:n, :n] = A4
    A[n, :n], A[n, n] = ANTIALIASING * C4[0], -ANTIALIASING
    outputs = np.zeros((2, n + 1))
    outputs[0, :n], outputs[1, n] = C4[0], 1.0
    B = np.vstack([B4, [[0.0]]])
    P = sampled_model(control.ss(A, B, outputs, 0.0), PERIOD, delay_samples=delay)
    return SampledPlant(P.A, P.B, P.C[:1], P.C[1:], K_optn * MICRO, PERIOD, filtered)


def regulators(
    K: StateSpace, strategy: Strategy, lower: StateSpace | None = None
) -> tuple[StateSpace, StateSpace]:
    """Controllers in clean parts and during defects, from continuous K and, for "lower", K'.

    Raises InputError for an unknown strategy, a missing K', and a K' with another slow pole than K.
    """
    sampled_K = discretise(K, PERIOD)
    if strategy == "none":
        return unswitched_modes(sampled_K)
    if strategy == "open":
        return dropout_modes(sampled_K)
    if strategy == "filter":
        return filtering_modes(sampled_K, discretise(low_pass(), PERIOD))
    if strategy != "lower":
        raise InputError(f'strategy is {strategy!r}; it must be "none", "open", "filter", "lower"')
    if lower is None:
        raise InputError('strategy "lower" needs a controller K\'; none is given')
    return replacement_modes(sampled_K, discretise(lower, PERIOD))


def filtered(omega: RealArray) -> ComplexArray:
    """Response of the anti-aliasing filter at omega [rad/s]."""
    return np.asarray(ANTIALIASING / (1j * omega + ANTIALIASING))
