"""Squared magnitudes of real polynomials, in bases that keep their digits over many decades.

A polynomial P(s) with real coefficients has |P(j omega)|^2 = prod(x + p_k^2), x = omega^2, over
its roots p_k, and every polynomial in x that is positive for x >= 0 is of this form, its roots all
in the left half plane (spectral factorisation). Here polynomials of degree n in x are written
relative to a current one: as Q(x) (c_0 + sum_k c_k / (x - xi_k)) / P(x), Q(x) = prod(x - xi_k),
with nodes xi_k at or beside the current roots, orthonormal over the frequencies. Their roots are
the eigenvalues of diag(xi) - 1 c^T / c_0, of a pencil where c_0 may vanish, as in vector fitting
(Gustavsen and Semlyen, IEEE Trans. Power Delivery 14, 1999).
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigvals

from workbench.arrays import ComplexArray, RealArray
from workbench.fitting.rational import paired

APART = 0.03
"""Least relative distance between nodes."""
BLUNT = 1e-2
"""Least damping ratio of nodes."""
NEAR = 1.5
"""Nodes stay within this factor of the frequencies."""
FAR = 1e5
"""Roots stay within this factor of the frequencies; those beyond change |W| by 1e-10."""
DAMPING = 1e-7
"""Least damping ratio: between grid points as close as 1e-3 it changes |W| by 1e-8 at most."""


class SquaredBasis:
    """Polynomials of degree n in x = omega^2, divided by a current one of roots (n,).

    Parameters
    ----------
    roots
        Roots [rad/s] of the current polynomial, in the left half plane.
    omega
        Frequencies [rad/s] (F,) over which the basis is orthonormal.

    Attributes
    ----------
    columns
        Basis at ``omega``, (F, n + 1).
    at_zero, at_infinity
        Rows (n + 1,) of unit length that give the sign at x = 0 and x = infinity.
    """

    def __init__(self, roots: ComplexArray, omega: RealArray) -> None:
        self.roots, self.omega = roots, omega
        self.nodes = _apart(roots, omega[0] / NEAR, omega[-1] * NEAR)
        triangle = np.linalg.qr(self._fractions(omega), mode="r")
        self._inverse = np.linalg.inv(triangle / np.sqrt(omega.size))
        self.columns = self(omega)
        self.at_zero = _unit(self._fractions(np.zeros(1))[0] @ self._inverse)
        self.at_infinity = _unit(self._inverse[0])

    def __call__(self, omega: RealArray) -> RealArray:
        """Basis (len(omega), n + 1) at frequencies [rad/s]."""
        return self._fractions(omega) @ self._inverse

    def zeros(self, coefficients: RealArray) -> ComplexArray:
        """Zeros in x, in units of (rad/s)^2, of a combination of the basis."""
        c, upper = self._inverse @ coefficients, np.flatnonzero(self.nodes.imag > 0)
        size = np.abs(self.nodes) ** 2
        middle = np.exp(np.mean(np.log(size))) if size.size else 1.0
        xi, grade = -(self.nodes**2) / middle, np.sqrt(size / middle)
        # real blocks [[a, b], [-b, a]] of input [2, 0] for pairs: zeros in exact pairs
        state, inputs, outputs = np.diag(xi.real), np.ones(xi.size), c[1:].copy()
        state[upper, upper + 1], state[upper + 1, upper] = xi.imag[upper], -xi.imag[upper]
        inputs[upper], inputs[upper + 1] = 2, 0
        outputs[upper], outputs[upper + 1] = c[1:][upper] / 2, c[1:][upper + 1] / 2
        residues = outputs.astype(complex)
        residues[upper] += 1j * outputs[upper + 1]
        residues[upper + 1] = residues[upper].conjugate()
        # a pencil, graded: no zero loses its digits beside far or infinite ones
        pencil = np.block(
            [
                [state / grade[:, None], (inputs / grade)[:, None]],
                [outputs[None] * grade**2, np.atleast_2d(c[0])],
            ]
        )
        zeros = eigvals(pencil, np.diag(np.append(1 / grade, 0.0)))
        far = (FAR * NEAR) ** 2 * np.abs(xi).max(initial=1.0)
        zeros = zeros[np.isfinite(zeros) & (np.abs(zeros) < far)]
        real, pairs = zeros[zeros.imag == 0].real + 0j, zeros[zeros.imag > 0]
        real = _polished(real, xi, c[0], residues * grade**2).real + 0j
        pairs = _polished(pairs, xi, c[0], residues * grade**2)
        beyond = np.full(xi.size - real.size - 2 * pairs.size, -far, dtype=complex)
        return np.asarray(np.concatenate([real, pairs, pairs.conj(), beyond]) * middle)

    def negative(self, coefficients: RealArray) -> RealArray:
        """Frequencies [rad/s] at which a combination of the basis is negative, one an interval."""
        crossings = _crossings(self.zeros(coefficients))
        if not crossings.size:
            return crossings
        inside = np.sqrt(crossings[:-1] * crossings[1:])
        tried = np.concatenate([[crossings[0] / 2], inside, [2 * crossings[-1]]])
        return tried[self(tried) @ coefficients < 0]

    def _fractions(self, omega: RealArray) -> RealArray:
        x = omega[:, None] ** 2
        size = np.abs(self.nodes) ** 2
        parts = size / (x + self.nodes**2)
        columns = np.where(self.nodes.imag < 0, parts.imag, parts.real)
        columns[:, self.nodes.imag > 0] = parts.real[:, self.nodes.imag > 0]
        return self.relative(omega)[:, None] * np.column_stack([np.ones(omega.size), columns])

    def relative(self, omega: RealArray) -> RealArray:
        """Q / P at frequencies [rad/s]."""
        x = omega[:, None] ** 2
        return np.asarray(np.prod((x + self.nodes**2) / (x + self.roots**2), axis=1).real)


def stable_roots(zeros: ComplexArray, omega: RealArray) -> ComplexArray:
    """Left half-plane roots [rad/s] of the polynomial in x with given zeros, repaired.

    A polynomial that is negative somewhere on x > 0 has no spectral factor; pairs of zeros around
    such an interval are moved together. ``omega`` [rad/s] are the frequencies that matter.
    """
    crossings = list(_crossings(zeros))
    negative, upper = zeros[(zeros.imag == 0) & (zeros.real <= 0)], zeros[zeros.imag > 0]
    pairs = -np.sqrt(-upper)
    roots = [*-np.sqrt(-negative), *pairs, *pairs.conj()]
    if len(crossings) % 2:  # negative as far as zero or infinity: moved out of reach there
        above = crossings[-1] / omega[-1] > omega[0] / crossings[0]
        crossings.pop(-1 if above else 0)
        roots.append(-FAR * omega[-1] if above else -omega[0] / FAR)
    for low, high in zip(crossings[::2], crossings[1::2], strict=True):
        roots += [1j * np.sqrt(low * high), -1j * np.sqrt(low * high)]
    return left_half_plane(np.array(roots, dtype=complex), omega)


def left_half_plane(roots: ComplexArray, omega: RealArray) -> ComplexArray:
    """Roots mirrored into the left half plane, of least damping, within reach of ``omega``."""
    roots = paired(roots)
    size = np.clip(np.abs(roots), omega[0] / FAR, omega[-1] * FAR)
    turn = np.where(roots == 0, -1, roots / np.where(roots == 0, 1, np.abs(roots)))
    damping = np.maximum(np.abs(turn.real), DAMPING)
    swing = np.sign(turn.imag) * np.sqrt(np.maximum(1 - damping**2, 0))
    return paired(size * (-damping + 1j * swing))


def _crossings(zeros: ComplexArray) -> RealArray:
    """Frequencies [rad/s] at the positive ones of zeros in x, sorted."""
    return np.sort(np.sqrt(zeros.real[(zeros.imag == 0) & (zeros.real > 0)]))


def _apart(roots: ComplexArray, low: float, high: float) -> ComplexArray:
    """Nodes beside roots: within [low, high], no two of them close, pairs with +j first."""
    nodes: list[complex] = []
    upper = roots[roots.imag >= 0]
    for root in upper[np.argsort(np.abs(upper))]:
        size = float(np.clip(abs(root), low, high))
        node = complex(root) * size / abs(root)
        if 0 < node.imag < APART * size:
            node = complex(node.real, APART * size)
        node = complex(min(node.real, -BLUNT * size), node.imag)
        while any(abs(node - other) < APART * abs(node) for other in nodes):
            node *= 1 + APART
        nodes += [node] if node.imag == 0 else [node, node.conjugate()]
    return np.array(nodes, dtype=complex)


def _polished(
    zeros: ComplexArray, xi: ComplexArray, constant: float, residues: ComplexArray
) -> ComplexArray:
    """Zeros of prod(x - xi) (constant + sum(residues / (x - xi))) from near ones, by Newton."""
    for _ in range(8):
        with np.errstate(all="ignore"):
            away = 1 / (zeros[:, None] - xi)
            value = constant + away @ residues
            correction = 1 / (away.sum(axis=1) - (away**2 @ residues) / value)
            usable = np.isfinite(correction) & (np.abs(correction) < 0.3 * np.abs(zeros))
        correction = np.where(usable, correction, 0)
        zeros = zeros - correction
        if np.all(np.abs(correction) <= 1e-14 * np.abs(zeros)):
            break
    return zeros


def _unit(row: RealArray) -> RealArray:
    return row / np.linalg.norm(row)
