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
from scipy.linalg import LinAlgError
from scipy.linalg.lapack import dggev

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.compiled import compiled, unchecked
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

POLISHING_STEPS = 8
"""Largest number of steps of Newton's method for each zero."""
POLISHING_REACH = 0.3
"""Largest step of Newton's method that is accepted, relative to the zero."""
POLISHING_END = 1e-14
"""Newton's method ends after a step below this, relative to the zero."""


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
        self.nodes = _separate_nodes(roots, omega[0] / NODE_RANGE, omega[-1] * NODE_RANGE)
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
        pencil, descriptor, far, middle = _pencil(self.nodes, self._inverse @ coefficients)
        real, imaginary, share, _, _, _, info = dggev(pencil, descriptor, 0, 0)
        if info > 0:
            raise LinAlgError("the zeros of a polynomial do not converge")
        found = _near(real, imaginary, share, far)
        poles, constant, residues = _secular(self.nodes, self._inverse @ coefficients)
        pairs = _polished_zeros(found[found.imag > 0], poles, constant, residues)
        single = _polished_zeros(found[found.imag == 0], poles, constant, residues).real
        beyond = np.full(self.nodes.size - single.size - 2 * pairs.size, -far)
        return np.concatenate([single, pairs, pairs.conj(), beyond]) * middle

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
        return np.asarray(_fractions(self.nodes, self.roots, omega))

    def relative(self, omega: RealArray) -> RealArray:
        """Q / P at frequencies [rad/s]."""
        return np.asarray(_fractions(self.nodes, self.roots, omega)[:, 0])


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


def _separate_nodes(roots: ComplexArray, low: float, high: float) -> ComplexArray:
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


@unchecked
def _fractions(nodes: ComplexArray, roots: ComplexArray, omega: RealArray) -> RealArray:
    """Q / P times 1 and the real partial fractions of the nodes, (F, n + 1)."""
    values = np.empty((omega.size, nodes.size + 1))
    for i in range(omega.size):
        x, relative = omega[i] ** 2, complex(1.0)
        for k in range(nodes.size):
            relative *= (x + nodes[k] ** 2) / (x + roots[k] ** 2)
        values[i, 0] = relative.real
        for k in range(nodes.size):
            part = (nodes[k].real ** 2 + nodes[k].imag ** 2) / (x + nodes[k] ** 2)
            values[i, k + 1] = relative.real * (part.imag if nodes[k].imag < 0 else part.real)
    return values


@compiled
def _middle(nodes: ComplexArray) -> float:
    """Geometric mean of the squared sizes of the nodes; 1 without nodes."""
    return float(np.exp(2 * np.mean(np.log(np.abs(nodes))))) if nodes.size else 1.0


@compiled
def _pencil(nodes: ComplexArray, c: RealArray) -> tuple[RealArray, RealArray, float, float]:
    """Pencil (n + 1, n + 1) and descriptor of the zeros in x / middle, their reach, and middle.

    The pencil is graded: zeros stay accurate beside very large or infinite ones. Pairs are real
    blocks [[a, b], [-b, a]] with input [2, 0], so that zeros come in exact pairs.
    """
    count, middle = nodes.size, _middle(nodes)
    pencil, descriptor = np.zeros((count + 1, count + 1)), np.zeros((count + 1, count + 1))
    far = 1.0
    for k in range(count):
        xi, grade = -(nodes[k] ** 2) / middle, np.abs(nodes[k]) / np.sqrt(middle)
        far = max(far, np.abs(xi))
        below = nodes[k].imag < 0
        pencil[k, k], descriptor[k, k] = xi.real / grade, 1 / grade
        pencil[k, count] = (0.0 if below else 2.0 if nodes[k].imag > 0 else 1.0) / grade
        pencil[count, k] = c[k + 1] * grade**2 / (1.0 if nodes[k].imag == 0 else 2.0)
        if nodes[k].imag > 0:
            pencil[k, k + 1], pencil[k + 1, k] = xi.imag / grade, -xi.imag / grade
    pencil[count, count] = c[0]
    return pencil, descriptor, (ROOT_RANGE * NODE_RANGE) ** 2 * far, middle


@compiled
def _secular(nodes: ComplexArray, c: RealArray) -> tuple[ComplexArray, float, ComplexArray]:
    """Poles (n,), constant and residues (n,) of the polynomial over Q, in x / middle."""
    middle = _middle(nodes)
    residues = np.empty(nodes.size, dtype=np.complex128)
    for k in range(nodes.size):
        size = np.abs(nodes[k]) ** 2 / middle
        if nodes[k].imag == 0:
            residues[k] = c[k + 1] * size
        elif nodes[k].imag > 0:
            residues[k] = (c[k + 1] + 1j * c[k + 2]) / 2 * size
            residues[k + 1] = residues[k].conjugate()
    return -(nodes**2) / middle, c[0], residues


@unchecked
def _near(real: RealArray, imaginary: RealArray, share: RealArray, far: float) -> ComplexArray:
    """The finite eigenvalues (real + j imaginary) / share whose size is below ``far``."""
    values = np.empty(real.size, dtype=np.complex128)
    count = 0
    for k in range(real.size):
        if np.hypot(real[k], imaginary[k]) < far * np.abs(share[k]):
            values[count] = complex(real[k] / share[k], imaginary[k] / share[k])
            count += 1
    return values[:count]


@unchecked
def _polished_zeros(
    zeros: ComplexArray, xi: ComplexArray, constant: float, residues: ComplexArray
) -> ComplexArray:
    """Zeros of prod(x - xi) (constant + sum(residues / (x - xi))), refined by Newton's method.

    Real zeros stay real.
    """
    found = zeros.copy()
    for i in range(found.size):
        x = found[i]
        for _ in range(POLISHING_STEPS):
            value, slope, whole = complex(constant), complex(0.0), complex(0.0)
            for k in range(xi.size):
                if x == xi[k]:
                    break
                away = 1 / (x - xi[k])
                value += residues[k] * away
                slope += residues[k] * away**2
                whole += away
            turned = whole * value - slope
            if turned == 0 or (x == xi).any():
                break
            step = value / turned
            if zeros[i].imag == 0:
                step = complex(step.real)
            # true for values that are not finite, too
            if not np.abs(step) < POLISHING_REACH * np.abs(x):
                break
            x -= step
            if np.abs(step) <= POLISHING_END * np.abs(x):
                break
        found[i] = x
    return found


def _unit(row: RealArray) -> RealArray:
    """The row scaled to length 1."""
    return row / np.linalg.norm(row)
