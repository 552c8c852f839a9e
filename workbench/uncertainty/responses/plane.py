"""Sampled systems with one channel as functions of the bilinear plane, and back.

The function at j v equals the sampled system at omega, where v = 2 / T tan(omega T / 2) and T [s]
is the sampling time. Circles, orders and stability are the same for both.
"""

from __future__ import annotations

from typing import Any

from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.fitting.rational import Rational, rational_of_system
from workbench.systems.bilinear import bilinear_continuous, bilinear_sampled


def plane_function(given: Any, name: str, dt: float | None) -> Rational:
    """A system with one channel, or a `Rational` of the plane, as a function of the plane.

    ``dt`` is the sampling time [s] that the system must have; None allows any. Raises InputError
    for another one.
    """
    import control

    if isinstance(given, Rational):
        return given
    own = float(getattr(given, "dt", None) or 0.0)
    if dt is not None and own != dt and hasattr(given, "poles"):
        raise InputError(f"{name} has dt = {own}; {dt} is needed")
    try:
        return rational_of_system(bilinear_continuous(control.ss(given)) if own else given)
    except InputError as error:
        raise InputError(f"{name}: {error}") from None


def from_plane(function: Rational, dt: float) -> StateSpace:
    """The system for a function of the plane, sampled every ``dt`` [s], or continuous if ``dt`` is
    0.
    """
    system = function.state_space()
    return bilinear_sampled(system, dt) if dt else system
