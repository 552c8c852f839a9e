"""Robust stability of a sampled controller around a continuous plant with continuous uncertainty.

The samples of the loop do not distinguish omega from its aliases omega_k = omega + 2 pi k / T, and
dynamics Delta have independent values delta_k at the aliases. With

    z = P_11 w + P_12 u,    y = P_21 w + P_22 u,    w = Delta z

(the plant), a hold H(s) = (1 - exp(-s T)) / s behind K, and Q = K / (1 - K G), where G is the
exactly sampled P_22, the loop is singular where

    1 = sum_k b_k delta_k a_k / (1 - d_k delta_k),
    a_k = P_12(j omega_k) H(j omega_k) Q / T,   b_k = P_21(j omega_k),   d_k = P_11(j omega_k).

For |delta_k| <= r each term fills a disc, so their sum also fills a disc. The least r at which this
disc reaches 1 is exact, up to the aliases that are left out; their sum is bounded. (G. E. Dullerud,
"Control of uncertain sampled-data systems", 1996, has the lifted operator.) The margin of the
discretised plant is a different number: there Delta would also be a sampled system.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from workbench._core.arrays import Array, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.answer import Answer, RepeatedChecker
from workbench.certificate import Check
from workbench.errors import InputError
from workbench.input_checks import need_positive
from workbench.second_opinion.implemented.held_plants import loops_held
from workbench.structure import Real
from workbench.synthesis.implementation.sampled_loop import (
    need_delay,
    need_same_time,
    sampled_conditions,
)
from workbench.synthesis.implementation.sampled_response import HeldPlantLoop
from workbench.systems.conversion import as_system
from workbench.systems.generalised_plant import response
from workbench.systems.realisation import realisation
from workbench.uncertainty.algebra.system import uncertain

FEWEST_ALIASES, MOST_ALIASES = 20, 20_000
"""Smallest and largest number of aliases on each side of a frequency."""
MORE = 8
"""Factor on their number if the bounds are too far apart."""
BOUNDS_TOLERANCE = 1e-3
"""Wanted relative distance of the bounds."""
REACH = 4.0
"""Frequency of the last alias relative to the norm of the plant's matrix A. Responses decrease
beyond it.
"""
HALVINGS = 60
"""Number of halvings of the interval that contains the margin at a frequency."""
LARGEST = 1e9
"""A margin above this counts as infinite."""
REFINEMENTS = 4
"""Number of times that frequencies are added around the smallest margin."""
RESPONSE_ROUNDING = 1e-9
"""Relative reduction of the lower bound for rounding errors of responses."""
CHUNK = 2_000_000
"""Largest number of responses in memory at once."""


@dataclass(frozen=True, eq=False, repr=False)
class SampledRobustness(Answer):
    """Bounds on the size that a continuous perturbation may reach before the loop becomes unstable.

    At the frequencies tried, no linear time-invariant Delta with a gain up to ``lower`` makes the
    loop singular, also between the samples; ``points`` is their number. At ``omega`` [rad/s],
    values of gain ``upper`` at its aliases make the loop singular. At most ``aliases`` aliases on
    each side were computed; the sum of the others is bounded.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import SampledRobustness, sampled_robustness
    >>> from workbench.uncertainty import dynamics, tf
    >>> plant = tf([1], [1, 1]) * (1 + 0.5 * dynamics("d", 1, 1))
    >>> found = sampled_robustness(plant, control.tf([0.4], [1, -1], 0.2), 0.2)
    >>> isinstance(found, SampledRobustness), found.omega > 0
    (True, True)
    """

    lower: float
    upper: float
    omega: float
    points: int
    aliases: int

    def summary(self) -> str:
        return (
            f"SampledRobustness: from {self.lower:.5g} to {self.upper:.5g}, at {self.omega:.5g} "
            f"rad/s\n  for continuous dynamics, between the samples too; at {self.points} "
            f"frequencies, up to {2 * self.aliases + 1} aliases counted and the others bounded"
        )


def sampled_robustness(
    plant: Any, controller: Any, dt: float, *, delay_samples: float = 0.0, sign: int = -1
) -> SampledRobustness:
    """Bounds on the continuous uncertainty that the loop of a sampled controller and a continuous
    plant tolerates.

    Parameters
    ----------
    plant
        A continuous uncertain system, or a model, with one input, one output and one uncertain
        element, which is complex and has one channel (`dynamics(name, 1, 1)`, or circles of an
        `UncertaintyModel`). It includes the filter of the output before the sampler.
    controller
        Controller, StateSpace or TransferFunction with one channel, sampled every ``dt``
        [s].
    delay_samples
        Computation delay [samples]; it may be fractional.
    sign
        Sign in u = sign K y.

    Raises
    ------
    InputError
        The plant has other elements or channels; the perturbation reaches the samples without
        roll-off, so that the sum over all aliases is not finite; or the nominal loop is unstable.

    Examples
    --------
    >>> import control
    >>> from workbench.synthesis import sampled_robustness
    >>> from workbench.uncertainty import dynamics, tf
    >>> plant = tf([1], [1, 1]) * (1 + 0.5 * dynamics("d", 1, 1))
    >>> found = sampled_robustness(plant, control.tf([0.4], [1, -1], 0.2), 0.2)
    >>> bool(found.lower <= found.upper <= 1.01 * found.lower)
    True
    """
    parts, controller = _parts(plant), as_system(controller, "controller")
    need_positive(dt, "dt")
    need_delay(delay_samples)
    need_same_time(controller, dt)
    nominal = realisation((parts.A, parts.B[:, 1:], parts.C[1:], parts.D[1:, 1:]), 0.0)
    if (controller.noutputs, controller.ninputs) != (1, 1) or sign not in (-1, 1):
        raise InputError(
            f"controller has {controller.noutputs} outputs and {controller.ninputs} inputs and "
            f"sign is {sign!r}; needed are one of each, and -1 or 1"
        )
    found = sampled_conditions(nominal, controller, dt, delay_samples=delay_samples, sign=sign)
    if not found.stable:
        raise InputError(f"the nominal loop is unstable: it has a pole at z = {found.pole:.6g}")
    sampled_K = realisation((controller.A, controller.B, controller.C, controller.D), dt)
    loop = _AliasedLoop(parts, HeldPlantLoop(nominal, sampled_K, dt, delay_samples, sign))
    angles = loop.held.angles()
    lower, upper = loop.margins(angles, loop.fewest)
    for _ in range(REFINEMENTS):
        k = int(np.argmin(lower))
        more = np.linspace(angles[max(k - 1, 0)], angles[min(k + 1, angles.size - 1)], 41)[1:-1]
        bounds = loop.margins(more, loop.fewest)
        angles, lower, upper = (
            np.concatenate(pair)
            for pair in ((angles, more), (lower, bounds[0]), (upper, bounds[1]))
        )
        order = np.argsort(angles)
        angles, lower, upper = angles[order], lower[order], upper[order]
    aliases = loop.fewest
    while aliases * MORE <= MOST_ALIASES:
        near = lower < (1 - BOUNDS_TOLERANCE) * upper.min()
        if not near.any():
            break
        aliases *= MORE
        lower[near], upper[near] = loop.margins(angles[near], aliases)
    k = int(np.argmin(upper))
    least = float(lower.min()) * (1 - RESPONSE_ROUNDING)
    over = f"at {angles.size} frequencies, for every linear time-invariant perturbation"
    again = partial(
        sampled_robustness, plant, controller, dt, delay_samples=delay_samples, sign=sign
    )
    return SampledRobustness(
        least if least < LARGEST / 2 else math.inf,
        float(upper[k]) if upper[k] < LARGEST / 2 else math.inf,
        float(angles[k] / dt),
        angles.size,
        aliases,
    ).with_checker(AliasChecker(again, over, parts, sampled_K, delay_samples, sign))


@dataclass(frozen=True, eq=False)
class AliasChecker(RepeatedChecker):
    """Computes a `SampledRobustness` again, and simulates loops closed with dynamics in time
    domain.

    ``parts`` is the plant from (w, u) to (z, y). ``K`` is sampled, and u = ``sign`` K y.
    """

    parts: StateSpace
    K: StateSpace
    delay: float
    sign: int

    def second_opinion(self, answer: SampledRobustness) -> list[Check]:
        return [loops_held(self.parts, self.K, self.delay, self.sign, answer.lower)]


def _parts(plant: Any) -> StateSpace:
    """The plant from (w, u) to (z, y); raises InputError unless Delta is one complex channel."""
    system = uncertain(plant, "plant")
    blocks = list(system.structure) if system.elements else []
    single = len(blocks) == 1 and blocks[0].rows == blocks[0].columns == 1
    if not single or isinstance(blocks[0], Real):
        raise InputError(
            f"the plant's uncertain elements are {', '.join(system.elements) or 'none'}; one is "
            "needed, of complex values and one channel, that occurs once"
        )
    if system.dt or (system.noutputs, system.ninputs) != (1, 1):
        raise InputError(
            f"the plant has {system.noutputs} outputs and {system.ninputs} inputs and dt = "
            f"{system.dt}; needed is one of each, in continuous time"
        )
    parts = system.system
    if parts.D[1, 0] or parts.D[1, 1]:
        raise InputError(
            "the plant reaches its samples without roll-off: put the filter before the sampler "
            "into it, such as control.tf([1], [1e-4, 1]), or a weight behind the uncertain element "
            "(W * dynamics(...), not dynamics(...) * W)"
        )
    return parts


class _AliasedLoop:
    """Margins of the loop at frequencies, computed from its responses at their aliases."""

    def __init__(self, parts: StateSpace, held: HeldPlantLoop) -> None:
        self.parts, self.held, self.period = parts, held, held.period
        size = float(np.linalg.norm(parts.A, 2)) if parts.nstates else 0.0
        rate = 2 * math.pi / self.period
        self.size = size
        wanted = math.ceil(REACH * size / rate) + 1
        if wanted > MOST_ALIASES:
            raise InputError(
                f"the plant's fastest dynamics are {wanted} times as fast as the sampling rate "
                f"{1 / self.period:.6g} Hz; reduce it, or sample faster"
            )
        self.fewest = max(FEWEST_ALIASES, wanted)

    def margins(self, angles: RealArray, aliases: int) -> tuple[RealArray, RealArray]:
        """Lower and upper bounds (F,) at frequencies [rad/sample], from `aliases` aliases on each
        side.
        """
        count = max(1, CHUNK // (2 * aliases + 1))
        parts = [
            self._margins(angles[k : k + count], aliases) for k in range(0, angles.size, count)
        ]
        lower, upper = (np.concatenate(each) for each in zip(*parts, strict=True))
        return lower, upper

    def _margins(self, angles: RealArray, aliases: int) -> tuple[RealArray, RealArray]:
        omega = angles / self.period
        shifts = 2 * math.pi / self.period * np.arange(-aliases, aliases + 1)
        all_ = omega[:, None] + shifts
        P = response(self.parts, all_.ravel()).reshape(*all_.shape, 2, 2)
        s = 1j * all_
        hold = -np.expm1(-s * self.period) / s * np.exp(-s * self.period * self.held.delay)
        Q = self._closed_controller(omega)
        g = P[..., 1, 0] * P[..., 0, 1] * hold * Q[:, None] / self.period
        others, most_d = self._bounds_of_others(aliases)
        rest = others * np.abs(Q) / self.period
        d = P[..., 0, 0]
        return _least_radius(g, d, rest, most_d), _least_radius(g, d, 0.0 * rest, 0.0)

    def _bounds_of_others(self, aliases: int) -> tuple[float, float]:
        """Bounds on the sum of |P_12 H P_21| over the further aliases, and on their |P_11|."""
        parts, rate = self.parts, 2 * math.pi / self.period
        last = (aliases + 0.5) * rate
        # |C (j w - A)^-1 B| <= |C| |B| / (w - |A|)
        fall = last / (last - self.size)
        sizes = [np.linalg.norm(M) for M in (parts.B[:, 0], parts.B[:, 1], parts.C[0], parts.C[1])]
        most_d = abs(parts.D[0, 0]) + fall * sizes[2] * sizes[0] / last
        most_a = abs(parts.D[0, 1]) + fall * sizes[2] * sizes[1] / last
        # |H| <= 2 / w; sum over both sides of 1 / w^2, w >= (k - 1/2) rate, k > aliases
        squares = 2 / (rate**2 * (aliases - 0.5))
        return float(2 * most_a * fall * sizes[3] * sizes[0] * squares), float(most_d)

    def _closed_controller(self, omega: RealArray) -> Array:
        """Response sign K / (1 - sign K G) at frequencies [rad/s]."""
        K = self.held.sign * response(self.held.K, omega)[:, 0, 0]
        G = response(self.held.held(), omega)[:, 0, 0]
        found: Array = K / (1 - K * G)
        return found


def _least_radius(g: Array, d: Array, rest: RealArray, most_d: float) -> RealArray:
    """The least r (F,) at which the sum of the terms of all aliases (F, K) can reach 1.

    g delta / (1 - d delta) fills a disc or, if r |d| > 1, the outside of a disc. The sum of two
    outsides is the whole plane. ``rest`` (F,) and ``most_d`` bound g and d of the aliases left out.
    """
    size = np.abs(d) ** 2
    high = np.full(len(g), min(LARGEST, 1 / max(most_d, 1 / LARGEST)))
    low = np.zeros_like(high)
    for _ in range(HALVINGS):
        r = (low + high) / 2
        room = 1 - size * r[:, None] ** 2
        outside = (room < 0).sum(axis=1)
        with np.errstate(all="ignore"):
            centre = (g * d.conj() / room).sum(axis=1) * r**2
            radius = (np.abs(g) / room).sum(axis=1) * r  # negative for the outside of a disc
            others = 2 * r * rest / (1 - r * most_d)
            away = np.abs(1 - centre)
            missed = np.where(outside, away < -radius - others, away > radius + others)
        missed &= outside < 2
        low, high = np.where(missed, r, low), np.where(missed, high, r)
    return low
