"""Stadiums for a given controller: weights that cover the drives where they hurt its loop least.

With T = L / (1 + L) of a controller, mu of its loop is that of `least_mu.LoopWeights`. The
narrowest stadium is not the one of least mu: the real weight is chosen for the least largest mu of
the sets that it needs about it, and the complex weight exceeds them where mu leaves room for it.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from scipy.optimize import minimize

from workbench.executor import Context
from workbench.fitting.rational import Complex, Rational, Real
from workbench.fitting.sections import Sections
from workbench.uncertainty import Responses, UncertaintyModel
from workbench.uncertainty.weights import (
    between,
    beyond,
    complex_weight,
    damped,
    needed_radius,
    resolved,
)

from .least_mu import LoopWeights
from .tables import Axis

if TYPE_CHECKING:
    from control import StateSpace

POWERS = (8, 32, 128)
"""Of the norms over frequency that stand for the largest mu, one after the other."""
STEPS = 100
EXTRA = 0.05
"""By which W_c may raise the largest mu, relative, before that counts."""
ROOM = 0.03
"""Least excess of the radius that counts as room, relative."""
OUTWARD = 1e-9
"""Of radii, relative to the plants: what a response rounds to."""


class ControlCover:
    """Models G (1 + W_c delta_c + W_r delta_r) of measured responses about a nominal G.

    Parameters
    ----------
    responses
        Of the drives, u [V] -> f_en [units].
    complex_order
        Of W_c; that of W_r is its start's.
    """

    def __init__(
        self, axis: Axis, speed: float, responses: Responses, nominal: Rational, complex_order: int
    ) -> None:
        self.axis, self.speed, self.nominal = axis, speed, nominal
        self.responses, self.complex_order = responses, complex_order
        G = nominal.response(responses.omega)
        self.away = responses.values / G[:, None] - 1
        self.rounding = OUTWARD * (1 + np.abs(responses.values).max(axis=1) / np.abs(G))
        # Weights go on between the responses' frequencies and beyond them.
        inside = np.concatenate([responses.omega, between(responses.omega)])
        self.omega = beyond(np.unique(inside))

    def model(self, K: StateSpace, start: Rational, context: Context) -> UncertaintyModel:
        """The model for a controller, its real weight near one to start from."""
        T, loop = self.complementary(K), self.loop()
        W_r = self._real_weight(T, loop, start, context)
        omega, end = self.responses.omega, W_r.response(self.omega)
        radius = self.radius(W_r.response(omega))
        # What |W_c| may be where mu is at most a little above its largest.
        peak = float(replace(loop, real=end, circular=self.lasting(radius)).mu(T).max())
        most = _largest_radius(T, replace(loop, real=end), (1 + EXTRA) * peak)
        room = np.interp(np.log(omega), np.log(self.omega), most) / radius - 1
        weight = 1 / np.maximum(room, ROOM)
        W_c = complex_weight(omega, radius, weight, self.complex_order, context)
        return UncertaintyModel(self.nominal, W_c, W_r)

    def complementary(self, K: StateSpace) -> Complex:
        """T (F,) of the nominal loop."""
        from .drives import ANTIALIASING

        s = 1j * self.omega
        L = K(s) * self.nominal.response(self.omega) / (1 + s / ANTIALIASING)
        return np.asarray(L / (1 + L))

    def loop(self) -> LoopWeights:
        """The weights of performance, without uncertainty."""
        none = Rational(np.empty(0, complex), np.empty(0, complex), 0.0)
        model = UncertaintyModel(self.nominal, none)
        return LoopWeights.of(self.axis, model, self.speed, self.omega)

    def lasting(self, radius: Real) -> Real:
        """Radii at the responses' frequencies, between them and beyond."""
        log = np.log(self.responses.omega)
        return np.asarray(np.exp(np.interp(np.log(self.omega), log, np.log(radius))))

    def radius(self, end: Complex) -> Real:
        """|W_c| that segments need, both at the responses' frequencies."""
        return np.asarray(needed_radius(self.away, end) + self.rounding)

    def _real_weight(
        self, T: Complex, loop: LoopWeights, start: Rational, context: Context
    ) -> Rational:
        band = float(self.omega[0]), float(self.omega[-1])
        sections = Sections.of(start, start.order, band, stable=True, minimum_phase=False)
        x = sections.start
        units = np.maximum(np.abs(x), 1e-3)

        def largest(y: Real, power: int) -> float:
            end = sections.response(y * units, self.omega)
            if not np.isfinite(end).all():
                return np.inf
            radius = self.lasting(self.radius(sections.response(y * units, self.responses.omega)))
            mu = replace(loop, real=end, circular=radius).mu(T)
            top = float(mu.max())
            return top * float(np.mean((mu / top) ** power)) ** (1 / power)

        y = x / units
        for power in context.track(POWERS, "real weight"):
            y = minimize(largest, y, (power,), "BFGS", options={"maxiter": STEPS}).x
        omega = self.responses.omega
        return damped(resolved(sections.rational(y * units), omega), omega)


def _largest_radius(T: Complex, loop: LoopWeights, level: float) -> Real:
    """|W_c| (F,) with which mu is the level: level * min |1 - x W_r T| over |x| <= 1 / level is
    what circles and performance may have together."""
    c = loop.real * T
    square = np.maximum(np.abs(c) ** 2, np.finfo(float).tiny)
    x = np.clip(c.real / square, -1 / level, 1 / level)
    outputs = np.hypot(loop.performance * np.abs(1 - T), loop.control * np.abs(T))
    left = level * np.abs(1 - x * c) - outputs
    return np.asarray(left / np.maximum(np.abs(T), np.finfo(float).tiny))
