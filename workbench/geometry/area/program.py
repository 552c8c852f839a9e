"""The stadium of the smallest area around a point set.

A stadium of radius r and half-length l has the area pi r^2 + 4 r l. Circles are stadiums, and so is
the narrowest stadium, so the smallest area is at most that of either.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import ComplexArray
from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.executor import Context
from workbench.geometry.area.bound import least_area
from workbench.geometry.area.search import smallest_area
from workbench.geometry.circle import finite_answer
from workbench.geometry.each_set import UnitFrame, each_set
from workbench.geometry.enclosing_shape import relative
from workbench.geometry.enclosing_stadium import EnclosingStadium, Stadium
from workbench.geometry.exact_circle import exact_circle
from workbench.geometry.exact_stadium import exact_stadium
from workbench.geometry.hull import convex_hull
from workbench.program import Claim, method
from workbench.solvers import Options, Outcome

TIGHTNESS = 1e-10
"""Relative distance between the bound and the least area met by the proof of the bound."""


@dataclass(frozen=True, eq=False)
class SmallestAreaStadium(EnclosingStadium):
    """The stadium of the smallest area that contains every point of a set.

    Parameters
    ----------
    points
        Complex, shape (..., N).
    center
        Complex, broadcast against the sets; None: free.
    angle
        Direction of the segment [rad], modulo pi, broadcast against the sets; None: free.

    The problem is not convex, even at a given angle. The answer is certified by containment and by
    a lower bound on the area over all angles and radii, by branch and bound.

    Examples
    --------
    >>> import numpy as np
    >>> import workbench as wb
    >>> from workbench.geometry import SmallestAreaStadium
    >>> points = np.array([[0, 2, 4, 2 + 1j]])
    >>> wb.solve(SmallestAreaStadium(points)).certificate.valid
    True
    """

    default_method: ClassVar[str] = "search"
    methods_in: ClassVar[tuple[str, ...]] = (
        "workbench.geometry.area.evolution",
        "workbench.geometry.area.nonlinear",
    )
    headline: ClassVar[str] = "area_peak"

    def objective(self, answer: Stadium) -> float:
        """The sum of the areas of all sets."""
        with np.errstate(over="ignore"):
            return float(np.sum(answer.area))

    def objective_rounding(self, answer: Stadium) -> float:
        """Sum over the sets of the perimeter times twice the rounding of a radius."""
        with np.errstate(over="ignore"):
            perimeter = 2 * np.pi * answer.radius + 4 * answer.half_length
            return float(np.sum(2 * self.rounding * perimeter))

    def gap(self, answer: Stadium) -> tuple[str, float]:
        _, area, rounding, bound = self._bounded(answer)
        value = float(np.max(relative(area - bound - rounding, area), initial=0.0))
        return "area above its lower bound over all allowed angles and radii, relative", value

    def area_bound(self, answer: Stadium) -> np.ndarray:
        """Lower bound (...) on the area of every stadium with the given centre and angle.

        The answer's sizes only decide where the search for a bound may stop. If no centre is given,
        the answer's centre only serves as the origin of the computation.
        """
        scale, _, _, bound = self._bounded(answer)
        return np.asarray(bound * scale * scale).reshape(self.batch)

    def _bounded(self, answer: Stadium) -> tuple[np.ndarray, ...]:
        """Size of each set (B,); then, in units of it: area, allowed rounding, and lower bound.

        The unit keeps the areas of huge and of tiny sets among the numbers. The rounding is the
        perimeter times twice that of a radius.
        """
        about = np.asarray(answer.center) if self.center is None else self.center
        away = (self.points.astype(np.clongdouble) - about[..., None]).reshape(-1, self.size)
        scale = np.abs(away).max(axis=-1)
        scale = np.where(scale > 0, scale, 1.0)
        radius, length, rounding = (
            (np.asarray(each, dtype=np.longdouble).ravel() / scale).astype(float)
            for each in (answer.radius, answer.half_length, self.rounding)
        )
        with np.errstate(over="ignore", invalid="ignore"):  # an answer may hold any numbers
            area = np.pi * radius**2 + 4 * radius * length
            rounding = 2 * rounding * (2 * np.pi * radius + 4 * length)
            close = rounding / 4 + TIGHTNESS * area
        angle = None if self.angle is None else self.angle.ravel()
        unit = (away / scale[:, None]).astype(complex)
        bound = least_area(unit, self.center is not None, angle, area, close)
        return scale, area, rounding, bound

    def metrics(self, answer: Stadium) -> dict[str, float]:
        with np.errstate(over="ignore"):
            largest = float(np.max(answer.area, initial=0.0))
        return super().metrics(answer) | {"area_peak": largest}


def smallest_area_stadium(
    points: ArrayLike,
    *,
    center: ArrayLike | None = None,
    angle: ArrayLike | None = None,
    method: str = "search",
    options: Options | None = None,
) -> Stadium:
    """Stadium of the smallest area around each set of points.

    Parameters
    ----------
    points
        Complex, shape (..., N), N >= 1, finite.
    center
        Complex, broadcast against the leading axes of ``points``; None: free.
    angle
        Direction of the segment [rad], modulo pi, broadcast likewise; None: free.
    method
        ``"search"``, ``"evolution"``, ``"ipopt"``, or ``"narrowest"`` (the narrowest stadium, to
        compare with).
    options
        Accuracy and time limit for the method.

    Returns
    -------
    Stadium
        ``center`` (complex), ``radius``, ``half_length`` and ``angle`` in [0, pi), of shape (...).
        The radius is rounded upward. The gap of its `certificate`, which is made when it is first
        asked for, says how far from the smallest area it is.

    Raises
    ------
    InputError
        Empty or non-finite points, real-valued pairs, a centre or angle that does not broadcast.
    SolverError
        The method gave no answer.

    Examples
    --------
    >>> from workbench.geometry import smallest_area_stadium
    >>> stadium = smallest_area_stadium([0, 2, 4, 2 + 1j])
    >>> 0.4 < float(stadium.radius) < 2.0
    True
    """
    return finite_answer(SmallestAreaStadium(points, center=center, angle=angle), method, options)


@method(SmallestAreaStadium, "search", optimal=True, accuracy=ANY_ACCURACY_ALIKE)
def _search(program: SmallestAreaStadium, context: Context) -> Claim:
    """Angles of the hull and of a grid, refined by golden sections over angle and radius."""
    return each_hull(program, context, smallest_area)


def each_hull(
    program: SmallestAreaStadium,
    context: Context,
    stadium: Callable[[ComplexArray, float, bool, float | None], tuple[complex, float, float]],
) -> Claim:
    """A method's answer from a function of one set that gives middle, half-length and angle of its
    stadium.

    The function takes the corners of the set's hull (N,), complex, in a frame in which lengths are
    near 1, around the given centre or that of the smallest circle; the radius of a circle around
    that centre that contains them; whether the centre is given; and the angle [rad], None if it is
    free.
    """
    centers = None if program.center is None else program.center.ravel()
    angles = None if program.angle is None else program.angle.ravel()

    def shape(unit: UnitFrame, index: int) -> tuple[complex, float, float]:
        center = 0j if centers is None else unit.to_frame(centers[index])
        corners = convex_hull(unit.points - center)
        if centers is None:
            center, largest = (part.item() for part in exact_circle(corners))
            corners = corners - center
        else:
            largest = float(np.abs(corners).max())
        angle = None if angles is None else float(angles[index])
        middle, half_length, angle = stadium(corners, largest, centers is not None, angle)
        return center + middle, half_length, angle

    shapes, outcome, message = each_set(program, context, shape)
    return Stadium(*shapes), outcome, message


@method(SmallestAreaStadium, "narrowest", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _narrowest(program: SmallestAreaStadium, context: Context) -> Claim:
    """The narrowest stadium, exact: an upper bound on the smallest area."""
    answer = exact_stadium(program.points, program.center, program.angle)
    return Stadium(*answer), Outcome.SOLVED, ""
