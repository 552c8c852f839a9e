"""Closed loops: stability and certified norm, by nothing that a method uses; storage."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from workbench.mu.peak import peak
from workbench.mu.sweep import starting_grid
from workbench.program import Check
from workbench.structure import Full, Structure
from workbench.synthesis.standard import realisation, to_continuous

if TYPE_CHECKING:
    import xarray as xr
    from control import StateSpace

CERTIFIED = 1e-4
"""Relative width of the interval in which the norm of a loop is certified."""
STEPS = 50
"""Intervals that should do: a loop whose response is rounding errors needs any number of them."""


def stability_of(loop: StateSpace) -> Check:
    """That its poles are left of the imaginary axis, or within the unit circle, by rounding."""
    poles = loop.poles()
    size = float(np.abs(poles).max(initial=0.0))
    limits = np.finfo(float)
    # A pole at 0 is not stable, however small the others are.
    rounding = max(float(limits.eps) * max(len(poles), 1) * size, float(limits.tiny))
    distance = np.abs(poles) - 1.0 if loop.dt else poles.real
    place = int(np.argmax(distance)) if len(poles) else 0
    value = float(distance[place]) if len(poles) else -np.inf
    where = f"at {poles[place]:.6g}" if len(poles) else ""
    statement = "distance of the worst closed-loop pole beyond the stability boundary"
    return Check("internal stability", statement, value, -rounding, where)


def certified_norm(loop: StateSpace) -> float:
    """An upper bound of the norm of a stable loop, on every frequency.

    Intervals whose Hamiltonians have no imaginary eigenvalue, `mu.peak` with one full block; a
    sampled loop is taken to continuous time by the bilinear transform, which keeps norms.
    """
    if loop.dt:
        loop = realisation(to_continuous((loop.A, loop.B, loop.C, loop.D)), 0.0)
    block = Structure([Full(loop.ninputs, loop.noutputs)])
    return peak(loop, block, CERTIFIED, steps=STEPS).upper


def frequencies_of(loop: StateSpace) -> np.ndarray:
    """Frequencies [rad/s] that a stable loop's poles ask for, 0 and infinity left out.

    Some of a static loop, which is the same at all of them.
    """
    omega = starting_grid(loop.poles())
    inside: np.ndarray = omega[(omega > 0) & np.isfinite(omega)]
    return inside if inside.size else np.array([0.1, 1.0, 10.0])


def stored(name: str, system: StateSpace) -> dict[str, Any]:
    """Variables of a dataset from which `restored` makes the system."""
    state, output, entering = (f"{name}_{kind}" for kind in ("state", "output", "input"))
    dims = {
        "A": (state, f"{state}_"),
        "B": (state, entering),
        "C": (output, state),
        "D": (output, entering),
    }
    parts: dict[str, Any] = {
        f"{name}_{part}": (
            place,
            getattr(system, part),
            {"long_name": f"{part} of the {name}'s realisation"},
        )
        for part, place in dims.items()
    }
    about = {"units": "s", "long_name": f"sampling time of the {name}, 0: continuous"}
    return parts | {f"{name}_dt": ((), float(system.dt or 0.0), about)}


def restored(data: xr.Dataset, name: str) -> StateSpace:
    """The system that was stored by that name."""
    A, B, C, D = (data[f"{name}_{part}"].values for part in "ABCD")
    return realisation((A, B, C, D), float(data[f"{name}_dt"]))
