"""The least leakage of a fault filter for a relative error: convex in the filter.

Let T = F S for the nominal loop, and p = S_nominal / S for each plant of the set. The estimate on a
plant is T / p times the fault, plus T / p times the disturbance and the noise. Over a basis of T,
for all p, the filter solves

    min   E + 3 rms     |p - T| <= r |p|             from demands.error_above on,
                        |T| max|1/p| W_d <= E        up to demands.leakage_below,
                        |T| max|1/p| <= demands.gain everywhere,    ||T max|1/p||| = rms

with white noise up to demands.noise_band. If the estimate is to be subtracted from the error, the
return difference of plant p is then 1 + L (1 - F) = p / S (1 - T (1 / S - 1 / p)), and with

    Re(1 - T (1 / S - 1 / p)) >= |S / p| / M

no plant's Nyquist curve encircles -1 and its sensitivity is at most M. This half-plane replaces the
outside of a disc, which is not convex. The program has second-order cones on a grid of frequencies;
a filter's requirements are certified separately, at all frequencies.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.diagnosis.estimation.fault_loop import FaultLoop
from workbench.diagnosis.estimation.front_program import FrontProgram
from workbench.diagnosis.estimation.limits import Limits, exchanged
from workbench.errors import InputError, SolverError
from workbench.input_checks import need_positive
from workbench.systems.generalised_plant import response
from workbench.systems.realisation import realisation

GRID_MARGIN = 0.01
"""Relative tightening of the limits on the grid: they must also hold between its frequencies and
between the boundary points of the set of plants."""


@dataclass(frozen=True)
class FrontPoint:
    """A filter of the front: coefficients, relative error, leakage and rms of the noise.

    Leakage and noise are in the unit of the fault.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.diagnosis import EstimationDemands, FaultFront, FaultLoop, LaguerreBasis
    >>> from workbench.fitting import Rational
    >>> from workbench.uncertainty import UncertaintyModel
    >>> room = control.ss(-0.1, 0.1, 3e-3, 0.0)  # of a room's temperature [K]
    >>> demands = EstimationDemands(
    ...     error_above_hz=0.5, leakage_below_hz=0.05, gain=2.0, disturbance=room, noise=1e-4,
    ...     noise_band_hz=1.0
    ... )
    >>> parts = [Rational([], [-p], gain) for p, gain in ((0.2, 0.2), (2.0, 0.2), (1.0, 0.15))]
    >>> K, H = control.ss(0.0, 0.1, 1.0, 0.8), control.ss(-30.0, 30.0, 1.0, 0.0)
    >>> loop = FaultLoop(UncertaintyModel(*parts), K, H, demands)
    >>> grid = np.unique(np.r_[np.geomspace(1e-3, 20.0, 40), 0.05, 0.5, 1.0])
    >>> point = FaultFront(loop, grid).least(
    ...     LaguerreBasis(loop, 1.0).response(loop.warped_omega(grid), 6), 0.5
    ... )
    >>> point.error <= 0.5 * (1 + 1e-6), len(point.coefficients)
    (True, 6)
    """

    coefficients: RealArray
    error: float
    leakage: float
    noise: float

    @property
    def total_error(self) -> float:
        """Leakage plus three times the rms of the noise."""
        return self.leakage + 3 * self.noise


class FaultFront:
    """Filters F over a basis, for a loop's set of plants or (`nominal`) its nominal plant.

    frequency_hz: grid [Hz] (F,), rising. Raises InputError for another grid, or one without a
    frequency at which the error, or the leakage, is limited.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.diagnosis import EstimationDemands, FaultFront, FaultLoop
    >>> from workbench.fitting import Rational
    >>> from workbench.uncertainty import UncertaintyModel
    >>> room = control.ss(-0.1, 0.1, 3e-3, 0.0)  # of a room's temperature [K]
    >>> demands = EstimationDemands(
    ...     error_above_hz=0.5, leakage_below_hz=0.05, gain=2.0, disturbance=room, noise=1e-4,
    ...     noise_band_hz=1.0
    ... )
    >>> parts = [Rational([], [-p], gain) for p, gain in ((0.2, 0.2), (2.0, 0.2), (1.0, 0.15))]
    >>> K, H = control.ss(0.0, 0.1, 1.0, 0.8), control.ss(-30.0, 30.0, 1.0, 0.0)
    >>> loop = FaultLoop(UncertaintyModel(*parts), K, H, demands)
    >>> grid = np.unique(np.r_[np.geomspace(1e-3, 20.0, 40), 0.05, 0.5, 1.0])
    >>> front = FaultFront(loop, grid, nominal=True)
    >>> error, leakage, noise = front.judged(np.ones(len(grid), complex))  # T = 1: all passes
    >>> error, round(leakage, 4), round(noise, 5)
    (0.0, 0.003, 0.0001)
    """

    def __init__(self, loop: FaultLoop, frequency_hz: ArrayLike, *, nominal: bool = False) -> None:
        self.loop = loop
        self.frequency_hz = f = np.asarray(frequency_hz, float)
        if f.ndim != 1 or not np.isfinite(f).all() or (np.diff(f, prepend=0.0) <= 0.0).any():
            raise InputError("frequency must be (F,), positive, finite and rising")
        if not f[0] <= loop.demands.leakage_below_hz or not f[-1] >= loop.demands.error_above_hz:
            raise InputError(
                f"the grid from {f[0]:g} to {f[-1]:g} Hz must have frequencies up to "
                f"{loop.demands.leakage_below_hz:g} Hz and from {loop.demands.error_above_hz:g} "
                "Hz on"
            )
        self.omega = loop.warped_omega(self.frequency_hz)
        L = loop.open_loop(self.omega)
        self.back = 1 + L  # 1 / S
        one = np.ones((len(L), 1), complex)
        self.p = one if nominal else loop.differences(self.omega)
        self.worst = np.ones(len(L)) if nominal else loop.amplification(self.omega)
        self.disturbance = loop.demands.disturbance_size(self.omega)

    def estimate(self, F: StateSpace) -> ComplexArray:
        """T (F,) of a filter."""
        return np.asarray(response(F, self.omega)[:, 0, 0] / self.back)

    def of_filter(self, F: StateSpace) -> ComplexArray:
        """Basis of T (F, n + 1) for all filters that share the poles and input matrix of F."""
        n = F.nstates
        states = realisation((F.A, F.B, np.eye(n), np.zeros((n, 1))), 0.0)
        columns = [response(states, self.omega)[:, :, 0], np.ones((len(self.omega), 1))]
        return np.asarray(np.hstack(columns) / self.back[:, None], complex)

    def error_leakage_noise(self, T: ComplexArray) -> tuple[float, float, float]:
        """Relative error, leakage and rms of the noise of T (F,), on the grid."""
        f, size = self.frequency_hz, np.abs(T) * self.worst
        demands = self.loop.demands
        error = np.abs(1 - T[:, None] / self.p).max(axis=1)
        leakage = (size * self.disturbance)[f <= demands.leakage_below_hz].max()
        noise = demands.noise * np.sqrt((self._shares * size**2).sum())
        return float(error[f >= demands.error_above_hz].max()), float(leakage), float(noise)

    @property
    def _shares(self) -> RealArray:
        """The share (F,) of the noise's power that each frequency of the grid represents."""
        band = self.loop.demands.noise_band_hz
        inside = np.minimum(self.frequency_hz, band)
        edges = np.concatenate([[0.0], (inside[1:] + inside[:-1]) / 2, [inside[-1]]])
        return np.diff(edges) / band

    def removed_peak(self, T: ComplexArray) -> float:
        """Largest |S| on the grid, while the estimate with T (F,) is subtracted from the error."""
        back = self.back[:, None] * self.p  # 1 / S of each plant
        return float((1 / np.abs(back - (self.back * T)[:, None] * (back - 1))).max())

    def least(
        self,
        basis: ComplexArray,
        error: float,
        *,
        leakage: float | None = None,
        peak: float | None = None,
    ) -> FrontPoint:
        """The filter with the least leakage and noise for a relative error, with T = basis @ x.

        Parameters
        ----------
        basis
            Functions (F, n) of T.
        error
            Relative error allowed.
        leakage
            Separate limit of the leakage, in the unit of the fault; None: no limit.
        peak
            Limit M of the sensitivity while the estimate is subtracted from the error; None: the
            estimate is not subtracted.

        Raises
        ------
        InputError
            The peak is not positive.
        SolverError
            No filter meets the limits.
        """
        need_positive(peak, "peak", or_none=True)
        self._need_stable_set()
        if self._factor_of_nothing(error, peak) <= 1.0:  # T = 0 lets nothing pass
            nothing = np.zeros(len(self.frequency_hz), complex)
            return FrontPoint(np.zeros(basis.shape[1]), *self.error_leakage_noise(nothing))
        scale = np.abs(basis).max(axis=0)
        basis = basis / scale
        demands = self.loop.demands
        power = self.worst / demands.unit * np.sqrt(self._shares) * demands.noise
        # A norm with many rows depends only on their triangular factor.
        noise = np.linalg.qr(np.vstack([part(_rows(basis, power)) for part in (np.real, np.imag)]))
        program = FrontProgram(noise.R, None if leakage is None else leakage / demands.unit)
        found = exchanged(program.solved, self._limits(basis, error, peak))
        if found is None:
            raise SolverError(
                f"no filter of this basis has a relative error of {error:g}: {program.said}"
            )
        T = basis @ found[0]
        return FrontPoint(found[0] / scale, *self.error_leakage_noise(T))

    def least_factor(
        self, basis: ComplexArray, error: float, leakage: float, *, peak: float | None = None
    ) -> float:
        """Least factor by which all limits must grow so that a filter exists, with T = basis @ x.

        The limits of error, leakage and peak are as in `least`; the limit of the gain does not
        grow. A factor of at most 1 means that the limits can be met. The problem is convex in the
        coefficients and the factor. It always has the solution T = 0, with an error of 1, no
        leakage, and an unchanged loop; the factor of T = 0 is returned if the solver finds no
        better one. Raises InputError for limits that are not positive, and SolverError if the set
        has plants on which the loop is not stable.

        Examples
        --------
        >>> import control
        >>> import numpy as np
        >>> from workbench.diagnosis import EstimationDemands, FaultFront, FaultLoop, LaguerreBasis
        >>> from workbench.fitting import Rational
        >>> from workbench.uncertainty import UncertaintyModel
        >>> room = control.ss(-0.1, 0.1, 3e-3, 0.0)  # of a room's temperature [K]
        >>> demands = EstimationDemands(
        ...     error_above_hz=0.5, leakage_below_hz=0.05, gain=2.0, disturbance=room, noise=1e-4,
        ...     noise_band_hz=1.0
        ... )
        >>> parts = [Rational([], [-p], gain) for p, gain in ((0.2, 0.2), (2.0, 0.2), (1.0, 0.15))]
        >>> K, H = control.ss(0.0, 0.1, 1.0, 0.8), control.ss(-30.0, 30.0, 1.0, 0.0)
        >>> loop = FaultLoop(UncertaintyModel(*parts), K, H, demands)
        >>> grid = np.unique(np.r_[np.geomspace(1e-3, 20.0, 40), 0.05, 0.5, 1.0])
        >>> front = FaultFront(loop, grid)
        >>> functions = LaguerreBasis(loop, 1.0).response(6, loop.warped_omega(grid))
        >>> bool(front.least_factor(functions, error=0.5, leakage=2e-3) < 1)
        True
        >>> bool(front.least_factor(functions, error=0.05, leakage=1e-4) > 1)
        True
        """
        need_positive(error, "error")
        need_positive(leakage, "leakage")
        need_positive(peak, "peak", or_none=True)
        self._need_stable_set()
        limits = self._limits(basis / np.abs(basis).max(axis=0), error, peak, leakage)
        found = exchanged(FrontProgram().solved, limits)
        nothing = self._factor_of_nothing(error, peak)
        return nothing if found is None else min(found[1], nothing)

    def _factor_of_nothing(self, error: float, peak: float | None) -> float:
        """The factor of error and peak with which T = 0 meets the limits on the grid."""
        sizes = [1.0 / error]
        if peak is not None:
            sizes.append(float((self.worst / np.abs(self.back)).max()) / peak)
        return max(sizes) / (1 - GRID_MARGIN)

    def _need_stable_set(self) -> None:
        """Raise SolverError if the loop itself is unstable for some plants of the set."""
        if not np.isfinite(self.worst).all():
            at = self.frequency_hz[~np.isfinite(self.worst)][0]
            raise SolverError(
                f"no filter of this basis: near {at:.4g} Hz the set has plants on which the loop "
                "itself is not stable; make it smaller (FaultLoop.within)"
            )

    def _limits(
        self,
        basis: ComplexArray,
        error: float,
        peak: float | None,
        leakage: float | None = None,
    ) -> list[Limits]:
        """All limits at the grid's frequencies, on the coefficients of a basis.

        Their E is the leakage in the demands' unit; if a limit of the leakage is given, E is the
        common factor of error, leakage and peak.
        """
        demands, f, tight = self.loop.demands, self.frequency_hz, 1 - GRID_MARGIN
        kept, growing = (1.0, 0.0) if leakage is None else (0.0, 1.0)
        slow, fast = f <= demands.leakage_below_hz, f >= demands.error_above_hz
        leaking = _rows(basis, self.worst / demands.unit * self.disturbance)[slow]
        largest = tight * (1.0 if leakage is None else leakage / demands.unit)
        one, zero = np.ones(len(f)), np.zeros(len(f), complex)
        limits = [
            Limits(leaking, zero[slow], zero.real[slow], largest),
            Limits(_rows(basis, self.worst), zero, tight * demands.gain * one),
        ]
        for p in self.p[fast].T:
            away, end = _rows(basis[fast], 1 / np.abs(p)), tight * error * one[fast]
            limits.append(Limits(away, p / np.abs(p), kept * end, growing * end))
        if peak is not None:
            shares = 1 / (tight * peak * np.abs(self.back[:, None] * self.p))
            limits += [
                Limits(_rows(basis, self.back - 1 / p), 1 + zero, kept * end, growing * end, True)
                for p, end in zip(self.p.T, shares.T, strict=True)
            ]
        return limits


def near_poles(loop: FaultLoop, frequency: RealArray, poles: ComplexArray) -> RealArray:
    """A grid [Hz] (F,) with frequencies added near poles [rad/s], closer for less damping."""
    upper = poles[poles.imag > 0.0]
    near = (upper.imag[:, None] + upper.real[:, None] * np.linspace(-3.0, 3.0, 13)).ravel()
    found = np.interp(near, loop.warped_omega(frequency), frequency)
    return np.union1d(frequency, found)


def _rows(basis: ComplexArray, weight: RealArray) -> ComplexArray:
    return basis * weight[:, None]
