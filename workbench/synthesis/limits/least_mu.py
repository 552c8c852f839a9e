"""The least mu over all controllers at a frequency: a lower bound that no design can beat.

K(j omega) acts on the loop of `LoopWeights` only through the complex number T = L / (1 + L), and
every T belongs to some K. Mu is that of `rank_one_mu`, with c_r = -W_r T and the sum of the others
|W_c T| + |(W_p (1 - T), W_u T / G)|, convex in T. The distance of a point from a segment is a
largest projection, so that mu is the least over phi of

    (|Re(exp(-j phi) W_r T)| + |W_c T| + |(W_p (1 - T), W_u T / G)|) / cos(phi).

With A = |(W_p, W_u / G)| and T turned by psi, the least value over |T| is

    W_p sin(min(zeta + kappa, pi / 2)) / cos(phi),  cos(zeta) = W_p cos(psi) / A,
    sin(kappa) = (|W_c| + |W_r| sin(delta - psi - phi)) / A,

where delta is the angle of W_r T from the imaginary axis at psi = 0. On this axis the real scalar
has the least effect. Both phi and psi turn W_r T towards the axis: they are not negative, and phi +
psi is at most delta.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import Dataset
from workbench.answer import (
    REPEATED_ROUNDING,
    Answer,
    RepeatedChecker,
    restored_numbers,
    stored_numbers,
)
from workbench.certificate import Check, Checker, relative_excess
from workbench.certify.agreement import need_agreement
from workbench.errors import InputError
from workbench.executor.effort import tries
from workbench.second_opinion import SEED
from workbench.synthesis.limits.loop_weights import LoopWeights

QUARTERS = ((0, 0), (0, 1), (1, 0), (1, 1))
"""Half (0 or 1) of the range of psi, and of phi, for each quarter of a box."""
HALVINGS = 40
"""Largest number of halvings of a box. Without a circular part and a control weight mu may jump,
and then no number of halvings reaches the tolerance.
"""
DRAWN = 200
"""Number of controllers drawn at random by a check."""


@dataclass(frozen=True, repr=False)
class LeastMu(Answer):
    """Bounds on the least mu: no controller is below ``lower`` (F,), and ``T`` (F,) has ``upper``
    (F,).

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.synthesis import LoopWeights, least_mu
    >>> weights = LoopWeights(
    ...     np.array([0.5]), np.array([0.2]), np.array([0.1]), np.array([0.3 + 0j])
    ... )
    >>> found = least_mu(weights)
    >>> bool(np.isclose(weights.mu(found.T)[0], found.upper[0]))
    True
    """

    lower: RealArray
    upper: RealArray
    T: ComplexArray


def least_mu(weights: LoopWeights, *, tolerance: float = 1e-3) -> LeastMu:
    """The least mu over all complex K, frequency by frequency, by branch and bound.

    K at each frequency may be any complex number: it need be neither causal nor stabilising.
    `DualCertificate` is a bound that requires both.

    Zeta rises with psi, kappa falls with psi + phi, and cos(phi) falls: on a box of both angles a
    lower bound on mu uses zeta at the least psi, kappa at the largest psi + phi, and the cosine of
    the least phi.

    Parameters
    ----------
    weights
        Weights of the loop at frequencies (F,).
    tolerance
        Largest relative distance of the two bounds, between 0 and 1.

    Raises
    ------
    InputError
        The tolerance is not between 0 and 1.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.synthesis import LoopWeights, least_mu
    >>> weights = LoopWeights(
    ...     np.array([0.5]), np.array([0.2]), np.array([0.1]), np.array([0.3 + 0j])
    ... )
    >>> found = least_mu(weights)
    >>> bool(found.lower[0] <= found.upper[0] <= 1.001 * found.lower[0])
    True
    """
    if not 0.0 < tolerance < 1.0:
        raise InputError(f"tolerance is {tolerance}; it must lie between 0 and 1")
    upper = weights.performance.copy()  # mu for T = 0
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
    need_agreement(
        (1 - REPEATED_ROUNDING) * lower,
        upper,
        "the least mu",
        "boxes cover all T",
        "one T reaches it",
        lambda index: f"at frequency {index[0] + 1}",
    )
    found = LeastMu(np.minimum(lower, upper), upper, T)
    again = partial(least_mu, weights, tolerance=tolerance)
    over = f"at these {len(upper)} frequencies, for all complex K"
    return found.with_checker(LeastMuChecker(again, over, weights))


@dataclass(frozen=True, eq=False)
class LeastMuChecker(RepeatedChecker):
    """Computes the bounds again, and tries T and random controllers."""

    weights: LoopWeights

    def second_opinion(self, answer: LeastMu) -> list[Check]:
        rng = np.random.default_rng(SEED)
        reached = self.weights.mu(answer.T)
        size = rng.lognormal(sigma=2.0, size=(tries(DRAWN), len(answer.T)))
        turns = np.exp(2j * np.pi * rng.uniform(size=size.shape))
        drawn = np.min([self.weights.mu(T) for T in size * turns], axis=0)
        return [
            Check(
                "reached",
                "mu with T over the claimed upper bound, less 1",
                float(np.max(reached / answer.upper, initial=0.0)) - 1.0,
                REPEATED_ROUNDING,
            ),
            Check(
                "drawn",
                "claimed lower bound over the least mu of controllers that are drawn, less 1",
                float(np.max(answer.lower / drawn, initial=0.0)) - 1.0,
                REPEATED_ROUNDING,
                over=f"for {tries(DRAWN)} complex numbers at each frequency",
            ),
        ]


@dataclass(frozen=True, eq=False, repr=False)
class LargestLeastMu(Answer):
    """Lower bound ``lower`` on every controller's peak of mu, reached at ``omega`` [rad/s].

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.synthesis import LoopWeights, largest_least_mu
    >>> def weights(omega):
    ...     return LoopWeights(1 / np.hypot(omega, 0.1), 0.5 * omega, 0.1 + 0 * omega, 0j * omega)
    ...
    >>> largest_least_mu(weights, np.geomspace(0.1, 10, 30)).holds
    True
    """

    lower: float
    omega: float

    @property
    def value(self) -> float:
        """The bound ``lower``."""
        return self.lower

    def summary(self) -> str:
        return f"LargestLeastMu: no peak below {self.lower:.6g}, by mu at {self.omega:.6g} rad/s"


@dataclass(frozen=True, eq=False)
class LargestLeastMuChecker(Checker):
    """Checks a `LargestLeastMu` by the weights at its one frequency.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.synthesis import LargestLeastMuChecker, LoopWeights, largest_least_mu
    >>> def weights(omega):
    ...     return LoopWeights(1 / np.hypot(omega, 0.1), 0.5 * omega, 0.1 + 0 * omega, 0j * omega)
    ...
    >>> found = largest_least_mu(weights, np.geomspace(0.1, 10, 30))
    >>> LargestLeastMuChecker(weights).certify(found, 1e-6).holds
    True
    """

    weights: Callable[[RealArray], LoopWeights]

    @property
    def quantifier(self) -> str:
        return "for all complex K"

    def checks(self, answer: LargestLeastMu, tolerance: float) -> list[Check]:
        again = float(least_mu(self.weights(np.array([answer.omega]))).lower[0])
        statement = "by which share the claimed bound is larger than the one computed again"
        return [Check("lower", statement, relative_excess(answer.lower, again), REPEATED_ROUNDING)]

    def stored_answer(self, name: str, answer: LargestLeastMu) -> dict[str, Any]:
        return stored_numbers(name, answer, "lower", "omega")

    def restored_answer(self, name: str, data: Dataset) -> LargestLeastMu | None:
        found = restored_numbers(name, data, "lower", "omega")
        return None if found is None else LargestLeastMu(**found)

    def second_opinion(self, answer: LargestLeastMu) -> list[Check]:
        found = least_mu(self.weights(np.array([answer.omega])))
        claimed = replace(found, lower=np.array([answer.lower]))
        assert found._checked_by is not None
        return [found._checked_by[0].second_opinion(claimed)[1]]


def largest_least_mu(
    weights: Callable[[RealArray], LoopWeights], omega: RealArray, *, rounds: int = 3
) -> LargestLeastMu:
    """A lower bound on every controller's peak of mu, and the frequency where it is reached.

    Parameters
    ----------
    weights
        The loop's `LoopWeights` at frequencies [rad/s] (F,).
    omega
        Frequencies [rad/s] (F,), increasing.
    rounds
        Number of times that frequencies are added between the neighbours of the largest bound.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.synthesis import LoopWeights, largest_least_mu
    >>> def weights(omega):
    ...     return LoopWeights(1 / np.hypot(omega, 0.1), 0.5 * omega, 0.1 + 0 * omega, 0j * omega)
    ...
    >>> bool(0 < largest_least_mu(weights, np.geomspace(0.1, 10, 30)).lower < 1)
    True
    """
    lower = least_mu(weights(omega)).lower
    for _ in range(rounds):
        k = int(lower.argmax())
        low, high = omega[max(k - 1, 0)], omega[min(k + 1, len(omega) - 1)]
        omega = np.unique(np.append(np.geomspace(low, high, 16), omega[k]))
        lower = least_mu(weights(omega)).lower
    k = int(lower.argmax())
    found = LargestLeastMu(float(lower[k]), float(omega[k]))
    return found.with_checker(LargestLeastMuChecker(weights))
