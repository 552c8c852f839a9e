"""The lower bound of mixed mu as a nonlinear program for IPOPT, solved from many starts.

The program maximises lambda subject to lambda x = M w and w = Delta x. A full block is not a
variable of the program; the constraint |w_i| <= |x_i| says that its gain is at most 1.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from workbench.executor import Context
from workbench.mu.lower.ascent import ascend
from workbench.mu.lower.attain import attained, block_table, innermost, turned
from workbench.solvers import ipopt
from workbench.structure import Complex, Real, Structure


class NonlinearSearch:
    """The nonlinear program of a structure, stated once for all matrices."""

    def __init__(self, structure: Structure, context: Context) -> None:
        import casadi as ca

        self._structure = structure
        self._table = block_table(structure)
        columns, rows = structure.columns, structure.rows
        with context.stating():
            M = [ca.SX.sym(name, columns, rows) for name in ("Mr", "Mi")]
            anchor = [ca.SX.sym(name, columns) for name in ("ar", "ai")]
            value = ca.SX.sym("value")
            x = [ca.SX.sym(name, columns) for name in ("xr", "xi")]
            variables: list[Any] = [value, *x]
            image: tuple[list[Any], list[Any]] = [], []
            limits: list[Any] = []
            places = zip(structure, structure.row_slices, structure.column_slices, strict=True)
            for block, _, column in places:
                part = [component[column] for component in x]
                if isinstance(block, Real):
                    delta = ca.SX.sym("d")
                    variables.append(delta)
                    w = [delta * component for component in part]
                    limits.append(delta**2 - 1)
                elif isinstance(block, Complex):
                    re, im = ca.SX.sym("re"), ca.SX.sym("im")
                    variables += [re, im]
                    w = [re * part[0] - im * part[1], re * part[1] + im * part[0]]
                    limits.append(re**2 + im**2 - 1)
                else:
                    w = [ca.SX.sym(name, block.rows) for name in ("wr", "wi")]
                    variables += w
                    limits.append(_square(*w) - _square(*part))
                image[0].append(w[0])
                image[1].append(w[1])
            wr, wi = (ca.vertcat(*component) for component in image)
            g = ca.vertcat(
                value * x[0] - M[0] @ wr + M[1] @ wi,
                value * x[1] - M[0] @ wi - M[1] @ wr,
                ca.dot(anchor[0], x[0]) + ca.dot(anchor[1], x[1]) - 1,
                ca.dot(anchor[0], x[1]) - ca.dot(anchor[1], x[0]),
                *limits,
            )
            nlp = {
                "x": ca.vertcat(*variables),
                "p": ca.vertcat(ca.vec(M[0]), ca.vec(M[1]), *anchor),
                "f": -value,
                "g": g,
            }
            self._solver = ipopt("mu_lower", nlp, context.options)
        self._lower = np.zeros(g.shape[0])
        self._lower[2 * columns + 2 :] = -np.inf

    def best_of(self, M: np.ndarray, starts: list[np.ndarray]) -> tuple[float, np.ndarray]:
        """Largest real eigenvalue of M Delta (0: none) from normalised starts, and its Delta."""
        best, found = 0.0, np.zeros((self._structure.rows, self._structure.columns), complex)
        for start in starts:
            value, delta = self._from(M, start)
            if value > best:
                best, found = value, delta
        return best, found

    def _from(self, M: np.ndarray, start: np.ndarray) -> tuple[float, np.ndarray]:
        """Real eigenvalue (0: none) and Delta found from one start."""
        values, vectors = np.linalg.eig(M @ start)
        place = np.argmax(values.real)
        x = vectors[:, place]
        guess: list[Any] = [[max(values[place].real, 1e-3)], x.real, x.imag]
        for _, row, column, block in self._places():
            if isinstance(block, Real):
                guess.append([start[row, column][0, 0].real])
            elif isinstance(block, Complex):
                guess.append([start[row, column][0, 0].real, start[row, column][0, 0].imag])
            else:
                w = start[row, column] @ x[column]
                guess += [w.real, w.imag]
        p = np.concatenate([M.real.ravel("F"), M.imag.ravel("F"), x.real, x.imag])
        answer: Any = self._solver(x0=np.concatenate(guess), p=p, lbg=self._lower, ubg=0)
        return self._refined(M, answer["x"].full().ravel())

    def _refined(self, M: np.ndarray, variables: np.ndarray) -> tuple[float, np.ndarray]:
        """Real eigenvalue and Delta computed from the variables, whatever IPOPT reported."""
        columns = self._structure.columns
        near = variables[0]
        x = variables[1 : 1 + columns] + 1j * variables[1 + columns : 1 + 2 * columns]
        at = 1 + 2 * columns
        parts = []
        for _, _, column, block in self._places():
            if isinstance(block, Real):
                parts.append(np.clip(variables[at], -1, 1) * np.eye(block.rows))
                at += 1
            elif isinstance(block, Complex):
                value = variables[at] + 1j * variables[at + 1]
                parts.append(value / max(abs(value), 1e-100) * np.eye(block.rows))
                at += 2
            else:
                w = (
                    variables[at : at + block.rows]
                    + 1j * variables[at + block.rows :][: block.rows]
                )
                at += 2 * block.rows
                dyad = np.outer(w, x[column].conj())
                parts.append(dyad / max(float(np.linalg.norm(dyad)), 1e-100))
        delta = self._structure.diagonal(parts).astype(complex)
        if not np.isfinite(delta).all():
            return 0.0, delta
        trial = delta.copy()
        some_complex = any(not isinstance(block, Real) for block in self._structure)
        free = -1 if some_complex else innermost(self._table, delta)
        value = turned(M, self._table, trial, near + 0j, free)[0]
        if value == 0 and some_complex:
            trial = delta
            value = attained(M, self._table, trial)
        if value > 0:
            value = ascend(M, self._table, trial, value)
        return value, trial

    def _places(self) -> list[tuple[int, slice, slice, Any]]:
        """Index, rows, columns and block of each block."""
        s = self._structure
        return list(zip(range(len(s)), s.row_slices, s.column_slices, s, strict=True))


def _square(re: Any, im: Any) -> Any:
    """Squared length of a complex vector."""
    import casadi as ca

    return ca.dot(re, re) + ca.dot(im, im)
