"""Weights of a single loop as rational functions, needed for proofs over all frequencies.

With e = w - G u, u = K e, L = G K and T = L / (1 + L), where G is the plant with its sensor, the
outputs are z_p = W_p (1 - T) w and z_u = (W_u / G_0) T w, where G_0 is the plant without its sensor
and G_0 (1 + W_c delta_c + W_r delta_r) the uncertain plant.
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench._core.arrays import RealArray
from workbench.errors import InputError
from workbench.fitting.rational import Rational
from workbench.synthesis.limits.intervals import ComplexInterval, Interval, down
from workbench.synthesis.limits.loop_weights import LoopWeights
from workbench.synthesis.limits.rational_bounds import (
    FrequencyCells,
    asymptote,
    direction,
    largest_magnitude,
    least_magnitude,
)


@dataclass(frozen=True, eq=False)
class LeastWeights:
    """Lower bounds on the weights of a loop over cells of frequency (F,).

    For a given T, mu does not decrease when a weight grows. So every T that a level allows at some
    frequency of a cell is also allowed with these bounds.

    Parameters
    ----------
    performance, control, circular, real
        Lower bounds (F,) on |W_p|, |W_u / G|, |W_c| and |W_r|.
    along, turned
        W_r / |W_r| in the middle of a cell, and its largest change of angle [rad] over the cell.
    """

    performance: RealArray
    control: RealArray
    circular: RealArray
    real: RealArray
    along: ComplexInterval
    turned: RealArray

    def at(self, k: NDArray[np.intp]) -> LeastWeights:
        """The bounds of some cells, by index."""
        real, imag = self.along.real, self.along.imag
        return LeastWeights(
            self.performance[k],
            self.control[k],
            self.circular[k],
            self.real[k],
            ComplexInterval(
                Interval(real.low[k], real.high[k]), Interval(imag.low[k], imag.high[k])
            ),
            self.turned[k],
        )


@dataclass(frozen=True, eq=False)
class LoopFunctions:
    """W_p, W_u, G, W_c and W_r of a loop. The last two are None for a loop without uncertainty.

    Raises InputError if W_u / G does not grow at high frequencies: T would not have to decrease
    there, and the integral over all frequencies would not be finite.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.fitting import Rational
    >>> from workbench.synthesis import AnalyticBasis, LoopFunctions
    >>> loop = LoopFunctions(Rational([], [], 0.1), Rational([], [], 1.0), Rational([], [1.0], 1.0))
    >>> basis = AnalyticBasis(np.geomspace(0.05, 20.0, 12), (1e-3, 1e3), poles=[1.0])
    >>> loop.nominal.circular is None, loop.at(np.array([1.0])).performance.round(6).tolist()
    (True, [0.1])
    """

    performance: Rational
    control: Rational
    plant: Rational
    _: KW_ONLY
    circular: Rational | None = None
    real: Rational | None = None

    def __post_init__(self) -> None:
        if self.falls < 1 or self.control.gain == 0.0 or self.plant.gain == 0.0:
            raise InputError(
                "W_u / G must grow with frequency, so that T must decrease; G has "
                f"{_relative_degree(self.plant)} more poles than zeros, "
                f"W_u {_relative_degree(self.control)}"
            )

    @property
    def falls(self) -> int:
        """The power k with which |T| decreases at least as 1 / omega^k if W_u T / G is bounded."""
        return _relative_degree(self.plant) - _relative_degree(self.control)

    @property
    def nominal(self) -> LoopFunctions:
        """The loop without uncertainty."""
        return LoopFunctions(self.performance, self.control, self.plant)

    def at(self, omega: ArrayLike) -> LoopWeights:
        """The weights at frequencies [rad/s] (F,), without bounds on rounding."""
        omega = np.asarray(omega, dtype=float)
        zero = np.zeros(omega.shape)
        return LoopWeights(
            np.abs(self.performance.response(omega)),
            np.abs(self.control.response(omega) / self.plant.response(omega)),
            zero if self.circular is None else np.abs(self.circular.response(omega)),
            zero.astype(complex) if self.real is None else self.real.response(omega),
        )

    @np.errstate(all="ignore")
    def over(self, cells: FrequencyCells) -> LeastWeights:
        """Lower bounds on the weights over cells, rounded downward."""
        zero = np.zeros(cells.low.shape)
        still = ComplexInterval(Interval.of(zero + 1.0), Interval.of(zero))
        along = (still, zero) if self.real is None else direction(self.real, cells)
        control = down(least_magnitude(self.control, cells) / largest_magnitude(self.plant, cells))
        return LeastWeights(
            least_magnitude(self.performance, cells),
            np.fmax(control, 0.0),
            zero if self.circular is None else least_magnitude(self.circular, cells),
            zero if self.real is None else least_magnitude(self.real, cells),
            *along,
        )

    @np.errstate(all="ignore")
    def largest_beyond(self, lowest: float, level: float) -> float:
        """A number c with |T| <= c / omega^`falls` above `lowest` [rad/s], if mu is at most a
        level.

        It is infinite if W_u may have a zero above `lowest`.
        """
        above, below = (asymptote(each, lowest) for each in (self.plant, self.control))
        return float((above * level / below).high)


def _relative_degree(function: Rational) -> int:
    return len(function.poles) - len(function.zeros)
