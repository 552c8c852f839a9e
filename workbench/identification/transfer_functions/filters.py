"""Filtered derivatives s^i / A(s) of sampled signals, by exact simulation of the filter.

Identification in continuous time cannot differentiate noisy samples. Instead all signals pass the
same filter 1 / A(s), whose states are the derivatives of its output. Between samples a signal is
assumed to be constant ("zero-order") or a straight line ("first-order").

Time is measured in units of 1 / rate, rate = |a_0|^(1/n), so that all derivatives have about the
same size: p = s / rate.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np
from scipy.linalg import expm

from workbench._core.arrays import RealArray
from workbench.systems.sampling import respond

Hold = Literal["zero-order", "first-order"]
"""How a signal moves between its samples."""


@dataclass(frozen=True, eq=False)
class DerivativeFilter:
    """The filter p^i / A(p), i = 0 ... n, for records with a sampling period [s].

    denominator: A(s), descending powers (n + 1,), monic and stable.
    """

    denominator: RealArray
    period: float

    @cached_property
    def rate(self) -> float:
        """Unit of frequency [rad/s]."""
        return float(abs(self.denominator[-1]) ** (1.0 / self.order))

    @property
    def order(self) -> int:
        return len(self.denominator) - 1

    @cached_property
    def scaled(self) -> RealArray:
        """A(p), descending powers, monic."""
        found: RealArray = self.denominator / self.rate ** np.arange(self.order + 1.0)
        return found

    def derivatives(self, signal: RealArray, hold: Hold) -> RealArray:
        """p^i / A(p) of a signal (N,) for i = 0 ... n: (N, n + 1), initially at rest."""
        import control

        n = self.order
        a = np.eye(n, k=1)
        a[-1] = -self.scaled[:0:-1]
        b, c = np.zeros((n, 1)), np.vstack([np.eye(n), a[-1]])
        b[-1], d = 1.0, np.zeros((n + 1, 1))
        d[-1] = 1.0
        step = self.period * self.rate
        block = np.zeros((len(a) + 2, len(a) + 2))  # two more states: the signal, and its slope
        block[: len(a), : len(a) + 1] = step * np.hstack([a, b])
        block[-2, -1] = 1.0
        grown = expm(block)
        states, constant, slope = np.split(grown[: len(a)], [len(a), len(a) + 1], axis=1)
        change = np.zeros_like(signal)
        if hold == "first-order":
            change[:-1] = np.diff(signal)
        inputs = np.column_stack([signal, change])
        sampled = control.ss(states, np.hstack([constant, slope]), c, np.hstack([d, 0 * d]), True)
        return respond(sampled, inputs)


def mirrored(denominator: RealArray) -> RealArray:
    """The polynomial (n + 1,) with its roots of positive real part mirrored to the left."""
    roots = np.roots(denominator)
    found: RealArray = np.real(np.poly(np.where(roots.real > 0, -roots.conj(), roots)))
    return found
