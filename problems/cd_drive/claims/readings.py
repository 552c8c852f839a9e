"""Ways to read a number of the ledger: quotients of metrics, both axes, the printed procedures."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

import numpy as np

from workbench import Run
from workbench.arrays import RealArray
from workbench.geometry import narrowest_stadium
from workbench.geometry.thesis import thesis_circle, thesis_stadium

from ..drive.plants import AMPLIFICATION, ATTENUATION
from ..drive.tables import AXES, Axis, nominal_table
from .items import Number, Value, at_most, near

METHODS, CONTROLLERS = "cd/focus/methods", "cd/focus/controllers"
DRIVES, PARAMETRIC = "cd/drives", "cd/{}/parametric"
WIDER = 1e-6
"""Relative excess of a radius that is more than rounding."""


def quotient(above: str, below: str) -> Value:
    """A metric over another one of the run."""
    return lambda run: run.metrics[above] / run.metrics[below]


class Limited(Protocol):
    """`at_most` or `at_least`."""

    def __call__(self, what: str, run: str, value: Value, limit: float, /) -> Number: ...


def both(limited: Limited, what: str, run: str, value: Value, limit: float) -> tuple[Number, ...]:
    """A number of the focus loop and the same of the radial loop; `run` holds {} for the axis."""
    return tuple(limited(f"{what}, {axis}", run.format(axis), value, limit) for axis in AXES)


def cover_size(quantity: str, end: Callable[[RealArray], float], over: str = "") -> Value:
    """A size of the covers by steps, over another one, at its `end` over the frequencies."""

    def found(run: Run) -> float:
        steps = run.data.sel(by="steps")
        sizes = {
            "": np.array(1.0),
            "radius": steps["radius"].values,
            "parametric": run.data["parametric"].sel(set="reduced").values,
        }
        names = run.data["quantity"].values.tolist()
        sizes |= {name: steps["size"].sel(quantity=name).values for name in names}
        return float(end(sizes[quantity] / sizes[over]))

    return found


# --- the procedures of chapter 5, as printed ------------------------------------------------------


def circle_excess(run: Run) -> float:
    """Largest relative excess of a circle by section 5.3.1 over the smallest one."""
    _, radius = thesis_circle(run.data["points"].values)
    return _excess(radius, run.data["radius"].values)


def stadium_excess(run: Run) -> float:
    """Largest relative excess of a stadium's width by section 5.4.1 over the least one."""
    _, radius, _, _ = thesis_stadium(run.data["points"].values)
    return _excess(radius, run.data["radius"].values)


def reach_over_narrowest(end: Callable[[RealArray], float]) -> Value:
    """Radius plus half-length of stadiums over that of the narrowest ones of the same points.

    It is the radius of the circle that D-K iteration takes a stadium for.
    """

    def over(run: Run) -> float:
        narrowest = narrowest_stadium(run.data["points"].values)
        reach = run.data["radius"].values + run.data["half_length"].values
        return float(end(reach / (narrowest.radius + narrowest.half_length)))

    return over


def second_sets_missed(run: Run) -> float:
    """Frequencies at which section 5.4.2 finds no stadium, or one wider than need be.

    About the nominal of Table 5.2, on the open loop: what it is multiplied by changes no ratio.
    """
    narrowest = run.data.sel(kind="Table 5.2", shape="stadium")
    points = run.data["L"].transpose("frequency", "drive").values
    _, radius, _, _ = thesis_stadium(points, narrowest["center"].values)
    wider = radius > narrowest["radius"].values * (1 + WIDER)
    return float((wider | np.isnan(radius)).sum())


def _excess(radius: RealArray, least: RealArray) -> float:
    """Largest relative excess; below 1e-10 it is rounding, which differs between processors."""
    return round(float((radius / least - 1).max()), 10)


def largest_turn(step: str) -> Value:
    """Largest turn [deg] of the stadiums between neighbouring frequencies."""

    def turn(run: Run) -> float:
        one = run.data.sel(kind=step, shape="stadium")
        angle = one["angle"].values - np.angle(one["center"].values)
        between = (np.diff(angle) + np.pi / 2) % np.pi - np.pi / 2
        return float(np.degrees(abs(between).max()))

    return turn


# --- Table 5.2 from Tables A.1 to A.3 -------------------------------------------------------------


def total_gain(axis: Axis, high: float, printed: float) -> Number:
    """K_total by the factors of equation 3.18 and the middle optical gain of Table A.3."""

    def gain(run: Run) -> float:
        return ATTENUATION * AMPLIFICATION * _range(run, axis, "K_optn")[0]

    return at_most(f"gain by equation 3.18 [units/V], {axis}", DRIVES, gain, high, printed)


def convention(axis: Axis, printed: float) -> Number:
    """5 % of the middle b [N s/m]."""

    def share(run: Run) -> float:
        return 0.05 * _range(run, axis, "b")[0]

    return near(f"5 % of b [N s/m], {axis}", DRIVES, share, printed, 0.01)


def masses_apart(run: Run) -> float:
    """Difference of the nominal m1 of focus and of radial loops [kg]."""
    focus, radial = (_range(run, axis, "m1")[0] for axis in AXES)
    return abs(focus - radial)


def reduced_tolerance(axis: Axis, factor: float, printed: float) -> Number:
    """Tolerance of R in Table 5.3, by that of Table 5.2."""

    def tolerance(run: Run) -> float:
        return factor * float(run.data["tolerance"].sel(model="nine", parameter="R"))

    what = f"tolerance of R times {factor:g}, {axis}"
    return near(what, PARAMETRIC.format(axis), tolerance, printed, 0.01)


def combinations(levels: int, printed: float, within: float) -> Number:
    """Number of plants with each parameter at one of some levels."""
    return near(
        f"plants at {levels} levels",
        PARAMETRIC.format("focus"),
        lambda run: float(levels) ** run.data.sizes["parameter"],
        printed,
        within,
    )


def half_range(axis: Axis, parameter: str) -> Value:
    """Half of the range of twelve drives, over its middle."""
    return lambda run: _range(run, axis, parameter)[1]


def nominals_off(axis: Axis, names: Sequence[str]) -> Value:
    """Largest relative difference of a nominal value of Table 5.2 from the midrange."""
    table = nominal_table(axis)
    return lambda run: max(
        abs(_range(run, axis, name)[0] / table[name].nominal - 1) for name in names
    )


def tolerances_off(axis: Axis, names: Sequence[str]) -> Value:
    """Largest difference of a tolerance of Table 5.2 from the half-range."""
    table = nominal_table(axis)
    return lambda run: max(
        abs(_range(run, axis, name)[1] - table[name].tolerance) for name in names
    )


def _range(run: Run, axis: Axis, parameter: str) -> tuple[float, float]:
    every = run.data["parameters"].sel(axis=axis, parameter=parameter)
    low, high = float(every.min()), float(every.max())
    return (high + low) / 2, (high - low) / (high + low)
