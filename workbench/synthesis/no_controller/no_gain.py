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
"""Number of gains of each sign for which the second opinion computes eigenvalues."""
SCANNED_DECADES = 6.0
"""Decades of gain around the plant's own scale over which those gains are spread."""
BESIDE_AXIS = 1e-6
"""Possible error of a computed eigenvalue near the imaginary axis, relative to the largest one."""


@dataclass(frozen=True, eq=False)
class NoStabilisingGain(ProofTask):
    """The claim that u = k y stabilises a plant with one input and one output for no real k.

    The number of stable poles is constant in each of r ranges of gains. The answer holds ``gains``
    (r,), one of each range; none of them stabilises.
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
        missed = len(ranges) if not alone else sum(map(_is_outside, ranges, gains.tolist()))
        return [
            Check("gains", "number of ranges of gains that stabilise", float(stabilising), 0.0),
            Check("ranges", "number of ranges without the gain that is told", float(missed), 0.0),
        ]

    def second_opinion(self, answer: Dataset) -> Sequence[Check]:
        """Compute the closed loop's eigenvalues for many gains."""
        statement = (
            f"farthest left that the rightmost eigenvalue lies for {2 * SCANNED} gains, over the "
            "largest eigenvalue"
        )
        left = max(_stability_degree(self.plant, gain) for gain in _scan_gains(self.plant, answer))
        return [Check("eigenvalues", statement, left, BESIDE_AXIS)]

    def metrics(self, answer: Dataset) -> dict[str, float]:
        return {"ranges": float(len(answer["gains"]))}


def no_gain_words() -> str:
    """The sentence that says why no constant gain stabilises."""
    return (
        "no constant gain stabilises this plant: in none of the ranges between gains that put a "
        "pole on the imaginary axis do all poles lie left of it. Ask for a family with dynamics, "
        "such as PD() or PID(), or a higher order"
    )


def _is_outside(one: GainRange, gain: float) -> bool:
    """Whether a gain lies outside a range."""
    if not np.isfinite(gain):
        return True
    k = as_fraction(gain)
    above = one.low is None or k >= one.low
    below = one.high is None or k <= one.high
    return not (above and below)


def _scan_gains(plant: StateSpace, answer: Dataset) -> RealArray:
    """Gains of both signs around the gains of the answer and around the plant's own scale."""
    told = np.abs(answer["gains"].values)
    size = float(np.linalg.norm(plant.B) * np.linalg.norm(plant.C)) or 1.0
    poles = float(np.abs(plant.poles()).max(initial=0.0)) or 1.0
    middle = np.append(told[np.isfinite(told) & (told > 0)], poles / size)
    low, high = np.log10(middle.min()), np.log10(middle.max())
    found = np.logspace(low - SCANNED_DECADES / 2, high + SCANNED_DECADES / 2, SCANNED)
    return np.concatenate([found, -found])


def _stability_degree(plant: StateSpace, gain: float) -> float:
    """Distance of the loop's rightmost pole to the left of the axis, over the size of its largest
    pole.
    """
    direct = 1.0 - gain * float(plant.D[0, 0])
    if direct == 0.0:
        return 0.0
    poles = np.linalg.eigvals(plant.A + plant.B @ plant.C * (gain / direct))
    return -float(poles.real.max(initial=-np.inf)) / (float(np.abs(poles).max(initial=0.0)) or 1.0)
