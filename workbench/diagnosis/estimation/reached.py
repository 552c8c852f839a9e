"""How much of a demand on fault filters can be met, if it cannot be met as asked.

A filter's estimate is bounded only on plants for which the loop itself is stable. So the set is
first reduced to the largest share on which the loop is proven stable, whatever the filter. On that
share the limits of error, leakage and sensitivity are raised by their least common factor. Share
and factor are both 1 if the demand can be met.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TypeVar

from workbench.diagnosis.estimation.fault_loop import FaultLoop
from workbench.diagnosis.estimation.front import GRID_MARGIN
from workbench.errors import SolverError
from workbench.mu import peak

Design = TypeVar("Design")

STABILITY_ROOM = 2 * GRID_MARGIN
"""Relative distance that the share of the set keeps from the share at which stability can no longer
be proven: there the loop amplifies without bound. The grid's tightening of the limits uses half of
it.
"""
FACTOR_ROOM = 1e-3
"""Filters are first sought at a factor this much above the least factor of a front, relatively:
there the cone program has an interior.
"""
STEP = 0.01
"""Relative step between larger factors, which filters with few states may need."""
STEPS = 512
"""Largest number of steps; it raises the limits to 163 times those asked."""


@dataclass(frozen=True)
class DemandReached:
    """How much of a demand is met: on which share of the set, with limits raised by which factor.

    The requirements hold for all perturbations of the set that are at most ``share`` as large, with
    limits ``factor`` times those asked.

    Examples
    --------
    >>> from workbench.diagnosis import DemandReached
    >>> DemandReached(1.0, 1.0).as_asked, DemandReached(0.9, 1.2).as_asked
    (True, False)
    """

    share: float
    factor: float

    @property
    def as_asked(self) -> bool:
        """Whether the demand is met for the whole set."""
        return self.share >= 1.0 and self.factor <= 1.0


def stable_share(loop: FaultLoop) -> float:
    """The share of the set, up to 1, on which the loop is proven stable with STABILITY_ROOM.

    Raises InputError if the nominal loop is not stable.

    Examples
    --------
    >>> import control
    >>> from workbench.diagnosis import EstimationDemands, FaultLoop
    >>> from workbench.diagnosis.estimation.reached import stable_share
    >>> from workbench.fitting import Rational
    >>> from workbench.uncertainty import UncertaintyModel
    >>> room = control.ss(-0.1, 0.1, 3e-3, 0.0)  # of a room's temperature [K]
    >>> demands = EstimationDemands(
    ...     error_above_hz=0.5, leakage_below_hz=0.05, gain=2.0, disturbance=room, noise=1e-4,
    ...     noise_band_hz=1.0
    ... )
    >>> K, H = control.ss(0.0, 0.1, 1.0, 0.8), control.ss(-30.0, 30.0, 1.0, 0.0)
    >>> heater, W_c, wide = (
    ...     Rational([], [-p], gain) for p, gain in ((0.2, 0.2), (2.0, 0.2), (2.0, 8.0))
    ... )
    >>> stable_share(FaultLoop(UncertaintyModel(heater, W_c), K, H, demands))
    1.0
    >>> bool(stable_share(FaultLoop(UncertaintyModel(heater, wide), K, H, demands)) < 0.7)
    True
    """
    plant = loop.plant
    structure = loop.model.structure
    found = peak(plant.system[: structure.columns, : structure.rows], structure)
    return min(1.0, (1 - STABILITY_ROOM) / max(found.upper, 1e-300))


def best_design(
    loops: Sequence[FaultLoop],
    least_factor: Callable[[DemandReached], float],
    designed: Callable[[DemandReached], Design | None],
) -> tuple[DemandReached, Design]:
    """The design that meets a demand, or the one that comes nearest to it; and how near it comes.

    Parameters
    ----------
    loops
        The loops, with the sets of plants, for which the design is made.
    least_factor
        Returns a factor of the limits below which no design exists on a share of the set.
    designed
        Returns a design that is certified to meet the given share and factor; None if none is
        found.

    Raises
    ------
    SolverError
        No design is found, even with limits 163 times as large.

    Examples
    --------
    A stand-in for a design that needs limits 1.5 times as large:

    >>> import control
    >>> from workbench.diagnosis import EstimationDemands, FaultLoop, best_design
    >>> from workbench.fitting import Rational
    >>> from workbench.uncertainty import UncertaintyModel
    >>> room = control.ss(-0.1, 0.1, 3e-3, 0.0)  # of a room's temperature [K]
    >>> demands = EstimationDemands(
    ...     error_above_hz=0.5, leakage_below_hz=0.05, gain=2.0, disturbance=room, noise=1e-4,
    ...     noise_band_hz=1.0
    ... )
    >>> K, H = control.ss(0.0, 0.1, 1.0, 0.8), control.ss(-30.0, 30.0, 1.0, 0.0)
    >>> heater, W_c = (Rational([], [-p], gain) for p, gain in ((0.2, 0.2), (2.0, 0.2)))
    >>> loop = FaultLoop(UncertaintyModel(heater, W_c), K, H, demands)
    >>> reached, design = best_design(
    ...     [loop],
    ...     lambda reached: 1.2,
    ...     lambda reached: "a filter" if reached.factor >= 1.5 else None,
    ... )
    >>> reached.share, round(reached.factor, 2), design
    (1.0, 1.51, 'a filter')
    """
    asked = DemandReached(1.0, 1.0)
    found = designed(asked)
    if found is not None:
        return asked, found
    share = min(map(stable_share, loops))
    factor = max(1.0, (1 + FACTOR_ROOM) * least_factor(DemandReached(share, 1.0)))

    def tried(steps: int) -> tuple[DemandReached, Design] | None:
        reached = DemandReached(share, factor * (1 + STEP) ** steps)
        found = designed(reached)
        return None if found is None else (reached, found)

    fails, meets, best = -1, 0, tried(0)
    while best is None:
        if meets == STEPS:
            raise SolverError(
                f"no filter is certified on {share:.3g} of the set with limits up to "
                f"{factor * (1 + STEP) ** STEPS:.3g} times those asked"
            )
        fails, meets = meets, max(1, 2 * meets)
        best = tried(meets)
    while meets - fails > 1:
        middle = (fails + meets) // 2
        better = tried(middle)
        fails, meets, best = (middle, meets, best) if better is None else (fails, middle, better)
    return best
