"""Statements about the strategies over many draws, and tables of their errors."""

from __future__ import annotations

import math
from itertools import combinations

from workbench.study import draws_summary, interval_text, markdown_table, verdict_of_share
from workbench.types import DataArray, Dataset

from ..strategy_looks import titled
from ..tactics import STRATEGIES

LEVELS = (1 / 2, 2 / 3, 1.0)
"""Fractions of the reference strategy's excursion below which a strategy may stay."""
CLAIMED = {"A": 1 / 2, "B": 1 / 2, "C": 1.0, "K_prime": 1.0}
"""The fraction below which each strategy stays, whenever the reference strategy's error is too
large to read. For C and K', one draw suggests 2/3, but many draws leave it undecided.
"""


def over_reference(values: DataArray) -> DataArray:
    """Values of every strategy, divided by those of the reference strategy in the same draw."""
    return values / values.sel(strategy="reference")


def unmet(reduced: DataArray) -> DataArray:
    """Share of the draws in which a strategy of `CLAIMED` is above its level; 0 without draws."""
    import xarray as xr

    every = [reduced.sel(strategy=name, level=level) for name, level in CLAIMED.items()]
    return 1.0 - xr.concat([one.drop_vars("level") for one in every], "strategy").fillna(1.0)


def claims_table(answer: Dataset) -> str:
    """Statements that hold in 95 % of the draws, and statements that are undecided."""
    below = "at most {:.2g} of the reference strategy's, where that cannot be read"
    rows = [
        (name, below.format(level), answer["reduced"].sel(strategy=name, level=level))
        for name in CLAIMED
        for level in LEVELS
    ]
    rows += [
        (name, "within what can be read", answer["readable"].sel(strategy=name))
        for name in STRATEGIES
    ]
    rows += [
        (one, f"below that of {titled(two)}", answer["smaller"].sel(strategy=one, other=two))
        for one, two in combinations(CLAIMED, 2)
    ]
    return markdown_table(
        ["excursion of", "is", "of the draws", "claim"],
        [[titled(name), text, *_share_and_claim(float(share))] for name, text, share in rows],
    )


def _share_and_claim(share: float) -> list[str]:
    return ["none", "undecided"] if math.isnan(share) else [f"{share:.1%}", verdict_of_share(share)]


def error_tables(excursion: DataArray, periodic: DataArray, draws: int) -> dict[str, str]:
    """Mean and interval [um] of both errors by drive and strategy."""
    titles = (
        "Largest true error within 5 ms after the 1.2 mm scratch [um]",
        "Amplitude of the true error at the rotation frequency [um]",
    )
    return {
        str(values.name): f"{title}: mean, and the interval of 90 % of {draws} draws.\n\n"
        + _by_drive(draws_summary(1e6 * values))
        for values, title in zip((excursion, periodic), titles, strict=True)
    }


def _by_drive(summary: DataArray) -> str:
    heads = ["drive", *(titled(str(name)) for name in summary["strategy"].values)]
    cells = summary.transpose("drive", "strategy", "summary")
    return markdown_table(
        heads, [[str(row["drive"].values), *(interval_text(one) for one in row)] for row in cells]
    )
