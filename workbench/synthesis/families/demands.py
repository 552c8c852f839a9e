"""Demands on the controller itself: its order, stability, speed and gain."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.certificate import EVERY_FREQUENCY, THIS_SYSTEM, Check, relative_excess
from workbench.certify.norms import certified_norm
from workbench.certify.stability import stability_check
from workbench.errors import InputError
from workbench.input_checks import need_kind, need_positive, need_whole
from workbench.synthesis.families.integral_action import without_integrators

LIMIT_ROUNDING = 1e-9
"""Rounding allowed in sizes of poles and gains, relative to the limit."""


@dataclass(frozen=True)
class Shippable:
    """Demands on a controller besides stability of the loop: order, own stability, pole sizes
    [rad/s].

    None leaves a demand out. With ``integral``, integrators count as stable. A controller whose
    largest gain (the largest singular value over all frequencies) is limited must be stable. Raises
    InputError for an order, a size or a gain that is not valid.
    """

    order: int | None = None
    stable: bool = False
    fastest: float | None = None
    integral: bool = False
    gain: float | None = None

    def __post_init__(self) -> None:
        need_positive(self.fastest, "fastest_pole", or_none=True)
        if self.order is not None:
            need_whole(self.order, "order")
            if self.order < 0:
                raise InputError(f"order is {self.order}; it must be 0 or more")
        need_kind(self.stable, bool, "stable")
        need_kind(self.integral, bool, "integral")
        need_positive(self.gain, "largest_gain", or_none=True)
        if self.gain is not None:
            if self.integral:
                raise InputError("integral: an integrator's gain is larger than any largest_gain")
            object.__setattr__(self, "stable", True)

    @property
    def asked(self) -> bool:
        """Whether there is any demand."""
        return self.order is not None or self.stable or self.fastest is not None

    @property
    def asked_of_poles(self) -> bool:
        """Whether there is a demand on the controller's poles."""
        return self.stable or self.fastest is not None

    @property
    def without_gain(self) -> Shippable:
        """The demands on order and poles, without the gain: a search satisfies these at every
        step.
        """
        return replace(self, gain=None)

    def checks(self, K: StateSpace) -> list[Check]:
        """Checks that a controller meets the demands."""
        found = []
        if self.order is not None:
            statement = "number of states of K, at most what was asked for"
            found.append(Check("order", statement, float(K.nstates), float(self.order)))
        if self.stable:
            statement = "distance of the controller's own worst pole beyond the imaginary axis"
            own = stability_check(without_integrators(K) if self.integral else K)
            found.append(
                Check(
                    "controller stable", statement, own.value, own.limit, where=own.where,
                    over=THIS_SYSTEM,
                )
            )  # fmt: skip
        if self.fastest is not None:
            statement = "size of the controller's fastest pole over the one allowed, less 1"
            size = float(np.abs(K.poles()).max(initial=0.0)) / self.fastest - 1.0
            found.append(Check("fastest pole", statement, size, LIMIT_ROUNDING, over=THIS_SYSTEM))
        if self.gain is not None:
            statement = "proven largest gain of the controller over the one allowed, less 1"
            largest = certified_norm(K) if stability_check(K).holds else np.inf
            found.append(
                Check(
                    "largest gain", statement, relative_excess(largest, self.gain), LIMIT_ROUNDING,
                    over=EVERY_FREQUENCY, proven=True,
                )
            )  # fmt: skip
        return found

    def admits(self, K: StateSpace) -> bool:
        """Whether a controller meets the demands."""
        return all(check.holds for check in self.checks(K))
