"""Approximation of plants and controllers by systems with fewer states, with a proven error."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import cache
from typing import Any, Literal, get_args

import numpy as np

from workbench._core.heavy_types import StateSpace
from workbench.certify.stability import stability_check
from workbench.errors import InputError
from workbench.input_checks import need_positive, need_whole
from workbench.mu.frequency.peak_bounds import Peak
from workbench.mu.robust.conditions import Conditions, conditions
from workbench.mu.robust.performance import performance_peak
from workbench.synthesis.implementation.reduced import deciding_peak
from workbench.synthesis.reduction import truncation
from workbench.synthesis.reduction.approximated_system import ApproximatedSystem, DifferenceChecker
from workbench.synthesis.reduction.kept_part import kept_and_stable
from workbench.synthesis.reduction.truncation import Weights
from workbench.systems.bilinear import to_continuous
from workbench.systems.conversion import as_system, as_weight, need_plant
from workbench.systems.generalised_plant import GeneralisedPlant, response
from workbench.systems.realisation import Matrices, matrices_of, pole_sizes, realisation

Reducer = tuple[int, Callable[[int], StateSpace]]
"""The least order that a method reaches, and a function: order -> system."""
DETOUR = 8
"""Largest number of states above the wanted order from which `approximations` starts again."""
ReductionMethod = Literal["weighted", "balanced", "matchdc", "hankel"]
"""Methods of order reduction; see `approximate`."""
SCREENED = 60
"""Number of frequencies at which a difference is evaluated before its bound is proven."""


def approximate(
    controller: Any,
    order: int | None,
    *,
    method: ReductionMethod = "weighted",
    plant: GeneralisedPlant | None = None,
    error: float | None = None,
    output_weight: Any = None,
    input_weight: Any = None,
) -> ApproximatedSystem:
    """Approximate a plant or a controller by a system with at most `order` states.

    The result has fewer states if the minimal part of K has fewer, or if Hankel singular values
    coincide. Poles on the boundary of stability and unstable poles are kept. Integrators (in
    sampled systems poles at z = 1 and z = -1) are exact in the result, even if rounding has moved
    them in K, for example when ``control.ss`` converted a transfer function.

    Parameters
    ----------
    controller
        StateSpace or TransferFunction, stable or not, continuous or sampled.
    order
        Largest number of states; None if an error is given instead.
    method
        ``"weighted"``: balanced truncation by Gramians of the closed loop. ``"balanced"``,
        ``"matchdc"`` and ``"hankel"``: balanced truncation, balanced singular perturbation, which
        keeps the response at zero frequency, and optimal Hankel-norm approximation. These three
        reduce the stable part of K only and keep the other poles (see
        `workbench.synthesis.reduction.truncation`).
    plant
        Plant of the loop u = K y; only for ``"weighted"``.
    error
        Largest allowed gain of the weighted difference. The result has the least order for which
        this is proven.
    output_weight, input_weight
        Stable weights W_o and W_i of the difference W_o (K - K_r) W_i, for "balanced" and
        "matchdc". A weight with one signal is used for each signal.

    Raises
    ------
    InputError
        Neither an order nor an error is given, or both; the order is below 0, above that of K, or
        below the number of poles that the method keeps; a weight is not stable, has another
        sampling time or belongs to another method; the method is "weighted" and there is no plant,
        or plant or K is sampled, or K does not stabilise the plant; or poles of K are 0 up to
        rounding, and it cannot be decided from its matrices whether they are integrators.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import approximate
    >>> K = control.ss([[-1.0, 0.0], [0.0, -1e4]], [[1.0], [1.0]], [[1.0, 1.0]], [[0.0]])
    >>> approximate(K, 1, method="balanced").poles().real.round(2).tolist()
    [-1.0]
    >>> small = approximate(K, None, method="balanced", error=1e-3)
    >>> small.nstates, bool(small.error <= 1e-3)
    (1, True)

    References
    ----------
    D. Enns, Model reduction with balanced realizations, CDC 1984, for a weight; G. Wang, V.
    Sreeram, W. Liu, IEEE Trans. Automatic Control 44 (1999) 1734-1737, for weights on both sides.
    """
    controller = as_system(controller, "controller")
    weights = _weights(controller, method, output_weight, input_weight)
    checker = DifferenceChecker(controller, *weights)
    least, of = reducer(controller, method, plant, None, weights)
    if (order is None) == (error is None):
        raise InputError(f"order is {order} and error is {error}; give one of them")
    if order is not None:
        return ApproximatedSystem.of(of_order(controller, order, method, (least, of)), checker)
    assert error is not None
    need_positive(error, "error")
    for k in range(least, controller.nstates):
        small = ApproximatedSystem.of(of(k), checker)
        if _largest_sampled_difference(checker, small) <= error and small.error <= error:
            return small
    return ApproximatedSystem.of(controller, checker)


def _largest_sampled_difference(checker: DifferenceChecker, small: StateSpace) -> float:
    """The largest weighted gain of the difference at some frequencies, a lower bound on every
    proven error.
    """
    sizes = pole_sizes(checker.references[0].system)
    sizes = sizes[sizes > 0.0]
    if not sizes.size:
        return 0.0
    omega = np.geomspace(sizes.min() / 10.0, sizes.max() * 10.0, SCREENED)
    if small.dt:
        omega = omega[omega < np.pi / float(small.dt)]
    apart = response(checker.references[0].system, omega) - response(small, omega)
    if checker.output_weight is not None:
        apart = response(checker.output_weight, omega) @ apart
    if checker.input_weight is not None:
        apart = apart @ response(checker.input_weight, omega)
    return float(np.linalg.norm(apart, 2, axis=(-2, -1)).max(initial=0.0)) * (1.0 - 1e-6)


def _weights(
    K: StateSpace, method: str, leaving: Any, entering: Any
) -> tuple[StateSpace | None, StateSpace | None]:
    """Both weights as systems, checked; None for a weight that is not given."""
    found: list[StateSpace | None] = []
    for name, weight, size in (
        ("output_weight", leaving, K.noutputs),
        ("input_weight", entering, K.ninputs),
    ):
        if weight is None:
            found.append(None)
            continue
        if method not in ("balanced", "matchdc"):
            raise InputError(f'{name} belongs to the methods "balanced" and "matchdc"')
        system = as_weight(weight, size, name)
        if name == "input_weight" and system.noutputs != size:
            raise InputError(f"{name} has {system.noutputs} outputs; it must have {size}")
        if (system.nstates and bool(system.dt) != bool(K.dt)) or (
            system.nstates and system.dt and K.dt and float(system.dt) != float(K.dt)
        ):
            raise InputError(
                f"{name} has dt = {system.dt}, and controller has dt = {K.dt}; give one dt"
            )
        if not stability_check(system).holds:
            raise InputError(f"{name} is not stable; a weight of an error must be")
        parts = matrices_of(system)
        found.append(realisation(parts, float(K.dt or 0.0)))
    return found[0], found[1]


def approximations(
    controller: Any,
    order: int,
    *,
    method: ReductionMethod = "weighted",
    plant: GeneralisedPlant | None = None,
) -> Iterator[StateSpace]:
    """The approximation of `approximate`, then others of the order by way of higher orders.

    Where the direct one does not stabilise the loop, or misses a requirement, another one may meet
    it. The others start from an approximation with up to `DETOUR` states more, by any method.

    Arguments and errors are those of `approximate`.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import approximations
    >>> K = control.ss([[-1.0, 0.0], [0.0, -1e4]], [[1.0], [1.0]], [[1.0, 1.0]], [[0.0]])
    >>> next(approximations(K, 1, method="balanced")).nstates
    1
    """
    controller = as_system(controller, "controller")
    yield approximate(controller, order, method=method, plant=plant)

    @cache
    def by(first: ReductionMethod) -> Reducer:
        return reducer(controller, first, plant, None)

    for higher in range(order + 1, min(order + DETOUR, controller.nstates - 1) + 1):
        for first in get_args(ReductionMethod):
            try:
                between = of_order(controller, higher, first, by(first))
                yield approximate(between, order, method=method, plant=plant)
            except InputError:  # it does not stabilise the plant, or keeps too many poles
                continue


def reducer(
    K: StateSpace,
    method: str,
    plant: GeneralisedPlant | None,
    found: Conditions | None,
    weights: tuple[StateSpace | None, StateSpace | None] = (None, None),
) -> Reducer:
    """The least order that a method reaches, and a function: order -> system."""
    if method == "weighted":
        of_states = weighted_by_loop(K, plant, found)
        least = 0
    elif method in ("balanced", "matchdc", "hankel"):
        parts = kept_and_stable(matrices_of(K), bool(K.dt))
        leaving, entering = (None if one is None else _in_continuous_time(one) for one in weights)
        if method == "hankel":
            least, of_states = truncation.hankel(parts)
        else:
            by = truncation.matchdc if method == "matchdc" else truncation.balanced_truncation
            least, of_states = by(parts, Weights(leaving, entering))
    else:
        raise InputError(f"method is {method!r}; it must be one of {get_args(ReductionMethod)}")
    labels = {"inputs": K.input_labels, "outputs": K.output_labels}

    def of(order: int) -> StateSpace:
        return realisation(of_states(order), K.dt, **labels)

    return least, of


def _in_continuous_time(system: StateSpace) -> Matrices:
    """Its states, of a sampled system by the bilinear transformation, which keeps norms."""
    parts = matrices_of(system)
    return to_continuous(parts) if system.dt else parts


def weighted_by_loop(
    K: StateSpace, plant: GeneralisedPlant | None, found: Conditions | None
) -> truncation.Reducer:
    """The method "weighted"; ``found`` are the conditions of the loop where they are known."""
    need_continuous(K)
    if plant is None:
        raise InputError(
            'the method "weighted" weighs with the closed loop; give the plant, or ask '
            '"balanced", "matchdc" or "hankel"'
        )
    peak = deciding_peak(found) if found is not None else _only_peak(plant, K)
    loop = plant.close(K)
    if peak is None:
        poles = loop.poles()
        pole = complex(poles[np.argmax(poles.real)])
        raise InputError(
            f"the loop with the given controller is unstable, its rightmost pole {pole:.6g}; "
            '"weighted" needs a controller that stabilises the plant'
        )
    return truncation.weighted(matrices_of(K), plant, matrices_of(loop), peak)


def _only_peak(plant: GeneralisedPlant, K: StateSpace) -> Peak | None:
    """The same peak, without what else `conditions` certifies; None where the loop is unstable."""
    need_plant(plant)
    if plant.performance and plant.exogenous:
        return performance_peak(plant, K)
    return conditions(plant, K).robust_stability


def need_continuous(K: StateSpace) -> None:
    """Raise InputError for a sampled controller."""
    if K.dt:
        raise InputError(
            f"controller is sampled (dt = {K.dt}), and the closed loop that weighs is continuous; "
            'reduce the continuous controller and discretise it then, or ask "balanced", "matchdc" '
            'or "hankel"'
        )


def of_order(K: StateSpace, order: int, method: str, reducer: Reducer) -> StateSpace:
    """The approximation of an order by a method.

    Raises InputError as `check_order`.
    """
    least, of = reducer
    check_order(order, least, K, method)
    return of(order)


def check_order(order: int, least: int, K: StateSpace, method: str) -> None:
    """Raise InputError unless the order lies between the least one and that of K."""
    need_whole(order, "order")
    if not least <= order <= K.nstates:
        kept = f" ({method!r} keeps the {least} poles that are not stable)" if least else ""
        raise InputError(
            f"order is {order}; it must lie between {least}{kept} and {K.nstates}, that of K"
        )
