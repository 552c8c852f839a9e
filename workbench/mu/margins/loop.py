"""All margins of a loop in one call: each channel by itself, all at once, over a set of plants."""

from __future__ import annotations

import math
from typing import Any

from workbench.errors import InputError
from workbench.input_checks import is_real, need_count, need_positive, need_tolerance
from workbench.mu.margins.closed_loop import ClosedLoop
from workbench.mu.margins.result import LoopChecker, LoopMargins


def loop_margins(
    plant: Any,
    controller: Any = 1.0,
    *,
    skew: float = 0.0,
    tolerance: float = 1e-4,
    parts: int | None = None,
    time_limit: float | None = None,
) -> LoopMargins:
    """Gain, phase, delay, modulus and disk margins of a loop, proven between grid points.

    The crossings of the nominal loop are computed at once. Disks, and the margins that every plant
    of an uncertain set keeps, are computed when they are asked for.

    Known dead time is treated exactly, anywhere in the loop. Two results use
    `dead_time_approximation`, a
    rational set that contains it, and lose what this approximation loses: proofs for a set of
    plants, and lower bounds of disks of several channels at once. For measured responses, the
    margins are those of the data, at their frequencies only, with ranges from variances.

    Parameters
    ----------
    plant
        A system, or an uncertain one, with any number of channels, in continuous or sampled time.
        Or a measured response of one channel: python-control's FrequencyResponseData, a
        `ResponseEstimate` with its variances, or `Responses` of several plants, each of which gets
        its own margins.
    controller
        K of u = -K y; for a loop L alone, 1.
    skew
        0: gain may rise and fall by the same factor; positive: more room to rise, negative: to
        fall. 1 is the disk of the sensitivity, -1 that of the complementary sensitivity.
    tolerance
        Relative distance between the bounds of a disk margin. For `every_plant` it is 0.01, or this
        value if larger.
    parts
        Largest number of parts of the box of real parameters that are examined for each margin of a
        set. None: 4,000, or 120 if the set has uncertain dynamics too, since the bounds then keep a
        gap that no number of parts closes.
    time_limit
        Time [s] after which `every_plant` returns its bounds so far.

    Raises
    ------
    InputError
        Plant and controller do not fit each other, or the loop is singular; its sampling time is
        not given; or gains that return with known dead time add up to 1 or more at infinity. If the
        nominal closed loop is unstable, its disks raise the error when they are asked for.

    Examples
    --------
    >>> import control
    >>> from workbench.mu import loop_margins
    >>> from workbench.uncertainty import delay, tf
    >>> found = loop_margins(tf([1], [1, 0]) * delay("tau", 1.0, 1.0))
    >>> round(found.delay, 6)  # pi / 2 - 1 s
    0.570796
    >>> found = loop_margins(control.tf([4], [1, 3, 3, 1]))
    >>> found.stable, round(found.gain[1], 6), round(found.phase_deg, 3)
    (True, 2.0, 27.142)
    """
    need_tolerance(tolerance)
    if parts is not None:
        need_count("parts", parts)
    need_positive(time_limit, "time_limit", or_none=True)
    if not is_real(skew) or not math.isfinite(skew):
        raise InputError(f"skew is {skew!r}; a number is needed")
    if hasattr(plant, "omega") and (found := _of_data(plant, controller)) is not None:
        return found
    asked = ClosedLoop(plant, controller, float(skew), tolerance, parts, time_limit)
    classical = asked.classical()
    stable = all(one.stable for one in classical.values())
    return LoopMargins(classical, stable, asked).with_checker(LoopChecker())


def _of_data(plant: Any, controller: Any) -> LoopMargins | None:
    """The margins of measured responses; None if nothing is measured."""
    from workbench.mu.margins.measured import is_measured, loops_of, measured_margins

    if not is_measured(plant):
        return None
    data, dt = loops_of(plant, controller)
    measured = {name: measured_margins(one, dt) for name, one in data.items()}
    return LoopMargins(measured, None, None).with_checker(LoopChecker())
