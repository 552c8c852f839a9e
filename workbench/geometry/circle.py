"""The smallest circle around a point set."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import EPS
from workbench._core.heavy_types import Dataset
from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.answer import ProgramAnswer, answer_of
from workbench.conic import ConeFactor, ConeKind, ConicallyStated, ConicForm
from workbench.executor import Context
from workbench.geometry.bounds import circle_radius_bound
from workbench.geometry.enclosing_shape import EnclosingShape, relative
from workbench.geometry.exact_circle import exact_circle
from workbench.geometry.thesis import thesis_circle
from workbench.program import Claim, method
from workbench.solvers import Options, Outcome


@dataclass(frozen=True, repr=False)
class Circle(ProgramAnswer):
    """Circles, one for each set: arrays of complex ``center`` and real ``radius``."""

    center: np.ndarray
    radius: np.ndarray

    @property
    def half_length(self) -> np.ndarray:
        """Zeros, because a circle is a stadium without a straight part."""
        return np.zeros_like(self.radius)

    @property
    def angle(self) -> np.ndarray:
        """Zeros, because a circle has no direction."""
        return np.zeros_like(self.radius)


@dataclass(frozen=True, eq=False)
class SmallestCircle(EnclosingShape, ConicallyStated):
    """The circle of least radius that contains every point of a set.

    The optimum is unique. It is certified by containment and, for its radius, by weak duality:
    for weights lambda >= 0 of sum 1, r^2 >= sum lambda |p|^2 - |sum lambda p|^2.
    """

    answer_names: ClassVar[dict[str, str]] = {
        "center": "centre of the circle",
        "radius": "radius of the circle",
    }

    def gap(self, answer: Circle) -> tuple[str, float]:
        radius = np.asarray(answer.radius, dtype=np.longdouble)
        bound = circle_radius_bound(self.points, answer.center)
        value = float(np.max(relative(radius - bound - 8 * EPS * self.reach, radius), initial=0.0))
        return "radius above its bound from the dual of the support points, relative", value

    def conic_form(self) -> ConicForm:
        """The least sum of radii with (radius, p - centre) in a second-order cone for each point.

        The variables are the centre's two coordinates and the radius of each set in turn.
        """
        from scipy.sparse import block_diag

        sets = self.points.reshape(-1, self.points.shape[-1]).astype(complex)
        one = np.array([[0.0, 0.0, -1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]])
        A = block_diag([np.tile(one, (sets.shape[1], 1))] * len(sets), format="csr")
        b = np.stack([np.zeros(sets.shape), sets.real, sets.imag], axis=-1).ravel()
        cone = ConeFactor(ConeKind.SECOND_ORDER, 3)
        return ConicForm(np.tile([0.0, 0.0, 1.0], len(sets)), A, b, (cone,) * sets.size)

    def from_dataset(self, data: Dataset) -> Circle:
        return Circle(data["center"].values, data["radius"].values)


def smallest_circle(
    points: ArrayLike, *, method: str = "exact", options: Options | None = None
) -> Circle:
    """Smallest circle around each set of points.

    Parameters
    ----------
    points
        Complex, shape (..., N), N >= 1, finite.
    method
        ``"exact"`` (globally optimal) or another method of `SmallestCircle`, such as ``"thesis"``
        or a conic solver.
    options
        Accuracy and time limit for the method.

    Returns
    -------
    Circle
        ``center`` (complex) and ``radius``, of shape (...). The radius is rounded upward, so that
        every point is inside. Its `certificate` is made when it is first asked for.

    Raises
    ------
    InputError
        Empty or non-finite points, or real-valued pairs.
    SolverError
        The method gave no answer.
    """
    return finite_answer(SmallestCircle(points), method, options)


def finite_answer(program: EnclosingShape, name: str, options: Options | None) -> Any:
    """Answer of a method; raises SolverError if there is none, or if a radius is not finite."""
    return answer_of(program, name, options, usable=lambda one: bool(np.isfinite(one.radius).all()))


@method(SmallestCircle, "exact", optimal=True, accuracy=ANY_ACCURACY_ALIKE)
def _exact(program: SmallestCircle, context: Context) -> Claim:
    """Exchange of support points; globally optimal, no tolerance."""
    return Circle(*exact_circle(program.points)), Outcome.SOLVED, ""


@method(SmallestCircle, "thesis", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _thesis(program: SmallestCircle, context: Context) -> Claim:
    """The shrinking circle of the thesis, section 5.3.1, as printed."""
    circle = Circle(*thesis_circle(program.points))
    lost = int(np.sum(~np.isfinite(circle.radius)))
    if lost:
        return circle, Outcome.FAILED, f"the procedure did not end for {lost} of the sets"
    return circle, Outcome.SOLVED, ""
