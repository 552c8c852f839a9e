"""How much demands on a benchmark's controller raise its peak of mu."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from workbench import problem
from workbench.synthesis import DemandCost

from .controller import PLANTS


@problem("{plant}/demands", plant=("mass-spring", "unstable-first-order"), slow=True)
def demands(
    plant: Literal["mass-spring", "unstable-first-order"],
    orders: tuple[Annotated[int, Field(ge=0)], ...] = (1, 2, 4),
    fastest_pole: Annotated[float, Field(gt=0.0, allow_inf_nan=False)] | None = 20.0,
) -> DemandCost:
    """The certified peak of mu of controllers that are small, stable themselves and slow.

    orders: numbers of states. fastest_pole: largest magnitude of a pole [rad/s]; None sets no
    limit.
    """
    return DemandCost(PLANTS[plant](), orders=orders, fastest_pole=fastest_pole)
