"""The narrowest stadium around a point set.

Narrowest means: of least radius, and among those of least half-length.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from workbench.accuracy import ANY_ACCURACY_ALIKE
from workbench.executor import Context
from workbench.geometry.bounds import least_half_width
from workbench.geometry.circle import finite_answer
from workbench.geometry.enclosing_shape import relative
from workbench.geometry.enclosing_stadium import EnclosingStadium, Stadium
from workbench.geometry.exact_stadium import exact_stadium
from workbench.geometry.thesis import thesis_stadium
from workbench.program import Claim, method
from workbench.solvers import Options, Outcome


@dataclass(frozen=True, eq=False)
class NarrowestStadium(EnclosingStadium):
    """The narrowest stadium that contains every point of a set.

    Parameters
    ----------
    points
        Complex, shape (..., N).
    center
        Complex, broadcast against the sets; None: free.
    angle
        Direction of the segment [rad], modulo pi, broadcast against the sets; None: free.

    The least radius is half the least width of the set; with a given centre it is half the least
    width of the set and its mirror image in the centre together. The answer is certified by
    containment, by a lower bound on the width over all angles and, for the half-length, by points
    that the round ends touch.
    """

    def gap(self, answer: Stadium) -> tuple[str, float]:
        radius = np.asarray(answer.radius, dtype=np.longdouble)
        width = relative(radius - self.radius_bound(answer) - self.rounding, radius)
        value = float(np.max([width, self.slack(answer)], initial=0.0))
        return (
            "radius above its lower bound over all allowed angles, or distance between a round "
            "end and the nearest point, relative to the radius"
        ), value

    def radius_bound(self, answer: Stadium) -> np.ndarray:
        """Lower bound (...) on the radius of every stadium with the given centre and angle.

        If no centre is given, the answer's centre only serves as the origin of the computation.
        """
        about = np.asarray(answer.center) if self.center is None else self.center
        if self.angle is not None:
            _, across = self.coordinates(about, self.angle)
            if self.center is not None:
                return np.abs(across).max(axis=-1)
            return (across.max(axis=-1) - across.min(axis=-1)) / 2
        away = (self.points.astype(np.clongdouble) - about[..., None]).reshape(-1, self.size)
        scale = np.maximum(np.abs(away).max(axis=-1, keepdims=True), np.finfo(np.longdouble).tiny)
        away = (away / scale).astype(complex)
        if self.center is not None:
            away = np.concatenate([away, -away], axis=-1)
        return (least_half_width(away) * scale[:, 0]).reshape(self.batch)

    def slack(self, answer: Stadium) -> np.ndarray:
        """Distance (...) between the round ends and the points that they should touch.

        It is relative to the radius, and 0 where the half-length is 0. A point beyond the end of
        the segment touches when its distance from the end is the radius, a point beside the segment
        when it is level with the end; the shortfall of either counts. Both ends must touch a point
        if the centre is free, one of them if it is given. If the touching point also lies on a
        straight side, the slack grows with the square of the excess length: the length itself is
        ill-conditioned there.
        """
        radius, length = np.asarray(answer.radius), np.asarray(answer.half_length)
        along, across = self.coordinates(answer.center, answer.angle)
        ends = []
        for toward in (along, -along):
            beyond = toward - length[..., None]
            room = radius[..., None] - np.hypot(np.maximum(beyond, 0), across)
            ends.append((room + np.maximum(-beyond, 0)).min(axis=-1))
        room = np.maximum(*ends) if self.center is None else np.minimum(*ends)
        return np.where(length == 0, 0.0, relative(room - self.rounding, radius))


def narrowest_stadium(
    points: ArrayLike,
    *,
    center: ArrayLike | None = None,
    angle: ArrayLike | None = None,
    method: str = "exact",
    options: Options | None = None,
) -> Stadium:
    """Narrowest stadium around each set of points: of least radius, then of least half-length.

    Parameters
    ----------
    points
        Complex, shape (..., N), N >= 1, finite.
    center
        Complex, broadcast against the leading axes of ``points``; None: free.
    angle
        Direction of the segment [rad], modulo pi, broadcast likewise; None: free.
    method
        ``"exact"`` (globally optimal), ``"thesis"``, ``"ipopt"``, or with a given angle the name
        of a conic solver.
    options
        Accuracy and time limit for the method.

    Returns
    -------
    Stadium
        ``center`` (complex), ``radius``, ``half_length`` and ``angle`` in [0, pi), of shape (...).
        The radius is rounded upward. ``solve(NarrowestStadium(...))`` gives a certificate too.

    Raises
    ------
    InputError
        Empty or non-finite points, real-valued pairs, a centre or angle that does not broadcast.
    SolverError
        The method gave no answer.
    """
    return finite_answer(NarrowestStadium(points, center=center, angle=angle), method, options)


@method(NarrowestStadium, "exact", optimal=True, accuracy=ANY_ACCURACY_ALIKE)
def _exact(program: NarrowestStadium, context: Context) -> Claim:
    """Convex hull, rotating calipers and critical angles; globally optimal, no tolerance."""
    answer = exact_stadium(program.points, program.center, program.angle)
    return Stadium(*answer), Outcome.SOLVED, ""


@method(NarrowestStadium, "thesis", optimal=False, accuracy=ANY_ACCURACY_ALIKE)
def _thesis(program: NarrowestStadium, context: Context) -> Claim:
    """The candidates of the thesis, sections 5.4.1 and 5.4.2, as printed."""
    stadium = Stadium(*thesis_stadium(program.points, program.center, program.angle))
    lost = int(np.sum(~np.isfinite(stadium.radius)))
    if lost:
        return stadium, Outcome.FAILED, f"the procedure has no candidate for {lost} of the sets"
    return stadium, Outcome.SOLVED, ""
