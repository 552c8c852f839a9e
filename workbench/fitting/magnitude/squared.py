"""Squared magnitudes of real polynomials, in bases that stay accurate over many decades.

A polynomial P(s) with real coefficients and roots p_k has |P(j omega)|^2 = prod(x + p_k^2),
x = omega^2. Conversely every polynomial in x that is positive for x >= 0 has this form with all
p_k in the left half plane (spectral factorisation). Here polynomials of degree n in x are written
relative to a current one P, as Q(x) (c_0 + sum_k c_k / (x - xi_k)) / P(x), Q(x) = prod(x - xi_k).
The nodes xi_k lie at or beside the current roots, and the basis is orthonormal over the
frequencies. The zeros are the eigenvalues of diag(xi) - 1 c^T / c_0, computed as those of a pencil
because c_0 may vanish, as in vector fitting (Gustavsen and Semlyen, IEEE Trans. Power Delivery 14,
1999).
"""

from __future__ import annotations

import numpy as np
from scipy.linalg import eigvals

from workbench.arrays import ComplexArray, RealArray
from workbench.fitting.rational import conjugate_pairs

NODE_DISTANCE = 0.03
"""Smallest distance between nodes, relative to their size."""
NODE_DAMPING = 1e-2
"""Smallest damping ratio of nodes."""
NODE_RANGE = 1.5
"""Largest factor by which nodes may lie below or above the band of the frequencies."""
ROOT_RANGE = 1e5
"""Largest factor by which roots may lie below or above the band; others change |W| by 1e-10."""
ROOT_DAMPING = 1e-7
"""Smallest damping ratio of roots; it changes |W| by 1e-8 at frequencies a relative 1e-3 apart."""


class SquaredBasis:
    """Basis of the polynomials of degree n in x = omega^2, relative to a current polynomial.

    Parameters
    ----------
    roots
        Roots (n,) [rad/s] of the current polynomial, in the left half plane.
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
        self.nodes = _apart(roots, omega[0] / NODE_RANGE, omega[-1] * NODE_RANGE)
        triangle = np.linalg.qr(self._fractions(omega), mode="r")
        self._inverse = np.linalg.inv(triangle / np.sqrt(omega.size))
        self.columns = self(omega)
        self.at_zero = _unit(self._fractions(np.zeros(1))[0] @ self._inverse)
        self.at_infinity = _unit(self._inverse[0])

    def __call__(self, omega: RealArray) -> RealArray:
        """Basis (len(omega), n + 1) at frequencies [rad/s]."""
        return self._fractions(omega) @ self._inverse

    def zeros(self, coefficients: RealArray) -> ComplexArray:
        """Zeros (n,) in x [(rad/s)^2] of the polynomial with given coefficients."""
        c, upper = self._inverse @ coefficients, np.flatnonzero(self.nodes.imag > 0)
        size = np.abs(self.nodes) ** 2
        middle = np.exp(np.mean(np.log(size))) if size.size else 1.0
        xi, grade = -(self.nodes**2) / middle, np.sqrt(size / middle)
        # pairs as real blocks [[a, b], [-b, a]] with input [2, 0]: zeros come in exact pairs
        state, inputs, outputs = np.diag(xi.real), np.ones(xi.size), c[1:].copy()
        state[upper, upper + 1], state[upper + 1, upper] = xi.imag[upper], -xi.imag[upper]
        inputs[upper], inputs[upper + 1] = 2, 0
        outputs[upper], outputs[upper + 1] = c[1:][upper] / 2, c[1:][upper + 1] / 2
        residues = outputs.astype(complex)
        residues[upper] += 1j * outputs[upper + 1]
        residues[upper + 1] = residues[upper].conjugate()
        # a graded pencil: zeros stay accurate beside very large or infinite ones
        pencil = np.block(
            [
                [state / grade[:, None], (inputs / grade)[:, None]],
                [outputs[None] * grade**2, np.atleast_2d(c[0])],
            ]
        )
        zeros = eigvals(pencil, np.diag(np.append(1 / grade, 0.0)))
        far = (ROOT_RANGE * NODE_RANGE) ** 2 * np.abs(xi).max(initial=1.0)
        zeros = zeros[np.isfinite(zeros) & (np.abs(zeros) < far)]
        real, pairs = zeros[zeros.imag == 0].real + 0j, zeros[zeros.imag > 0]
        real = _polished(real, xi, c[0], residues * grade**2).real + 0j
        pairs = _polished(pairs, xi, c[0], residues * grade**2)
        beyond = np.full(xi.size - real.size - 2 * pairs.size, -far, dtype=complex)
        return np.asarray(np.concatenate([real, pairs, pairs.conj(), beyond]) * middle)

    def negative(self, coefficients: RealArray) -> RealArray:
        """Frequencies [rad/s] at which a combination is negative, one for each such interval."""
        crossings = _crossings(self.zeros(coefficients))
        if not crossings.size:
            return crossings
        inside = np.sqrt(crossings[:-1] * crossings[1:])
        tried = np.concatenate([[crossings[0] / 2], inside, [2 * crossings[-1]]])
        return tried[self(tried) @ coefficients < 0]

    def _fractions(self, omega: RealArray) -> RealArray:
        """Q / P times 1 and the real partial fractions of the nodes, (len(omega), n + 1)."""
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
    """Roots [rad/s] in the left half plane of the spectral factor of a polynomial in x.

    ``zeros`` [(rad/s)^2] are the polynomial's, ``omega`` [rad/s] the frequencies of interest. A
    polynomial that is negative somewhere on x > 0 has no spectral factor: it is repaired by moving
    the two zeros around each such interval together.
    """
    crossings = list(_crossings(zeros))
    negative, upper = zeros[(zeros.imag == 0) & (zeros.real <= 0)], zeros[zeros.imag > 0]
    pairs = -np.sqrt(-upper)
    roots = [*-np.sqrt(-negative), *pairs, *pairs.conj()]
    if len(crossings) % 2:  # negative down to zero or up to infinity: move that zero far away
        above = crossings[-1] / omega[-1] > omega[0] / crossings[0]
        crossings.pop(-1 if above else 0)
        roots.append(-ROOT_RANGE * omega[-1] if above else -omega[0] / ROOT_RANGE)
    for low, high in zip(crossings[::2], crossings[1::2], strict=True):
        roots += [1j * np.sqrt(low * high), -1j * np.sqrt(low * high)]
    return left_half_plane(np.array(roots, dtype=complex), omega)


def left_half_plane(roots: ComplexArray, omega: RealArray) -> ComplexArray:
    """Roots mirrored into the left half plane and kept within ROOT_DAMPING and ROOT_RANGE."""
    roots = conjugate_pairs(roots)
    size = np.clip(np.abs(roots), omega[0] / ROOT_RANGE, omega[-1] * ROOT_RANGE)
    turn = np.where(roots == 0, -1, roots / np.where(roots == 0, 1, np.abs(roots)))
    damping = np.maximum(np.abs(turn.real), ROOT_DAMPING)
    swing = np.sign(turn.imag) * np.sqrt(np.maximum(1 - damping**2, 0))
    return conjugate_pairs(size * (-damping + 1j * swing))


def _crossings(zeros: ComplexArray) -> RealArray:
    """Frequencies [rad/s], rising, of the positive real zeros in x."""
    return np.sort(np.sqrt(zeros.real[(zeros.imag == 0) & (zeros.real > 0)]))


def _apart(roots: ComplexArray, low: float, high: float) -> ComplexArray:
    """Nodes near the roots: sizes within [low, high], no two nodes close, +j first in pairs."""
    nodes: list[complex] = []
    upper = roots[roots.imag >= 0]
    for root in upper[np.argsort(np.abs(upper))]:
        size = float(np.clip(abs(root), low, high))
        node = complex(root) * size / abs(root)
        if 0 < node.imag < NODE_DISTANCE * size:
            node = complex(node.real, NODE_DISTANCE * size)
        node = complex(min(node.real, -NODE_DAMPING * size), node.imag)
        while any(abs(node - other) < NODE_DISTANCE * abs(node) for other in nodes):
            node *= 1 + NODE_DISTANCE
        nodes += [node] if node.imag == 0 else [node, node.conjugate()]
    return np.array(nodes, dtype=complex)


def _polished(
    zeros: ComplexArray, xi: ComplexArray, constant: float, residues: ComplexArray
) -> ComplexArray:
    """Zeros of prod(x - xi) (constant + sum(residues / (x - xi))), refined by Newton's method."""
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
    """The row scaled to length 1."""
    return row / np.linalg.norm(row)
