"""The claim that no constant gain stabilises a plant of one input and output, with a proof."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import Dataset, StateSpace
from workbench.certificate import Check
from workbench.certify.interlacing import as_fraction
from workbench.certify.proofs.static_gains import GainRange, gain_ranges
from workbench.executor import Context
from workbench.program import Claim, ProofTask
from workbench.solvers import Outcome

SCANNED = 400
"""Gains of either sign at which eigenvalues are asked for a second opinion."""
SCANNED_DECADES = 6.0
"""Decades about the plant's own scale over which those gains are spread."""
BESIDE_AXIS = 1e-6
"""Distance of a pole left of the axis, over the largest one, that eigenvalues may get wrong."""


@dataclass(frozen=True, eq=False)
class NoStabilisingGain(ProofTask):
    """The claim that no real k stabilises a plant with u = k y, of one input and output.

    The answer has ``gains`` (r,), one in each range of gains in which the number of stable poles
    stays the same; none of them stabilises.
    """

    plant: StateSpace

    @property
    def quantifier(self) -> str:
        return "for every real gain"

    def respond(self, method: str | None, context: Context) -> Claim:
        import xarray as xr

        ranges = gain_ranges(self.plant)
        if any(one.stabilises for one in ranges):
            return None, Outcome.FAILED, "some gains stabilise"
        about: dict[str, Any] = {"long_name": "a gain of each range without a stabilising one"}
        gains = [float(one.middle) for one in ranges]
        return xr.Dataset({"gains": ("range", gains, about)}), Outcome.SOLVED, no_gain_words()

    def checks(self, answer: Dataset, tolerance: float) -> Sequence[Check]:
        gains = answer["gains"].values
        ranges = gain_ranges(self.plant)
        stabilising = sum(one.stabilises for one in ranges)
        alone = len(gains) == len(ranges)
        missed = len(ranges) if not alone else sum(map(_outside, ranges, gains.tolist()))
        return [
            Check("gains", "number of ranges of gains that stabilise", float(stabilising), 0.0),
            Check("ranges", "number of ranges without the gain that is told", float(missed), 0.0),
        ]

    def second_opinion(self, answer: Dataset) -> Sequence[Check]:
        """The eigenvalues of the loops of many gains."""
        statement = (
            f"farthest left that the rightmost eigenvalue lies for {2 * SCANNED} gains, over the "
            "largest eigenvalue"
        )
        left = max(_left(self.plant, gain) for gain in _scanned(self.plant, answer))
        return [Check("eigenvalues", statement, left, BESIDE_AXIS)]

    def metrics(self, answer: Dataset) -> dict[str, float]:
        return {"ranges": float(len(answer["gains"]))}


def no_gain_words() -> str:
    """What forbids a constant gain."""
    return (
        "no constant gain stabilises this plant: in none of the ranges between gains that put a "
        "pole on the imaginary axis do all poles lie left of it. Ask for a family with dynamics, "
        "such as PD() or PID(), or a higher order"
    )


def _outside(one: GainRange, gain: float) -> bool:
    """Whether a gain lies outside a range."""
    if not np.isfinite(gain):
        return True
    k = as_fraction(gain)
    above = one.low is None or k >= one.low
    below = one.high is None or k <= one.high
    return not (above and below)


def _scanned(plant: StateSpace, answer: Dataset) -> RealArray:
    """Gains of both signs about the sizes that matter: those told, and that of the plant."""
    told = np.abs(answer["gains"].values)
    size = float(np.linalg.norm(plant.B) * np.linalg.norm(plant.C)) or 1.0
    poles = float(np.abs(plant.poles()).max(initial=0.0)) or 1.0
    middle = np.append(told[np.isfinite(told) & (told > 0)], poles / size)
    low, high = np.log10(middle.min()), np.log10(middle.max())
    found = np.logspace(low - SCANNED_DECADES / 2, high + SCANNED_DECADES / 2, SCANNED)
    return np.concatenate([found, -found])


def _left(plant: StateSpace, gain: float) -> float:
    """How far left of the axis the loop's rightmost pole lies, over the size of the largest."""
    direct = 1.0 - gain * float(plant.D[0, 0])
    if direct == 0.0:
        return 0.0
    poles = np.linalg.eigvals(plant.A + plant.B @ plant.C * (gain / direct))
    return -float(poles.real.max(initial=-np.inf)) / (float(np.abs(poles).max(initial=0.0)) or 1.0)
