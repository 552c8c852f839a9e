"""Which accuracies make a difference to a method; the others ask for the same computation."""

from __future__ import annotations

from dataclasses import dataclass

from workbench.solvers import ACCURACY

DEFAULT_TOLERANCE = ACCURACY["middle"]
"""The tolerance of a run for which nobody asks for another one."""


@dataclass(frozen=True)
class AccuracyRange:
    """The tolerances that make a difference to a method: those from ``finest`` to ``coarsest``.

    A finer tolerance is served as the finest one, a coarser tolerance as the coarsest one.
    """

    finest: float = 0.0
    coarsest: float = 1.0

    def served(self, tolerance: float) -> float:
        """The tolerance that stands for all those which a method serves alike with this one.

        It is the default tolerance wherever that is served alike.
        """
        nearest = self._nearest(tolerance)
        return DEFAULT_TOLERANCE if nearest == self._nearest(DEFAULT_TOLERANCE) else nearest

    def joined(self, finest: float) -> AccuracyRange:
        """The range without tolerances finer than this one."""
        return AccuracyRange(max(self.finest, finest), max(self.coarsest, finest))

    @property
    def none(self) -> bool:
        """No tolerance makes a difference."""
        return self.finest >= self.coarsest

    @property
    def words(self) -> str:
        """What a user should know of the range; empty where every tolerance makes a difference."""
        if self.none:
            return "the same at every accuracy"
        limits = [
            f"no {word} than {limit:.2g}"
            for word, limit, free in (
                ("finer", self.finest, self.finest <= 0.0),
                ("coarser", self.coarsest, self.coarsest >= 1.0),
            )
            if not free
        ]
        return "its accuracy gets " + " and ".join(limits) if limits else ""

    def _nearest(self, tolerance: float) -> float:
        return min(max(tolerance, self.finest), self.coarsest)


EVERY_ACCURACY = AccuracyRange()
"""Of a method to which every tolerance makes a difference."""
ANY_ACCURACY_ALIKE = AccuracyRange(DEFAULT_TOLERANCE, DEFAULT_TOLERANCE)
"""Of a method that computes the same whatever tolerance is asked for."""
