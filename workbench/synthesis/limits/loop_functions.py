"""A single loop's weights as rational functions, which proofs over all frequencies need.

With e = w - G u, u = K e, L = G K and T = L / (1 + L), where G is the plant with its sensor, the
outputs are z_p = W_p (1 - T) w and z_u = (W_u / G_0) T w, G_0 being the plant before the sensor,
with the uncertainty G_0 (1 + W_c delta_c + W_r delta_r).
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
    """What the weights of a loop are at least over cells of frequency (F,).

    Mu of a loop with T does not fall when a weight grows. So a T that a level allows at a frequency
    of a cell is allowed by these.

    Parameters
    ----------
    performance, control, circular, real
        Lower bounds (F,) on |W_p|, |W_u / G|, |W_c| and |W_r|.
    along, turned
        W_r / |W_r| in the middle of a cell, and the most [rad] that it turns from there.
    """

    performance: RealArray
    control: RealArray
    circular: RealArray
    real: RealArray
    along: ComplexInterval
    turned: RealArray

    def at(self, k: NDArray[np.intp]) -> LeastWeights:
        """Those of some of the cells, by index."""
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
    """W_p, W_u, G, W_c and W_r of a loop; without uncertainty the last two are None.

    Raises InputError where W_u / G does not grow at high frequencies: nothing would force T to fall
    there, and no integral over all frequencies would be finite.

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
                "W_u / G must grow with frequency, so that T must fall; G has "
                f"{_excess(self.plant)} more poles than zeros, W_u {_excess(self.control)}"
            )

    @property
    def falls(self) -> int:
        """The power of 1 / omega with which a bounded W_u T / G makes T fall at least."""
        return _excess(self.plant) - _excess(self.control)

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
        """What the weights are at least over cells, rounded downward."""
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
        """A number c: where mu is at most a level, |T| <= c / omega^`falls` above `lowest` [rad/s].

        Infinite where W_u may have a zero there.
        """
        above, below = (asymptote(each, lowest) for each in (self.plant, self.control))
        return float((above * level / below).high)


def _excess(function: Rational) -> int:
    return len(function.poles) - len(function.zeros)
