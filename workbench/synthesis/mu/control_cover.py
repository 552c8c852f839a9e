"""Uncertainty covers for a loop: weights that contain the plants where they hurt the loop least.

With T = L / (1 + L) of a controller, mu of its loop is that of `LoopWeights`, with the radius that
the plants need about a real weight. The narrowest stadium is not the one of least mu: here the
real weight is chosen for mu, alone or together with nominal and controller, and the complex weight
then exceeds the radius where mu leaves room for it. Plants that are known at every frequency count
at every frequency of the grid, which is fine about their resonances.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Literal, NamedTuple

import numpy as np
from scipy.optimize import minimize

from workbench.arrays import Array, ComplexArray, RealArray
from workbench.errors import InputError
from workbench.executor import Context
from workbench.fitting.factored import FactoredRational
from workbench.fitting.rational import Rational
from workbench.synthesis.limits.loop_weights import LoopWeights
from workbench.systems.frequency_grid import starting_grid
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
COVER_BFGS_STEPS = 300
"""Largest number of steps of BFGS for each power."""
SLOPE_STEP, LEAST_SIZE = 1e-7, 1e-3
"""Step of the differences by which mu's slopes are found, over the size of a part's response there;
and the least share of its largest size that it is taken to have."""
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

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.synthesis import ControlCover
    >>> from workbench.uncertainty import Responses
    >>> omega = np.geomspace(0.01, 100, 60)
    >>> plants = Responses(omega, np.array([gain / (1j * omega + 1) for gain in (0.9, 1.0, 1.1)]).T)
    >>> cover = ControlCover(
    ...     plants,
    ...     1,
    ...     performance=lambda w: 0.5 / (1j * w + 0.05),
    ...     control=lambda w: 0.02 + 0 * w,
    ...     sensor=lambda w: 1 + 0j * w,
    ...     lowest=0.01,
    ... )
    >>> cover.responses.omega.size
    60
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
        self.omega = _frequencies(responses, lowest)
        known = [plant.response(self.omega) for plant in responses.known_plants.values()]
        self._known = np.array(known).reshape(len(known), self.omega.size).T
        self._performance = np.abs(performance(self.omega))
        self._control = np.abs(control(self.omega))
        self._from_zero = np.concatenate([[0.0], self.omega])
        self._sensor = sensor(self._from_zero)

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
        held = self._responses(parts)
        unstable = _unstable_poles([part for name, part in parts.items() if name not in moving])

        def split(y: RealArray) -> Iterator[tuple[Name, FactoredRational, RealArray]]:
            return zip(sections, sections.values(), np.split(y * units, ends), strict=True)

        def largest(y: RealArray, power: int) -> tuple[float, RealArray]:
            values, slopes = dict(held), {}
            for name, part, vector in split(y):
                values[name], slopes[name] = part.values(vector, self._from_zero)
            loop = self._loop(values, unstable)
            if loop is None:
                return UNSTABLE_MU, np.zeros_like(y)
            inside = {name: value[1:] for name, value in values.items()}
            return self._smoothed(loop, inside, slopes, power, units)

        y = x / units
        for power in context.track(POWERS, " and ".join(moving)):
            steps = {"maxiter": COVER_BFGS_STEPS}
            y = minimize(largest, y, (power,), "BFGS", jac=True, options=steps).x
            found = {name: part.rational(vector) for name, part, vector in split(y)}
            if "real" in found:
                omega = self.responses.omega
                found["real"] = damped(resolved(found["real"], omega), omega)
            yield parts | found

    def _smoothed(
        self,
        loop: LoopData,
        values: dict[Name, ComplexArray],
        slopes: dict[Name, ComplexArray],
        power: int,
        units: RealArray,
    ) -> tuple[float, RealArray]:
        """The power mean of mu over frequency, and its slopes by the parameters over their units.

        Mu at a frequency depends on the parameters by a few complex numbers, the ``values`` (F,) of
        the parts, whose ``slopes`` (1 + F, P) by the parameters are known.
        """
        mu = loop.weights.mu(loop.T)
        share = mu / mu.max()
        mean = float(np.mean(share**power))
        norm = float(mu.max()) * mean ** (1 / power)
        counts = norm / mu.max() * share ** (power - 1) / (mean * mu.size)
        by_part = []
        for name, by_parameter in slopes.items():
            size = np.abs(values[name])
            step = SLOPE_STEP * np.maximum(size, LEAST_SIZE * size.max())
            slope: RealArray = np.zeros(by_parameter.shape[1])
            for turn, part in ((1, by_parameter.real), (1j, by_parameter.imag)):
                beside = self._data(values | {name: values[name] + turn * step})
                change = (beside.weights.mu(beside.T) - mu) / step
                slope += (counts * change) @ part[1:]
            by_part.append(slope)
        return norm, np.concatenate(by_part) * units

    def loop(self, parts: dict[Name, Rational]) -> LoopData | None:
        """The loop of these parts; None where the nominal one is unstable.

        Stability is read from the encirclements of -1; the controller may have one integrator.
        """
        return self._loop(self._responses(parts), _unstable_poles(parts.values()))

    def least_peak(self, parts: dict[Name, Rational]) -> float:
        """Largest mu with |W_c| at the radii that it must cover; infinite if the loop is unstable.

        A `model` of these parts has no lower peak, but for rounding. Where a plant is not known,
        only the responses' frequencies are looked at: W_c covers such a plant there alone.
        """
        loop = self.loop(parts)
        if loop is None:
            return np.inf
        mu = loop.weights.mu(loop.T)
        if len(self.responses.known_plants) < len(self.responses.plants):
            mu = mu[np.isin(self.omega, self.responses.omega)]
        return float(mu.max())

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

    def _responses(self, parts: dict[Name, Rational]) -> dict[Name, ComplexArray]:
        """Responses (1 + F,) of the parts at 0 and at the cover's frequencies."""
        with np.errstate(divide="ignore", invalid="ignore"):  # an integrator has none at 0
            return {name: part.response(self._from_zero) for name, part in parts.items()}

    def _loop(self, values: dict[Name, ComplexArray], unstable: int) -> LoopData | None:
        """From responses (1 + F,) of the parts, with a number of unstable poles."""
        with np.errstate(invalid="ignore"):
            whole = values["controller"] * values["nominal"] * self._sensor
        L = whole[1:]
        if not np.isfinite(L).all() or _encirclements(whole[0], L) != unstable:
            return None
        return self._data({name: value[1:] for name, value in values.items()})

    def _data(self, values: dict[Name, ComplexArray]) -> LoopData:
        """What mu depends on, from responses (F,) of the parts."""
        G, real = values["nominal"], values["real"]
        L = values["controller"] * G * self._sensor[1:]
        radius = self._radius(G, real)
        weights = LoopWeights(self._performance, self._control / np.abs(G), radius, real)
        return LoopData(L / (1 + L), weights, radius)

    def _radius(self, nominal: ComplexArray, end: ComplexArray) -> RealArray:
        """|W_c| (F,) that segments need: exact for known plants, else between the responses."""
        responses, radii = self.responses, []
        if self._known.size:
            radii.append(_needed(self._known, nominal, end))
        if len(responses.known_plants) < len(responses.plants):
            at = np.searchsorted(self.omega, responses.omega)
            given = _needed(responses.points, nominal[at], end[at])
            log = np.log(self.omega), np.log(responses.omega)
            radii.append(np.exp(np.interp(*log, np.log(given))))
        return np.max(radii, axis=0)


def _frequencies(responses: Responses, lowest: float) -> RealArray:
    """Where mu is looked at [rad/s] (F,): those of the responses among them.

    They go on between the responses' frequencies, about the resonances of known plants, and beyond:
    to the slowest pole of W_p, and past the fastest of a controller.
    """
    low, high = lowest, beyond(responses.omega)[-1]
    outside = np.geomspace(low, high, round(PER_DECADE * np.log10(high / low)))
    poles = [plant.poles for plant in responses.known_plants.values()]
    near = starting_grid(np.concatenate([np.zeros(0), *poles]))
    near = near[(near > responses.omega[0]) & (near < responses.omega[-1])]
    inside = np.concatenate([responses.omega, between(responses.omega), near])
    outside = outside[(outside < inside.min()) | (outside > inside.max())]
    return np.unique(np.concatenate([inside, outside]))


def _needed(plants: ComplexArray, nominal: ComplexArray, end: ComplexArray) -> RealArray:
    """|W_c| (F,) that plants (F, N) need about segments of a real weight, with rounding errors."""
    away = plants / nominal[:, None] - 1
    rounding = RESPONSE_ROUNDING * (1 + np.abs(plants).max(axis=1) / np.abs(nominal))
    return np.asarray(needed_radius(away, end) + rounding)


def _unstable_poles(parts: Iterable[Rational]) -> int:
    return sum(int(np.sum(part.poles.real > 0.0)) for part in parts)


def _encirclements(L_0: complex, L: ComplexArray) -> int:
    """Number of times that L encircles -1 over frequencies of either sign; L vanishes at the last.

    The path starts at L(0); for an integrator, where that is not finite, far out on the positive
    real axis, so that the integrator counts as a stable pole.
    """
    back = 1 + L
    start = np.angle(back[0])
    if np.isfinite(L_0) and L_0.real < -1.0:
        start -= np.copysign(np.pi, start)
    turned = start + np.angle(back[1:] / back[:-1]).sum()
    return round(float(turned) / np.pi)
