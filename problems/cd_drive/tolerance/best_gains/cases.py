"""Strategies at several gains and switched pairs, run in the same circumstances.

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal, NamedTuple, get_args

import numpy as np

from workbench.simulation import Cascade, Part, linear_controller
from workbench.types import RealArray, StateSpace

from ...laboratory.bench_setup import PERIOD
from ...laboratory.experiment import MEASUREMENTS
from ..bench_reading import BenchReading
from ..ensemble import Circumstance
from ..playability.runs import evaluated, sampled_controller, scored
from ..tactics import Strategies, clean_level

Use = Literal["alone", "reference", "A", "B", "C", "switched"]
"""One controller without a detector; a strategy with one controller; or two controllers that are
switched while the light is bad.
"""
USES: tuple[Use, ...] = get_args(Use)
GAINS = (-9.5, -6.0, -3.0, 0.0, 1.0, 2.0)
"""Gains of one controller over the reference controller's [dB]. -9.5 dB is a third; above 2 dB the
largest |S| exceeds 2 on one of the twelve drives.
"""
FAST, SLOW = (0.0, 1.0, 2.0), (-9.5, -6.0, -3.0)
"""Gains [dB] of the fast and of the slow controller of a pair; the slow one may also be K'."""


class Case(NamedTuple):
    """Use of one or two controllers; slow: gain [dB], or None for K'."""

    use: Use
    fast: float
    slow: float | None = None

    @property
    def name(self) -> str:
        """Name such as "A +2 dB", or "+2 dB and -6 dB"."""
        if self.use != "switched":
            return f"{self.use} {self.fast:+g} dB"
        return f"{self.fast:+g} dB and {'K-prime' if self.slow is None else f'{self.slow:+g} dB'}"


CASES = (
    *(Case(use, gain) for use in USES[:-1] for gain in GAINS),
    *(Case("switched", fast, slow) for fast in FAST for slow in (*SLOW, None)),
)


@dataclass(frozen=True, eq=False)
class Cases:
    """Every case on several drives in one circumstance, as a task for an executor.

    slower: discrete K'. reading: of what the text leaves open about the bench.
    """

    slower: StateSpace
    drives: tuple[str, ...]
    duration: float = 1.0
    reading: BenchReading = field(default_factory=BenchReading)

    def cascade(self, case: Case, one: Circumstance, level: float) -> Cascade:
        """The controller of a case; ``level`` [V] is that of a clean disc."""
        fast = sampled_controller(one.axis, case.fast + one.gain_db)
        if case.use == "alone":
            return Cascade(
                MEASUREMENTS, [Part("K", linear_controller(fast, PERIOD), ["f_en"], outputs=["u"])]
            )
        made = Strategies(one.axis, level, one.believed, K=fast, replacement=self._slow(case, one))
        return made.named("K_prime" if case.use == "switched" else case.use)

    def _slow(self, case: Case, one: Circumstance) -> StateSpace:
        if case.slow is None:
            return 10.0 ** (one.gain_db / 20.0) * self.slower
        return sampled_controller(one.axis, case.slow + one.gain_db)

    def error(self, case: Case, one: Circumstance, drive: str) -> RealArray:
        """True error [m] (N,) in the scored part of a run."""
        bench = self.reading.laboratory(one.axis, drive)
        record = bench.closed_loop(
            self.cascade(case, one, clean_level(bench, one.disc.reflectivity)),
            one.excitation(bench, self.duration),
            disc=one.disc,
            defects=one.defects,
            seed=one.noise_seed(drive),
        )
        return evaluated(record)

    def __call__(self, one: Circumstance) -> RealArray:
        """Scores (drives, CASES, SCORES)."""
        return np.array(
            [
                [scored(self.error(case, one, drive), one.axis) for case in CASES]
                for drive in self.drives
            ]
        )
