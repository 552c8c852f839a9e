"""Order reduction of controllers, with a certificate of the loop of each reduced controller."""

from __future__ import annotations

import math
from typing import Any

from workbench._core.heavy_types import StateSpace
from workbench.certify.stability import stability_check
from workbench.executor import Context
from workbench.input_checks import need_positive
from workbench.mu.robust.conditions import Conditions, conditions
from workbench.solution import solve
from workbench.synthesis.implementation.approximation import (
    ReductionMethod,
    approximate,
    check_order,
    need_continuous,
    reducer,
)
from workbench.synthesis.implementation.reduced import (
    ReducedChecker,
    ReducedController,
    ReducedControllers,
    ReducedControllersChecker,
    deciding_peak,
)
from workbench.synthesis.mu.program import MuSynthesis
from workbench.systems.conversion import as_system
from workbench.systems.generalised_plant import GeneralisedPlant


def reduce_order(
    plant: GeneralisedPlant,
    controller: Any,
    *,
    target: float = 1.0,
    order: int | None = None,
    method: ReductionMethod = "weighted",
    refine: bool = False,
    context: Context | None = None,
) -> ReducedControllers:
    """Reduce the order of a controller to every order, or to one, and certify each loop.

    Stability is decided by the poles of the closed loop, and the peak is that of `mu.conditions`;
    both use the plant and the reduced controller only. All orders are tried, because the peak does
    not depend monotonically on the order.

    Parameters
    ----------
    target
        Largest certified peak that is accepted.
    order
        The only order to try; None for all orders.
    refine
        Whether method "fixed" of `MuSynthesis` improves controllers above the target, from the
        highest order downward. The approximation of a refined controller may be a better start for
        the next order.
    context
        Context with progress and time limit of the refinement.

    Raises
    ------
    InputError
        As in `approximate`; the target is not positive; or refinement is requested for a plant
        without uncertainty.

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
    >>> reduced = reduce_order(plant, K2, target=1.0)
    >>> reduced.smallest.order
    1
    """
    need_positive(target, "target")
    controller = as_system(controller, "controller")
    need_continuous(controller)
    found, given = _certified_controller(plant, controller)
    least, of = reducer(controller, method, plant, found)
    if order is None:
        orders = list(range(least, controller.nstates))
    else:
        check_order(order, least, controller, method)
        orders = [order] if order < controller.nstates else []
    tried: dict[int, StateSpace] = {}
    for k in orders:
        one = of(k)
        if one.nstates < controller.nstates:
            tried.setdefault(one.nstates, one)
    certified = [_certified_controller(plant, tried[k])[1] for k in sorted(tried)]
    if refine:
        certified = _refined_controllers(plant, certified, given, target, context or Context())
    reduced = ReducedControllers((*certified, given), target)
    return reduced.with_checker(ReducedControllersChecker())


def _refined_controllers(
    plant: GeneralisedPlant,
    reductions: list[ReducedController],
    given: ReducedController,
    target: float,
    context: Context,
) -> list[ReducedController]:
    """The controllers, lowest order first, with those above the target improved by "fixed"."""
    found: list[ReducedController] = []
    above = given
    for one in context.track(reductions[::-1], "refinement"):
        best = one if one.stable and one.upper <= target else _best_refined(plant, one, above)
        above = best if best.stable else above
        found.append(best)
    return found[::-1]


def _best_refined(
    plant: GeneralisedPlant, one: ReducedController, above: ReducedController
) -> ReducedController:
    """A reduced controller, refined by method "fixed".

    The start is this controller, or the approximation of the next higher order's controller if that
    is better.
    """
    again = approximate(above.K, one.order, plant=plant)
    best = min(one, _certified_controller(plant, again)[1], key=lambda each: each.upper)
    if not best.stable:
        return best
    solution = solve(MuSynthesis(plant, start=best.K), method="fixed")
    if solution.answer is None:
        return best
    return min(
        best, _certified_controller(plant, solution.answer.K)[1], key=lambda each: each.upper
    )


def _certified_controller(
    plant: GeneralisedPlant, K: StateSpace
) -> tuple[Conditions, ReducedController]:
    """The conditions of a loop, and the controller with its certified peak."""
    found = conditions(plant, K)
    peak = deciding_peak(found)
    stable = peak is not None and bool(stability_check(plant.close(K)).holds)
    bounds = (peak.lower, peak.upper) if peak is not None and stable else (math.inf, math.inf)
    return found, ReducedController(K, stable, *bounds).with_checker(ReducedChecker(found))
