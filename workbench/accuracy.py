"""Range of tolerances to which a method responds; it serves any other as the nearest of them."""

from __future__ import annotations

from dataclasses import dataclass

from workbench.solvers import ACCURACY

DEFAULT_TOLERANCE = ACCURACY["middle"]
"""The tolerance of a run for which nobody asks for another one."""


@dataclass(frozen=True)
class AccuracyRange:
    """Range of tolerances, from ``finest`` to ``coarsest``, that change what a method computes.

    A finer tolerance is treated as ``finest``, a coarser one as ``coarsest``.
    """

    finest: float = 0.0
    coarsest: float = 1.0

    def served(self, tolerance: float) -> float:
        """The tolerance that the method uses when this one is asked for.

        If the default tolerance leads to the same computation, the default tolerance is returned.
        """
        nearest = self._nearest(tolerance)
        return DEFAULT_TOLERANCE if nearest == self._nearest(DEFAULT_TOLERANCE) else nearest

    def joined(self, finest: float) -> AccuracyRange:
        """This range, cut off so that it holds no tolerance finer than the one given."""
        return AccuracyRange(max(self.finest, finest), max(self.coarsest, finest))

    @property
    def none(self) -> bool:
        """Whether the method ignores the tolerance."""
        return self.finest >= self.coarsest

    @property
    def words(self) -> str:
        """A phrase that tells the user the limits of the range; empty if it has none."""
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
"""Range of a method for which every tolerance makes a difference."""
ANY_ACCURACY_ALIKE = AccuracyRange(DEFAULT_TOLERANCE, DEFAULT_TOLERANCE)
"""Range of a method that computes the same for every tolerance."""
