"""Robust stability of an uncertain system: its margin, and a perturbation that destabilises it."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np

from workbench._core.arrays import RealArray
from workbench.certify.agreement import need_agreement
from workbench.certify.perturbed_loop import proven_at
from workbench.certify.singularity import said
from workbench.certify.stable_system import angular_frequency
from workbench.errors import InputError
from workbench.executor import Context
from workbench.executor.live import shown_live
from workbench.input_checks import need_count, need_positive, need_tolerance
from workbench.mu.boxes.margin import (
    LARGEST_MARGIN,
    REPROOF_PARTS,
    Growing,
    box_margin,
    proven_stable,
)
from workbench.mu.boxes.recentred import RealParameters
from workbench.mu.frequency.attained import Attained, destabilised
from workbench.mu.frequency.channels import analysed, even_channels, in_loops
from workbench.mu.frequency.peak import peak
from workbench.mu.frequency.peak_bounds import Peak
from workbench.mu.robust.delay_margins import delay_margins
from workbench.mu.robust.destabilising import destabilising_perturbation
from workbench.mu.robust.late_margin import late_margin
from workbench.mu.robust.margin_bounds import (
    PerformanceChecker,
    PerformanceMargin,
    StabilityChecker,
    StabilityMargin,
    UnlimitedChecker,
)
from workbench.mu.robust.regions import with_damping, with_decay
from workbench.mu.robust.values import values_of
from workbench.solvers import Options
from workbench.structure import Real
from workbench.systems.bilinear import bilinear_sampled
from workbench.uncertainty.algebra.dead_time import dead_times, need_no_dead_time
from workbench.uncertainty.algebra.system import UncertainSystem, uncertain

PARTS = 4000
"""Largest number of parts of the box of real parameters that are examined. It limits the time. With
half of them a margin may keep a wider gap; double takes twice as long where the gap stays.
"""
EXCLUDED = "every part of the box of parameters is proven to be stable"
"""What lower margins of systems with real parameters rest on."""
BISECTIONS = 40
"""Largest number of sizes of uncertainty tried for a margin of performance: 20 doublings reach
`LARGEST_MARGIN`, and 13 bisections leave 1e-4. With half of them bounds may stay apart; more are
hardly made.
"""


def robust_stability(
    system: Any,
    *,
    tolerance: float = 1e-4,
    decay: float = 0.0,
    damping: float = 0.0,
    parts: int = PARTS,
    time_limit: float | None = None,
) -> StabilityMargin:
    """Certified margin of robust stability of an uncertain system, such as a closed loop.

    If all elements are real, mu is not continuous in frequency. The method is different then:
    corners, faces and single parameters are searched for a small unstable member; then the box of
    parameters is cut into parts and frequency into bands until all are excluded, so that the bounds
    meet. A terminal or a notebook shows the bounds as they tighten, and they hold whenever the
    search ends.

    Known dead time is treated exactly: the lower bound is proven with exp(-s T) at every frequency,
    by a rational set that contains it (`workbench.mu.robust.late_margin`), and the upper bound is
    that of the response with exp(-j omega T) itself.

    Parameters
    ----------
    system
        An `UncertainSystem`, stable at its nominal; or an object that stands for one.
    tolerance
        As in `peak`; if all elements are real, relative distance of the bounds.
    decay
        A rate [1/s]: poles must lie left of -decay (sampled: within the radius exp(-decay T)), so
        that all transients decay at least as fast. Not for systems with uncertain dynamics, whose
        gain is known on the axis only.
    damping
        A damping ratio below 1 that all poles must have at least, in continuous time. Not for
        systems with uncertain dynamics either.
    parts
        If all elements are real, largest number of parts of their box that are examined.
    time_limit
        If all elements are real, time [s] after which the bounds so far are returned.

    Raises
    ------
    InputError
        The system has no uncertain element, or is unstable at its nominal, or has a nominal pole
        outside the region of ``decay`` and ``damping``, or has known dead time, with which there is
        no such region.
    """
    need_count("parts", parts)
    need_tolerance(tolerance)
    if dead_times((late := uncertain(system, "system")).elements):
        if decay or damping:
            raise InputError(
                "decay and damping move the axis, and dead time has size 1 on the axis only: "
                "give `dead_time_approximation(system)`"
            )
        return late_margin(late, tolerance)
    given = analysed(system)
    whole, given = given, in_loops(given)
    idle = tuple(name for name in whole.elements if name not in given.elements)
    if not given.elements:
        unlimited = StabilityMargin(
            math.inf,
            math.inf,
            math.nan,
            None,
            None,
            parts=0,
            dt=whole.dt or 0.0,
            idle_elements=idle,
        )
        again = partial(robust_stability, whole)
        return unlimited.with_checker(
            UnlimitedChecker(again, "for whatever the elements are", whole)
        )
    if not (idle or all(isinstance(block, Real) for block in given.structure)):
        given = whole
    asked = [with_decay(given, decay)] if decay or not damping else []
    if damping:
        asked.append(with_damping(given, damping))
    with shown_live("robust stability") as (progress, watch):
        context = Context(options=Options(time_limit=time_limit), progress=progress, watch=watch)
        margins = [_margin(one, tolerance, parts, context) for one in asked]
    first = min(margins, key=lambda one: one.upper)
    found = replace(
        first,
        lower=min(one.lower for one in margins),
        parts=sum(one.parts for one in margins),
        dt=given.dt or 0.0,
        idle_elements=idle,
        delays=delay_margins(given, tolerance),
    )
    if all(isinstance(block, Real) for block in given.structure):
        again = partial(_proven_again, tuple(asked), found)
    else:
        again = partial(robust_stability, given, tolerance=tolerance, decay=decay, damping=damping)
    return found.with_checker(StabilityChecker(tuple(asked), again))


def _margin(
    found: UncertainSystem, tolerance: float, parts: int, context: Context
) -> StabilityMargin:
    """The margin of a system whose poles must lie left of the axis, or in the circle."""
    structure = found.structure
    if all(isinstance(block, Real) for block in structure):
        return _margin_of_parameters(found, tolerance, parts, context)
    N, period = even_channels(found.system, structure)
    bounds = peak(N, structure, tolerance=tolerance)
    lower = 1 / bounds.upper if bounds.upper > 0 else math.inf
    omega = angular_frequency(bounds.omega, period)
    if not bounds.lower > 0:
        return StabilityMargin(lower, math.inf, omega, None, bounds)
    Delta = destabilising_perturbation(bounds, N, structure)
    worst = values_of(
        found.elements.values(),
        found.structure,
        bilinear_sampled(Delta, period) if period else Delta,
    )
    return StabilityMargin(lower, 1 / bounds.lower, omega, worst, bounds)


def _parameters(found: UncertainSystem) -> tuple[RealParameters, float]:
    """A system whose elements are all real, in continuous time, and its period [s]."""
    stable, period = even_channels(found.system, found.structure)
    return RealParameters(stable, found.structure), period


def _margin_of_parameters(
    found: UncertainSystem, tolerance: float, parts: int, context: Context
) -> StabilityMargin:
    """As `_margin`, if all elements are real."""
    import control

    given, period = _parameters(found)
    box = box_margin(given, Growing(len(given.places)), tolerance, parts, context=context)
    best = None if box.values is None else _singular(given, given.perturbation(box.values))
    if best is None:
        return StabilityMargin(box.lower, math.inf, math.nan, None, None, parts=box.parts)
    need_agreement(best.value, 1 / box.lower if box.lower > 0 else math.inf, upper_claim=EXCLUDED)
    worst = values_of(
        found.elements.values(), found.structure, control.ss([], [], [], best.Delta.real)
    )
    omega = angular_frequency(best.omega, period)
    return StabilityMargin(box.lower, 1 / best.value, omega, worst, None, parts=box.parts)


def _singular(given: RealParameters, Delta: RealArray) -> Attained | None:
    """The multiple of a real Delta that is proven to make the loop singular; None: not proven."""
    best = destabilised(given.system, given.structure, Delta)
    if not best.value > 0:  # the loop may be singular at infinity, where no pole crosses the axis
        singular = said(proven_at(given.system, given.structure, Delta + 0j, math.inf))
        best = Attained(singular, math.inf, Delta)
    return best if best.value > 0 else None


def _proven_again(asked: tuple[UncertainSystem, ...], found: StabilityMargin) -> StabilityMargin:
    """Bounds for real parameters alone, proven again from the numbers found; the search is not
    repeated.
    """
    lower, upper = found.lower, math.inf
    for one in asked:
        given, _ = _parameters(one)
        boxes = Growing(len(given.places))
        if lower and not proven_stable(given, boxes, lower, REPROOF_PARTS * (found.parts + 1)):
            lower = 0.0
        if found.worst is not None:
            values = np.array([e.delta(found.worst[e.name]) for e in one.elements.values()])
            best = _singular(given, given.perturbation(values))
            upper = upper if best is None else min(upper, 1 / best.value)
    return replace(found, lower=lower, upper=upper)


def robust_performance(
    system: Any, *, gain: float = 1.0, tolerance: float = 1e-3
) -> PerformanceMargin:
    """Certified factor by which all uncertainty may grow before the largest gain exceeds a level.

    The gain is the largest singular value over all frequencies. Multiply the perturbation by t and
    divide the outputs by the level: the gain stays below the level for every perturbation of size
    up to t if and only if mu of this system is below 1. t is found by bisection.

    Parameters
    ----------
    system
        An `UncertainSystem`, stable at its nominal; or an object that stands for one.
    gain
        The level.
    tolerance
        Relative distance between the bounds, where the bounds of mu come as near to each other.

    Raises
    ------
    InputError
        As `robust_stability`; the level is not positive, or the system has known dead time: the
        message then names the call that bounds its margin.

    Examples
    --------
    >>> import control
    >>> from workbench.mu import robust_performance
    >>> from workbench.uncertainty import feedback, real, tf
    >>> k = real("k", 10, percent=40)
    >>> closed = feedback(tf([18], [1, 1.8, k]) * control.tf([0.4, 1.0], [0.02, 1.0]), 1)
    >>> margin = robust_performance(closed, gain=3.0)
    >>> bool(margin.lower <= margin.upper)
    True
    """
    need_positive(gain, "gain")
    need_tolerance(tolerance)
    elements = uncertain(system, "system").elements
    need_no_dead_time(elements, "robust_performance", "a lower bound of 1 or more")
    found = analysed(system)
    structure, given = found.structure, found.system
    closed = structure.with_performance(found.noutputs, found.ninputs)
    whole, period = even_channels(given, closed)
    outputs, inputs = (np.arange(count) for count in whole.D.shape)

    def bounded(t: float) -> Peak:
        scale = np.ones(outputs.size)
        scale[: structure.columns], scale[structure.columns :] = t, 1 / gain
        return peak(whole.channels(outputs, inputs, scale), closed, tolerance=tolerance / 4)

    low, high = 0.0, math.inf
    proven: dict[float, Peak] = {}

    def at(t: float) -> Peak:
        if t not in proven:
            proven[t] = bounded(t)
        return proven[t]

    def margin(lower: float, upper: float, omega: float) -> PerformanceMargin:
        found = PerformanceMargin(lower, upper, angular_frequency(omega, period), gain)
        checker = PerformanceChecker((lower, upper), proven.get(lower), proven.get(upper))
        return found.with_checker(checker)

    if (nominal := at(0.0)).upper >= 1.0:
        return margin(0.0, 0.0 if nominal.lower >= 1 else math.inf, nominal.omega)
    t = 1.0
    for _ in range(BISECTIONS):
        if at(t).upper < 1.0:
            low = t
        elif at(t).lower >= 1.0:
            high = t
        else:  # 1 lies between the bounds of mu: the ends of the range that they leave undecided
            low = _end(low, t, lambda t: at(t).upper < 1.0, tolerance / 2)
            high = _end(high, t, lambda t: at(t).lower >= 1.0, tolerance / 2)
            break
        if high <= low * (1 + tolerance) or low > LARGEST_MARGIN or high < 1 / LARGEST_MARGIN:
            break
        if math.isinf(high):
            t = 2.0 * low
        elif low == 0.0:
            t = high / 2.0
        else:
            t = math.sqrt(low * high)
    return margin(low, high, proven[high].omega if high in proven else math.nan)


def _end(
    decided: float, undecided: float, holds: Callable[[float], bool], tolerance: float
) -> float:
    """The factor nearest to ``undecided`` for which ``holds`` is found, from one (0 or inf: none).

    By bisection, up to a relative distance.
    """
    for _ in range(BISECTIONS):
        if decided == 0.0:
            middle = undecided / 2.0
        elif math.isinf(decided):
            middle = undecided * 2.0
        else:
            middle = math.sqrt(decided * undecided)
        near = max(middle / undecided, undecided / middle) <= 1.0 + tolerance / 2
        if near or not 1 / LARGEST_MARGIN <= middle <= LARGEST_MARGIN:
            break
        if holds(middle):
            decided = middle
        else:
            undecided = middle
    return decided
