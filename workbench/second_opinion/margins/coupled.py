"""Loops of several channels with dead time, by their responses alone, in doubles.

States, delayed signals and loop signals depend on each other by a matrix Q (n + d + c), and

    f(s) = det(diag(s I, I) - Q diag(I, exp(-s T), gains)) / (s + rho)^n

has its zeros right of the axis at the closed loop's poles there; the turns that it makes along the
axis count them.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from workbench._core.arrays import Array, ComplexArray, RealArray
from workbench.second_opinion.margins.dead_times import DECADES, POINTS, turns_right

REFINEMENTS = 4
"""Number of times that the search around a least value is refined."""


@dataclass(frozen=True, eq=False)
class TriedLoop:
    """The loop of channel ``channel`` of ``Q``; the first ``states`` signals are states.

    Unlike a `CoupledLoop`, it is of the second opinion, which shares no code with the kernel.

    ``delays`` (d,) [s] belong to the signals after the states.
    """

    Q: RealArray
    states: int
    delays: RealArray
    channel: int

    def missed(self, crossings: RealArray) -> tuple[int, int]:
        """Number of crossings of |L| = 1 that are not among the given ones [rad/s], and of
        frequencies tried.
        """
        omega = self._frequencies()
        above = np.abs(self.response(omega)) - 1.0
        known = np.abs(above) > 1e-6
        passed = (above[1:] * above[:-1] < 0) & known[1:] & known[:-1]
        return int((passed & ~(np.histogram(crossings, omega)[0] > 0)).sum()), omega.size

    def response(self, omega: RealArray) -> ComplexArray:
        """L (F,) with the other channels closed."""
        at = self.states + len(self.delays) + self.channel
        found: Array = np.linalg.solve(self._matrix(omega, 0.0), self.Q[:, [at]])
        return -found[:, at, 0]

    def counted_poles(self, gain: float = 1.0) -> int:
        """Number of closed-loop poles right of the axis, with a gain in the channel."""
        rho = self._speed()

        def values(omega: RealArray) -> ComplexArray:
            M = self._matrix(omega, gain)
            M[:, : self.states] /= (1j * omega + rho)[:, None, None]
            found: ComplexArray = np.linalg.det(M)
            return found

        return turns_right(values, np.concatenate([[0.0], self._frequencies()]))

    def least_distance(self) -> float:
        """The least |1 + L| found."""
        return self.least_size(1.0)

    def least_size(self, skew: float) -> float:
        """The least |delta| that breaks the loop, over the frequencies tried."""
        omega, least = self._frequencies(), math.inf
        for _ in range(REFINEMENTS):
            L = self.response(omega)
            sizes = np.abs(1.0 + L) / np.abs((1.0 + skew) / 2.0 + (skew - 1.0) / 2.0 * L)
            k = int(np.argmin(sizes))
            least = min(least, float(sizes[k]))
            omega = np.linspace(omega[max(k - 1, 0)], omega[min(k + 1, omega.size - 1)], 100)
        return least

    def distance_at(self, omega: float, factor: complex) -> float:
        """|1 + factor L| divided by 1 + |factor L| at a frequency [rad/s]; at a pole |factor|."""
        try:
            L = complex(self.response(np.array([omega]))[0])
        except np.linalg.LinAlgError:
            return abs(factor)
        return abs(1.0 + factor * L) / (1.0 + abs(factor * L))

    def _matrix(self, omega: RealArray, gain: float) -> Array:
        n, d = self.states, len(self.delays)
        factors = np.ones((omega.size, len(self.Q)), complex)
        factors[:, n : n + d] = np.exp(-1j * np.multiply.outer(omega, self.delays))
        factors[:, n + d + self.channel] = gain
        unit = np.ones((omega.size, len(self.Q)), complex)
        unit[:, :n] = 1j * omega[:, None]
        whole: Array = unit[:, :, None] * np.eye(len(self.Q)) - self.Q * factors[:, None, :]
        return whole

    def _frequencies(self) -> RealArray:
        rho = self._speed()
        return np.geomspace(rho * 10.0**-DECADES, rho * 10.0**DECADES, POINTS)

    def _speed(self) -> float:
        n = self.states
        A, B, C = self.Q[:n, :n], self.Q[:n, n:], self.Q[n:, :n]
        sizes = np.abs(np.linalg.eigvals(A)) if n else np.zeros(0)
        loop = np.linalg.norm(B) * np.linalg.norm(C)
        return float(max(sizes.max(initial=0.0), loop)) or 1.0
