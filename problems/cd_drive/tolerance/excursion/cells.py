"""For each defect: is a strategy better or worse than the reference strategy (section 8.7)?

Section numbers refer to E. Vidal Sanchez, Robust and Fault Tolerant Control of CD-players (2003).
"""

from __future__ import annotations

import numpy as np

from workbench.study import Rows, share_of_draws, verdict_of_share
from workbench.types import DataArray

from ..strategy_looks import titled
from ..tactics import STRATEGIES

OTHERS = [name for name in STRATEGIES if name != "reference"]
CELL = ("angle", "length", "share")
VERDICTS = {"holds": "better", "fails": "worse", "undecided": "undecided"}
"""Verdict on a strategy if the statement that its error is the smaller one holds, fails, or is
undecided.
"""


def verdicts(peak: DataArray) -> DataArray:
    """Whether each strategy is "better", "worse" or "undecided" in each defect of the map.

    It is better if its largest error is the smaller one in 95 % of the draws or more.
    """
    smaller = peak.sel(strategy=OTHERS) < peak.sel(strategy="reference")
    share = share_of_draws(smaller, "strategy", *CELL)
    said = np.vectorize(lambda one: VERDICTS[verdict_of_share(one)])(share.values)
    return share.copy(data=said)


def counts(peak: DataArray) -> dict[str, float]:
    """Number of defects on the Red Book's disc, and on all discs, with each verdict."""
    said, numbers = verdicts(peak), {}
    for where, some in (("red_book", said.sel(share=1.0)), ("all", said)):
        for name in OTHERS:
            of_strategy = some.sel(strategy=name)
            for verdict in VERDICTS.values():
                numbers[f"{verdict}_{where}_{name}"] = float((of_strategy == verdict).sum())
    return numbers


def cells_table(peak: DataArray) -> Rows:
    """On the Red Book's disc: number of defects by verdict, and the worst one among "worse"."""
    numbers, rows = counts(peak), []
    ratio = (peak / peak.sel(strategy="reference")).mean("draw").sel(share=1.0)
    worse = verdicts(peak).sel(share=1.0) == "worse"
    for name in OTHERS:
        told = [f"{numbers[f'{one}_red_book_{name}']:.0f}" for one in VERDICTS.values()]
        most = float(ratio.sel(strategy=name).where(worse.sel(strategy=name)).max())
        rows.append([titled(name), *told, "-" if np.isnan(most) else f"{most:.2f}"])
    heads = ["strategy", *VERDICTS.values(), "largest mean ratio where worse"]
    return heads, rows
