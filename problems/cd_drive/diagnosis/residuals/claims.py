"""Statements about the residuals in each draw; statistics are compared within the same draw."""

from __future__ import annotations

from itertools import combinations

from workbench.types import DataArray, Dataset

from ..defect_claims import Claim
from .figures import NAMES
from .trials import at_usual_noise

CLAIMED = ("deep defects", "depth", "isolation")
"""Names of the statements that are checked: they hold in all but a few draws, whatever the seed."""
SLOW_SUM = 0.8
"""Largest light loss at which the slow sum alarms, over that at which the level alarms."""
ISOLATED = 0.6
"""Least share of faults that are isolated correctly."""


def isolated_share(confusion: DataArray) -> DataArray:
    """Share of the faults (draw,) that were isolated correctly."""
    faults = confusion["fault"].values.tolist()
    right = sum(confusion.sel(fault=one, isolated_as=one, drop=True) for one in faults)
    found: DataArray = right / confusion.sum(["fault", "isolated_as"])
    return found


def residual_claims(answer: Dataset) -> list[Claim]:
    """Statements that are checked, then comparisons of the statistics."""
    area, usual = answer["area"], at_usual_noise(answer["area"])
    deep = usual.sel(statistic=["sum", "quality", "cusum"], depth=0.4, length=1e-3)
    by_sum, by_quality = (area.sel(statistic=name) for name in ("sum", "quality"))
    slow, by_level = (answer["fade"].sel(way=way) for way in ("slow sum", "level"))
    conditions = ("depth", "length", "noise")
    checked = [
        Claim(
            "deep defects",
            "areas of sum, quality and CUSUM at least 0.99 for 40 % of the light, 1 mm",
            (deep >= 0.99).all("statistic"),
        ),
        Claim(
            "depth",
            "no deeper defect with less of the sum's area by 0.05",
            (by_sum.diff("depth") >= -0.05).all(conditions),
        ),
        Claim(
            "quality is the sum",
            "quality nowhere better than the sum by an area of 0.02",
            (by_quality - by_sum <= 0.02).all(conditions),
        ),
        Claim(
            "fading laser",
            f"slow sum alarms before {SLOW_SUM:g} of the light lost at the level's alarm",
            slow <= SLOW_SUM * by_level,
        ),
        Claim(
            "isolation",
            f"at least {ISOLATED:.0%} of the faults isolated",
            isolated_share(answer["confusion"]) >= ISOLATED,
        ),
    ]
    return [
        *checked,
        Claim("", "slow sum sooner than the level", slow < by_level),
        *_compared(usual, at_usual_noise(answer["delay"])),
    ]


def _compared(area: DataArray, delay: DataArray) -> list[Claim]:
    """Statistics compared in the same draw, at the usual noise."""
    mean = area.mean(["depth", "length"])
    better = [
        Claim(
            "",
            f"area, all defects: {NAMES[one]} above {NAMES[other]}",
            mean.sel(statistic=one) > mean.sel(statistic=other),
        )
        for one, other in combinations(NAMES, 2)
    ]
    shallow = area.sel(depth=0.1)
    memory = [
        Claim(
            "",
            f"area, 10 % of the light, {1e3 * length:g} mm: CUSUM above sum",
            shallow.sel(statistic="cusum", length=length)
            > shallow.sel(statistic="sum", length=length),
        )
        for length in area["length"].values.tolist()
    ]
    late = delay.sel(depth=0.4, length=1e-3)
    sooner = [
        Claim(
            "",
            f"delay, 40 % of the light, 1 mm: sum before {NAMES[other]}",
            late.sel(statistic="sum") < late.sel(statistic=other),
        )
        for other in ("quality", "cusum", "glr")
    ]
    return [*better, *memory, *sooner]
