"""Static errors of a loop with constant set-points and disturbances, for every plant of a set."""

from __future__ import annotations

import math
from dataclasses import dataclass
from fractions import Fraction

import numpy as np

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.certificate import Check
from workbench.synthesis.implementation.working_point.actuator import Actuator
from workbench.synthesis.implementation.working_point.point import told
from workbench.systems.conversion import as_system
from workbench.uncertainty import UncertaintyModel

EVERY_PLANT = "for every plant of the set, at frequency zero"


@dataclass(frozen=True)
class ConstantSignals:
    """Static errors of a loop that is stable for every plant of a set.

    ``integral`` is True if the controller has an exact integrator. ``gains`` are the least and the
    largest static gain of the plants; infinite for integrating plants. ``error`` is the largest
    static error for a constant set-point or a disturbance at the output, relative to its size.
    ``room`` is how far below and above its rest every plant can be held within the limits; None
    without limits or for integrating plants. ``lowest_hz`` [Hz] is the lowest frequency of the
    responses from which the plants are known. The static gains are then extrapolated, and the room
    is that of a slow oscillation at this frequency. It is None for a stated model.
    """

    integral: bool
    gains: tuple[float, float]
    error: float
    room: tuple[float, float] | None
    lowest_hz: float | None = None

    @property
    def integrating(self) -> bool:
        """Whether every plant of the set has a pole at frequency zero."""
        return not math.isfinite(self.gains[0])

    @property
    def vanishes(self) -> bool:
        """Whether a static gain may be zero, so that no controller can hold a set-point."""
        low, high = self.gains
        return low <= 0.0 <= high

    def words(self, unit: str) -> str:
        """The statement on static errors in words, with its conditions."""
        if self.vanishes:
            return "constant signals: a plant of the set may have static gain zero"
        if not self.integral:
            return (
                f"constant signals: at most {100 * self.error:.3g} % of a step of the set-point, "
                "or of a disturbance at the output, is left for every plant of the set: the "
                "controller has no integrator" + self._extrapolated()
            )
        return f"constant signals: no static error for every plant of the set, {self._limits(unit)}"

    def _limits(self, unit: str) -> str:
        """The condition on the limits of the control."""
        if self.integrating:
            return (
                "while the control stays within its limits: every plant integrates, so without a "
                "load it holds any output with the control at which it rests"
            )
        if self.room is None:
            return "while the control is not limited"
        below, above = (told((side,), unit) for side in self.room)
        held = f"up to {below} below and {above} above where a plant rests at the working point"
        if self.lowest_hz is None:
            return f"while the control stays within its limits: {held}"
        return (
            f"while the control stays within its limits{self._extrapolated()}; at "
            f"{self.lowest_hz:.4g} Hz, the lowest measured frequency, the limits allow "
            f"oscillations {held}"
        )

    def _extrapolated(self) -> str:
        """A remark on static gains that no record shows."""
        if self.lowest_hz is None or self.integrating:
            return ""
        return "; the static gains are extrapolated from the records"

    def check(self) -> Check:
        """Check that the static error is smaller than the step; it is zero with an integrator."""
        statement = "largest error that a constant set-point or disturbance leaves, over its size"
        value = math.inf if self.vanishes else self.error
        return Check("constant signals", statement, value, 0.0 if self.integral else 1.0,
                     over=EVERY_PLANT)  # fmt: skip


def constant_signals(
    model: UncertaintyModel, K: StateSpace, sign: int, actuator: Actuator
) -> ConstantSignals:
    """Static errors of the loop u = sign K y with one control and one measurement.

    The loop must be stable for every plant of the set. Deviations at frequency zero are real.
    """
    gains = static_gains(model)
    integral = has_pole_at_one(K)
    static = 0.0 if integral else float(np.real(as_system(K, "K")(1.0)))
    ends = [abs(1.0 / (1.0 - sign * gain * static)) for gain in gains if math.isfinite(gain)]
    error = 0.0 if integral else max(ends, default=0.0)
    lowest = None if model.measured is None else model.measured[0]
    room = None
    if actuator.deviations is not None and math.isfinite(gains[0]):
        low, high = actuator.deviations
        least = _least_gain(model, lowest or 0.0)
        below, above = -float(low[0]) * least, float(high[0]) * least
        room = (below, above) if gains[0] > 0 else (above, below)
    lowest_hz = None if lowest is None else lowest / (2 * math.pi)
    return ConstantSignals(integral, gains, error, room, lowest_hz)


def static_gains(model: UncertaintyModel) -> tuple[float, float]:
    """Least and largest gain at frequency zero over the plants of a model.

    Below the measured frequencies a weight may have any size. The plants are taken to differ there
    at least as much as at the lowest of these.
    """
    zero = np.zeros(1)
    with np.errstate(divide="ignore", invalid="ignore"):
        centre = float(np.real(model.nominal.response(zero)[0]))
    if not math.isfinite(centre):
        return math.inf, math.inf
    lowest = 0.0 if model.measured is None else model.measured[0]
    away = max(_away(model, 0.0), _away(model, lowest))
    away *= abs(centre) if model.form == "multiplicative" else 1.0
    return centre - away, centre + away


def _least_gain(model: UncertaintyModel, omega: float) -> float:
    """Least gain of the plants of a model at a frequency [rad/s]; 0 where one may vanish."""
    centre = abs(complex(model.nominal.response(np.array([omega]))[0]))
    away = _away(model, omega) * (centre if model.form == "multiplicative" else 1.0)
    return max(centre - away, 0.0)


def _away(model: UncertaintyModel, omega: float) -> float:
    """Largest deviation from the nominal at a frequency [rad/s], in the units of the weights."""
    radius, length = model.sizes(np.array([omega]))
    return float(radius[0] + length[0])


def has_pole_at_one(K: StateSpace) -> bool:
    """Whether a sampled system has a pole at z = 1, by the exact determinant of 1 - A."""
    return not _determinant(np.eye(K.nstates) - np.asarray(K.A, dtype=float))


def _determinant(matrix: RealArray) -> Fraction:
    """The exact determinant, by Gaussian elimination."""
    rows = [[Fraction(value) for value in row] for row in matrix.tolist()]
    product = Fraction(1)
    for k in range(len(rows)):
        pivot = next((i for i in range(k, len(rows)) if rows[i][k]), None)
        if pivot is None:
            return Fraction(0)
        rows[k], rows[pivot] = rows[pivot], rows[k]
        product *= rows[k][k] if pivot == k else -rows[k][k]
        for row in rows[k + 1 :]:
            share = row[k] / rows[k][k]
            row[k:] = [a - share * b for a, b in zip(row[k:], rows[k][k:], strict=True)]
    return product
