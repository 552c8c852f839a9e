"""What may be claimed of defects after many draws: statements that hold in a draw, or do not."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

from workbench import Check
from workbench._core.heavy_types import DataArray
from workbench._core.tables import markdown
from workbench.study import share_of_draws, verdict_of_share
from workbench.study.draws import SURE


class Claim(NamedTuple):
    """A statement in words, and whether it holds (draw,): in each draw by itself.

    name: that of its check, where it is one.
    """

    name: str
    words: str
    holds: DataArray

    @property
    def share(self) -> float:
        """Share of the draws in which it holds."""
        return float(share_of_draws(self.holds))


def claim_checks(claims: Sequence[Claim], made: Collection[str]) -> list[Check]:
    """A check of each claim that is made: it fails in few of the draws."""
    return [
        Check(one.name, f"share of draws without: {one.words}", 1.0 - one.share, 1.0 - SURE)
        for one in claims
        if one.name in made
    ]


def claims_in_words(claims: Sequence[Claim]) -> str:
    """A table of what holds in 95 % of the draws, what fails in as many, and what is undecided."""
    rows = [[one.words, f"{one.share:.1%}", verdict_of_share(one.share)] for one in claims]
    return markdown(["statement", "holds in, of the draws", "claim"], rows)
