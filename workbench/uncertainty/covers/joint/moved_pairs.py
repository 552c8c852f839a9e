"""Rational functions of the same order with a pair of poles and of zeros at another frequency.

A search by small steps hardly moves a pair of roots from one resonance to another, since the
function is worse on the way.
"""

from __future__ import annotations

from itertools import product

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.fitting.rational import Rational

NEW_DAMPING = 0.02, 0.5
"""Least and largest damping ratio of new pairs of roots. Less damping makes peaks that fall between
frequencies; more makes real roots. Half or double changes which starts are drawn.
"""
NEW_SPREAD, APART = 0.15, 0.05
"""Standard deviation of the logarithm of a new frequency from the wanted one, and of the distance
between its poles and zeros. The first is a fifth of an octave; the second makes pairs that change
the response near their frequency only. Half or double changes which starts are drawn.
"""


def with_moved_pair(
    function: Rational, omega: RealArray, wanted: float, rng: np.random.Generator
) -> Rational | None:
    """The function whose pairs of poles and zeros that nearly cancel are near a wanted frequency
    [rad/s]; None if it has no pairs.
    """
    choices = list(product(_pairs(function.poles), _pairs(function.zeros)))
    if not choices:
        return None
    s = 1j * omega

    def ratio(poles: list[int], zeros: list[int]) -> ComplexArray:
        """The factor (F,) of a pair of poles and a pair of zeros."""
        top = np.prod(s[:, None] - function.zeros[zeros], axis=1)
        return np.asarray(top / np.prod(s[:, None] - function.poles[poles], axis=1))

    def variation(choice: tuple[list[int], list[int]]) -> float:
        """Mean square of the logarithm of the factor's size about its mean, and of its phase."""
        found = ratio(*choice)
        angle = np.angle(found * np.sign(found.real.sum() or 1.0))
        return float(np.log(np.abs(found)).var() + np.mean(angle**2))

    poles, zeros = min(choices, key=variation)
    old = ratio(poles, zeros)
    gain = np.exp(np.log(np.abs(old)).mean()) * np.sign(old.real.sum() or 1.0)
    place = wanted * np.exp(NEW_SPREAD * rng.standard_normal())
    least, largest = np.log(NEW_DAMPING)
    damping = np.exp(rng.uniform(least, largest, 2))
    places = place * np.exp(APART * rng.standard_normal(2))
    added = [_pair(*each) for each in zip(places, damping, strict=True)]
    return Rational(
        np.concatenate([np.delete(function.zeros, zeros), added[0]]),
        np.concatenate([np.delete(function.poles, poles), added[1]]),
        function.gain * float(gain),
    )


def _pairs(roots: ComplexArray) -> list[list[int]]:
    """Indices of complex conjugate pairs, and of real roots in pairs of neighbours."""
    found = [
        [int(i), int(np.flatnonzero(roots == roots[i].conjugate())[0])]
        for i in np.flatnonzero(roots.imag > 0)
    ]
    real = np.flatnonzero(roots.imag == 0)
    real = real[np.argsort(np.abs(roots[real]))]
    return found + [real[i : i + 2].tolist() for i in range(0, real.size - 1, 2)]


def _pair(frequency: float, damping: float) -> ComplexArray:
    """A conjugate pair of roots left of the axis."""
    root = frequency * complex(-damping, np.sqrt(1 - damping**2))
    return np.array([root, root.conjugate()])
