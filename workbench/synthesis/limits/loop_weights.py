"""Weights of a single loop, and its mu as a function of the complementary sensitivity T.

With one disturbance w, e = w - G u, u = K e, L = G K and T = L / (1 + L), the outputs are

    z_p = W_p (1 - T) w      z_u = (W_u / G) T w

and the uncertain plant is G (1 + W_c delta_c + W_r delta_r), where delta_r is real. So mu of the
loop depends on the controller only through the complex number T.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench._core.arrays import Array, ComplexArray, RealArray
from workbench.errors import InputError
from workbench.mu.robust.rank_one import rank_one_mu
from workbench.uncertainty import UncertaintyModel


@dataclass(frozen=True)
class LoopWeights:
    """Weights that, together with T, determine mu of w -> (z_p, z_u) at frequencies (F,).

    A single number holds for every frequency. Raises InputError if a weight is not finite, if the
    performance weight is not positive, or if another weight is negative.

    Parameters
    ----------
    performance, control, circular
        |W_p|, |W_u / G| and |W_c| (F,).
    real
        W_r (F,), complex; 0 for a model of circles.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.synthesis import LoopWeights
    >>> weights = LoopWeights(
    ...     np.array([0.5]), np.array([0.2]), np.array([0.1]), np.array([0.3 + 0j])
    ... )
    >>> float(weights.mu(np.array([0.0 + 0j]))[0])  # without a controller: |W_p|
    0.5
    """

    performance: RealArray
    control: RealArray
    circular: RealArray
    real: ComplexArray

    def __post_init__(self) -> None:
        names = ("performance", "control", "circular", "real")
        parts = np.broadcast_arrays(*(np.atleast_1d(getattr(self, name)) for name in names))
        for name, values in zip(names, parts, strict=True):
            kind = complex if name == "real" else float
            object.__setattr__(self, name, values.astype(kind))
            if not np.isfinite(values).all():
                raise InputError(f"{name} must be finite at every frequency")
            least = 0.0 if name == "real" else float(values.min(initial=np.inf))
            if least < 0.0 or (name == "performance" and least == 0.0):
                raise InputError(f"{name} has the size {least:.3g}; sizes are positive")

    @classmethod
    def of(
        cls, model: UncertaintyModel, performance: Array, control: Array, omega: ArrayLike
    ) -> LoopWeights:
        """The weights of an uncertain plant at frequencies [rad/s] (F,).

        Parameters
        ----------
        model
            Multiplicative model: circles or stadiums around the nominal.
        performance, control
            Responses of W_p and W_u / G (F,); only their magnitudes are used.
        """
        omega = np.asarray(omega, dtype=float)
        if model.form != "multiplicative":
            raise InputError(f"the model is {model.form}; a multiplicative one is needed")
        return cls(
            np.abs(performance),
            np.abs(control),
            np.abs(model.W_c.response(omega)),
            np.zeros(omega.shape, complex) if model.W_r is None else model.W_r.response(omega),
        )

    def at(self, k: NDArray[np.intp]) -> LoopWeights:
        """The weights at some of the frequencies, by index."""
        return LoopWeights(self.performance[k], self.control[k], self.circular[k], self.real[k])

    def mu(self, T: ComplexArray) -> RealArray:
        """Mu of the loops with complementary sensitivity T (F,) or (..., F)."""
        return loop_mu(T, self.performance, self.control, self.circular, self.real)

    @property
    def delta(self) -> RealArray:
        """Angle of W_r from the imaginary axis [rad]; 0 for a model of circles."""
        angle = np.arctan2(np.abs(self.real.real), np.abs(self.real.imag))
        return np.where(self.real == 0.0, 0.0, angle)

    def zeta(self, psi: RealArray) -> RealArray:
        """The angle zeta of `least_mu` [rad], for T turned by psi."""
        along, across = self.performance * np.cos(psi), self.performance * np.sin(psi)
        return np.arctan2(np.hypot(self.control, across), along)

    def kappa(self, turned: RealArray) -> RealArray:
        """The angle kappa of `least_mu` [rad], for phi + psi = `turned`."""
        left = np.abs(self.real) * np.sin(np.maximum(self.delta - turned, 0.0))
        whole = np.hypot(self.performance, self.control)
        return np.arcsin(np.minimum((self.circular + left) / whole, 1.0))

    def best(self, psi: RealArray, turned: RealArray) -> ComplexArray:
        """The T with the least mu for these angles."""
        zeta, kappa = self.zeta(psi), self.kappa(turned)
        share = self.performance / np.hypot(self.performance, self.control)
        modulus = share * np.maximum(np.cos(zeta + kappa), 0.0) / np.cos(kappa)
        towards = np.where(self.real.real * self.real.imag < 0.0, -1.0, 1.0)
        return np.asarray(modulus * np.exp(1j * towards * psi), dtype=complex)

    def largest_circular(self, T: ComplexArray, level: float) -> RealArray:
        """|W_c| (F,) for which mu of the loops with T (F,) equals a level; negative if there is
        none.

        The circular part and the performance part of mu together may be at most level * min |1 - x
        W_r T| over real |x| <= 1 / level.
        """
        c = self.real * T
        square = np.maximum(np.abs(c) ** 2, np.finfo(float).tiny)
        x = np.clip(c.real / square, -1 / level, 1 / level)
        outputs = np.hypot(self.performance * np.abs(1 - T), self.control * np.abs(T))
        left = level * np.abs(1 - x * c) - outputs
        return np.asarray(left / np.maximum(np.abs(T), np.finfo(float).tiny))


def loop_mu(
    T: ComplexArray,
    performance: RealArray,
    control: RealArray,
    circular: RealArray,
    real: ComplexArray,
) -> RealArray:
    """Mu (F,) of loops with complementary sensitivity T (F,) and weights as in `LoopWeights`."""
    outputs = np.hypot(performance * np.abs(1 - T), control * np.abs(T))
    found: RealArray = rank_one_mu(real * T, circular * np.abs(T) + outputs)
    return found
