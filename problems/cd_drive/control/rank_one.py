"""Mu of one disturbance channel of a CD drive's loop in closed form, and of sets without a fit.

For a single channel w -> z the loop's N is of rank one: with c_k = N_kk, I - N Delta is singular
where sum of delta_k c_k = 1, and with one real scalar, a complex one and the channel's own

    mu = 1 / min { t : |1 - x c_r| <= t (|c_c| + |c_z|), |x| <= t, x real }.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from workbench.arrays import ComplexArray, RealArray
from workbench.fitting.rational import Rational
from workbench.geometry import Stadium
from workbench.heavy_types import StateSpace
from workbench.uncertainty import UncertaintyModel, cheapest
from workbench.uncertainty.covers.sets import stadiums_about_nominal

from ..drive.tables import Axis
from .control_problem import generalised

NONE = np.empty(0, complex)
CHANNELS = {"disturbance": ("w_p", "z_p"), "control": ("w_u", "z_u")}
"""Exogenous input and performance output of each channel."""


def rank_one_mu(real: ComplexArray, others: RealArray) -> RealArray:
    """Mu of c_r (...) of a real scalar and the sum (...) of |c_k| of complex ones.

    Where the best x is inside, |x| < t, the distance of 1 from the line through c_r counts; on the
    end |x| = t, (mu - |Re c_r|)^2 + (Im c_r)^2 = others^2.
    """
    along, across, size = np.abs(real.real), np.abs(real.imag), np.abs(real)
    at_end = others * along >= across * size
    with np.errstate(divide="ignore", invalid="ignore"):
        inside = others * size / across
    end = along + np.sqrt(np.maximum(others**2 - across**2, 0.0))
    return np.where(at_end, end, inside)


@dataclass(frozen=True)
class Channel:
    """c_u and c_z (F,) of a loop: of an uncertainty of size 1, and of the channel."""

    uncertain: ComplexArray
    performance: ComplexArray

    def mu(self, sets: Stadium) -> RealArray:
        """Mu over multiplicative sets (F, ...) about the nominal, without a fit of weights."""
        uncertain, performance = (
            part.reshape(part.shape + (1,) * (sets.radius.ndim - 1))
            for part in (self.uncertain, self.performance)
        )
        segment = sets.half_length * np.exp(1j * sets.angle)
        return rank_one_mu(
            segment * uncertain, sets.radius * np.abs(uncertain) + np.abs(performance)
        )

    def for_mu(self, omega: RealArray, away: ComplexArray) -> Stadium:
        """Stadiums around deviations (F, N) from the nominal, oriented for this loop's mu.

        The best of the candidates of `cheapest` and the narrowest.
        """

        def cost(
            _: RealArray, angle: RealArray, radius: RealArray, half_length: RealArray
        ) -> RealArray:
            every = np.broadcast_to(angle, radius.shape)
            return self.mu(Stadium(np.zeros(radius.shape, complex), radius, half_length, every))

        narrow = stadiums_about_nominal(away)
        angle = cheapest(cost, 0.0)(omega, away)
        better = self.mu(narrow) <= self.mu(stadiums_about_nominal(away, angle))
        return stadiums_about_nominal(away, np.where(better, narrow.angle, angle))


def channel_of(
    axis: Axis, nominal: Rational, K: StateSpace, name: str, speed: float, omega: RealArray
) -> Channel:
    """A loop's channel at frequencies [rad/s] (F,), about a nominal plant u -> f_en."""
    exogenous, performance = CHANNELS[name]
    plant = generalised(axis, UncertaintyModel(nominal, Rational(NONE, NONE, 1.0)), speed)
    N = plant.close(K)
    response = np.moveaxis(N(1j * omega, squeeze=False), -1, 0)
    z, w = N.output_labels.index(performance), N.input_labels.index(exogenous)
    return Channel(response[:, 0, 0], response[:, z, w])
