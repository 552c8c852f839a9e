"""Controllers that one would ship: stable, not too fast, of an order."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench.certificate import THIS_SYSTEM, Check
from workbench.certify.stability import stability_of
from workbench.errors import InputError
from workbench.heavy_types import StateSpace
from workbench.input_checks import need_kind, need_positive, need_whole
from workbench.synthesis.families.integral_action import without_integrators

ROUNDING = 1e-9
"""Relative rounding of the sizes of poles."""


@dataclass(frozen=True)
class Shippable:
    """What a controller must be besides stabilising: order, stability, poles up to a size [rad/s].

    None leaves a demand out. With ``integral`` integrators count as stable. Raises InputError for
    an order or a size that is none.
    """

    order: int | None = None
    stable: bool = False
    fastest: float | None = None
    integral: bool = False

    def __post_init__(self) -> None:
        need_positive(self.fastest, "fastest_pole", or_none=True)
        if self.order is not None:
            need_whole(self.order, "order")
            if self.order < 0:
                raise InputError(f"order is {self.order}; it must be 0 or more")
        need_kind(self.stable, bool, "stable")
        need_kind(self.integral, bool, "integral")

    @property
    def asked(self) -> bool:
        """Whether anything is asked."""
        return self.order is not None or self.stable or self.fastest is not None

    @property
    def asked_of_poles(self) -> bool:
        """Whether anything is asked of the controller's poles."""
        return self.stable or self.fastest is not None

    def checks(self, K: StateSpace) -> list[Check]:
        """Checks that a controller meets the demands."""
        found = []
        if self.order is not None:
            statement = "number of states of K, at most what was asked for"
            found.append(Check("order", statement, float(K.nstates), float(self.order)))
        if self.stable:
            statement = "distance of the controller's own worst pole beyond the imaginary axis"
            own = stability_of(without_integrators(K) if self.integral else K)
            found.append(
                Check(
                    "controller stable", statement, own.value, own.limit, own.where,
                    over=THIS_SYSTEM,
                )
            )  # fmt: skip
        if self.fastest is not None:
            statement = "size of the controller's fastest pole over the one allowed, less 1"
            size = float(np.abs(K.poles()).max(initial=0.0)) / self.fastest - 1.0
            found.append(Check("fastest pole", statement, size, ROUNDING, over=THIS_SYSTEM))
        return found

    def admits(self, K: StateSpace) -> bool:
        """Whether a controller meets the demands."""
        return all(check.holds for check in self.checks(K))
