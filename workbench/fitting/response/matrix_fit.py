"""Stable systems of a given order fitted to matrix responses.

Vector fitting with the same poles in every entry (B. Gustavsen and A. Semlyen, IEEE Trans. Power
Delivery 14(3), 1999) gives the poles and a matrix residue for each, of which the largest singular
value is kept. Poles, residues and the direct term are then moved together by Gauss-Newton steps.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.optimize import least_squares

from workbench._core.arrays import Array, ComplexArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.fitting.response.numerator import real_over_imaginary
from workbench.fitting.response.vector_fitting import (
    off_the_axis,
    partial_fractions,
    real_groups,
    relocated_poles,
    spread_poles,
)
from workbench.fitting.samples import as_count, as_frequencies
from workbench.input_checks import as_array
from workbench.systems.realisation import realisation

RELOCATIONS = 20
"""Number of relocations of the poles."""
EVALUATIONS = 200
"""Largest number of evaluations in the Gauss-Newton steps."""
LEAST_DAMPING = 1e-4
"""Least damping ratio of a pole in the fit."""


def fit_matrix_response(omega: Any, values: Any, order: int, *, weight: Any = None) -> StateSpace:
    """A stable continuous-time system of a given order whose response is near given matrices.

    Parameters
    ----------
    omega
        Frequencies (F,) [rad/s], positive and rising.
    values
        Complex responses (F, p, m).
    order
        Number of states.
    weight
        Weights (F, p, m) of the errors, whose squares are summed; None: at each frequency errors
        are relative to the largest entry.

    Raises
    ------
    InputError
        Other data, or too few frequencies for the order.

    Examples
    --------
    >>> import numpy as np
    >>> from workbench.fitting import fit_matrix_response
    >>> omega = np.geomspace(0.1, 10, 30)
    >>> values = np.array([[[1 / (1j * w + 1)], [2 / (1j * w + 1)]] for w in omega])
    >>> G = fit_matrix_response(omega, values, order=1)
    >>> G.poles().real.round(4).tolist(), G.noutputs
    ([-1.0], 2)
    """
    omega = as_frequencies(omega)
    values = as_array(values, "values", dtype=complex)
    if values.ndim != 3 or len(values) != omega.size or not np.isfinite(values).all():
        raise InputError(
            f"finite values of shape ({omega.size}, p, m) are needed, not of {values.shape}"
        )
    order = as_count("order", order)
    if order > omega.size - 1:
        raise InputError(f"order {order} needs more than {omega.size} frequencies")
    if weight is None:
        size = np.abs(values).max(axis=(1, 2), keepdims=True)
        weight = np.broadcast_to(1 / np.where(size > 0, size, 1.0), values.shape)
    else:
        weight = as_array(weight, "weight")
        if weight.shape != values.shape or not (weight > 0).all():
            raise InputError(f"weight must be positive and of shape {values.shape}")
    unit = float(np.sqrt(omega[0] * omega[-1]))
    x = omega / unit
    fit = _Modal(x, values, weight, _relocated(x, values, weight, order))
    return fit.polished(unit)


def _relocated(x: RealArray, values: Array, weight: RealArray, order: int) -> ComplexArray:
    """Poles common to all entries, by relaxed relocations."""
    poles = spread_poles(x, order)
    targets = (weight * values).reshape(len(x), -1)
    weights = weight.reshape(len(x), -1)
    for _ in range(RELOCATIONS if order else 0):
        groups = real_groups(poles)
        parts = [partial_fractions(each, x) for each in groups]
        fractions = np.hstack([*parts, np.ones((len(x), 1))])
        rows = []
        for target, w in zip(targets.T, weights.T, strict=True):
            basis = np.linalg.qr(real_over_imaginary(w[:, None] * fractions))[0]
            columns = real_over_imaginary(target[:, None] * fractions)
            rows.append(columns - basis @ (basis.T @ columns))
        scale = np.linalg.norm(targets) / len(x)
        moved = relocated_poles(np.vstack(rows), scale, fractions, groups)
        poles = off_the_axis(-np.abs(moved.real) + 1j * moved.imag, x)
    return poles


class _Modal:
    """A system in modal coordinates: D + sum C_i (s - A_i)^-1 B_i over real poles and pairs."""

    def __init__(self, x: RealArray, values: Array, weight: RealArray, poles: ComplexArray) -> None:
        self.x, self.values, self.weight = x, values, weight
        self.p, self.m = values.shape[1:]
        self.real = np.sort(poles[poles.imag == 0].real)
        self.pairs = poles[poles.imag > 0]
        least = LEAST_DAMPING * np.abs(self.pairs)
        self.pairs = np.minimum(self.pairs.real, -least) + 1j * self.pairs.imag
        self.B, self.C, self.D = self._residues()

    def _residues(self) -> tuple[Array, Array, RealArray]:
        """Directions of the residues (k, m) and (p, k), the largest one of each pole, and D."""
        ways = [1 / (1j * self.x[:, None] - self.real)]
        s = 1j * self.x[:, None]
        one, other = 1 / (s - self.pairs), 1 / (s - self.pairs.conj())
        basis = np.hstack([*ways, one + other, 1j * (one - other), np.ones((len(self.x), 1))])
        found = np.empty((basis.shape[1], self.p, self.m))
        for i, j in np.ndindex(self.p, self.m):
            w = self.weight[:, i, j]
            rows = real_over_imaginary(w[:, None] * basis)
            right = real_over_imaginary(w * self.values[:, i, j])
            found[:, i, j] = np.linalg.lstsq(rows, right)[0]
        r, c = self.real.size, self.pairs.size
        residues = np.concatenate([found[:r], found[r : r + c] + 1j * found[r + c : r + 2 * c]])
        u, size, vh = np.linalg.svd(residues)
        root = np.sqrt(size[:, :1])
        return root * vh[:, 0], (root * u[:, :, 0]).T, found[-1]

    def polished(self, unit: float) -> StateSpace:
        """The system after Gauss-Newton steps; ``unit`` is the frequency scale [rad/s]."""
        start = self._packed()
        if start.size > self.D.size:
            found = least_squares(self._errors, start, method="trf", max_nfev=EVALUATIONS).x
        else:
            found = start
        real, pairs, B, C, D = self._unpacked(found)
        r, c = real.size, pairs.size
        A = np.zeros((r + 2 * c, r + 2 * c))
        A[:r, :r] = np.diag(real)
        inputs, outputs = np.zeros((r + 2 * c, self.m)), np.zeros((self.p, r + 2 * c))
        inputs[:r], outputs[:, :r] = B[:r].real, C[:, :r].real
        for k, pole in enumerate(pairs):  # c b / (s - pole) and its conjugate, in real coordinates
            at = slice(r + 2 * k, r + 2 * k + 2)
            A[at, at] = [[pole.real, pole.imag], [-pole.imag, pole.real]]
            inputs[at] = np.sqrt(2) * np.vstack([B[r + k].real, -B[r + k].imag])
            outputs[:, at] = np.sqrt(2) * np.column_stack([C[:, r + k].real, C[:, r + k].imag])
        return realisation((unit * A, unit * inputs, outputs, D), 0.0)

    def _packed(self) -> RealArray:
        poles = [np.log(-self.real), np.log(-self.pairs.real), np.log(self.pairs.imag)]
        damping = np.concatenate(poles)
        r = self.real.size
        parts = [damping, self.B[:r].real, self.C[:, :r].real, self.B[r:].real, self.B[r:].imag,
                 self.C[:, r:].real, self.C[:, r:].imag, self.D]  # fmt: skip
        self.shapes = [part.shape for part in parts]
        return np.concatenate([part.ravel() for part in parts])

    def _unpacked(self, x: RealArray) -> tuple[RealArray, Array, Array, Array, RealArray]:
        ends = np.cumsum([int(np.prod(shape)) for shape in self.shapes])[:-1]
        parts = [part.reshape(s) for part, s in zip(np.split(x, ends), self.shapes, strict=True)]
        r, c = self.real.size, self.pairs.size
        sizes = np.exp(parts[0])
        real, pairs = -sizes[:r], -sizes[r : r + c] + 1j * sizes[r + c :]
        B = np.vstack([parts[1], parts[3] + 1j * parts[4]])
        C = np.hstack([parts[2], parts[5] + 1j * parts[6]])
        return real, pairs, B, C, parts[7]

    def _errors(self, x: RealArray) -> RealArray:
        real, pairs, B, C, D = self._unpacked(x)
        r = real.size
        s = 1j * self.x[:, None]
        fit = np.einsum("fk,pk,km->fpm", 1 / (s - real), C[:, :r], B[:r])
        one, other = 1 / (s - pairs), 1 / (s - pairs.conj())
        fit = fit + np.einsum("fk,pk,km->fpm", one, C[:, r:], B[r:])
        fit = fit + np.einsum("fk,pk,km->fpm", other, C[:, r:].conj(), B[r:].conj())
        error = self.weight * (fit + D - self.values)
        return np.concatenate([error.real.ravel(), error.imag.ravel()])
