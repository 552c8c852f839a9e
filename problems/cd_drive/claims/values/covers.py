"""Sets that cover the drives, and controllers for them (chapter 5)."""

from __future__ import annotations

from typing import Literal

import numpy as np

from workbench import Run
from workbench.geometry import narrowest_stadium
from workbench.geometry.thesis import Medians, thesis_circle, thesis_stadium
from workbench.types import RealArray

from .registry import value

WIDER = 1e-6
"""Relative excess of a radius that is more than a rounding error."""


@value
def cover_size(
    run: Run, quantity: str, end: Literal["min", "median", "max"], over: str = ""
) -> float:
    """A size of the covers by steps, over another size; `end` says which value over the
    frequencies.
    """
    steps = run.data.sel(by="steps")
    sizes = {
        "": np.array(1.0),
        "radius": steps["radius"].values,
        "parametric": run.data["parametric"].sel(set="reduced").values,
    }
    names = run.data["quantity"].values.tolist()
    sizes |= {name: steps["size"].sel(quantity=name).values for name in names}
    return float(getattr(np, end)(sizes[quantity] / sizes[over]))


@value
def circle_excess(run: Run) -> float:
    """Largest relative excess of a circle by section 5.3.1 over the smallest one."""
    _, radius = thesis_circle(run.data["points"].values)
    return _excess(radius, run.data["radius"].values)


@value
def stadium_excess(run: Run) -> float:
    """Largest relative excess of a stadium's width by section 5.4.1 over the least one."""
    _, radius, _, _ = thesis_stadium(run.data["points"].values)
    return _excess(radius, run.data["radius"].values)


@value
def reach_over_narrowest(run: Run, end: Literal["min", "median", "max"]) -> float:
    """Radius plus half-length of stadiums over that of the narrowest ones of the same points.

    This is the radius of the circle by which D-K iteration replaces a stadium.
    """
    narrowest = narrowest_stadium(run.data["points"].values)
    reach = run.data["radius"].values + run.data["half_length"].values
    return float(getattr(np, end)(reach / (narrowest.radius + narrowest.half_length)))


@value
def second_sets_missed(run: Run, medians: Medians) -> float:
    """Number of frequencies at which section 5.4.2 finds no stadium, or a wider one than necessary.

    The stadiums are about the nominal of Table 5.2, on the open loop, whose factor changes no
    ratio.
    """
    narrowest = run.data.sel(kind="Table 5.2", shape="stadium")
    points = run.data["L"].transpose("frequency", "drive").values
    _, radius, _, _ = thesis_stadium(points, narrowest["center"].values, medians=medians)
    wider = radius > narrowest["radius"].values * (1 + WIDER)
    return float((wider | np.isnan(radius)).sum())


def _excess(radius: RealArray, least: RealArray) -> float:
    """Largest relative excess; below 1e-10 it is a rounding error, which differs between
    processors.
    """
    return round(float((radius / least - 1).max()), 10)


@value
def largest_turn(run: Run, step: str) -> float:
    """Largest turn [deg] of the stadiums between neighbouring frequencies."""
    one = run.data.sel(kind=step, shape="stadium")
    angle = one["angle"].values - np.angle(one["center"].values)
    between = (np.diff(angle) + np.pi / 2) % np.pi - np.pi / 2
    return float(np.degrees(abs(between).max()))


@value
def states_over(run: Run, model: str) -> float:
    """States of a controller by (D, G)-K iteration over those of one by (mu, D)-K iteration."""
    order = run.data["order"].sel(model=model)
    return float(order.sel(controller="(D, G)-K") / order.sel(controller="(mu, D)-K"))


@value
def mu_over_norm(run: Run) -> float:
    """Largest mu over the norm with a full block, of eight controllers."""
    peak = run.data["peak"]
    mu = peak.sel(condition="robust performance", bound="lower")
    return float((mu / peak.sel(condition="full block", bound="upper")).max())
