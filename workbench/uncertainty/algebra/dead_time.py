"""Known dead time in a system's LFT: extracting its channels, closing them, and adding delays in
series.

A dead time T is a channel whose scalar is exp(-s T) exactly. Its rational approximation is
all-pass: exp(-s T) = P(s) (1 + e(s)) with the diagonal Pade approximation P of order n, where |e(j
w)| = 2 |sin(theta / 2)| and theta is the difference of the two phases. With P = Q(-s) / Q(s) and x
= w T the slope of theta is c^2 x^(2n) / |Q(j x)|^2, c = n! / (2n)! (this follows from Q(s) exp(s) -
Q(-s) = O(s^(2n+1)): the slope is a ratio of even polynomials, and its numerator can contain only
the highest power). Since |Q(j x)| >= Q(0) = 1,

    |e| <= min(2, c^2 x^(2n+1) / (2n+1)) <= 2 min(1, (x / a)^k) <= |W(j x)|,   k <= 2n + 1,
    W = 2 sqrt(2) (s/a)^k / B(s/a),   a = (2 (2n+1) / c^2)^(1 / (2n+1)),

with the Butterworth polynomial B of order k, |B(j y)|^2 = 1 + y^(2k), at all frequencies.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import Array, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.structure import Block
from workbench.systems.balancing import singular
from workbench.uncertainty.algebra.elements import Element
from workbench.uncertainty.algebra.lft import LFT, diagonal, linked


@dataclass(frozen=True)
class DeadTime(Element):
    """A known delay [s], exp(-s delay), without uncertainty."""

    delay: float

    @property
    def channels(self) -> tuple[str, ...]:
        return (self.name,)

    def block(self, occurrences: int) -> Block:
        raise InputError(self.refusal)

    def delta(self, value: Any) -> Any:
        raise InputError(f"{self.name} is a known dead time of {self.delay:g} s; it has no values")

    def value(self, delta: Any) -> Any:
        return delta

    def sample(self, rng: np.random.Generator, speed: float) -> float:
        return self.delay

    @property
    def refusal(self) -> str:
        """The error for a function that needs a system with states."""
        return (
            f"the dead time {self.name} of {self.delay:g} s has no state-space system; "
            "`loop_margins`, `robust_stability` and `response` take it as it is, and "
            "`dead_time_approximation` replaces it by a Pade approximation and the bound of "
            "its error"
        )


def dead_times(elements: Mapping[str, Element]) -> dict[str, DeadTime]:
    """The elements that are known delays, by name."""
    return {name: one for name, one in elements.items() if isinstance(one, DeadTime)}


def need_no_dead_time(elements: Mapping[str, Element], function: str, proven: str) -> None:
    """Raise InputError if a function's system has known delays; the message gives the call to use.

    ``proven`` says which part of the answer to that call holds for the dead time itself.
    """
    late = dead_times(elements)
    if not late:
        return
    times = ", ".join(f"{name} of {one.delay:g} s" for name, one in late.items())
    raise InputError(
        f"the system has the dead time {times}, which no states describe: call "
        f"`{function}(dead_time_approximation(system))`, of a set that contains the dead time "
        "itself; "
        f"{proven} then holds with it, and a higher `order` makes the set smaller"
    )


def channels_pulled_out(lft: LFT, names: Sequence[str]) -> tuple[LFT, tuple[str, ...]]:
    """The LFT with the channels of these names as first outputs and inputs, and the name of each
    channel.
    """
    out = [k for k, name in enumerate(lft.names) if name in names]
    kept = [k for k in range(len(lft.names)) if k not in out]
    r = len(lft.names)
    rows = [*kept, *out, *range(r, lft.M.shape[0])]
    columns = [*kept, *out, *range(r, lft.M.shape[1])]
    left = LFT(lft.M[np.ix_(rows, columns)], tuple(lft.names[k] for k in kept))
    return left, tuple(lft.names[k] for k in out)


def closed_with(pulled: LFT, parts: Sequence[LFT]) -> LFT:
    """An LFT whose first outputs are fed back to its first inputs, each through a part."""
    d = len(parts)
    p, m = pulled.shape[0] - d, pulled.shape[1] - d
    whole = diagonal(pulled, *parts)  # outputs (z, y, w), inputs (w, u, z)
    links = np.zeros((d + m + d, d + p + d))
    links[:d, d + p :], links[d + m :, :d] = np.eye(d), np.eye(d)
    if singular(np.eye(len(links)) - links @ whole.blocks[3]):
        raise InputError(
            "the loop is not well posed: it is singular through the direct terms of its parts at "
            "the nominal; give one of them a lag, or another gain"
        )
    enters, leaves = np.zeros((d + m + d, m)), np.zeros((p, d + p + d))
    enters[d : d + m], leaves[:, d : d + p] = np.eye(m), np.eye(p)
    return linked(whole, links, enters, leaves)


def closed_response(found: Array, delays: Sequence[float], omega: ArrayLike) -> Array:
    """Responses (F, p, m) from `found` (F, d + p, d + m), whose first d channels are closed with
    delays [s].
    """
    d = len(delays)
    turns = np.exp(-1j * np.multiply.outer(np.atleast_1d(np.asarray(omega, dtype=float)), delays))
    loop = np.eye(d) - turns[:, :, None] * found[:, :d, :d]
    back = np.linalg.solve(loop, turns[:, :, None] * found[:, :d, d:])
    whole: Array = found[:, d:, d:] + found[:, d:, :d] @ back
    return whole


def total_delay(lft: LFT, times: Mapping[str, float]) -> Fraction | None:
    """The dead time [s] common to all paths from the inputs to the outputs; None if paths differ.

    Channels with names in ``times`` are delayed. A closed path must not contain a delay.
    """
    r = len(lft.names)
    follows = [np.flatnonzero(column) for column in lft.M.T]
    own = [Fraction(times.get(name, 0.0)) for name in lft.names] + [Fraction(0)] * len(lft.M)
    arrived: dict[int, Fraction] = {}
    seen = set(_leading_to_outputs(lft))
    waiting = [(int(k), Fraction(0)) for u in range(r, lft.M.shape[1]) for k in follows[u]]
    while waiting:
        k, late = waiting.pop()
        k = min(k, r)  # all outputs count as one node
        if k < r and k not in seen:
            continue
        if k in arrived:
            if arrived[k] != late:
                return None
            continue
        arrived[k] = late
        if k < r:
            waiting += [(int(j), late + own[k]) for j in follows[k]]
    return arrived.get(r, Fraction(0))


def _leading_to_outputs(lft: LFT) -> list[int]:
    """Mask of the channels from which a path leads to an output."""
    r = len(lft.names)
    found = [k for k in range(r) if lft.M[r:, k].any()]
    for k in found:  # the list grows during the loop
        found += [int(j) for j in np.flatnonzero(lft.M[k, :r]) if j not in found]
    return found


def pade(delay: float, order: int) -> StateSpace:
    """The Pade approximation P: all-pass, with `order` states; entries of its realisation have
    similar sizes.
    """
    import control

    n = order
    den = np.array([
        math.comb(n, k) * math.factorial(2 * n - k) / math.factorial(2 * n) for k in range(n + 1)
    ])  # fmt: skip
    num = den * (-1.0) ** np.arange(n + 1)
    return _in_time(control.tf(num[::-1], den[::-1]), delay)


def pade_corner(order: int) -> float:
    """The constant a: frequency times delay at which the bound on the error reaches 2."""
    n = order
    square = (math.factorial(n) / math.factorial(2 * n)) ** 2
    return float((2.0 * (2 * n + 1) / square) ** (1.0 / (2 * n + 1)))


def pade_error(delay: float, order: int) -> StateSpace:
    """The weight W: its magnitude is at least the relative error of P at every frequency."""
    import control

    poles = np.exp(1j * math.pi * (2 * np.arange(order) + order + 1) / (2 * order))
    den: RealArray = np.asarray(np.poly(poles).real, dtype=float)
    num = np.zeros(order + 1)
    num[0] = 2.0 * math.sqrt(2.0)
    return _in_time(control.tf(num, den), delay / pade_corner(order))


def _in_time(function: Any, unit: float) -> StateSpace:
    """A transfer function in another unit of time, converted to a system in seconds."""
    import control

    one = control.ss(function)
    return control.ss(one.A / unit, one.B / unit, one.C, one.D)
