"""Uncertainty covers for a loop: weights that contain the plants where they hurt the loop least.

With T = L / (1 + L) of a controller, mu of its loop is that of `LoopWeights`, with the radius that
the plants need about a real weight. The narrowest stadium is not the one of least mu: here the
real weight is chosen for mu, alone or together with nominal and controller, and the complex weight
then exceeds the radius where mu leaves room for it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from typing import Literal, NamedTuple

import numpy as np
from scipy.optimize import minimize

from workbench.arrays import Array, ComplexArray, RealArray
from workbench.errors import InputError
from workbench.executor import Context
from workbench.fitting.factored import FactoredRational
from workbench.fitting.rational import Rational
from workbench.synthesis.limits.loop_weights import LoopWeights
from workbench.uncertainty import Responses, UncertaintyModel
from workbench.uncertainty.covers.everywhere import covering_weight
from workbench.uncertainty.covers.weights import (
    between,
    beyond,
    damped,
    needed_radius,
    resolved,
)

POWERS = (8, 32, 128)
"""Powers of the means over frequency that stand for the largest mu, one after the other."""
COVER_BFGS_STEPS = 100
"""Largest number of steps of BFGS for each power."""
COMPLEX_EXCESS = 0.05
"""Relative rise of the largest mu that an excess of W_c may cause before it counts."""
RADIUS_ROOM = 0.03
"""Least relative margin of the useful |W_c| over the radius; it caps the weight of the fit."""
RESPONSE_ROUNDING = 1e-9
"""Rounding of a response, relative to the plants, that radii are increased by."""
PER_DECADE = 10
"""Frequencies per decade where no response is known."""
UNSTABLE_MU = 1e6
"""Mu assigned to an unstable loop; infinity would leave the optimiser no slope."""
LEAST_UNIT = 1e-3
"""Unit of a parameter that starts near zero."""

Weight = Callable[[RealArray], Array]
"""Response of a known system at frequencies [rad/s] (F,)."""

Name = Literal["nominal", "real", "controller"]


class LoopData(NamedTuple):
    """Quantities that mu depends on, at the frequencies (F,) of a `ControlCover`."""

    T: ComplexArray
    weights: LoopWeights
    radius: RealArray


class ControlCover:
    """Models G (1 + W_c delta_c + W_r delta_r) of measured responses, chosen for a loop.

    The loop is e = w - G u, u = K sensor e, with the outputs W_p e and W_u u.

    Parameters
    ----------
    responses
        Responses of the plants, from u to the place where w enters.
    complex_order
        Order of W_c.
    performance, control
        W_p and W_u, of which the magnitudes count.
    sensor
        Known dynamics between e and the controller.
    lowest
        Lowest frequency [rad/s] at which mu is looked at, below the slowest pole of W_p.
    """

    def __init__(
        self,
        responses: Responses,
        complex_order: int,
        *,
        performance: Weight,
        control: Weight,
        sensor: Weight,
        lowest: float,
    ) -> None:
        self.responses, self.complex_order = responses, complex_order
        # Weights go on between the responses' frequencies and beyond them, to the slowest pole of
        # W_p and past the fastest of a controller.
        low, high = lowest, beyond(responses.omega)[-1]
        outside = np.geomspace(low, high, round(PER_DECADE * np.log10(high / low)))
        inside = np.concatenate([responses.omega, between(responses.omega)])
        outside = outside[(outside < inside.min()) | (outside > inside.max())]
        self.omega = np.unique(np.concatenate([inside, outside]))
        self._performance = np.abs(performance(self.omega))
        self._control = np.abs(control(self.omega))
        self._sensor = sensor(self.omega)

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
            y = minimize(largest, y, (power,), "BFGS", options={"maxiter": COVER_BFGS_STEPS}).x
            vectors = zip(sections.items(), np.split(y * units, ends), strict=True)
            found = {name: part.rational(vector) for (name, part), vector in vectors}
            if "real" in found:
                omega = self.responses.omega
                found["real"] = damped(resolved(found["real"], omega), omega)
            yield parts | found

    def loop(self, parts: dict[Name, Rational]) -> LoopData | None:
        """The loop of these parts; None where the nominal one is unstable.

        Stability is read from the encirclements of -1, for a stable nominal and controller with
        L(0) > -1 or one integrator.
        """
        grids = self.omega, self.responses.omega
        return self._loop(
            {name: [part.response(grid) for grid in grids] for name, part in parts.items()}
        )

    def model(self, parts: dict[Name, Rational], context: Context) -> UncertaintyModel:
        """The model about nominal and real weight, with a complex weight for the controller's loop.

        It contains the known plants of the responses at every frequency, the others at theirs.

        Raises InputError for a controller with which the nominal loop is unstable.
        """
        loop = self.loop(parts)
        if loop is None:
            raise InputError("the nominal loop is unstable with this controller: start at another")
        # What |W_c| may be where mu is at most a little above its largest.
        most = loop.weights.largest_circular(
            loop.T, (1 + COMPLEX_EXCESS) * loop.weights.mu(loop.T).max()
        )
        nominal, W_r = parts["nominal"], parts["real"]

        def share(omega: RealArray, radius: RealArray, _: RealArray) -> RealArray:
            """Weight of an excess: the less room there is over the radius, the more it counts."""
            room = np.interp(np.log(omega), np.log(self.omega), most / loop.radius)
            return 1 / np.maximum(room - 1, RADIUS_ROOM)

        W_c = covering_weight(
            self.responses,
            self.responses.points / nominal.response(self.responses.omega)[:, None] - 1,
            nominal,
            W_r,
            "multiplicative",
            self.complex_order,
            share,
            RESPONSE_ROUNDING,
            True,
            context,
        )
        return UncertaintyModel(nominal, W_c, W_r)

    def _loop(self, values: dict[Name, list[ComplexArray]]) -> LoopData | None:
        """From responses of the parts at the cover's frequencies and at the responses'."""
        (G, at), (real, end), (K, _) = (values[name] for name in ("nominal", "real", "controller"))
        radius = self._radius(at, end)
        lasting = np.exp(
            np.interp(np.log(self.omega), np.log(self.responses.omega), np.log(radius))
        )
        L = K * G * self._sensor
        if not np.isfinite(L).all() or _encirclements(L):
            return None
        weights = LoopWeights(self._performance, self._control / np.abs(G), lasting, real)
        return LoopData(L / (1 + L), weights, lasting)

    def _radius(self, nominal: ComplexArray, end: ComplexArray) -> RealArray:
        """|W_c| that segments need at the responses' frequencies."""
        values = self.responses.points
        away = values / nominal[:, None] - 1
        rounding = RESPONSE_ROUNDING * (1 + np.abs(values).max(axis=1) / np.abs(nominal))
        return np.asarray(needed_radius(away, end) + rounding)


def _norm(loop: LoopData | None, power: int) -> float:
    """The largest mu, smoothed: the power mean of mu over frequency."""
    if loop is None:
        return UNSTABLE_MU
    mu = loop.weights.mu(loop.T)
    top = float(mu.max())
    return top * float(np.mean((mu / top) ** power)) ** (1 / power)


def _encirclements(L: ComplexArray) -> int:
    """Number of times that L encircles -1 over frequencies of either sign; L vanishes at the last.

    The path is closed through the positive real axis at the first: L(0) > -1, or one integrator.
    """
    back = 1 + L
    turned = np.angle(back[0]) + np.angle(back[1:] / back[:-1]).sum()
    return round(float(turned) / np.pi)
