"""Stadiums for a loop: weights that cover the drives where they hurt it least.

With T = L / (1 + L) of a controller, mu of its loop is that of `least_mu.LoopWeights`, with the
radius that the drives need about a real weight. The narrowest stadium is not the one of least mu:
here the real weight is chosen for it, alone or together with nominal and controller, and the
complex weight then exceeds the radius where mu leaves room for it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Literal, NamedTuple

import numpy as np
from scipy.optimize import minimize

from workbench.arrays import ComplexArray, RealArray
from workbench.executor import Context
from workbench.fitting.factored import FactoredRational
from workbench.fitting.rational import Rational
from workbench.uncertainty import Responses, UncertaintyModel
from workbench.uncertainty.covers.weights import (
    between,
    beyond,
    complex_weight,
    damped,
    needed_radius,
    resolved,
)

from ...drive.plants import ANTIALIASING
from ...drive.tables import Axis
from ..control_problem import LEAK, control_weight, optical_gain, performance_weight
from ..least_mu import LoopWeights

POWERS = (8, 32, 128)
"""Of the norms over frequency that stand for the largest mu, one after the other."""
STEPS = 100
EXTRA = 0.05
"""By which W_c may raise the largest mu, relative, before that counts."""
ROOM = 0.03
"""Least excess of the radius that counts as room, relative."""
OUTWARD = 1e-9
"""Of radii, relative to the plants: what a response rounds to."""
PER_DECADE = 10
"""Frequencies where no response is known."""
UNSTABLE = 1e6
"""What an unstable loop counts as: differences of infinities are no slopes."""
LEAST_UNIT = 1e-3
"""Of a parameter that starts near zero."""

Name = Literal["nominal", "real", "controller"]


class Loop(NamedTuple):
    """What mu depends on, over the frequencies (F,) of a `ControlCover`."""

    T: ComplexArray
    weights: LoopWeights
    radius: RealArray


class ControlCover:
    """Models G (1 + W_c delta_c + W_r delta_r) of measured responses, chosen for a loop.

    Parameters
    ----------
    responses
        Of the drives, u [V] -> f_en [units].
    complex_order
        Of W_c.
    """

    def __init__(self, axis: Axis, speed: float, responses: Responses, complex_order: int) -> None:
        self.axis, self.responses, self.complex_order = axis, responses, complex_order
        # Weights go on between the responses' frequencies and beyond them, to the slowest pole of
        # W_p and past the fastest of a controller.
        low, high = LEAK / 10, beyond(responses.omega)[-1]
        outside = np.geomspace(low, high, round(PER_DECADE * np.log10(high / low)))
        inside = np.concatenate([responses.omega, between(responses.omega)])
        outside = outside[(outside < inside.min()) | (outside > inside.max())]
        self.omega = np.unique(np.concatenate([inside, outside]))
        s = 1j * self.omega
        self._performance = np.abs(performance_weight(axis, speed)(s))
        self._control = np.abs(control_weight(axis)(s)) * optical_gain(axis)
        self._filter = 1 / (1 + s / ANTIALIASING)

    def chosen(
        self, parts: dict[Name, Rational], moving: Sequence[Name], context: Context
    ) -> Iterator[dict[Name, Rational]]:
        """Nominal, real weight and controller, those that move chosen for the least largest mu.

        They stay stable, with as many poles and zeros as they have; the controller keeps its zeros
        on the left, and the nominal loop stable. One choice for each of `POWERS`, from the one
        before: the last is the best for the radii that are needed, and for a weight that is fitted
        to them another may be.
        """
        band = float(self.omega[0]), float(self.omega[-1])
        sections = {
            name: FactoredRational.of(
                parts[name], len(parts[name].zeros), band, True, name == "controller"
            )
            for name in moving
        }
        starts = [part.start for part in sections.values()]
        ends = np.cumsum([len(start) for start in starts])[:-1]
        x = np.concatenate(starts)
        units = np.maximum(np.abs(x), LEAST_UNIT)
        grids = self.omega, self.responses.omega
        held = {name: [part.response(grid) for grid in grids] for name, part in parts.items()}

        def largest(y: RealArray, power: int) -> float:
            vectors = zip(sections.items(), np.split(y * units, ends), strict=True)
            moved = {
                name: [part.response(vector, grid) for grid in grids]
                for (name, part), vector in vectors
            }
            return _norm(self._loop(held | moved), power)

        y = x / units
        for power in context.track(POWERS, " and ".join(moving)):
            y = minimize(largest, y, (power,), "BFGS", options={"maxiter": STEPS}).x
            vectors = zip(sections.items(), np.split(y * units, ends), strict=True)
            found = {name: part.rational(vector) for (name, part), vector in vectors}
            if "real" in found:
                omega = self.responses.omega
                found["real"] = damped(resolved(found["real"], omega), omega)
            yield parts | found

    def loop(self, parts: dict[Name, Rational]) -> Loop | None:
        """The loop of these parts; None where the nominal one is unstable."""
        grids = self.omega, self.responses.omega
        return self._loop(
            {name: [part.response(grid) for grid in grids] for name, part in parts.items()}
        )

    def model(self, parts: dict[Name, Rational], context: Context) -> UncertaintyModel:
        """The model about nominal and real weight, its complex weight for the controller's loop."""
        loop = self.loop(parts)
        assert loop is not None  # `best` starts and ends at stable ones
        omega = self.responses.omega
        # What |W_c| may be where mu is at most a little above its largest.
        most = _largest_radius(loop.T, loop.weights, (1 + EXTRA) * loop.weights.mu(loop.T).max())
        log = np.log(self.omega)
        radius, most = (np.interp(np.log(omega), log, values) for values in (loop.radius, most))
        weight = 1 / np.maximum(most / radius - 1, ROOM)
        nominal, W_r = parts["nominal"], parts["real"]
        needed = self._radius(nominal.response(omega), W_r.response(omega))
        W_c = complex_weight(omega, needed, weight, self.complex_order, context)
        return UncertaintyModel(nominal, W_c, W_r)

    def _loop(self, values: dict[Name, list[ComplexArray]]) -> Loop | None:
        """From responses of the parts at our frequencies and at the drives'."""
        (G, at), (real, end), (K, _) = (values[name] for name in ("nominal", "real", "controller"))
        radius = self._radius(at, end)
        lasting = np.exp(
            np.interp(np.log(self.omega), np.log(self.responses.omega), np.log(radius))
        )
        L = K * G * self._filter
        if not np.isfinite(L).all() or _encirclements(L):
            return None
        weights = LoopWeights(self._performance, self._control / np.abs(G), lasting, real)
        return Loop(L / (1 + L), weights, lasting)

    def _radius(self, nominal: ComplexArray, end: ComplexArray) -> RealArray:
        """|W_c| that segments need at the drives' frequencies."""
        values = self.responses.values
        away = values / nominal[:, None] - 1
        rounding = OUTWARD * (1 + np.abs(values).max(axis=1) / np.abs(nominal))
        return np.asarray(needed_radius(away, end) + rounding)


def _norm(loop: Loop | None, power: int) -> float:
    """The largest mu, smoothed: its mean of a power over frequency."""
    if loop is None:
        return UNSTABLE
    mu = loop.weights.mu(loop.T)
    top = float(mu.max())
    return top * float(np.mean((mu / top) ** power)) ** (1 / power)


def _encirclements(L: ComplexArray) -> int:
    """Of -1 by L over frequencies of either sign, where it vanishes at the last."""
    back = 1 + L
    turned = np.angle(back[0]) + np.angle(back[1:] / back[:-1]).sum()
    return round(float(turned) / np.pi)


def _largest_radius(T: ComplexArray, loop: LoopWeights, level: float) -> RealArray:
    """|W_c| (F,) with which mu is the level: level * min |1 - x W_r T| over |x| <= 1 / level is
    what circles and performance may have together."""
    c = loop.real * T
    square = np.maximum(np.abs(c) ** 2, np.finfo(float).tiny)
    x = np.clip(c.real / square, -1 / level, 1 / level)
    outputs = np.hypot(loop.performance * np.abs(1 - T), loop.control * np.abs(T))
    left = level * np.abs(1 - x * c) - outputs
    return np.asarray(left / np.maximum(np.abs(T), np.finfo(float).tiny))
