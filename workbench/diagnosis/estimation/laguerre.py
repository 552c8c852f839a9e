"""Laguerre basis of T = F S, the estimate of a fault in a loop, and the filters F = T / S."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.diagnosis.estimation.fault_loop import FaultLoop
from workbench.fitting.rational import Rational, conjugate_pairs
from workbench.input_checks import need_positive
from workbench.systems.realisation import realisation


@dataclass(frozen=True, eq=False)
class LaguerreBasis:
    """Functions for T: zero at the loop's integrators, then all-pass factors with one pole.

    corner: -pole [rad/s]. Raises InputError unless it is positive.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.diagnosis import EstimationDemands, FaultLoop, LaguerreBasis
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
    >>> basis = LaguerreBasis(loop, corner=1.0)
    >>> bool(basis.filter(np.ones(3)).poles().real.max() < 0)
    True
    """

    loop: FaultLoop
    corner: float

    def __post_init__(self) -> None:
        need_positive(self.corner, "corner")

    def response(self, omega: RealArray, count: int) -> ComplexArray:
        """Responses (F, count) of the first functions at omega [rad/s]."""
        s = 1j * omega[:, None]
        zero = (s + self.loop.slowest_pole) / (s + self.corner)
        every = zero * ((s - self.corner) / (s + self.corner)) ** np.arange(count)
        return np.asarray(every, complex)

    def filter(self, coefficients: RealArray) -> StateSpace:
        """F = T / S for coefficients (count,); the zero of T cancels the integrators in 1 / S."""
        corner = self.corner
        root, n = np.sqrt(2 * corner), len(coefficients) - 1
        # z_k = (s - a) / (s + a) z_(k-1) = z_(k-1) - sqrt(2 a) x_k.
        A = -corner * (np.eye(n) + 2 * np.tril(np.ones((n, n)), -1))
        left = np.cumsum(coefficients[::-1])[::-1]
        C, D = -root * left[1:][None, :], np.array([[left[0]]])
        ladder = realisation((A, root * np.ones((n, 1)), C, D), 0.0)
        return ladder * self._inverse_sensitivity().state_space()

    def _inverse_sensitivity(self) -> Rational:
        """(1 + L) (s + slowest pole) / (s + corner)."""
        loop = self.loop
        L = loop.nominal * loop.controller
        direct = 1.0 + float(L.D[0, 0])
        zeros = np.linalg.eigvals(L.A - L.B @ L.C / direct)
        poles = np.concatenate([loop.controller.poles(), loop.nominal.poles()])
        poles[np.argmin(np.abs(poles))] = -self.corner
        return Rational(conjugate_pairs(zeros), conjugate_pairs(poles), direct)
