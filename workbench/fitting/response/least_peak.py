"""A rational function polished in its sections: least squares first, then the least peak."""

from __future__ import annotations

import numpy as np

from workbench.arrays import ComplexArray, RealArray
from workbench.fitting.rational import Rational
from workbench.fitting.response.program import ResponseFit
from workbench.fitting.sections import Sections

STEPS = 40
"""Gauss-Newton steps of the least squares."""
PEAKS = 40
"""Reweightings of the least peak; each is worth one step."""
TRIALS = 10
"""Dampings tried, each ten times the last, before a point is taken for a minimum."""
ROUNDING = 1e-14


def sections_of(program: ResponseFit, start: Rational) -> Sections:
    """The sections around a function that keep what the program asks."""
    omega = program.active.omega
    band = float(omega[0]), float(omega[-1])
    return Sections.of(start, program.zeros, band, program.stable, program.minimum_phase)


def polished(program: ResponseFit, start: Rational) -> tuple[float, Rational]:
    """The least worst error met, and its function, on a way from ``start``.

    Levenberg and Marquardt's steps to the weighted least squares; then Lawson's reweighting, each
    weight multiplied by its error, whose fixed points are minimax.
    """
    data = program.active
    sections = sections_of(program, start)
    here = _Point(program, sections, sections.start)
    best = here
    even = np.ones(data.omega.size)
    damping = 1e-6
    for _ in range(STEPS):
        moved, damping = _step(here, even, damping)
        if moved is None:
            break
        gained = 1 - moved.square(even) / here.square(even)
        here = moved
        best = min(best, here, key=lambda point: point.peak)
        if gained < 1e-6:
            break
    weight = even
    for _ in range(PEAKS):
        if here.peak <= ROUNDING * program.size:
            break
        weight = weight * np.abs(here.error)
        weight = np.maximum(weight / weight.mean(), ROUNDING)
        moved, damping = _step(here, np.sqrt(weight), damping)
        if moved is None:
            break
        here = moved
        best = min(best, here, key=lambda point: point.peak)
    return best.peak, sections.rational(best.vector)


class _Point:
    """Parameters, and the weighted errors there."""

    def __init__(self, program: ResponseFit, sections: Sections, vector: RealArray) -> None:
        data = program.active
        self.program, self.sections, self.vector = program, sections, vector
        self.error = data.weight * (sections.response(vector, data.omega) - data.response)
        peak = float(np.abs(self.error).max())
        self.peak = peak if np.isfinite(peak) else np.inf

    @property
    def slopes(self) -> ComplexArray:
        """How the weighted errors change with the parameters, (F, P)."""
        data = self.program.active
        return data.weight[:, None] * self.sections.slopes(self.vector, data.omega)

    def square(self, weight: RealArray) -> float:
        return float(np.sum(np.abs(weight * self.error) ** 2))


def _step(here: _Point, weight: RealArray, damping: float) -> tuple[_Point | None, float]:
    """A point of less weighted square error, and the damping that found it; None without one."""
    slopes = weight[:, None] * here.slopes
    matrix = np.concatenate([slopes.real, slopes.imag])
    size = np.linalg.norm(matrix, axis=0)
    size[size == 0] = 1.0
    matrix /= size
    error = weight * here.error
    downhill = matrix.T @ np.concatenate([error.real, error.imag])
    # The Gram matrix is enough, and small: the gradient alone decides where the steps end.
    curvature, directions = np.linalg.eigh(matrix.T @ matrix)
    curvature = np.maximum(curvature, 0.0)
    along = directions.T @ downhill
    now = here.square(weight)
    for _ in range(TRIALS):
        step = directions @ (along / (curvature + damping * curvature[-1]))
        with np.errstate(all="ignore"):  # a step too far is refused
            moved = _Point(here.program, here.sections, here.vector - step / size)
            if moved.square(weight) < now:
                return moved, max(damping / 100, ROUNDING)
        damping = max(10 * damping, 1e-10)
    return None, damping
