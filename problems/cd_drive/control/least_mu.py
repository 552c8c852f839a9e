"""The least mu that any controller leaves at a frequency: a bound that no design can beat.

All that K = K(j w) does to a drive's loop of w_p -> (z_p, z_u) is the complex number
T = L / (1 + L), and every T has its K. Mu is that of `rank_one`, with c_r = -W_r T and the sum of
the others |W_c T| + |(W_p (1 - T), W_u T / ACT)|, convex in T. The distance of a point from a
segment is a largest projection, so that mu is the least over phi of

    (|Re(exp(-j phi) W_r T)| + |W_c T| + |(W_p (1 - T), W_u T / ACT)|) / cos(phi).

With A = |(W_p, W_u / ACT)| and T turned by psi its least over |T| is

    W_p sin(min(zeta + kappa, pi / 2)) / cos(phi),  cos(zeta) = W_p cos(psi) / A,
    sin(kappa) = (|W_c| + |W_r| sin(delta - psi - phi)) / A,

delta being the angle of W_r T from the imaginary axis at psi = 0, where the real scalar does least.
Both turn W_r T towards that axis: phi and psi are not negative, and together delta at most.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from workbench.arrays import ComplexArray, RealArray
from workbench.errors import InputError
from workbench.uncertainty import UncertaintyModel

from ..drive.tables import Axis
from .control_problem import control_weight, optical_gain, performance_weight
from .rank_one import rank_one_mu

QUARTERS = ((0, 0), (0, 1), (1, 0), (1, 1))
"""Of a box of psi and phi."""
HALVINGS = 40
"""Of boxes; without circular part and control weight mu may jump, and no number would do."""


@dataclass(frozen=True)
class LoopWeights:
    """What mu of w_p -> (z_p, z_u) depends on beside T, at frequencies (F,), and its angles.

    ``performance`` |W_p|, ``control`` |W_u / ACT| and ``circular`` |W_c|, the first positive, the
    others not negative; ``real`` W_r, complex, 0 for circles.

    Raises InputError for others.
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
    def of(cls, axis: Axis, model: UncertaintyModel, speed: float, omega: ArrayLike) -> LoopWeights:
        """Those of a drive and its circles or stadiums at frequencies [rad/s] (F,)."""
        omega = np.asarray(omega, dtype=float)
        s = 1j * omega
        actuator = model.nominal.response(omega) / optical_gain(axis)
        return cls(
            np.abs(performance_weight(axis, speed)(s)),
            np.abs(control_weight(axis)(s) / actuator),
            np.abs(model.W_c.response(omega)),
            np.zeros(omega.shape, complex) if model.W_r is None else model.W_r.response(omega),
        )

    def at(self, k: NDArray[np.intp]) -> LoopWeights:
        """Those of some of the frequencies."""
        return LoopWeights(self.performance[k], self.control[k], self.circular[k], self.real[k])

    def mu(self, T: ComplexArray) -> RealArray:
        """Mu of the loops with T (F,), or (..., F)."""
        outputs = np.hypot(self.performance * np.abs(1 - T), self.control * np.abs(T))
        found: RealArray = rank_one_mu(self.real * T, self.circular * np.abs(T) + outputs)
        return found

    @property
    def delta(self) -> RealArray:
        """Angle of W_r from the imaginary axis [rad]; 0 for circles."""
        angle = np.arctan2(np.abs(self.real.real), np.abs(self.real.imag))
        return np.where(self.real == 0.0, 0.0, angle)

    def zeta(self, psi: RealArray) -> RealArray:
        along, across = self.performance * np.cos(psi), self.performance * np.sin(psi)
        return np.arctan2(np.hypot(self.control, across), along)

    def kappa(self, turned: RealArray) -> RealArray:
        """Where phi and psi together are `turned`."""
        left = np.abs(self.real) * np.sin(np.maximum(self.delta - turned, 0.0))
        whole = np.hypot(self.performance, self.control)
        return np.arcsin(np.minimum((self.circular + left) / whole, 1.0))

    def best(self, psi: RealArray, turned: RealArray) -> ComplexArray:
        """T of least mu for these angles."""
        zeta, kappa = self.zeta(psi), self.kappa(turned)
        share = self.performance / np.hypot(self.performance, self.control)
        modulus = share * np.maximum(np.cos(zeta + kappa), 0.0) / np.cos(kappa)
        towards = np.where(self.real.real * self.real.imag < 0.0, -1.0, 1.0)
        return np.asarray(modulus * np.exp(1j * towards * psi), dtype=complex)


@dataclass(frozen=True)
class LeastMu:
    """No K has mu below ``lower`` (F,); that with ``T`` (F,) has ``upper`` (F,)."""

    lower: RealArray
    upper: RealArray
    T: ComplexArray


def least_mu(weights: LoopWeights, tolerance: float = 1e-3) -> LeastMu:
    """The least mu over all complex K, frequency by frequency, by branch and bound.

    Zeta rises with psi, kappa falls with psi + phi, and cos(phi) falls: on a box of both angles mu
    has at least zeta of its least psi, kappa of its largest angles and the cosine of its least phi.

    Parameters
    ----------
    tolerance
        Relative distance of the two bounds.

    Raises
    ------
    InputError
        A tolerance that is not above 0 and below 1.
    """
    if not 0.0 < tolerance < 1.0:
        raise InputError(f"tolerance is {tolerance}; it must lie between 0 and 1")
    upper = weights.performance.copy()  # of T = 0
    lower, T = np.full(upper.shape, np.inf), np.zeros(upper.shape, complex)
    k = np.arange(len(upper))
    boxes = np.stack([np.zeros(upper.shape), np.zeros(upper.shape), weights.delta])
    for _ in range(HALVINGS):
        part = weights.at(k)
        psi, phi, width = boxes
        for turned in (psi + phi, psi + phi + width):
            trial = part.best(psi, turned)
            mu = part.mu(trial)
            np.minimum.at(upper, k, mu)
            found = mu == upper[k]
            T[k[found]] = trial[found]
        angle = part.zeta(psi) + part.kappa(psi + phi + 2 * width)
        least = part.performance * np.sin(np.minimum(angle, np.pi / 2)) / np.cos(phi)
        done = least >= (1.0 - tolerance) * upper[k]
        np.minimum.at(lower, k[done], least[done])
        quarters = [boxes[:, ~done] * [[1], [1], [0.5]] for _ in QUARTERS]
        for quarter, (right, up) in zip(quarters, QUARTERS, strict=True):
            quarter[:2] += quarter[2] * [[right], [up]]
        boxes = np.concatenate(quarters, axis=1)
        k, least = np.tile(k[~done], len(QUARTERS)), np.tile(least[~done], len(QUARTERS))
        inside = boxes[0] + boxes[1] <= weights.delta[k]
        k, least, boxes = k[inside], least[inside], boxes[:, inside]
        if not len(k):
            break
    np.minimum.at(lower, k, least)
    return LeastMu(np.minimum(lower, upper), upper, T)


def largest_least_mu(
    weights: Callable[[RealArray], LoopWeights], omega: RealArray, rounds: int = 3
) -> tuple[float, float]:
    """A lower bound of every controller's peak, and its frequency [rad/s].

    The largest `lower` at `omega` (F,) [rad/s], increasing, and closer and closer around it.
    """
    lower = least_mu(weights(omega)).lower
    for _ in range(rounds):
        k = int(lower.argmax())
        low, high = omega[max(k - 1, 0)], omega[min(k + 1, len(omega) - 1)]
        omega = np.unique(np.append(np.geomspace(low, high, 16), omega[k]))
        lower = least_mu(weights(omega)).lower
    k = int(lower.argmax())
    return float(lower[k]), float(omega[k])
