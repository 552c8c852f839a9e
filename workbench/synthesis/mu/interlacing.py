"""The claim that no stable controller stabilises a plant, as a task with a proof."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import numpy as np

from workbench.certificate import Check
from workbench.certify.interlacing import Interlacing, Range, interlacing
from workbench.executor import Context
from workbench.heavy_types import Dataset, StateSpace
from workbench.program import Claim, ProofTask
from workbench.solvers import Outcome
from workbench.systems.generalised_plant import response

ZERO_RESIDUE = 1e-9
"""Size of a response at a zero, over that at other places, from which it counts as zero."""
WIDTHS = (0.0, *(10.0**k for k in range(-15, -5)))
"""Relative half-widths of the ranges in which a zero is proven to lie."""


@dataclass(frozen=True, eq=False)
class NoStableController(ProofTask):
    """The claim that no stable controller stabilises a plant (parity interlacing).

    The answer has two ranges ``zeros`` (2, 2) [rad/s], each of which contains a blocking zero of
    the plant: a point at which its whole response is zero. Between the two lies an odd number of
    its poles. Infinite ends stand for infinity.
    """

    plant: StateSpace

    @property
    def quantifier(self) -> str:
        return "for every stable controller of any order, linear and time-invariant"

    def respond(self, method: str | None, context: Context) -> Claim:
        pair = violated(self.plant)
        if pair is not None:
            for width in WIDTHS:
                low, high = (_around(zero, width) for zero in pair)
                if interlacing(self.plant, low, high).holds:
                    return _stored(low, high), Outcome.SOLVED, words(self.plant, *pair)
        return None, Outcome.FAILED, "no two zeros were proven between which poles are odd"

    def checks(self, answer: Dataset, tolerance: float) -> Sequence[Check]:
        found = self._proven(answer)
        facts = {
            "lower zero": ("whether the plant has no zero in the lower range", found.low_zero),
            "upper zero": ("whether the plant has no zero in the upper range", found.high_zero),
            "parity": (
                "whether the number of poles between the zeros is not proven to be odd",
                found.opposite,
            ),
        }
        return [Check(name, text, float(not held), 0.0) for name, (text, held) in facts.items()]

    def second_opinion(self, answer: Dataset) -> Sequence[Check]:
        """The poles between the zeros, counted among the eigenvalues."""
        (_, low), (high, _) = answer["zeros"].values.tolist()
        count = len(_between(self.plant, low, high))
        statement = "1 if the number of real eigenvalues between the zeros is even"
        return [Check("eigenvalues", statement, float(count % 2 == 0), 0.0)]

    def _proven(self, answer: Dataset) -> Interlacing:
        (a, b), (c, d) = answer["zeros"].values.tolist()
        return interlacing(self.plant, (float(a), float(b)), (float(c), float(d)))

    def metrics(self, answer: Dataset) -> dict[str, float]:
        (_, low), (high, _) = answer["zeros"].values.tolist()
        return {
            "lower_zero_rad_s": float(low),
            "upper_zero_rad_s": float(high),
            "poles_between": float(len(_between(self.plant, low, high))),
        }


def violated(plant: StateSpace) -> tuple[float, float] | None:
    """Two real blocking zeros, from 0 to infinity, with an odd number of poles between."""
    zeros = _real_zeros(plant)
    if not np.any(plant.D):
        zeros = [*zeros, math.inf]
    for low, high in pairwise(zeros):
        if len(_between(plant, low, high)) % 2:
            return low, high
    return None


def words(plant: StateSpace, low: float, high: float) -> str:
    """What forbids a stable controller."""
    end = "infinity" if math.isinf(high) else f"{high:.6g}"
    poles = ", ".join(f"{pole:.6g}" for pole in _between(plant, low, high))
    return (
        f"no stable controller stabilises this plant: between its zeros {low:.6g} and {end} it has "
        f"an odd number of real unstable poles, {poles} rad/s (parity interlacing): leave out "
        "stable=True, or move the sensor"
    )


def _between(plant: StateSpace, low: float, high: float) -> list[float]:
    """Real poles between two points of the positive real axis."""
    poles = plant.poles()
    real = poles[np.abs(poles.imag) <= 1e-8 * np.abs(poles)].real
    return [float(pole) for pole in np.sort(real) if low < pole < high]


def _real_zeros(plant: StateSpace) -> list[float]:
    """Real blocking zeros right of the imaginary axis, or on it at 0, ascending."""
    if not plant.nstates:
        return []
    zeros = _entry(plant).zeros()
    zeros = np.asarray(zeros)[np.isfinite(zeros)]
    real = zeros[(np.abs(zeros.imag) <= 1e-8 * np.abs(zeros)) & (zeros.real >= 0)].real
    return [float(zero) for zero in np.sort(real) if _is_zero(plant, float(zero))]


def _entry(plant: StateSpace) -> StateSpace:
    """The first entry that is not zero everywhere: its zeros have the blocking ones among them."""
    sizes = np.abs(response(plant, [1.0, np.pi])).max(axis=0)
    i, j = np.unravel_index(np.argmax(sizes > 0), sizes.shape)
    part: StateSpace = plant[int(i), int(j)]
    return part


def _is_zero(plant: StateSpace, zero: float) -> bool:
    """Whether the response vanishes there: zeros of hidden modes do not count."""
    try:
        at, near = np.abs(plant(zero)), np.abs(plant(zero * 1.3 + 1e-3))
    except (ZeroDivisionError, np.linalg.LinAlgError):
        return False
    return bool((at <= ZERO_RESIDUE * near).all())


def _around(zero: float, width: float) -> Range:
    """A range about a zero, not left of 0."""
    if math.isinf(zero):
        return zero, zero
    return max(zero * (1 - width), 0.0), zero * (1 + width)


def _stored(low: Range, high: Range) -> Dataset:
    import xarray as xr

    about: dict[str, Any] = {"units": "rad/s", "long_name": "ranges that each contain a zero"}
    return xr.Dataset({"zeros": (("range", "end"), [low, high], about)})
