"""Structure of a model that is given before the fit: variable, degrees, delays, stable region."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.identification.rational_models.model import variable
from workbench.identification.rational_models.weighted import WeightedResponse

LEAST_DAMPING = 1e-6
"""Least distance of a pole from the stability boundary, relative to its size (1 in the z-plane)."""
LEAST_RATE = 1e-6
"""Least distance of any stable pole from the imaginary axis, relative to the lowest frequency."""

Entries = list[tuple[int, int]]
"""Row and column of the entries whose numerators are computed together."""


@dataclass(frozen=True, eq=False)
class ModelStructure:
    """Structure shared by the models of all orders.

    Unlike a `Structure`, it says nothing on uncertainty: it has the numbers of zeros and the
    delays that a fit may use.

    Parameters
    ----------
    excess
        Number of poles minus zeros for each entry (p, m), at least 0.
    stable
        Whether poles must be stable.
    delay
        Known delays (p, m) [s].
    delay_bounds
        Bounds (2,) [s] of a further delay that all entries share; None if there is none.
    """

    data: WeightedResponse
    excess: np.ndarray
    sample_time: float | None
    stable: bool
    delay: RealArray
    delay_bounds: tuple[float, float] | None

    @property
    def free_delay(self) -> bool:
        """Whether a delay is fitted."""
        return self.delay_bounds is not None

    @cached_property
    def unit(self) -> float:
        """Unit of frequency [rad/s] of x; 1 in the z-plane."""
        if self.sample_time is not None:
            return 1.0
        return float(np.sqrt(self.data.omega[0] * self.data.omega[-1]))

    @cached_property
    def x(self) -> ComplexArray:
        """Points (F,): s in that unit, or z."""
        return variable(self.data.omega / self.unit, self.sample_time)

    @cached_property
    def weight(self) -> RealArray:
        """Weights (F,) of the basis: the root mean square over the entries, of mean 1."""
        found = np.sqrt(np.mean(self.data.deviation**-2.0, axis=(1, 2)))
        result: RealArray = found / found.mean()
        return result

    @cached_property
    def groups(self) -> list[Entries]:
        """Groups of entries with dependent errors, which are computed together."""
        p, m = self.data.shape
        entries = [(i, j) for i in range(p) for j in range(m)]
        return [[each] for each in entries] if self.data.independent else [entries]

    def degree(self, i: int, j: int, order: int) -> int:
        """Degree of the numerator of an entry; at least 0."""
        return max(order - int(self.excess[i, j]), 0)

    def unknowns(self, order: int) -> int:
        """Number of free real coefficients."""
        numerators = np.maximum(order - self.excess, 0) + 1
        return int(order + numerators.sum() + self.free_delay)

    def stacked(self, values: ComplexArray, group: Entries) -> RealArray:
        """Values (F, p, m, ...) of a group's entries as rows, real parts above imaginary ones."""
        chosen = np.concatenate([values[:, i, j] for i, j in group])
        return np.concatenate([chosen.real, chosen.imag])

    def unstack(self, rows: RealArray, group: Entries, into: ComplexArray) -> None:
        """Write rows in the form of `stacked` into an array (F, p, m)."""
        half = rows.size // 2
        values = (rows[:half] + 1j * rows[half:]).reshape(len(group), -1)
        for (i, j), each in zip(group, values, strict=True):
            into[:, i, j] = each

    def margin(self, poles: ComplexArray) -> RealArray:
        """Least distance of each stable pole from the boundary, in units of x."""
        if self.sample_time is not None:
            return np.full(poles.size, LEAST_DAMPING)
        lowest = LEAST_RATE * float(self.data.omega[0]) / self.unit
        found: RealArray = np.maximum(LEAST_DAMPING * np.abs(poles), lowest)
        return found

    def distance(self, poles: ComplexArray) -> RealArray:
        """Distance of poles from the boundary of stability, positive on its stable side."""
        inside = -poles.real if self.sample_time is None else 1.0 - np.abs(poles)
        found: RealArray = inside
        return found

    def allowed(self, poles: ComplexArray) -> ComplexArray:
        """Poles, with those beyond the margin of stability moved to it."""
        if not self.stable:
            return poles
        margin = self.margin(poles)
        beyond = self.distance(poles) < margin
        if self.sample_time is None:
            moved = -margin + 1j * poles.imag
        else:
            moved = poles / np.maximum(np.abs(poles), 1e-300) * (1.0 - margin)
        return np.where(beyond, moved, poles)

    def mirrored(self, poles: ComplexArray) -> ComplexArray:
        """Poles, with the unstable ones mirrored and, if necessary, moved to the margin."""
        if self.sample_time is None:
            poles = -np.abs(poles.real) + 1j * poles.imag
        else:
            size = np.abs(poles)
            poles = np.where(size > 1, poles / np.maximum(size, 1e-300) ** 2, poles)
        margin = self.margin(poles)
        close = self.distance(poles) < margin
        if self.sample_time is None:
            return np.where(close, -margin + 1j * poles.imag, poles)
        return np.where(close, poles / np.maximum(np.abs(poles), 1e-300) * (1 - margin), poles)

    def allowed_delay(self, delay: float) -> float:
        """The delay [s], limited to its bounds."""
        assert self.delay_bounds is not None
        return float(np.clip(delay, *self.delay_bounds))
