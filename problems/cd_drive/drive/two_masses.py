"""Two masses on two springs, and the lumped values of their first resonance (eq. 4.18).

The open-loop experiment shows one mass on one spring. Its values are distributed over the masses,
springs and dampers of the fourth-order model (section 4.3.2). Equation and section numbers refer to
E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, NamedTuple

from .tables import ActuatorParameters

FITTED = ("m1", "m2", "k1", "k2", "b1", "b2")
"""Parameters of the fourth-order model that the closed-loop fit determines."""


class LumpedValues(NamedTuple):
    """Force factor [N/A], spring [N/m], damper [N s/m] and mass [kg] near the first resonance."""

    Bl: Any
    k: Any
    b: Any
    m: Any


def lumped_values(p: Mapping[str, Any]) -> LumpedValues:
    """Values that the fourth-order model with parameters p shows at low frequency.

    At low frequency the displacement of the arm is rho = k2 / (k1 + k2) times that of the lens.
    """
    rho = p["k2"] / (p["k1"] + p["k2"])
    k = p["k1"] * p["k2"] / (p["k1"] + p["k2"])
    b = p["b1"] * rho**2 + p["b2"] * (1 - rho) ** 2
    return LumpedValues(p["Bl"], k, b, p["m1"] + p["m2"] * rho**2)


def lumped(drive: ActuatorParameters) -> LumpedValues:
    """The lumped values of a drive."""
    return lumped_values(vars(drive))


def mismatch_names(arms: int) -> tuple[str, ...]:
    """Names of the free mismatches of this many arms; the last arm's mismatch makes their sum 0."""
    return tuple(f"mismatch{n}" for n in range(1, arms))


def lens_on_arms(p: Mapping[str, Any], s: Any, R: Any, arms: int) -> Any:
    """x / coil voltage [m/V] of a lens on several arms that differ only in their links (section
    4.6.2).

    p holds the parameters of `lens` and those of `mismatch_names`. Each link has (1 + mismatch) /
    arms of k2 and b2. R [ohm] is that of the whole circuit.
    """
    mismatch = [p[name] for name in mismatch_names(arms)]
    force = p["m1"] * s**2 + s * (p["Bl"] ** 2 / R)
    for one in [*mismatch, -sum(mismatch)]:
        link = (p["b2"] * s + p["k2"]) * ((1 + one) / arms)
        arm = (p["m2"] * s**2 + p["b1"] * s + p["k1"]) / arms + link
        force = force + link - link**2 / arm
    return (p["Bl"] / R) / force


def lens(p: Mapping[str, Any], s: Any, R: Any) -> Any:
    """x / coil voltage [m/V] of the specific model (Table 3.2), with R [ohm] of the
    whole circuit.
    """
    return lens_on_arms(p, s, R, 1)
