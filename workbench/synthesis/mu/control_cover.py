"""Uncertainty covers for a loop: weights that contain the plants and give the loop the least mu.

For a controller with T = L / (1 + L), mu of its loop is that of `LoopWeights`, where the circular
weight is the radius that the plants need around the real weight. The narrowest stadium does not
give the least mu. Here both weights are chosen for mu, alone or together with nominal and
controller: the circular weight may exceed the radius at frequencies where this does not raise the
peak of mu. Plants that are known at every frequency are covered at every frequency of the grid,
which is fine around their resonances.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import Literal, NamedTuple

import numpy as np

from workbench._core.arrays import Array, ComplexArray, RealArray
from workbench.errors import InputError
from workbench.executor import Context
from workbench.fitting.factored import FactoredRational
from workbench.fitting.magnitude.program import MagnitudeFit
from workbench.fitting.rational import Rational
from workbench.synthesis.limits.loop_weights import LoopWeights, loop_mu
from workbench.synthesis.mu.cover_search import UNSTABLE_MU, least_of_several
from workbench.synthesis.mu.covered_plants import RESPONSE_ROUNDING, CoveredPlants
from workbench.systems.frequency_grid import starting_grid
from workbench.uncertainty import Responses, UncertaintyModel
from workbench.uncertainty.covers.everywhere import reaching_known
from workbench.uncertainty.covers.weights import (
    between,
    beyond,
    damped,
    fitted,
    needed_radius,
    reaching,
    resolved,
    roots_within_reach,
)

SLOPE_STEP, LEAST_SIZE = 1e-7, 1e-3
"""Step of the differences that give the slopes of mu, relative to the size of a part's response at
the frequency; and the least size assumed, relative to the largest size.
"""
PER_DECADE = 10
"""Frequencies per decade where no response is known."""
BEYOND_ALL = (1e1, 1e2, 1e3, 1e6, 1e9)
"""Multiples of the highest of these frequencies at which mu is also evaluated."""
PULL = 3e-6
"""Relative penalty on mu for a parameter that moves by its unit. Without it, parameters without
effect, such as a pole and a zero that cancel, would drift to values with bad realisations.
"""
LEAST_UNIT = 1e-3
"""Unit of a parameter that starts near zero."""

Weight = Callable[[RealArray], Array]
"""Response of a known system at frequencies [rad/s] (F,)."""

CoverPart = Literal["nominal", "real", "controller", "circular"]
"""Part of a `ControlCover` that may move: the nominal, a weight by its kind, or the controller."""


class LoopData(NamedTuple):
    """Quantities on which mu depends, at the frequencies (F,) of a `ControlCover`."""

    T: ComplexArray
    weights: LoopWeights
    radius: RealArray


class ControlCover:
    """Models G (1 + W_c delta_c + W_r delta_r) of measured responses, optimised for a loop.

    The loop is e = w - G u, u = K sensor e, with the outputs W_p e and W_u u.

    Parameters
    ----------
    responses
        Responses of the plants, from u to the point where w enters.
    complex_order
        Order of W_c.
    performance, control
        W_p and W_u; only their magnitudes are used.
    sensor
        Known dynamics between the error e and the controller.
    lowest
        Lowest frequency [rad/s] at which mu is evaluated; it should be below the slowest pole of
        W_p.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.synthesis import ControlCover
    >>> from workbench.uncertainty import Responses
    >>> omega = np.geomspace(0.01, 100, 60)
    >>> plants = Responses(
    ...     omega=omega, values=np.array([gain / (1j * omega + 1) for gain in (0.9, 1.0, 1.1)]).T
    ... )
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
        self._plants = CoveredPlants.of(responses, self.omega)
        self._performance = np.abs(performance(self.omega))
        self._control = np.abs(control(self.omega))
        self._from_zero = np.concatenate([[0.0], self.omega])
        self._sensor = sensor(self._from_zero)

    def optimised_parts(
        self, parts: dict[CoverPart, Rational], moving: Sequence[CoverPart], context: Context
    ) -> dict[CoverPart, Rational]:
        """The parts, where the moving ones and the circular weight minimise the peak of mu.

        The parts keep their numbers of poles, zeros and unstable poles. The circular weight keeps
        its zeros on the left, and so does a controller whose zeros are all there. The controller
        keeps the nominal loop stable. The result is the best end of several local searches.

        Parameters
        ----------
        parts
            The nominal, the real weight, the controller, and the circular weight. A missing
            circular weight is fitted to the radii that it must cover.
        moving
            Names of the parts, among the first three, that may change.

        Raises InputError for a controller with which the nominal loop is unstable.
        """
        parts, moving = self._with_circular_weight(parts, context), [*moving, "circular"]
        band = float(self.omega[0]), float(self.omega[-1])
        sections = {name: _factored_part(name, parts[name], band) for name in moving}
        starts = [part.start for part in sections.values()]
        ends = np.cumsum([len(start) for start in starts])[:-1]
        x = np.concatenate(starts)
        units, sizes = np.maximum(np.abs(x), LEAST_UNIT), np.maximum(np.abs(x), 1.0)
        held, unstable = self._responses(parts), _unstable_poles(parts.values())

        def split(y: RealArray) -> Iterator[tuple[CoverPart, FactoredRational, RealArray]]:
            return zip(sections, sections.values(), np.split(y * units, ends), strict=True)

        def largest(y: RealArray, power: int) -> tuple[float, RealArray]:
            values, slopes = dict(held), {}
            for name, part, vector in split(y):
                values[name], slopes[name] = part.values(vector, self._from_zero)
            if not self._is_stable(values, unstable):
                return UNSTABLE_MU, np.zeros_like(y)
            inside = {name: value[1:] for name, value in values.items()}
            norm, slope = self._power_mean_of_mu(inside, slopes, power)
            moved = (y * units - x) / sizes
            pull = 1 + PULL * float(moved @ moved)
            return norm * pull, (slope * pull + 2 * norm * PULL * moved / sizes) * units

        y = least_of_several(largest, x / units, context, " and ".join(moving))
        omega = self.responses.omega
        found = {
            name: roots_within_reach(
                part.rational(vector),
                self.omega[0] if name == "controller" else omega[0],
                omega[-1],
            )
            for name, part, vector in split(y)
        }
        if "real" in found:
            found["real"] = damped(resolved(found["real"], omega), omega)
        found = parts | found
        nominal, end = (found[name].response(self.omega) for name in ("nominal", "real"))
        radius = self._plants.radius(nominal, end)
        ratio = radius / np.abs(found["circular"].response(self.omega))
        return found | {"circular": found["circular"].scaled(float(ratio.max()))}

    def _power_mean_of_mu(
        self,
        values: dict[CoverPart, ComplexArray],
        slopes: dict[CoverPart, ComplexArray],
        power: int,
    ) -> tuple[float, RealArray]:
        """The power mean of mu over frequency, and its derivatives by all parameters.

        Mu at a frequency depends on the parameters only through a few complex numbers, the
        ``values`` (F,) of the parts. Their ``slopes`` (1 + F, P) are the derivatives by the
        parameters. The circular weight is scaled so that the power mean of radius over weight is 1.
        """
        plants, nominal, end = self._plants, values["nominal"], values["real"]
        known, given = plants.logs(nominal, end)
        size, lines = np.abs(values["circular"]), plants.between(given)
        scale, by_ratio = _power_mean(np.exp(np.maximum(known, lines)) / size, power)
        circular = scale * size

        def mu(values: dict[CoverPart, ComplexArray], circular: RealArray) -> RealArray:
            T, control = self._closed_loop(values)
            return loop_mu(T, self._performance, control, circular, values["real"])

        found = mu(values, circular)
        norm, by_mu = _power_mean(found, power)
        by_mu = norm * by_mu / found
        by_circular = by_mu * (mu(values, circular * (1 + SLOPE_STEP)) - found) / SLOPE_STEP
        by_radius = by_ratio * by_circular.sum()
        by_known = np.where(known >= lines, by_radius, 0.0)
        by_given = (by_radius - by_known) @ plants.lines
        farthest = plants.farthest(nominal, end)
        known, given = farthest.logs(nominal, end)
        every = []
        for name, by_parameter in slopes.items():
            if name == "circular":
                relative = (by_parameter[1:] / values[name][:, None]).real
                every.append((by_circular - by_radius) @ relative)
                continue
            size = np.abs(values[name])
            step = SLOPE_STEP * np.maximum(size, LEAST_SIZE * size.max())
            slope: RealArray = np.zeros(by_parameter.shape[1])
            for turn, part in ((1, by_parameter.real), (1j, by_parameter.imag)):
                beside = values | {name: values[name] + turn * step}
                change = by_mu * (mu(beside, circular) - found)
                if name != "controller":
                    new_known, new_given = farthest.logs(beside["nominal"], beside["real"])
                    change += by_known * (new_known - known)
                    change[plants.at] += by_given * (new_given - given)
                slope += (change / step) @ part[1:]
            every.append(slope)
        return norm, np.concatenate([*every, []])

    def loop(self, parts: dict[CoverPart, Rational]) -> LoopData | None:
        """The loop of these parts; None if the nominal loop is unstable.

        Stability follows from the encirclements of -1; the controller may have one integrator.
        """
        values = self._responses(parts)
        if not self._is_stable(values, _unstable_poles(parts.values())):
            return None
        values = {name: value[1:] for name, value in values.items()}
        (T, control), real = self._closed_loop(values), values["real"]
        radius = self._plants.radius(values["nominal"], real)
        return LoopData(T, LoopWeights(self._performance, control, radius, real), radius)

    def model(self, parts: dict[CoverPart, Rational], context: Context) -> UncertaintyModel:
        """The uncertainty model of nominal and weights; a missing circular weight is fitted.

        The circular weight is scaled so that the model contains the known plants at every
        frequency, and the other plants at and between their own frequencies.

        Raises InputError for a controller with which the nominal loop is unstable.
        """
        parts, omega = self._with_circular_weight(parts, context), self.responses.omega
        nominal, W_r = parts["nominal"], parts["real"]
        away = self.responses.points / nominal.response(omega)[:, None] - 1
        radius = needed_radius(away, W_r.response(omega))
        radius += RESPONSE_ROUNDING * (2 + np.abs(away).max(axis=1))
        W_c = parts["circular"]
        if len(self.responses.known_plants) == len(self.responses.plants):
            W_c = W_c.scaled(max(1.0, float((radius / np.abs(W_c.response(omega))).max())))
        else:
            W_c = reaching(W_c, omega, radius)
        W_c = reaching_known(self.responses, nominal, W_c, W_r, "multiplicative")
        tested, ends = self.responses.tested, self.responses.ends
        return UncertaintyModel(nominal, W_c, W_r, tested=tested, measured=ends)

    def _with_circular_weight(
        self, parts: dict[CoverPart, Rational], context: Context
    ) -> dict[CoverPart, Rational]:
        """The parts including a circular weight; a missing one is fitted to the radii it must
        cover.
        """
        loop = self.loop(parts)
        if loop is None:
            raise InputError("the nominal loop is unstable with this controller: use another")
        if "circular" in parts:
            return parts
        near = self.omega <= beyond(self.responses.omega)[-1]
        fit = MagnitudeFit(self.omega[near], loop.radius[near], self.complex_order, cover=True)
        return parts | {"circular": fitted(fit, context)}

    def _responses(self, parts: dict[CoverPart, Rational]) -> dict[CoverPart, ComplexArray]:
        """Responses (1 + F,) of the parts at frequency 0 and at the cover's frequencies."""
        with np.errstate(divide="ignore", invalid="ignore"):  # an integrator has no response at 0
            return {name: part.response(self._from_zero) for name, part in parts.items()}

    def _is_stable(self, values: dict[CoverPart, ComplexArray], unstable: int) -> bool:
        """Whether the nominal loop is stable, from responses (1 + F,) of parts with `unstable`
        unstable poles.
        """
        with np.errstate(invalid="ignore"):
            whole = values["controller"] * values["nominal"] * self._sensor
        L = whole[1:]
        return bool(np.isfinite(L).all()) and _encirclements(whole[0], L) == unstable

    def _closed_loop(self, values: dict[CoverPart, ComplexArray]) -> tuple[ComplexArray, RealArray]:
        """T and |W_u / G| (F,), from responses (F,) of the parts."""
        L = values["controller"] * values["nominal"] * self._sensor[1:]
        return L / (1 + L), self._control / np.abs(values["nominal"])


def _frequencies(responses: Responses, lowest: float) -> RealArray:
    """Frequencies [rad/s] (F,) at which mu is evaluated, including those of the responses.

    More frequencies lie between those of the responses and around the resonances of known plants.
    Others lie below them, down to the slowest pole of W_p, and above them, beyond any fast pole
    that the search may give to the controller.
    """
    low, high = lowest, beyond(responses.omega)[-1]
    outside = np.geomspace(low, high, round(PER_DECADE * np.log10(high / low)))
    poles = [plant.poles for plant in responses.known_plants.values()]
    near = starting_grid(np.concatenate([np.zeros(0), *poles]))
    near = near[(near > responses.omega[0]) & (near < responses.omega[-1])]
    endless = high * np.array(BEYOND_ALL)
    outside = outside[(outside < responses.omega[0]) | (outside > responses.omega[-1])]
    inside = np.concatenate([between(responses.omega), near])
    return np.unique(np.concatenate([beyond(responses.omega), inside, outside, endless]))


def _factored_part(name: CoverPart, part: Rational, band: tuple[float, float]) -> FactoredRational:
    """A part as a function of parameters. Unlike other roots, zeros of the controller on the right
    are not mirrored.

    A mirrored zero would change the controller, and the loop might be unstable.
    """
    left = name == "circular" or (name == "controller" and bool((part.zeros.real <= 0.0).all()))
    return FactoredRational.of(part, len(part.zeros), band, True, left, _unstable_poles([part]))


def _power_mean(values: RealArray, power: int) -> tuple[float, RealArray]:
    """The power mean of positive values (F,), and the derivatives (F,) of its log by their logs."""
    top = float(values.max())
    shares = (values / top) ** power
    return top * float(shares.mean()) ** (1 / power), shares / shares.sum()


def _unstable_poles(parts: Iterable[Rational]) -> int:
    return sum(int(np.sum(part.poles.real > 0.0)) for part in parts)


def _encirclements(L_0: complex, L: ComplexArray) -> int:
    """Number of times that L encircles -1 over positive and negative frequencies; L vanishes at the
    last one.

    The path starts at L(0). If L(0) is not finite because of an integrator, it starts far out on
    the positive real axis, so that the integrator counts as a stable pole.
    """
    back = 1 + L
    start = np.angle(back[0])
    if np.isfinite(L_0) and L_0.real < -1.0:
        start -= np.copysign(np.pi, start)
    turned = start + np.angle(back[1:] / back[:-1]).sum()
    return round(float(turned) / np.pi)
