"""Transformed systems: stable if and only if the poles of the given ones lie in a region."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from workbench._core.arrays import Array, RealArray
from workbench.errors import InputError
from workbench.input_checks import is_real
from workbench.uncertainty.algebra.delays import DelayElement
from workbench.uncertainty.algebra.elements import DynamicElement
from workbench.uncertainty.algebra.lft import INTEGRATOR, LFT
from workbench.uncertainty.algebra.system import UncertainSystem


def with_decay(found: UncertainSystem, decay: float) -> UncertainSystem:
    """The system with its poles moved to the right by a rate [1/s]."""
    if not is_real(decay) or not 0.0 <= decay < math.inf:
        raise InputError(f"decay is {decay!r}; a rate of 0 or more [1/s] is needed")
    if not decay:
        return found
    _need_numbers(found, "decay")
    poles = found.nominal.poles()
    rates = -np.log(np.abs(poles)) / found.dt if found.dt else -poles.real
    _need_nominal(poles, rates, decay, "decays at {:.4g} 1/s, and {:g} 1/s")
    M, place = found.value.M.copy(), _states(found)
    if found.dt:
        M[place] *= math.exp(decay * found.dt)
    else:
        M[place, place] += decay
    return replace(found, value=LFT(M, found.value.names))


def with_damping(found: UncertainSystem, damping: float) -> UncertainSystem:
    """The system with its poles turned by asin(damping) towards the axis, in real coordinates.

    x' = exp(-j phi) (A x + B w) is stable if and only if the poles above the real axis have a
    damping ratio above sin(phi); the others are their conjugates. Each channel becomes two: its
    real and its imaginary part.
    """
    if not is_real(damping) or not 0.0 <= damping < 1.0:
        raise InputError(f"damping is {damping!r}; a ratio from 0 to below 1 is needed")
    _need_numbers(found, "damping")
    if found.dt:
        raise InputError(
            f"damping is for continuous time and the system has dt = {found.dt} s: its poles of "
            "one damping ratio lie on a spiral; give `decay`"
        )
    poles = found.nominal.poles()
    ratios = -poles.real / np.where(poles == 0, 1.0, np.abs(poles))
    _need_nominal(poles, ratios, damping, "has a damping of {:.4g}, and {:g}")
    phi = math.asin(damping)
    turn = np.array([[math.cos(phi), math.sin(phi)], [-math.sin(phi), math.cos(phi)]])
    M, place = np.kron(found.value.M, np.eye(2)), _states(found)
    for k in place:
        M[2 * k : 2 * k + 2] = turn @ M[2 * k : 2 * k + 2]
    names = tuple(name for name in found.value.names for _ in range(2))
    return replace(found, value=LFT(M, names))


def _states(found: UncertainSystem) -> np.ndarray:
    """Indices of the channels that are states."""
    return np.flatnonzero([name == INTEGRATOR for name in found.value.names])


def _need_numbers(found: UncertainSystem, asked: str) -> None:
    """Refuse a system with uncertain dynamics."""
    for one in found.elements.values():
        if isinstance(one, DynamicElement | DelayElement):
            raise InputError(
                f"{one.name} is dynamics, whose gain is known on the axis only; {asked} is "
                "for systems with uncertain numbers only"
            )


def _need_nominal(poles: Array, found: RealArray, asked: float, words: str) -> None:
    """Refuse a system whose nominal has a pole outside the region asked for."""
    if not found.size or found.min() > asked:
        return
    least = int(np.argmin(found))
    raise InputError(
        f"the nominal pole at {poles[least]:.6g} {words.format(found[least], asked)} is asked for"
    )
