"""Controllers of reduced order with the certified peaks of their loops, and their checkers."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from workbench._core.heavy_types import StateSpace
from workbench.answer import Answer, PartsChecker
from workbench.certificate import EVERY_PERTURBATION, Check
from workbench.errors import InputError
from workbench.mu.frequency.peak_bounds import Peak
from workbench.mu.robust.conditions import Conditions
from workbench.systems.realisation import in_words


@dataclass(frozen=True, eq=False, repr=False)
class ReducedController(Answer):
    """A controller with fewer states and the certified peak of its loop.

    Unlike a `StateSpace`, it has the proven peak of its loop.

    The peak of mu of robust performance lies between ``lower`` and ``upper``. For a plant without
    uncertainty it is the peak of the gain, for a plant without performance the peak of mu of robust
    stability. If the loop is not ``stable``, both bounds are infinite.

    Examples
    --------
    >>> import control
    >>> from workbench.structure import Complex
    >>> from workbench.synthesis import reduce_order
    >>> from workbench.uncertainty import generalised_plant
    >>> G = control.tf([1.0], [1.0, 1.0])
    >>> parts = [
    ...     (G, "v", "y"),
    ...     (control.ss([], [], [], [[0.2]]), "u", "z"),
    ...     (control.tf([0.4], [1.0, 0.01]), "e", "z_e"),
    ... ]
    >>> sums = {"v": "u + d", "e": "r - y"}
    >>> uncertain = [(Complex(1), "z", "d")]
    >>> plant = generalised_plant(
    ...     parts,
    ...     sums,
    ...     perturbation=uncertain,
    ...     exogenous=["r"],
    ...     performance=["z_e"],
    ...     control=["u"],
    ...     measurement="e",
    ... )
    >>> K = control.ss([[-0.01]], [[1.0]], [[1.0]], [[1.0]])
    >>> found = reduce_order(plant, K, order=0).tried[0]
    >>> found.order, found.stable, bool(found.lower <= found.upper)
    (0, True, True)
    """

    K: StateSpace
    stable: bool
    lower: float
    upper: float

    @property
    def lti(self) -> StateSpace:
        """The controller."""
        return self.K

    @property
    def order(self) -> int:
        """Number of states."""
        return int(self.K.nstates)

    def summary(self) -> str:
        loop = f"peak {self.lower:.4g} to {self.upper:.4g}" if self.stable else "loop UNSTABLE"
        return f"ReducedController: {in_words(self.K)}; {loop}"


@dataclass(frozen=True, eq=False, repr=False)
class ReducedControllers(Answer):
    """Reduced controllers of all orders tried, by increasing order; the last one is the given
    controller.

    Unlike a `ReducedController`, it has one controller for each order.

    ``smallest`` is the controller of least order with a stable loop and a certified peak of at most
    the target; None if there is none.

    Examples
    --------
    >>> import control
    >>> from workbench.structure import Complex
    >>> from workbench.synthesis import reduce_order
    >>> from workbench.uncertainty import generalised_plant
    >>> G = control.tf([1.0], [1.0, 1.0])
    >>> parts = [
    ...     (G, "v", "y"),
    ...     (control.ss([], [], [], [[0.2]]), "u", "z"),
    ...     (control.tf([0.4], [1.0, 0.01]), "e", "z_e"),
    ... ]
    >>> sums = {"v": "u + d", "e": "r - y"}
    >>> uncertain = [(Complex(1), "z", "d")]
    >>> plant = generalised_plant(
    ...     parts,
    ...     sums,
    ...     perturbation=uncertain,
    ...     exogenous=["r"],
    ...     performance=["z_e"],
    ...     control=["u"],
    ...     measurement="e",
    ... )
    >>> K = control.ss([[-0.01]], [[1.0]], [[1.0]], [[1.0]])
    >>> K2 = control.ss([[-0.01, 0.0], [0.0, -1e4]], [[1.0], [1.0]], [[1.0, 1.0]], [[1.0]])
    >>> [controller.order for controller in reduce_order(plant, K2).tried]
    [0, 1, 2]
    """

    tried: tuple[ReducedController, ...]
    target: float

    def summary(self) -> str:
        lines = [f"ReducedControllers, target {self.target:.4g}:"]
        lines += [f"  {in_words(one.K)}; " + one.summary().split("; ")[-1] for one in self.tried]
        return "\n".join(lines)

    @property
    def smallest(self) -> ReducedController | None:
        """The controller of lowest order with a stable loop whose proven peak is at most the
        target.
        """
        return next((one for one in self.tried if one.stable and one.upper <= self.target), None)

    @property
    def lti(self) -> StateSpace:
        """The controller of least order that meets the target. Raises InputError if none does."""
        if self.smallest is None:
            raise InputError(
                f"no reduced controller has a certified peak of {self.target:.6g} or less; choose "
                "one of `tried`"
            )
        return self.smallest.K

    @property
    def curve(self) -> NDArray[np.float64]:
        """Order, lower and upper bound on the peak (N, 3); infinite for an unstable loop."""
        return np.array([[one.order, one.lower, one.upper] for one in self.tried])


@dataclass(frozen=True, eq=False)
class ReducedChecker(PartsChecker):
    """Checks a `ReducedController` by the conditions of its loop."""

    found: Conditions

    @property
    def quantifier(self) -> str:
        return EVERY_PERTURBATION

    def parts(self, answer: ReducedController) -> Mapping[str, Answer]:
        return {"loop": self.found}

    def checks(self, answer: ReducedController, tolerance: float) -> list[Check]:
        peak = deciding_peak(self.found)
        if peak is None or not answer.stable:
            claimed = float(math.isfinite(answer.upper))
            return [Check("unstable", "whether a peak is claimed of it", claimed, 0.0)]
        better = float(answer.lower > peak.lower or answer.upper < peak.upper)
        return [Check("bounds", "whether they are better than those of the peak", better, 0.0)]


class ReducedControllersChecker(PartsChecker):
    """Checks `ReducedControllers` one by one."""

    @property
    def quantifier(self) -> str:
        return EVERY_PERTURBATION

    def parts(self, answer: ReducedControllers) -> Mapping[str, Answer]:
        return {f"order {one.order}": one for one in answer.tried}


def deciding_peak(found: Conditions) -> Peak | None:
    """The peak of robust performance, or of robust stability if there is no performance."""
    return found.robust_performance or found.robust_stability
