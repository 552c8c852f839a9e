"""Search for the weights that prove the largest lower bound on the inflation of a nominal.

For weights w >= 0 of the points p at the frequencies, every nominal P / Q has a point with

    |p - P / Q|^2 / E^2 >= min over P, Q of  sum w |P - p Q|^2 / E^2  /  sum w |Q|^2,

where E are the extents of the narrowest sets. The minimum is a generalised eigenvalue. The weights
that maximise it are sought by bisection: at a value below the largest bound, a semidefinite program
finds weights with which the form is positive.
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import LinAlgError, eigh
from scipy.sparse import csr_array, vstack

from workbench._core.arrays import ComplexArray, RealArray
from workbench.certify.cones.form import ConeFactor, ConeKind, ConicForm, triangle
from workbench.conic.numeric import minimiser
from workbench.fitting.rational import Rational
from workbench.fitting.response.numerator import NumeratorBasis

STARTING_FREQUENCIES = 40
"""Number of frequencies whose points are weighted at first. They hold most peaks; rounds add the
others. Half or double changes the number of rounds and the time.
"""
MOST_ROUNDS = 6
"""Largest number of rounds, each of which adds the frequencies where a nominal is too far away.
They end earlier by `BOUND_TOLERANCE`. With half of them a bound may be smaller, and is proven as
well; double costs time.
"""
BOUND_TOLERANCE = 2e-3
"""Relative width of the interval of the squared bound that ends a bisection, and least increase of
it in a round. The bound then has 0.1 %. With half of it each search takes a program more; double
loosens the bound by 0.1 %.
"""
LEAST_WEIGHT = 1e-9
"""Weights below this share of the largest one are dropped. They are a solver's rounding. Half or
double changes a bound by as little.
"""
BALANCE = 1e-3
"""Share of the largest weight that is added to all, where the weights give the coordinates of the
next program. It keeps the coordinates regular where few weights are positive. Half or double
changes the solver's accuracy, and no proof.
"""


class PointForms:
    """Quadratic forms of the coefficients of P and Q, in bases orthonormal over the frequencies.

    Parameters
    ----------
    omega, points, extents
        Frequencies (F,) [rad/s], points (F, N), and extents (F,) of the sets around them.
    near
        A nominal near the points, over whose denominator P and Q are taken.
    zeros, order
        Degrees of P and Q.
    """

    def __init__(
        self,
        omega: RealArray,
        points: ComplexArray,
        extents: RealArray,
        near: Rational,
        zeros: int,
        order: int,
    ) -> None:
        unit = float(np.sqrt(omega[0] * omega[-1]))
        x, poles = omega / unit, near.poles / unit
        bases = (
            NumeratorBasis.over(x, weight, poles, degree).columns * np.sqrt(omega.size)
            for weight, degree in ((1 / extents, zeros), (np.ones_like(x), order))
        )
        self.top, self.bottom = (part[: x.size] + 1j * part[x.size :] for part in bases)
        self.relative = points / extents[:, None]
        denominator = np.abs(Rational(np.zeros(0, dtype=complex), poles, 1.0).response(x))
        away = np.abs(self.relative - (near.response(omega) / extents)[:, None])
        self.reached = float(away.max()) ** 2
        """Squared inflation of the nominal near the points, which no bound exceeds."""
        self.share = (denominator / extents) ** 2
        """Factor (F,) of weights that makes them weights of |P - p Q|^2, in powers of s."""

    def rows(self, f: np.ndarray) -> tuple[ComplexArray, ComplexArray]:
        """Rows of (P - p Q) / E for each point (f, N, C), and of Q (f, C), over the
        coefficients.
        """
        top, bottom = self.top[f], self.bottom[f]
        beside = -self.relative[f][:, :, None] * bottom[:, None, :]
        first = np.broadcast_to(top[:, None, :], (*beside.shape[:2], top.shape[1]))
        return np.concatenate([first, beside], axis=2), np.hstack([np.zeros_like(top), bottom])

    def distances(self, x: RealArray) -> RealArray:
        """Largest distance |p - P / Q| / E (F,) of a point from the nominal of coefficients."""
        split = self.top.shape[1]
        with np.errstate(all="ignore"):
            nominal = (self.top @ x[:split]) / (self.bottom @ x[split:])
            away = np.abs(self.relative - nominal[:, None]).max(axis=1)
        return np.where(np.isfinite(away), away, np.inf)


def best_weights(forms: PointForms) -> RealArray | None:
    """The weights (F, N) that prove the largest bound found; None if there is none above 0."""
    count = len(forms.relative)
    chosen = np.unique(np.linspace(0, count - 1, min(STARTING_FREQUENCIES, count)).astype(int))
    best, weights = 0.0, None
    for _ in range(MOST_ROUNDS):
        square, found, nominal = _raised(forms, chosen, best)
        if square <= best * (1 + BOUND_TOLERANCE):
            break
        best, weights = square, np.zeros(forms.relative.shape)
        weights[chosen] = found
        worst = forms.distances(nominal)
        peak = (worst >= np.roll(worst, 1)) & (worst >= np.roll(worst, -1))
        further = np.flatnonzero(peak & (worst**2 > best * (1 + BOUND_TOLERANCE)))
        if np.isin(further, chosen).all():
            break
        chosen = np.union1d(chosen, further)
    return None if weights is None else weights * forms.share[:, None]


def _raised(
    forms: PointForms, chosen: np.ndarray, known: float
) -> tuple[float, RealArray, RealArray]:
    """The best squared bound above a known one from points at chosen frequencies (f,), its weights
    (f, N), and the coefficients of the nominal that comes nearest by these weights.
    """
    away, below = forms.rows(chosen)
    far = np.einsum("fni,fnj->fnij", away, away.conj()).real
    near = np.broadcast_to(np.einsum("fi,fj->fij", below, below.conj()).real[:, None], far.shape)
    best, found = 0.0, np.ones(far.shape[:2]) / np.trace(far, axis1=2, axis2=3)
    nominal = np.zeros(far.shape[-1])
    low, high = known, forms.reached
    while high > low * (1 + BOUND_TOLERANCE):
        middle = (low + high) / 2
        balance = found + BALANCE * found.max()
        try:
            root = np.linalg.inv(np.linalg.cholesky(_sum(balance, far)))
            weights = _most_positive(root @ (far - middle * near) @ root.T)
            if weights is None:
                break
            values, vectors = eigh(_sum(weights, near), _sum(weights, far))
        except LinAlgError:
            break
        square = 1 / float(values[-1]) if values[-1] > 0 else 0.0
        if square > best:
            best, found, nominal = square, weights, vectors[:, -1]
        low = max(low, square)
        if square < middle:
            high = middle
    return best, found, nominal


def _sum(weights: RealArray, forms: RealArray) -> RealArray:
    return np.asarray(np.tensordot(weights, forms, axes=2))


def _most_positive(forms: RealArray) -> RealArray | None:
    """Weights (f, N) with which the sum of forms (f, N, C, C) has the largest least eigenvalue.

    The sum of the weights is 1 in units of the largest entries of the forms.
    """
    unit = np.abs(forms).max(axis=(2, 3))
    order = forms.shape[-1]
    i, j = np.array(triangle(order)).T
    columns = (forms / unit[..., None, None])[..., i, j].reshape(unit.size, -1).T
    count = unit.size
    one = np.append(np.ones(count), 0.0)
    level = (i == j).astype(float)[:, None]
    rows = vstack([
        csr_array(one[None, :]),
        csr_array((-np.ones(count), (np.arange(count),) * 2), shape=(count, count + 1)),
        csr_array(np.hstack([-columns, level])),
    ])  # fmt: skip
    cones = (
        ConeFactor(ConeKind.ZERO, 1),
        ConeFactor(ConeKind.NONNEGATIVE, count),
        ConeFactor(ConeKind.SEMIDEFINITE, order),
    )
    sides = np.append(1.0, np.zeros(count + i.size))
    found = minimiser(ConicForm(one - 1.0, rows, sides, cones))
    if found is None:
        return None
    weights = np.maximum(found[:-1], 0.0)
    weights[weights < LEAST_WEIGHT * weights.max()] = 0.0
    return weights.reshape(unit.shape) / unit if weights.any() else None
