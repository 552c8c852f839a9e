"""The bilinear transformation s = (z - 1) / (z + 1), from sampled to continuous time and back."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.input_checks import need_positive, need_sampling_time
from workbench.systems.axis_poles import pole_may_be_at
from workbench.systems.conversion import as_states
from workbench.systems.joints import system_of
from workbench.systems.realisation import Matrices, realisation
from workbench.systems.standard_plant import StandardPlant


def continuous(plant: StandardPlant) -> StandardPlant:
    """Transform a sampled plant by s = (z - 1) / (z + 1), which keeps norms.

    A continuous plant is returned unchanged. Raises InputError where the plant has a pole at
    z = -1, which the transformation moves to infinity.
    """
    if not plant.dt:
        return plant
    A, B, C, D = to_continuous((plant.A, plant.B, plant.C, plant.D))
    return replace(plant, A=A, B=B, C=C, D=D, dt=0.0)


def to_continuous(sampled: Matrices) -> Matrices:
    """Transform a sampled realisation by s = (z - 1) / (z + 1).

    Raises InputError for a pole at z = -1.
    """
    A, B, C, D = sampled
    n = len(A)
    if n and pole_may_be_at(-1.0, A):
        raise InputError(
            "the system has a pole at z = -1, half the sampling rate; the bilinear transformation "
            "takes it to infinity: filter it or sample at another rate"
        )
    back = np.linalg.inv(A + np.eye(n))
    root = math.sqrt(2.0)
    return back @ (A - np.eye(n)), root * back @ B, root * C @ back, D - C @ back @ B


def to_sampled(K: Matrices) -> Matrices:
    """Transform a controller back by z = (1 + s) / (1 - s).

    Raises LinAlgError for a pole at s = 1.
    """
    A, B, C, D = K
    n = len(A)
    back = np.linalg.inv(np.eye(n) - A)
    root = math.sqrt(2.0)
    return back @ (A + np.eye(n)), root * back @ B, root * C @ back, D + C @ back @ B


def bilinear_continuous(system: Any) -> StateSpace:
    """The continuous system of a sampled one by s = (2 / T) (z - 1) / (z + 1), sampling time T [s].

    Its response at omega = (2 / T) tan(w T / 2) is the sampled one's at w [rad/s], so both have the
    same stability and the same norm. Raises InputError for a continuous system, for one without a
    sampling time, and for a pole at z = -1.

    Examples
    --------
    >>> import control
    >>> from workbench.systems import bilinear_continuous, bilinear_sampled
    >>> sampled = bilinear_sampled(control.ss(-3.0, 1.0, 1.0, 0.0), dt=0.1)
    >>> round(float(bilinear_continuous(sampled).poles()[0].real), 6)
    -3.0
    """
    system = as_states(system_of(system, "system"), "system")
    if not system.dt:
        raise InputError("the system is continuous already (dt = 0); give a sampled one")
    need_sampling_time(system.dt, "the system")
    rate = 2.0 / system.dt
    A, B, C, D = to_continuous((system.A, system.B, system.C, system.D))
    return realisation((rate * A, rate * B, C, D), 0.0)


def bilinear_sampled(system: Any, dt: float) -> StateSpace:
    """Inverse of `bilinear_continuous`: the system sampled every ``dt`` [s].

    Raises InputError for a system that is sampled already, and LinAlgError for a pole at
    s = 2 / dt.

    Examples
    --------
    >>> import control
    >>> from workbench.systems import bilinear_sampled
    >>> sampled = bilinear_sampled(control.tf([1.0], [1.0, 0.0]), dt=0.2)
    >>> round(float(sampled.D[0, 0]), 6), sampled.dt  # the trapezoidal rule
    (0.1, 0.2)
    """
    system = as_states(system_of(system, "system"), "system")
    if system.dt:
        raise InputError(f"the system is sampled already (dt = {system.dt}); give a continuous one")
    need_positive(dt, "dt")
    rate = 2.0 / dt
    A, B, C, D = to_sampled((system.A / rate, system.B / rate, system.C, system.D))
    return realisation((A, B, C, D), dt)


def in_continuous_plane(K: StateSpace) -> StateSpace:
    """A controller in continuous time.

    A sampled one is transformed by s = (2 / T) (z - 1) / (z + 1).
    """
    return bilinear_continuous(K) if K.dt else K


def from_continuous_plane(K: StateSpace, dt: float) -> StateSpace:
    """Undo `in_continuous_plane`: the controller in a plant's time; dt: sampling time [s], or 0."""
    return bilinear_sampled(K, dt) if dt else K
