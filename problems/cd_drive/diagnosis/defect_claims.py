"""Statements about defects, judged over many draws: in each draw a statement holds or fails."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

from workbench import Check
from workbench.study import CLAIM_SHARE, markdown_table, share_of_draws, verdict_of_share
from workbench.types import DataArray


class Claim(NamedTuple):
    """A statement in words, and whether it holds in each draw (draw,).

    name: name of its check, if it is one.
    """

    name: str
    words: str
    holds: DataArray

    @property
    def share(self) -> float:
        """Share of the draws in which the statement holds."""
        return float(share_of_draws(self.holds))


def claim_checks(claims: Sequence[Claim], made: Collection[str]) -> list[Check]:
    """A check for each statement that is claimed: it may fail in few of the draws only."""
    return [
        Check(one.name, f"share of draws without: {one.words}", 1.0 - one.share, 1.0 - CLAIM_SHARE)
        for one in claims
        if one.name in made
    ]


def claims_in_words(claims: Sequence[Claim]) -> str:
    """A table of the statements that hold in 95 % of the draws, fail in as many, or are
    undecided.
    """
    rows = [[one.words, f"{one.share:.1%}", verdict_of_share(one.share)] for one in claims]
    return markdown_table(["statement", "holds in, of the draws", "claim"], rows)
