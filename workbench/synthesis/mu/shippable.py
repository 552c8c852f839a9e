"""Controllers that one would ship: stable, not too fast, of an order; and what forbids them."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from workbench.arrays import RealArray
from workbench.certificate import THIS_SYSTEM, Check
from workbench.certify.stability import stability_of
from workbench.heavy_types import StateSpace

ZERO_RESIDUE = 1e-9
"""Size of a response at a zero, over that at other places, from which it counts as zero."""
ROUNDING = 1e-9
"""Relative rounding of the sizes of poles."""


@dataclass(frozen=True)
class Shippable:
    """What a controller must be besides stabilising: order, stability, poles up to a size [rad/s].

    None leaves a demand out.
    """

    order: int | None = None
    stable: bool = False
    fastest: float | None = None

    @property
    def asked(self) -> bool:
        """Whether anything is asked."""
        return self.order is not None or self.stable or self.fastest is not None

    def checks(self, K: StateSpace) -> list[Check]:
        """Checks that a controller meets the demands."""
        found = []
        if self.order is not None:
            statement = "number of states of K, at most what was asked for"
            found.append(Check("order", statement, float(K.nstates), float(self.order)))
        if self.stable:
            statement = "distance of the controller's own worst pole beyond the imaginary axis"
            own = stability_of(K)
            found.append(
                Check(
                    "controller stable", statement, own.value, own.limit, own.where,
                    over=THIS_SYSTEM,
                )
            )  # fmt: skip
        if self.fastest is not None:
            statement = "size of the controller's fastest pole over the one allowed, less 1"
            size = float(np.abs(K.poles()).max(initial=0.0)) / self.fastest - 1.0
            found.append(Check("fastest pole", statement, size, ROUNDING, over=THIS_SYSTEM))
        return found

    def admits(self, K: StateSpace) -> bool:
        """Whether a controller meets the demands."""
        return all(check.holds for check in self.checks(K))


def interlacing_violation(plant: StateSpace) -> str | None:
    """Why no stable controller stabilises a plant from controls to measurements; None if one may.

    A stable stabilising controller exists if and only if the plant has an even number of real poles
    between every pair of its real blocking zeros in the right half plane, infinity included (D. C.
    Youla, J. J. Bongiorno, C. N. Lu, Automatica 10 (1974) 159-173). Zeros of a scalar plant, and at
    infinity of any plant, are looked at.
    """
    poles = plant.poles()
    unstable = np.sort(poles[(np.abs(poles.imag) <= 1e-8 * np.abs(poles)) & (poles.real > 0)].real)
    zeros = _real_zeros(plant)
    if not np.any(plant.D):
        zeros = [*zeros, np.inf]
    for low, high in pairwise(zeros):
        between = [float(pole) for pole in unstable if low < pole < high]
        if len(between) % 2:
            end = "infinity" if np.isinf(high) else f"{high:.6g}"
            told = ", ".join(f"{pole:.6g}" for pole in between)
            return (
                f"no stable controller stabilises this plant: between its zeros {low:.6g} and "
                f"{end} it has an odd number of real unstable poles, {told} rad/s (parity "
                "interlacing)"
            )
    return None


def _real_zeros(plant: StateSpace) -> list[float]:
    """Real zeros right of the imaginary axis, or on it at 0, of a scalar plant, ascending."""
    if (plant.ninputs, plant.noutputs) != (1, 1):
        return []
    zeros = plant.zeros()
    zeros = np.asarray(zeros)[np.isfinite(zeros)]
    real = zeros[(np.abs(zeros.imag) <= 1e-8 * np.abs(zeros)) & (zeros.real >= 0)].real
    return [float(zero) for zero in np.sort(real) if _is_zero(plant, float(zero))]


def _is_zero(plant: StateSpace, zero: float) -> bool:
    """Whether the response vanishes there: zeros of hidden modes do not count."""
    try:
        near: RealArray = np.abs(np.array([plant(zero), plant(zero * 1.3 + 1e-3)]))
    except (ZeroDivisionError, np.linalg.LinAlgError):
        return False
    return bool(near[0] <= ZERO_RESIDUE * near[1])
