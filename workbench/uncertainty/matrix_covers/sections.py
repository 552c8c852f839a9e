"""Weights as quotients of sections with positive coefficients, stable with stable inverses."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from workbench._core.arrays import Array, ComplexArray, RealArray
from workbench.fitting.rational import Rational, conjugate_pairs


@dataclass(frozen=True)
class RootSections:
    """Coefficients of quadratic sections (q, 2) and of linear ones (l,), as functions of their
    logarithms.
    """

    quadratic: int
    linear: int

    @property
    def count(self) -> int:
        return 2 * self.quadratic + self.linear

    def logs(self, x: RealArray, omega: RealArray) -> tuple[RealArray, RealArray]:
        """Logarithm of the product's magnitude (F,), and its slope (F, count) by x."""
        square = (omega**2)[:, None]
        a, b = np.exp(x[: 2 * self.quadratic].reshape(-1, 2)).T
        size = (b - square) ** 2 + a**2 * square
        c = np.exp(x[2 * self.quadratic :])
        lines = square + c**2
        slope = np.concatenate(
            [
                np.stack([a**2 * square / size, (b - square) * b / size], axis=2).reshape(
                    len(omega), -1
                ),
                c**2 / lines,
            ],
            axis=1,
        )
        return (np.log(size).sum(axis=1) + np.log(lines).sum(axis=1)) / 2, slope

    def roots(self, x: RealArray) -> ComplexArray:
        pairs = np.exp(x[: 2 * self.quadratic].reshape(-1, 2))
        found = [np.roots([1.0, a, b]) for a, b in pairs]
        found.append(-np.exp(x[2 * self.quadratic :]))
        return conjugate_pairs(np.concatenate([*found, np.zeros(0)]).astype(complex))


def sections_of(roots: ComplexArray) -> tuple[RootSections, RealArray]:
    """RootSections with these roots, and the logarithms of their coefficients."""
    upper = roots[roots.imag > 0]
    reals = np.sort(-roots[roots.imag == 0].real)
    pairs = [(-2 * root.real, abs(root) ** 2) for root in upper]
    pairs += [(p + q, p * q) for p, q in zip(reals[0:-1:2], reals[1::2], strict=True)]
    linear = reals[2 * (reals.size // 2) :]
    x = np.log(np.concatenate([np.ravel(pairs), linear]))
    return RootSections(len(pairs), linear.size), x


class SideOfWeights:
    """The weights of one side at frequencies of the bilinear plane, in a unit of frequency."""

    def __init__(self, axis: RealArray, unit: float, fits: Sequence[Rational]) -> None:
        self.unit = unit
        self.omega = axis / unit
        self.gains = [np.log(abs(fit.gain)) + (fit.zeros.size - fit.poles.size) * np.log(self.unit)
                      for fit in fits]  # fmt: skip
        found = [sections_of(roots / self.unit) for fit in fits for roots in (fit.zeros, fit.poles)]
        self.sections = [sections for sections, _ in found]
        self.start = np.concatenate([x for _, x in found]) if found else np.zeros(0)
        self.ends = np.cumsum([sections.count for sections in self.sections])[:-1]

    def logs(self, x: RealArray) -> tuple[RealArray, Array]:
        """Logarithms of the weights' sizes (F, channels), and slopes (F, channels, d)."""
        F, channels = self.omega.size, len(self.gains)
        logs = np.tile(np.array(self.gains), (F, 1))
        slopes = np.zeros((F, channels, x.size))
        place = 0
        for number, (sections, part) in enumerate(
            zip(self.sections, np.split(x, self.ends), strict=True)
        ):
            value, slope = sections.logs(part, self.omega)
            sign = 1.0 if number % 2 == 0 else -1.0  # zeros and poles alternate
            logs[:, number // 2] += sign * value
            slopes[:, number // 2, place : place + part.size] = sign * slope
            place += part.size
        return logs, slopes

    def fits(self, x: RealArray) -> list[Rational]:
        """The weights with these coefficients."""
        roots = [
            self.unit * sections.roots(part)
            for sections, part in zip(self.sections, np.split(x, self.ends), strict=True)
        ]
        gains = np.exp(self.gains)
        return [
            Rational(zeros, poles, float(gain * self.unit ** (poles.size - zeros.size)))
            for zeros, poles, gain in zip(roots[::2], roots[1::2], gains, strict=True)
        ]
