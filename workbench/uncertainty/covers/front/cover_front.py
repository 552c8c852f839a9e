"""Covers of several orders, and what each costs: `cover_front`."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Any, Literal

import numpy as np

from workbench.errors import InputError, SolverError
from workbench.fitting.samples import as_count
from workbench.input_checks import need_choice
from workbench.solution import solve
from workbench.solvers import Options
from workbench.uncertainty.covers.circle_cover import CircleCover
from workbench.uncertainty.covers.cover import UncertaintyCover
from workbench.uncertainty.covers.front.checks import CoverFrontChecker
from workbench.uncertainty.covers.front.points import CoverFront, FrontCover, Loop, Orders
from workbench.uncertainty.covers.limits.least_inflation import least_inflation
from workbench.uncertainty.covers.sets import CoverForm
from workbench.uncertainty.covers.stadium_cover import StadiumCover
from workbench.uncertainty.responses.plants import Responses

METHODS = ("inflation", "joint")
"""Methods whose covers are compared at each of the orders."""


def cover_front(
    responses: Responses,
    *,
    orders: Iterable[int | Sequence[int]] = (2, 4, 6, 8),
    loop: Loop | None = None,
    shape: Literal["circle", "stadium"] = "stadium",
    form: CoverForm = "multiplicative",
    options: Options | None = None,
) -> CoverFront:
    """Covers of several orders, and how large their sets are, or what they cost a loop in mu.

    For each of the orders, covers are made by the methods "inflation" and "joint", and the cheapest
    one is kept. A cheaper cover of smaller orders is kept instead, since it is a cover of these
    orders too. So the cost never rises with the orders. The front consists of those covers that no
    other cover beats in states and cost.
    `least_inflation` says how small the sets can be with a nominal of the order, so that a reader
    sees what the order costs.

    Parameters
    ----------
    responses
        Responses of the plants.
    orders
        Orders of nominal, W_c and W_r: three numbers, or one for all. With circles the last one is
        not used.
    loop
        Function of an `UncertaintyModel` that returns an upper bound on mu of a loop, such as
        ``lambda model: performance_peak(plant_of(model), controller).upper``. If it is given, mu is
        the cost that the front compares; otherwise it is the largest ratio of the sets to the
        narrowest ones. An unstable loop has the value ``inf``.
    shape, form
        Shape of the sets, and form of the model.
    options
        Seed and limit of time of each search.

    Raises
    ------
    InputError
        The orders are none, or no whole numbers, or too many for the frequencies; or the loop
        raises an error, or returns no number of 0 or more.
    SolverError
        There is no cover of any of the orders.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.uncertainty import Responses, cover_front
    >>> omega = np.geomspace(1, 100, 20)
    >>> values = np.array([gain / (1j * omega / 30 + 1) for gain in (0.9, 1.0, 1.1)]).T
    >>> front = cover_front(Responses(omega=omega, values=values), orders=[1], shape="circle")
    >>> front.chosen.orders, front.holds
    ((1, 1, 0), True)
    """
    need_choice(shape, Literal["circle", "stadium"], "shape")
    if not isinstance(responses, Responses):
        raise InputError(
            f"responses must be Responses, not {type(responses).__name__}; Responses.from_frd and "
            "Responses.from_files make them"
        )
    if loop is not None and not callable(loop):
        raise InputError(f"loop must be a function of a model, not {loop!r}")
    programs = {each: _program(responses, each, shape, form) for each in _orders(orders, shape)}
    points: list[FrontCover] = []
    failures = {}
    for each in sorted(programs, key=sum):
        program, found, said = programs[each], [], ""
        for method in METHODS:
            solution = solve(program, method=method, options=options)
            if solution.certificate is not None and solution.certificate.valid:
                found.append(FrontCover.of_cover(program, each, method, solution.answer, loop))
            else:
                said = solution.message
        if found:
            found += [
                replace(p, orders=each) for p in points if np.less_equal(p.orders, each).all()
            ]
            points.append(min(found, key=lambda point: point.cost))
        else:
            failures[each] = said or "no certificate is valid"
    if not points:
        raise SolverError(f"no cover of any of the orders: {failures}")
    points.sort(key=lambda point: (point.states, point.cost))
    checker = CoverFrontChecker(programs, loop)
    nominals = {point.orders[0]: programs[point.orders] for point in points}
    least = {order: least_inflation(each, options=options) for order, each in nominals.items()}
    return CoverFront(tuple(points), failures=failures, least=least).with_checker(checker)


def _orders(given: Any, shape: str) -> list[Orders]:
    """Orders of nominal, W_c and W_r, each once."""
    try:
        listed = list(given)
    except TypeError:
        raise InputError(f"orders must be a list, it is {given!r}") from None
    if not listed:
        raise InputError("orders is empty; give one or more")
    found: dict[Orders, None] = {}
    for each in listed:
        three = list(each) if isinstance(each, Sequence | np.ndarray) else [each] * 3
        if isinstance(each, str) or len(three) != 3:
            raise InputError(f"orders has {each!r}; one number is needed, or three for G, W_c, W_r")
        nominal, circle, real = (as_count("orders", order) for order in three)
        found[nominal, circle, real if shape == "stadium" else 0] = None
    return list(found)


def _program(responses: Responses, orders: Orders, shape: str, form: CoverForm) -> UncertaintyCover:
    nominal, circle, real = orders
    if shape == "stadium":
        return StadiumCover(responses, nominal, complex_order=circle, real_order=real, form=form)
    return CircleCover(responses, nominal, complex_order=circle, form=form)
