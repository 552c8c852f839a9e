"""Orders of models: those to try, and those that a record can determine."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from workbench.errors import InputError
from workbench.identification.state_space.selection import fitting_pasts, largest_order
from workbench.input_checks import need_whole

USUAL_ORDERS = (1, 2, 3, 4, 6, 8)
"""Orders that are tried by default, as far as the record determines them."""
SAMPLES_FOR_EACH = 2
"""Fewest output samples for each parameter of a model."""


@dataclass(frozen=True)
class OrderLimits:
    """The orders that a number of samples of nu inputs and ny outputs can determine.

    A model has no fewer states than ``known_poles``.
    """

    samples: int
    nu: int
    ny: int
    known_poles: int = 0

    def settled(self, orders: Any) -> tuple[int, ...]:
        """The orders to try, rising: the given ones, or the usual ones for None.

        Raises InputError for invalid orders, and for orders that the samples do not determine.
        """
        if orders is None:
            fewest = max(1, self.known_poles)
            usual = sorted({fewest, *(n for n in USUAL_ORDERS if n >= fewest)})
            return tuple(n for n in usual if self.determines(n)) or (self._refused(usual[0]),)
        if isinstance(orders, str) or not np.iterable(orders):
            raise InputError(f"orders is {orders!r}; a list of whole numbers is needed")
        for order in orders:
            need_whole(order, "an order")
        found = tuple(sorted({int(order) for order in orders}))
        if not found:
            raise InputError("no orders to choose from; give at least one")
        if 0 < found[0] < self.known_poles:
            raise InputError(
                f"order {found[0]} is too low for {self.known_poles} known poles; "
                f"ask for orders of at least {self.known_poles}"
            )
        for order in (found[0], found[-1]):
            if not self.determines(order):
                self._refused(order)
        return found

    def parameters(self, order: int) -> int:
        """Number of free parameters of a model of an order."""
        return order * (2 * self.ny + self.nu) + self.ny * self.nu

    def determines(self, order: int) -> bool:
        """Whether the samples determine models of an order."""
        known = bool(fitting_pasts(order, self.samples, self.nu, self.ny))
        return known and SAMPLES_FOR_EACH * self.parameters(order) <= self.samples * self.ny

    def determines_arx(self, order: int) -> bool:
        """Whether the samples determine an ARX model of an order."""
        unknowns = 1 + order * (self.nu + self.ny) + self.nu
        return self.samples - order >= SAMPLES_FOR_EACH * unknowns

    def _refused(self, order: int) -> int:
        """Raise `InputError`: the samples do not determine models of an order."""
        raise InputError(
            f"order {order} does not fit the data: its {self.parameters(order)} free parameters "
            f"would be estimated from {self.samples * self.ny} output samples; at least "
            f"{SAMPLES_FOR_EACH} for each parameter are needed, and an order of at most "
            f"{largest_order(self.samples, self.nu, self.ny)}: choose lower orders (at least 1) "
            "or a longer record"
        )
