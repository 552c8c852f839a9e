"""Functions h for proofs that no controller reaches a level, and bounds on h over a cell.

h is analytic in the right half-plane, except for simple poles where T = L / (1 + L) is known: at
the plant's zeros, where T = 0, and at the plant's poles, where T = 1.
"""

from __future__ import annotations

from dataclasses import KW_ONLY, dataclass, field
from typing import NamedTuple

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench.errors import InputError
from workbench.synthesis.limits.intervals import ComplexInterval, Interval, up
from workbench.synthesis.limits.rational_bounds import FrequencyCells, relative_factor, root_factor

NONE = np.empty(0, complex)


class Tangent(NamedTuple):
    """Linear bound on h over cells: |h(omega) - value - slope (omega - middle)| <= error (F,)."""

    value: ComplexArray
    slope: ComplexArray
    error: RealArray


@dataclass(frozen=True, eq=False)
class AnalyticBasis:
    """Basis functions; h is a sum of them with real coefficients.

    For each corner a there is 2 a / (s + a) times the all-pass functions of the corners before it.
    For each zero or pole p of the plant in the right half-plane there is 2 |p| / (s - p), or two
    such functions for a complex pair.

    Parameters
    ----------
    corners
        Corner frequencies a [rad/s] (N,), positive. They should cover the frequencies where |T|
        decreases.
    band_hz
        Lowest and highest frequency [Hz] of the search for h. A proof covers all frequencies.
    zeros, poles
        The plant's zeros and poles [rad/s] in the open right half-plane, one of each complex pair.

    Raises
    ------
    InputError
        A corner is not positive; the band is not an increasing pair; or a zero or pole is not in
        the right half-plane or is given twice.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.synthesis import AnalyticBasis
    >>> basis = AnalyticBasis(np.geomspace(0.1, 10.0, 8), (1e-3, 1e3), poles=[1.0])
    >>> basis.size
    9
    """

    corners: RealArray
    band_hz: tuple[float, float]
    _: KW_ONLY
    zeros: ComplexArray = field(default_factory=lambda: NONE)
    poles: ComplexArray = field(default_factory=lambda: NONE)

    def __post_init__(self) -> None:
        corners = np.atleast_1d(np.asarray(self.corners, dtype=float))
        if not corners.size or not (np.isfinite(corners) & (corners > 0.0)).all():
            raise InputError("corners must be positive frequencies [rad/s], at least one")
        low, high = self.band_hz
        if not 0.0 < low < high < np.inf:
            raise InputError(
                f"band_hz is {self.band_hz}; it must be two frequencies [Hz], low and high"
            )
        object.__setattr__(self, "corners", corners)
        for name in ("zeros", "poles"):
            given = np.atleast_1d(np.asarray(getattr(self, name), dtype=complex))
            if not (np.isfinite(given) & (given.real > 0.0) & (given.imag >= 0.0)).all():
                raise InputError(f"{name} must have positive real parts, one of each pair: {given}")
            object.__setattr__(self, name, given)
        points = np.concatenate([self.zeros, self.poles])
        if len(np.unique(points)) < len(points):
            raise InputError(f"zeros and poles must differ from each other, they are {points}")

    @property
    def size(self) -> int:
        """Number of functions."""
        return len(self.corners) + len(self._fractions[0])

    @property
    def known(self) -> RealArray:
        """Integral of Re(T h) over omega from 0 to infinity, divided by pi, for each function (N,).

        It is the same for all stabilising controllers: by Cauchy's theorem it is minus the sum of
        the residues of T h in the right half-plane.
        """
        points, weights = self._fractions
        one = np.isin(points, self.poles)
        residues = np.where(one, weights.real * np.where(points.imag > 0.0, 2.0, 1.0), 0.0)
        return np.concatenate([np.zeros(len(self.corners)), -residues])

    def midpoints(self, parts: int) -> tuple[RealArray, RealArray]:
        """Middles [rad/s] (F,) and widths of equal parts of the band.

        The parts have equal length in log omega.
        """
        ends = 2 * np.pi * np.geomspace(*self.band_hz, parts + 1)
        omega = np.sqrt(ends[1:] * ends[:-1])
        return omega, omega * np.log(ends[1:] / ends[:-1])

    def response(self, omega: RealArray) -> ComplexArray:
        """Responses (F, N) of the functions at frequencies [rad/s] (F,)."""
        s = 1j * omega[:, None]
        corners = self.corners
        passed = np.cumprod((s - corners[:-1]) / (s + corners[:-1]), axis=1)
        before = np.concatenate([np.ones((len(omega), 1)), passed], axis=1)
        smooth = 2 * corners / (s + corners) * before
        points, weights = self._fractions
        pair = np.where(points.imag > 0.0, weights.conj() / (s - points.conj()), 0.0)
        return np.concatenate([smooth, weights / (s - points) + pair], axis=1)

    @np.errstate(all="ignore")
    def tangent(self, x: RealArray, cells: FrequencyCells) -> Tangent:
        """Linear bounds on h with coefficients x (N,) over cells, by Taylor's theorem.

        Value and slope are computed at the middle. The triangle inequality bounds the second
        derivative over the cell. The error includes all rounding.
        """
        s, none = Interval.of(cells.middle), Interval.of(np.zeros(cells.low.shape))
        h = slope = ComplexInterval(none, none)
        size = steep = bent = none  # upper bounds on |h|, |h'| and |h''| over the cell
        count = len(self.corners)
        for a, each in zip(self.corners[::-1], x[:count][::-1], strict=True):
            # h becomes (2 a x + (s - a) h) / (s + a) = q h + turn x
            u = _inverse(-a, s)
            turn = u.scaled(2 * a)
            q = ComplexInterval(1.0 - turn.real, -turn.imag)
            slope = q * slope + turn * u * ComplexInterval(h.real - each, h.imag)
            h = q * h + turn.scaled(each)
            u_most = 1.0 / root_factor(-a, cells.all).size()
            more = u_most * (2 * a)
            left = size + abs(each)
            bent = bent + more * u_most * 2 * (steep + u_most * left)
            steep = steep + more * u_most * left
            size = size + more * abs(each)
        for point, weight in self._simple_poles(x):
            u = _inverse(point, s)
            part = u * ComplexInterval(Interval.of(weight.real), Interval.of(weight.imag))
            h, slope = h + part, slope + (part * u).scaled(-1.0)
            u_most = 1.0 / root_factor(point, cells.all).size()
            bent = (
                bent
                + u_most * u_most * u_most * (Interval.of(abs(weight.real)) + abs(weight.imag)) * 2
            )
        value, along = _middle(h), _middle(slope)
        radius = Interval.of(cells.radius)
        rounded = _radius(h) + _radius(slope) * radius
        # d / d omega is j d / ds
        return Tangent(value, 1j * along, (rounded + radius * radius * bent * 0.5).high)

    def decay(self, x: RealArray, lowest: float) -> float:
        """A number c with |h(j omega)| <= c / omega above the frequency `lowest` [rad/s]."""
        found = Interval.of(0.0)
        for a, each in zip(self.corners, x, strict=False):
            found = found + Interval.of(2 * a) * abs(each)
        inverse = Interval(np.zeros(()), up(1.0 / lowest))
        for point, weight in self._simple_poles(x):
            size = Interval.of(abs(weight.real)) + abs(weight.imag)
            found = found + size / relative_factor(point, inverse)
        return float(found.high)

    @property
    def _fractions(self) -> tuple[ComplexArray, ComplexArray]:
        """Points p and weights c of the functions c / (s - p), including the conjugate of a complex
        pair.

        Weights are powers of two, times j for the second function of a pair, so that products with
        them are exact.
        """
        points = np.concatenate([self.zeros, self.poles])
        pairs = points[points.imag > 0.0]
        turn = np.concatenate([np.ones(len(points)), np.full(len(pairs), 1j)])
        both = np.concatenate([points, pairs])
        return both, 2.0 ** np.ceil(np.log2(2 * np.abs(both))) * turn

    def _simple_poles(self, x: RealArray) -> list[tuple[complex, complex]]:
        """Poles p of h in the right half-plane and their residues, including conjugates."""
        points, weights = self._fractions
        found = []
        for point, residue in zip(points, weights * x[len(self.corners) :], strict=True):
            found.append((complex(point), complex(residue)))
            if point.imag > 0.0:
                found.append((complex(point.conjugate()), complex(residue.conjugate())))
        return found


def _inverse(root: complex, omega: Interval) -> ComplexInterval:
    """1 / (j omega - root)."""
    away = root_factor(root, omega)
    square = away.real.squared() + away.imag.squared()
    return ComplexInterval(away.real / square, -away.imag / square)


def _middle(box: ComplexInterval) -> ComplexArray:
    """A number in the middle of each box."""
    real, imag = ((each.low + each.high) / 2 for each in (box.real, box.imag))
    found: ComplexArray = real + 1j * imag
    return found


def _radius(box: ComplexInterval) -> Interval:
    """Largest distance of a number in each box from its `_middle`."""
    middle = _middle(box)
    return ComplexInterval(box.real - middle.real, box.imag - middle.imag).size()
