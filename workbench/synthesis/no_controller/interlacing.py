"""The claim that no stable controller stabilises a plant, as a task with a proof."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench._core.heavy_types import Dataset, StateSpace
from workbench.certificate import Check
from workbench.certify.interlacing import Interlacing, Range, interlacing, separated_zeros
from workbench.executor import Context
from workbench.program import Claim, ProofTask
from workbench.solvers import Outcome

ON_THE_AXIS = 1e-6
"""Distance from the imaginary axis, relative to the largest pole. Poles closer to the axis may lie
right of it: doubles cannot tell.
"""

ABOUT, DEEP_DIP = 1e-3, 1e-3
"""Distance of the comparison points from a zero, relative to its size, and the largest ratio of the
response at the zero to the responses at those points. A true zero gives a ratio near the rounding
error, far below this.
"""


@dataclass(frozen=True, eq=False)
class NoStableController(ProofTask):
    """The claim that no stable controller stabilises a plant (parity interlacing property).

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
        if pair is None:
            return None, Outcome.FAILED, "no two zeros were proven between which poles are odd"
        return _stored(*pair), Outcome.SOLVED, words(self.plant, *pair)

    def checks(self, answer: Dataset, tolerance: float) -> Sequence[Check]:
        found = self._proven_interlacing(answer)
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
        """Count the poles between the zeros by eigenvalues."""
        (_, low), (high, _) = answer["zeros"].values.tolist()
        count = len(_real_poles_between(self.plant, low, high))
        statement = "1 if the number of real eigenvalues between the zeros is even"
        return [Check("eigenvalues", statement, float(count % 2 == 0), 0.0)]

    def deep_opinion(self, answer: Dataset) -> Sequence[Check]:
        """Compare the response at each zero, which must be almost zero, with the responses beside
        it.
        """
        statement = "largest response at the zero over the least of those about it"
        ranges = zip(("lower", "upper"), answer["zeros"].values.tolist(), strict=True)
        found = [
            Check(
                f"{name} zero in responses",
                statement,
                _relative_response_at_zero(self.plant, *ends),
                DEEP_DIP,
            )
            for name, ends in ranges
        ]
        return [*super().deep_opinion(answer), *found]

    def _proven_interlacing(self, answer: Dataset) -> Interlacing:
        (a, b), (c, d) = answer["zeros"].values.tolist()
        return interlacing(self.plant, (float(a), float(b)), (float(c), float(d)))

    def metrics(self, answer: Dataset) -> dict[str, float]:
        (_, low), (high, _) = answer["zeros"].values.tolist()
        return {
            "lower_zero_rad_s": float(low),
            "upper_zero_rad_s": float(high),
            "poles_between": float(len(_real_poles_between(self.plant, low, high))),
        }


def violated(plant: StateSpace) -> tuple[Range, Range] | None:
    """Ranges of two real blocking zeros in [0, infinity] with an odd number of real poles between
    them.

    Exact arithmetic decides. It is used only where a pole may be unstable.
    """
    poles = plant.poles()
    size = np.abs(poles).max(initial=0.0)
    if not (poles.real > -ON_THE_AXIS * size).any():
        return None
    return separated_zeros(plant)


def words(plant: StateSpace, low: Range, high: Range) -> str:
    """The sentence that says why no stable controller exists."""
    end = "infinity" if math.isinf(high[0]) else f"{high[0]:.6g}"
    poles = ", ".join(f"{pole:.6g}" for pole in _real_poles_between(plant, low[1], high[0]))
    return (
        f"no stable controller stabilises this plant: between its zeros {low[1]:.6g} and {end} it "
        f"has an odd number of real unstable poles, {poles} rad/s (parity interlacing): leave out "
        "stable=True, or move the sensor"
    )


def _real_poles_between(plant: StateSpace, low: float, high: float) -> list[float]:
    """Real poles between two points of the positive real axis."""
    poles = plant.poles()
    real = poles[np.abs(poles.imag) <= 1e-8 * np.abs(poles)].real
    return [float(pole) for pole in np.sort(real) if low < pole < high]


def _relative_response_at_zero(plant: StateSpace, low: float, high: float) -> float:
    """Size of the response at a real zero over the least response at a relative distance of
    ABOUT.
    """
    if math.isinf(low):
        return float(np.abs(plant.D).max(initial=0.0) > 0.0)
    zero = (low + high) / 2
    size = zero or float(np.abs(plant.poles()).max(initial=1.0))
    step, sizes = max(ABOUT * size, (high - low) / ABOUT**2), []
    for s in (zero, zero - step, zero + step):
        inner = np.linalg.solve(s * np.eye(plant.nstates) - plant.A, plant.B)
        sizes.append(float(np.abs(plant.C @ inner + plant.D).max()))
    return sizes[0] / (min(sizes[1:]) or math.ulp(0.0))


def _stored(low: Range, high: Range) -> Dataset:
    import xarray as xr

    about: dict[str, Any] = {"units": "rad/s", "long_name": "ranges that each contain a zero"}
    return xr.Dataset({"zeros": (("range", "end"), [low, high], about)})
