"""A proven lower bound on the norm of every loop with a gain of a box, and its certificate."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

import control
import numpy as np

from workbench._core.arrays import Array, RealArray
from workbench.answer import Answer
from workbench.certificate import Check, Checker, relative_excess
from workbench.certify.norms import certified_norm
from workbench.certify.proofs.gain_boxes import is_unstable_box, level_of_box
from workbench.executor.effort import tries
from workbench.systems.norms import hinf_norm
from workbench.systems.realisation import Matrices
from workbench.systems.standard_plant import StandardPlant

VOLUME_ROUNDING = 1e-9
"""Rounding error of the sum of volumes, relative to the volume of the whole box."""
UPPER_ROUNDING = 2e-4
"""Largest relative distance of a certified norm from the norm in doubles."""
DRAWN, NORM_ROUNDING = 50, 1e-7
"""Number of random gains, and relative accuracy of the norms of their loops."""
Matrix = tuple[RealArray, RealArray]
"""The lowest and the highest gains of a box."""


@dataclass(frozen=True, eq=False)
class BoxProof:
    """The proof for a box of gains: a form proves that none stabilises, or a frequency proves a
    level.
    """

    box: Matrix
    form: RealArray | None = None
    omega: float = math.nan
    driven: tuple[Array, Array] | None = None
    dual: bool = False

    def level(self, P: StandardPlant) -> float:
        """The level proven for the box, in ball arithmetic; infinite if no gain stabilises."""
        if self.form is not None:
            return math.inf if is_unstable_box(P.A, P.B2, P.C2, self.box, self.form) else 0.0
        if self.driven is None:
            return 0.0
        sides = len(P.C1), P.B1.shape[1]
        return level_of_box(
            (P.A, P.B, P.C, P.D), sides, self.box, self.omega, self.driven, self.dual
        )


@dataclass(frozen=True, eq=False, repr=False)
class GainBoxBound(Answer):
    """Proven bound on the norms of loops with the gains K of a box, low <= K <= high.

    ``lower`` is a proven lower bound on the norm of every loop with a stabilising gain of the box;
    it is infinite if none stabilises. ``gain`` is the best gain that was found, and ``upper`` the
    norm of its loop, in doubles; infinite without such a gain. The certificate makes all proofs
    again.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import least_norm_in_box
    >>> from workbench.uncertainty import GeneralisedPlant
    >>> B, C, D = [[1.0, 0, 1]], [[1.0], [0], [1]], [[0, 0, 0], [0, 0, 1], [0, 1, 0]]
    >>> plant = GeneralisedPlant(control.ss([[1.0]], B, C, D), None, 1, 1)
    >>> found = least_norm_in_box(plant, [[-10.0]], [[10.0]])
    >>> found.holds, 2.5 < found.lower < found.upper < 2.8
    (True, True)
    """

    low: RealArray
    high: RealArray
    lower: float
    upper: float
    gain: RealArray
    finished: bool
    """Whether lower came as close to upper as demanded, before the largest number of boxes was
    reached.
    """
    proofs: tuple[BoxProof, ...] = field(repr=False)

    @property
    def boxes(self) -> int:
        """Number of boxes with proofs."""
        return len(self.proofs)

    def summary(self) -> str:
        ends = ", ".join(
            f"{a:.4g} to {b:.4g}" for a, b in zip(self.low.flat, self.high.flat, strict=True)
        )
        if math.isinf(self.lower):
            return f"GainBoxBound: no gain in {ends} stabilises, proven on {self.boxes} boxes"
        far = f", distance {self.upper / self.lower - 1:.1%}" if self.lower else ""
        return (
            f"GainBoxBound: {self.upper:.4g} reached; no gain in {ends} has a norm below "
            f"{self.lower:.4g}, proven on {self.boxes} boxes{far}"
        )


@dataclass(frozen=True, eq=False)
class GainBoxChecker(Checker):
    """Makes the proofs of all boxes again in ball arithmetic, and tries random gains."""

    plant: StandardPlant
    low: RealArray
    high: RealArray

    @property
    def quantifier(self) -> str:
        return "for all gains of the box"

    def checks(self, answer: GainBoxBound, tolerance: float) -> list[Check]:
        least = min((proof.level(self.plant) for proof in answer.proofs), default=0.0)
        behind = 0.0 if least >= answer.lower else 1.0 - least / answer.lower
        moving = self.low < self.high
        whole = (self.high - self.low)[moving]
        filled = sum(
            float(np.prod((h - b)[moving] / whole)) for b, h in (p.box for p in answer.proofs)
        )
        statement = "share by which the least level proven for a box lies below lower"
        found = [
            Check("lower", statement, behind, 0.0, proven=True),
            Check(
                "cover",
                "share of the whole box's volume that the boxes leave out",
                abs(1.0 - filled),
                VOLUME_ROUNDING,
            ),
        ]
        if math.isfinite(answer.upper):
            norm = certified_norm(control.ss(*self._loop(answer.gain)))
            statement = "certified norm of the gain's loop over upper, less 1"
            off = relative_excess(norm, answer.upper)
            found.append(Check("upper", statement, off, UPPER_ROUNDING, over="for this gain"))
        return found

    def second_opinion(self, answer: GainBoxBound) -> list[Check]:
        """Norms of loops with random gains of the box, by SLICOT."""
        rng = np.random.default_rng(0)
        gains = rng.uniform(self.low, self.high, (tries(DRAWN), *self.low.shape))
        least = min(hinf_norm(self._loop(gain)) for gain in gains)
        statement = "share by which the least norm of a random gain lies below lower"
        below = 0.0 if least >= answer.lower else 1.0 - least / answer.lower
        return [Check("random gains", statement, below, NORM_ROUNDING)]

    def _loop(self, gain: RealArray) -> Matrices:
        none = np.zeros((0, 0))
        rows, columns = self.low.shape
        return self.plant.close((none, np.zeros((0, columns)), np.zeros((rows, 0)), gain))
