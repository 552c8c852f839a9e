"""Ways to read a number of the ledger from the runs about unlike arms."""

from __future__ import annotations

from workbench import Run

ARMS_FOCUS, ARMS_RADIAL = "cd/focus/unlike-arms", "cd/radial/unlike-arms"


def two_or_three_of_random_arms(run: Run) -> float:
    """Share of random arms whose links are 40 % off (standard deviation) that show 2 or 3."""
    return float(run.data["random_shown"].sel(deviation=0.4, count=[2, 3]).sum())
