"""Prior knowledge of a plant: poles and static gains.

Iterations keep known poles if A is block triangular with those poles in the first block, whose
diagonal is fixed. They keep known gains if each step is followed by the least change of B and D
that restores them, since the gain is linear in both.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import groupby

import numpy as np
from scipy.linalg import schur
from scipy.linalg.lapack import dtrsen
from scipy.optimize import linear_sum_assignment

from workbench._core.arrays import BoolArray, RealArray
from workbench.identification.innovations.model import InnovationsModel

NEAR = 1e-3
"""Largest distance of an eigenvalue from the known pole that it represents."""

GAIN_ROUNDING = 1e-7
"""Error of a known gain, relative to the sizes of the signals, that counts as rounding."""


@dataclass(frozen=True, eq=False)
class Knowledge:
    """Known poles of a plant in discrete time, and its known static gains.

    ``poles`` (k,) include the conjugates of complex poles, each repeated by its multiplicity.
    ``gain`` (ny, nu) is NaN for unknown gains; None: all are unknown.
    """

    poles: tuple[complex, ...] = ()
    gain: RealArray | None = None

    def in_units(self, u_spread: RealArray, y_spread: RealArray) -> Knowledge:
        """The same knowledge for signals divided by these spreads, (nu,) and (ny,)."""
        if self.gain is None:
            return self
        return replace(self, gain=self.gain * u_spread / y_spread[:, None])

    def groups(self) -> list[tuple[complex, int]]:
        """The different poles in the closed upper half plane, with their multiplicities."""
        upper = sorted((p for p in self.poles if p.imag >= 0), key=lambda p: (p.real, p.imag))
        return [(pole, len(list(same))) for pole, same in groupby(upper)]

    def exact(self, model: InnovationsModel) -> InnovationsModel | None:
        """The model in a basis where A is block triangular and has the poles exactly.

        None if its eigenvalues are not near the poles.
        """
        if not self.poles:
            return model
        count = len(self.poles)
        if model.order < count:
            return None
        T, Z = schur(model.A, output="real")
        values = _eigenvalues(T)
        apart = np.abs(values[:, None] - np.array(self.poles))
        places = linear_sum_assignment(apart)[0]
        chosen = np.zeros(len(T), dtype=np.int32)
        chosen[places] = 1
        low = np.flatnonzero(np.diag(T, -1))
        if (chosen[low] != chosen[low + 1]).any():
            return None
        T, Z, *_, info = dtrsen(chosen, T, Z, job="N", lwork=max(1, len(T)), liwork=1)
        block = _with_poles(T[:count, :count], self.poles)
        if info or block is None:
            return None
        T[:count, :count], T[count:, :count] = block, 0.0
        return replace(model, A=T, B=Z.T @ model.B, C=model.C @ Z, K=Z.T @ model.K)

    def free_entries(self, model: InnovationsModel) -> BoolArray | None:
        """Mask of the entries of A, B, C, D, K in an `exact` model that may change; None: all."""
        if not self.poles:
            return None
        count = len(self.poles)
        free = np.ones(model.A.shape, dtype=bool)
        free[:, :count] = False
        for first, end in _blocks(model.A[:count, :count]):
            free[:first, first:end] = True
        others = sum(getattr(model, name).size for name in "BCDK")
        return np.concatenate([free.ravel(), np.ones(others, dtype=bool)])

    def gain_error(self, model: InnovationsModel) -> tuple[RealArray, RealArray]:
        """Gains of a model minus the known ones (q,), and derivatives (q, P) of its gains.

        The P parameters are the entries of A, B, C, D, K and both offsets, row by row.
        """
        n, nu, ny = model.order, model.B.shape[1], len(model.C)
        size = n * n + 2 * n * ny + n * nu + ny * nu + nu + ny
        if self.gain is None:
            return np.zeros(0), np.zeros((0, size))
        rest = np.eye(n) - model.A
        with np.errstate(all="ignore"):
            inward = np.linalg.solve(rest, model.B)
            outward = np.linalg.solve(rest.T, model.C.T).T
        found = model.C @ inward + model.D
        rows, errors = [], []
        for o, j in np.argwhere(np.isfinite(self.gain)):
            of_B, of_C, of_D = (np.zeros(M.shape) for M in (model.B, model.C, model.D))
            of_B[:, j], of_C[o], of_D[o, j] = outward[o], inward[:, j], 1.0
            parts = [np.outer(outward[o], inward[:, j]), of_B, of_C, of_D]
            still = np.zeros(n * ny + nu + ny)
            rows.append(np.concatenate([*(part.ravel() for part in parts), still]))
            errors.append(found[o, j] - self.gain[o, j])
        return np.array(errors), np.array(rows)

    def holds(self, model: InnovationsModel, size: RealArray) -> bool:
        """Whether a model has the poles and, up to rounding relative to ``size``, the gains."""
        errors = np.abs(self.gain_error(model)[0])
        if self.gain is not None:
            known = np.isfinite(self.gain)
            errors = errors / np.maximum(np.abs(self.gain[known]), size[known])
        return bool((errors <= GAIN_ROUNDING).all()) and self.exact(model) is not None


def _blocks(T: RealArray) -> list[tuple[int, int]]:
    """First row and end of the diagonal blocks of a quasi-triangular matrix."""
    found, first = [], 0
    while first < len(T):
        end = first + 2 if first + 1 < len(T) and T[first + 1, first] != 0 else first + 1
        found.append((first, end))
        first = end
    return found


def _eigenvalues(T: RealArray) -> np.ndarray:
    """Eigenvalues of a real Schur form, in the order of its rows."""
    return np.concatenate([np.linalg.eigvals(T[a:b, a:b]).astype(complex) for a, b in _blocks(T)])


def _with_poles(T: RealArray, poles: tuple[complex, ...]) -> RealArray | None:
    """A quasi-triangular matrix with these eigenvalues, near its own; None if they are far."""
    values, found = _eigenvalues(T), T.copy()
    rows, columns = linear_sum_assignment(np.abs(values[:, None] - np.array(poles)))
    near = np.empty(len(T), dtype=complex)
    near[rows] = np.array(poles)[columns]
    if (np.abs(near - values) > NEAR).any():
        return None
    for a, b in _blocks(T):
        pole = near[a]
        if b - a == 1:
            if pole.imag:
                return None
            found[a, a] = pole.real
        elif pole.imag and near[a + 1] == pole.conjugate():
            scale = abs(pole.imag) / np.sqrt(-T[a, a + 1] * T[a + 1, a])
            found[a, a] = found[a + 1, a + 1] = pole.real
            found[a, a + 1] *= scale
            found[a + 1, a] *= scale
        elif not (pole.imag or near[a + 1].imag):  # a double real pole that rounding has split
            small = (a + 1, a) if abs(T[a + 1, a]) <= abs(T[a, a + 1]) else (a, a + 1)
            found[small], found[a, a], found[a + 1, a + 1] = 0.0, pole.real, near[a + 1].real
        else:
            return None
    return found
