"""Playability over the whole ensemble: every drive, every strategy, a thousand scenarios."""

from __future__ import annotations

from workbench import Run, problem

from ..drive.shared_parameters import TABLES
from .playability.problem import SLOWER, Count, Workers, playability
from .playability.study import Playability


@problem("cd/playability-full", needs=SLOWER, data=(*TABLES, "data/red_book.csv"), slow=True)
def playability_full(
    focus: Run, radial: Run, scenarios: Count = 1000, workers: Workers = 2
) -> Playability:
    """All of `cd/playability`: twelve drives, both axes, five strategies, 1,000 scenarios of 1 s.

    scenarios: number of circumstances for each axis. workers: number of threads.
    """
    return playability(focus, radial, scenarios, drives=12, training=35, trials=20, workers=workers)
