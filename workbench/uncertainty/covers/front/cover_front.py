"""Covers of several orders, and what each costs: `cover_front`."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import KW_ONLY, dataclass, field, replace
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike

from workbench import figures
from workbench._core.heavy_types import Figure
from workbench.answer import Answer
from workbench.certificate import Check, Checker
from workbench.errors import InputError, SolverError
from workbench.fitting.samples import as_count
from workbench.input_checks import need_choice
from workbench.solution import solve
from workbench.solvers import Options
from workbench.uncertainty.covers.circle_cover import CircleCover
from workbench.uncertainty.covers.cover import UncertaintyCover
from workbench.uncertainty.covers.model import UncertaintyModel
from workbench.uncertainty.covers.sets import CoverForm
from workbench.uncertainty.covers.stadium_cover import StadiumCover
from workbench.uncertainty.covers.steps import CoverSteps
from workbench.uncertainty.responses.plants import Responses

NEAR_BEST = 0.1
"""The chosen cover costs at most this much more than the best one, relative."""
METHODS = ("inflation", "joint")
"""Methods whose covers are compared at each of the orders."""
REPEATED = 1e-6
"""Rounding error by which a told cost may be below the recomputed one, relative."""

Orders = tuple[int, int, int]
"""Orders of the nominal, of W_c and of W_r; the last one is 0 for circles."""
Loop = Callable[[UncertaintyModel], float]
"""Function of a model that returns a bound on mu of a loop, infinite for an unstable one."""


@dataclass(frozen=True)
class FrontCover:
    """One certified cover of a front.

    ``inflation`` and ``rms`` compare its sets with the narrowest ones about its nominal,
    ``inflation_free`` and ``rms_free`` with those whose centres are free: the largest radius plus
    half-length, and the root mean square of the radius. ``mu`` is that of the loop, NaN without
    one. ``cost`` is what the front compares.
    """

    orders: Orders
    method: str
    cover: CoverSteps
    inflation: float
    inflation_free: float
    rms: float
    rms_free: float
    mu: float

    @property
    def states(self) -> int:
        """Sum of the orders, which is the number of states of the uncertain plant."""
        return sum(self.orders)

    @property
    def cost(self) -> float:
        """Mu of the loop or, without a loop, the largest ratio to the narrowest sets."""
        if np.isnan(self.mu):
            return max(self.inflation, self.inflation_free, self.rms_free)
        return self.mu


@dataclass(frozen=True, eq=False, repr=False)
class CoverFront(Answer):
    """Certified covers of several orders, and the one that is chosen.

    ``points`` are by increasing number of states. ``failures`` are the reasons why there is no
    cover, by orders.

    Examples
    --------
    See `cover_front`.
    """

    points: tuple[FrontCover, ...]
    _: KW_ONLY
    failures: dict[Orders, str] = field(default_factory=dict, kw_only=True)

    @property
    def front(self) -> tuple[FrontCover, ...]:
        """The points of which none has as few states and costs less."""
        kept: list[FrontCover] = []
        for point in self.points:  # of equally many states the cheapest comes first
            if not kept or point.cost < kept[-1].cost:
                kept.append(point)
        return tuple(kept)

    @property
    def dominated(self) -> tuple[FrontCover, ...]:
        """The other points."""
        front = self.front
        return tuple(point for point in self.points if all(point is not one for one in front))

    @property
    def chosen(self) -> FrontCover:
        """The point with the fewest states whose cost is within 10 % of the least one."""
        points = self.points
        return points[least_states([p.states for p in points], [p.cost for p in points])]

    @property
    def value(self) -> float:
        """Cost of the chosen point."""
        return self.chosen.cost

    def said(self) -> str:
        heads = "states  orders (G, W_c, W_r)  inflation  free   rms    rms free  mu"
        front = self.front
        rows = [
            f"{p.states:6d}  {p.orders!s:21s} {p.inflation:9.3f}  {p.inflation_free:5.3f}  "
            f"{p.rms:5.3f}  {p.rms_free:5.3f}     {'-' if np.isnan(p.mu) else f'{p.mu:.3f}'}"
            + (" *" if p is self.chosen else "" if p in front else "  (dominated)")
            for p in self.points
        ]
        missing = [f"  {orders}: {why}" for orders, why in self.failures.items()]
        return "\n".join(["CoverFront (* chosen)", heads, *rows, *missing])


@dataclass(frozen=True, eq=False)
class CoverFrontChecker(Checker):
    """Checks every cover of a front by the program of its orders, and the costs that are told."""

    programs: dict[Orders, UncertaintyCover]
    loop: Loop | None

    @property
    def quantifier(self) -> str:
        return "for every cover of the front"

    def checks(self, answer: CoverFront, tolerance: float) -> list[Check]:
        found = []
        for point in answer.points:
            program = self.programs[point.orders]
            found += _named(point, program.checks(point.cover, tolerance))
            again = _point(program, point.orders, point.method, point.cover, self.loop).cost
            statement = "recomputed cost over the told one, less 1"
            found += _named(point, [Check("cost", statement, again / point.cost - 1, REPEATED)])
        return found

    def second_opinion(self, answer: CoverFront) -> list[Check]:
        return [
            check
            for point in answer.points
            for check in _named(point, self.programs[point.orders].second_opinion(point.cover))
        ]

    def figures(self, answer: CoverFront) -> dict[str, Figure]:
        return {"front": front_figure(answer)}


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

    For each of the orders, covers are made by the methods "inflation" and "joint". The cheaper one
    is a point of the front.

    Parameters
    ----------
    responses
        Responses of the plants.
    orders
        Orders of nominal, W_c and W_r: three numbers, or one for all. With circles the last one is
        not used.
    loop
        Function of an `UncertaintyModel` that returns an upper bound on mu of a loop, as
        ``lambda model: performance_peak(plant_of(model), controller).upper``. If it is given, mu is
        the cost that the front compares; otherwise it is the largest ratio of the sets to the
        narrowest ones.
    shape, form
        Shape of the sets, and form of the model.
    options
        Seed and limit of time of each search.

    Raises
    ------
    InputError
        The orders are none, or no whole numbers, or too many for the frequencies.
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
        raise InputError(f"responses must be Responses, not {type(responses).__name__}")
    if loop is not None and not callable(loop):
        raise InputError(f"loop must be a function of a model, not {loop!r}")
    programs = {each: _program(responses, each, form) for each in _orders(orders, shape)}
    points, failures = [], {}
    for each, program in programs.items():
        found, said = [], ""
        for method in METHODS:
            solution = solve(program, method=method, options=options)
            if solution.certificate is not None and solution.certificate.valid:
                found.append(_point(program, each, method, solution.answer, loop))
            else:
                said = solution.message
        if found:
            points.append(min(found, key=lambda point: point.cost))
        else:
            failures[each] = said or "no certificate is valid"
    if not points:
        raise SolverError(f"no cover of any of the orders: {failures}")
    points.sort(key=lambda point: (point.states, point.cost))
    checker = CoverFrontChecker(programs, loop)
    return CoverFront(tuple(points), failures=failures).checked_by(checker)


def least_states(states: ArrayLike, cost: ArrayLike) -> int:
    """Index of the fewest states (N,) whose cost (N,) is within 10 % of the least cost."""
    states, cost = np.asarray(states), np.asarray(cost)
    near = cost <= cost.min() * (1 + NEAR_BEST)
    return int(np.lexsort((cost, np.where(near, states, np.inf)))[0])


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


def _program(responses: Responses, orders: Orders, form: CoverForm) -> UncertaintyCover:
    nominal, circle, real = orders
    if real:
        return StadiumCover(responses, nominal, complex_order=circle, real_order=real, form=form)
    return CircleCover(responses, nominal, complex_order=circle, form=form)


def _point(
    program: UncertaintyCover, orders: Orders, method: str, cover: CoverSteps, loop: Loop | None
) -> FrontCover:
    over = program.inflation(cover)
    return FrontCover(
        orders,
        method,
        cover,
        float(over.about.max()),
        float(over.free.max()),
        over.rms,
        over.rms_free,
        float("nan") if loop is None else float(loop(cover.model)),
    )


def _named(point: FrontCover, checks: Sequence[Check]) -> list[Check]:
    """Checks whose names begin with the orders of the point."""
    orders = ", ".join(map(str, point.orders))
    return [replace(check, name=f"{orders}: {check.name}") for check in checks]


def front_figure(answer: CoverFront) -> Figure:
    """Cost of the covers over their number of states."""
    figure, axes = figures.axes(1, 2, size=(9.0, 4.0))
    states = [point.states for point in answer.points]
    for name, label, colour in (
        ("inflation", "about the nominal", figures.BLUE),
        ("inflation_free", "free centres", figures.ORANGE),
    ):
        axes[0].plot(states, [getattr(p, name) for p in answer.points], "o", color=colour,
                     label=f"extent, {label}")  # fmt: skip
        name = name.replace("inflation", "rms")
        axes[0].plot(states, [getattr(p, name) for p in answer.points], "+", color=colour,
                     label=f"rms of the radius, {label}")  # fmt: skip
    figures.label(axes[0], x="states", y="size over that of the narrowest sets", log="y")
    front = answer.front
    axes[1].step([p.states for p in front], [p.cost for p in front], where="post",
                 color=figures.BLUE, label="front")  # fmt: skip
    axes[1].plot(states, [p.cost for p in answer.points], "o", color="0.6", label="covers")
    chosen = answer.chosen
    axes[1].plot(
        chosen.states, chosen.cost, "o", color=figures.ORANGE, label=f"chosen, {chosen.orders}"
    )
    cost = "largest ratio" if np.isnan(chosen.mu) else "mu of the loop"
    figures.label(axes[1], x="states", y=cost)
    axes[0].legend(fontsize=7)
    axes[1].legend(fontsize=7)
    return figure
