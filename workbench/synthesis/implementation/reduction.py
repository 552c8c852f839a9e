"""Order reduction of controllers, with a certificate of the loop of each reduced controller."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal, get_args

import numpy as np
from numpy.typing import NDArray

from workbench.certify.stability import stability_of
from workbench.errors import InputError
from workbench.executor import Context
from workbench.heavy_types import StateSpace
from workbench.input_checks import need_positive, need_whole
from workbench.mu.frequency.peak import Peak
from workbench.mu.robust.conditions import Conditions, conditions
from workbench.mu.robust.performance import performance_peak
from workbench.solution import solve
from workbench.synthesis.mu.program import MuSynthesis
from workbench.synthesis.reduction import truncation
from workbench.systems.conversion import as_system, need_plant
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.systems.realisation import in_words, realisation

Reducer = tuple[int, Callable[[int], StateSpace]]
"""The least order that a method reaches, and a function from an order to the controller."""
DETOUR = 8
"""States above the wanted order from which `approximations` starts again at most."""
ReductionMethod = Literal["weighted", "balanced", "matchdc", "hankel"]
"""Methods of order reduction; see `approximated`."""


@dataclass(frozen=True, eq=False)
class ReducedController:
    """A controller with fewer states and the certified peak of its loop.

    The peak of mu of robust performance lies between ``lower`` and ``upper``. For a plant without
    uncertainty it is the peak of the gain, for a plant without performance the peak of mu of robust
    stability. Where the loop is not ``stable`` both bounds are infinite.

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
    >>> found = reduce_order(K, plant, order=0).tried[0]
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

    def __repr__(self) -> str:
        loop = f"peak {self.lower:.4g} to {self.upper:.4g}" if self.stable else "loop UNSTABLE"
        return f"ReducedController: {in_words(self.K)}; {loop}"


@dataclass(frozen=True, eq=False)
class ReducedControllers:
    """Reduced controllers of all orders tried, lowest first; the last one is the given controller.

    ``smallest`` is the controller of the least order that has a stable loop with a certified peak
    of at most the target; None where no order has one.

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
    >>> [controller.order for controller in reduce_order(K2, plant).tried]
    [0, 1, 2]
    """

    tried: tuple[ReducedController, ...]
    target: float

    def __repr__(self) -> str:
        lines = [f"ReducedControllers, target {self.target:.4g}:"]
        lines += [f"  {in_words(one.K)}; " + repr(one).split("; ")[-1] for one in self.tried]
        return "\n".join(lines)

    @property
    def smallest(self) -> ReducedController | None:
        """The stable controller of lowest order whose peak is proven within the target."""
        return next((one for one in self.tried if one.stable and one.upper <= self.target), None)

    @property
    def lti(self) -> StateSpace:
        """The controller of the least order that meets the target; InputError where none does."""
        if self.smallest is None:
            raise InputError(
                f"no reduced controller has a certified peak of {self.target:.6g} or less; choose "
                "one of `tried`"
            )
        return self.smallest.K

    @property
    def curve(self) -> NDArray[np.float64]:
        """Order, lower and upper bound of the peak (N, 3); infinite where the loop is unstable."""
        return np.array([[one.order, one.lower, one.upper] for one in self.tried])


def approximated(
    K: Any, order: int, method: ReductionMethod = "weighted", plant: GeneralisedPlant | None = None
) -> StateSpace:
    """Approximate a controller by one with at most `order` states.

    The result has fewer states where the minimal part of K has fewer, or where Hankel singular
    values coincide.

    Parameters
    ----------
    K
        StateSpace or TransferFunction, continuous time.
    method
        ``"weighted"``: balanced truncation by Gramians of the closed loop. ``"balanced"``,
        ``"matchdc"`` and ``"hankel"``: balanced truncation, the same with the response at zero
        frequency kept, and optimal Hankel-norm approximation of the stable part of K alone; the
        other poles are kept (see `workbench.synthesis.reduction.truncation`).
    plant
        Plant of the loop u = K y; for ``"weighted"`` only.

    Raises
    ------
    InputError
        The controller or plant is sampled; the order is below 0, above that of K, or below the
        number of poles that the method keeps; or the method is "weighted" and there is no plant, or
        K does not stabilise it.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import approximated
    >>> K = control.ss([[-1.0, 0.0], [0.0, -1e4]], [[1.0], [1.0]], [[1.0, 1.0]], [[0.0]])
    >>> approximated(K, 1, "balanced").poles().real.round(2).tolist()
    [-1.0]
    """
    K = _continuous(K)
    return _of_order(K, order, method, _reducer(K, method, plant, None))


def approximations(
    K: Any, order: int, method: ReductionMethod = "weighted", plant: GeneralisedPlant | None = None
) -> Iterator[StateSpace]:
    """The approximation of `approximated`, then others of the order by way of higher orders.

    Where the direct one does not stabilise the loop, or misses a requirement, another one may meet
    it. The others start from an approximation with up to `DETOUR` states more, by any method.

    Arguments and errors are those of `approximated`.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import approximations
    >>> K = control.ss([[-1.0, 0.0], [0.0, -1e4]], [[1.0], [1.0]], [[1.0, 1.0]], [[0.0]])
    >>> next(approximations(K, 1, "balanced")).nstates
    1
    """
    K = _continuous(K)
    yield approximated(K, order, method, plant)

    @cache
    def reducer(first: ReductionMethod) -> Reducer:
        return _reducer(K, first, plant, None)

    for higher in range(order + 1, min(order + DETOUR, K.nstates - 1) + 1):
        for first in get_args(ReductionMethod):
            try:
                between = _of_order(K, higher, first, reducer(first))
                yield approximated(between, order, method, plant)
            except InputError:  # it does not stabilise the plant, or keeps too many poles
                continue


def reduce_order(
    K: Any,
    plant: GeneralisedPlant,
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
        The only order to try; None: all.
    refine
        Whether to improve controllers above the target by method "fixed" of `MuSynthesis`, from the
        highest order down. The approximation of a refined controller may be a better start for the
        next order.
    context
        Progress and time limit of the refinement.

    Raises
    ------
    InputError
        As `approximated`; the target is not positive; or refinement is asked for a plant without
        uncertainty.

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
    >>> reduced = reduce_order(K2, plant, target=1.0)
    >>> reduced.smallest.order
    1
    """
    need_positive(target, "target")
    K = _continuous(K)
    found, given = _certified(plant, K)
    least, of = _reducer(K, method, plant, found)
    if order is None:
        orders = list(range(least, K.nstates))
    else:
        _check_order(order, least, K, method)
        orders = [order] if order < K.nstates else []
    tried: dict[int, StateSpace] = {}
    for k in orders:
        one = of(k)
        if one.nstates < K.nstates:
            tried.setdefault(one.nstates, one)
    certified = [_certified(plant, tried[k])[1] for k in sorted(tried)]
    if refine:
        certified = _refined(plant, certified, given, target, context or Context())
    return ReducedControllers((*certified, given), target)


def _refined(
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
    """A reduced controller refined by "fixed".

    The start is the better of this controller and the approximation of the next higher order's.
    """
    again = approximated(above.K, one.order, plant=plant)
    best = min(one, _certified(plant, again)[1], key=lambda each: each.upper)
    if not best.stable:
        return best
    solution = solve(MuSynthesis(plant, start=best.K), "fixed")
    if solution.answer is None:
        return best
    return min(best, _certified(plant, solution.answer.K)[1], key=lambda each: each.upper)


def _reducer(
    K: StateSpace, method: str, plant: GeneralisedPlant | None, found: Conditions | None
) -> Reducer:
    """The least order that a method reaches, and a function from an order to the controller."""
    parts = K.A, K.B, K.C, K.D
    least = 0
    if method == "balanced":
        least, of = truncation.balanced_truncation(parts)
    elif method == "matchdc":
        least, of = truncation.matchdc(parts)
    elif method == "hankel":
        least, of = truncation.hankel(parts)
    elif method == "weighted":
        if plant is None:
            raise InputError(
                'the method "weighted" weighs with the closed loop; give the plant, or ask '
                '"balanced", "matchdc" or "hankel"'
            )
        peak = _peak(found) if found is not None else _only_peak(plant, K)
        loop = plant.close(K)
        if peak is None:
            poles = loop.poles()
            pole = complex(poles[np.argmax(poles.real)])
            raise InputError(
                f"the loop with the given controller is unstable, its rightmost pole {pole:.6g}; "
                '"weighted" needs a controller that stabilises the plant'
            )
        closed = loop.A, loop.B, loop.C, loop.D
        of = truncation.weighted(parts, plant, closed, peak)
    else:
        raise InputError(f"method is {method!r}; it must be one of {get_args(ReductionMethod)}")
    labels = {"inputs": K.input_labels, "outputs": K.output_labels}
    return least, lambda k: realisation(of(k), 0.0, **labels)


def _certified(plant: GeneralisedPlant, K: StateSpace) -> tuple[Conditions, ReducedController]:
    """The conditions of a loop, and the controller with its certified peak."""
    found = conditions(plant, K)
    peak = _peak(found)
    stable = peak is not None and bool(stability_of(plant.close(K)).holds)
    bounds = (peak.lower, peak.upper) if peak is not None and stable else (math.inf, math.inf)
    return found, ReducedController(K, stable, *bounds)


def _peak(found: Conditions) -> Peak | None:
    """The peak of robust performance, or of robust stability where there is no performance."""
    return found.robust_performance or found.robust_stability


def _only_peak(plant: GeneralisedPlant, K: StateSpace) -> Peak | None:
    """The same peak, without what else `conditions` certifies; None where the loop is unstable."""
    need_plant(plant)
    if plant.performance and plant.exogenous:
        return performance_peak(plant, K)
    return conditions(plant, K).robust_stability


def _continuous(K: Any) -> StateSpace:
    """K as a StateSpace; raises InputError for a sampled controller."""
    K = as_system(K, "K")
    if K.dt:
        raise InputError(
            f"K is sampled (dt = {K.dt}); reduce the continuous controller and discretise it then"
        )
    return K


def _of_order(K: StateSpace, order: int, method: str, reducer: Reducer) -> StateSpace:
    least, of = reducer
    _check_order(order, least, K, method)
    return of(order)


def _check_order(order: int, least: int, K: StateSpace, method: str) -> None:
    """Raise InputError unless the order lies between the least one and that of K."""
    need_whole(order, "order")
    if not least <= order <= K.nstates:
        kept = f" ({method!r} keeps the {least} poles that are not stable)" if least else ""
        raise InputError(
            f"order is {order}; it must lie between {least}{kept} and {K.nstates}, that of K"
        )
