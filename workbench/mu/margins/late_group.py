"""Disk margins of several channels at once with dead time: one complex factor in each.

The factors are uncertain dynamics of the closed loop, so that the margin is one of robust stability
with known dead time (`workbench.mu.robust.late_margin`): the lower bound uses a rational set that
contains the dead time, the upper bound the dead time itself.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.answer import Answer, PartsChecker, no_better
from workbench.certificate import Check
from workbench.errors import InputError
from workbench.mu.margins.disk import DiskMargin, factor_of
from workbench.mu.robust.late_margin import late_margin
from workbench.mu.robust.margin_bounds import RECIPROCAL_ROUNDING
from workbench.uncertainty.algebra.elements import DynamicElement
from workbench.uncertainty.algebra.lft import LFT
from workbench.uncertainty.algebra.system import UncertainSystem

FACTOR = "factor_of_channel_"
"""Prefix of the names that the factors have as uncertain elements."""


@dataclass(frozen=True, eq=False)
class LateGroupChecker(PartsChecker):
    """Checks a `DiskMargin` of several channels of a loop with dead time."""

    @property
    def quantifier(self) -> str:
        return "for this one plant, for all factors of the disk"

    def parts(self, answer: DiskMargin) -> Mapping[str, Answer]:
        return {"margin": answer.proof}

    def checks(self, answer: DiskMargin, tolerance: float) -> list[Check]:
        statement = "by which share it is better than the margin that is proven"
        lower, upper = answer.proof.lower, answer.proof.upper
        return no_better(answer, lower, upper, statement, RECIPROCAL_ROUNDING)


def late_group(
    returned: UncertainSystem, channels: Mapping[int, str], skew: float, tolerance: float
) -> DiskMargin:
    """The disk margin of several channels of a stable loop with known dead time.

    ``returned`` is the closed loop from signals added in the channels to the signals there without
    the added ones, as for `workbench.mu.margins.disk.disk_of`. Raises InputError if the loop does
    not fall to 0 at infinite frequency.
    """
    part = returned[list(channels), list(channels)]
    shifted = part + (1.0 + skew) / 2.0 * np.eye(len(channels))
    factors = [DynamicElement(f"{FACTOR}{k}", 1, 1) for k in channels]
    names = shifted.value.names + tuple(one.channels[0] for one in factors)
    elements = {**shifted.elements, **{one.name: one for one in factors}}
    margin = late_margin(UncertainSystem(LFT(shifted.value.M, names), elements, dt=0.0), tolerance)
    if margin.lower == 0.0:
        raise InputError(
            f"the loop in {', '.join(channels.values())} does not fall to 0 at infinite "
            "frequency, where no Pade approximation of its dead time is accurate, so that no disk "
            "of several channels can be proven; add a lag to plant or controller, or take the "
            "disks of each channel alone from `disks`"
        )
    worst: dict[str, StateSpace] | None = None
    if margin.worst is not None and 0.0 < margin.upper < math.inf:
        found = [factor_of(margin.worst[one.name], 0, 0, skew) for one in factors]
        worst = {name: f for name, f in zip(channels.values(), found, strict=True) if f is not None}
        worst = worst if len(worst) == len(channels) else None
    answer = DiskMargin(
        tuple(channels.values()),
        skew,
        margin.lower,
        margin.upper,
        margin.omega,
        worst,
        None,
        margin,
    )
    return answer.with_checker(LateGroupChecker())
