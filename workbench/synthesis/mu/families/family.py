"""Families of controllers with a fixed structure and few real parameters.

The parameters are free real numbers, scaled such that a step of a given size has about the same
effect everywhere.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from dataclasses import dataclass

import numpy as np

from workbench.arrays import ComplexArray, RealArray
from workbench.errors import InputError
from workbench.heavy_types import StateSpace

LEAST_DAMPING, POLE_ROOM = 1e-6, 1e-6
"""Least coefficient of a block that is asked to be stable, and the share of the size allowed that
poles keep away from it."""
STATE_DIRECTIONS = 24
"""Directions of the first state of a second-order block that are tried for good conditioning."""


class Family(ABC):
    """Controllers u = K(s; x) y with p outputs and m inputs and real parameters x.

    Examples
    --------
    >>> from workbench.synthesis import PID, Family
    >>> family, x = PID.of(2.0, 1.0, 0.1, 0.01)
    >>> isinstance(family, Family), x.shape
    (True, (4,))
    """

    @abstractmethod
    def system(self, x: RealArray) -> StateSpace:
        """The controller with parameters x (k,)."""

    @abstractmethod
    def response(self, x: RealArray, omega: RealArray) -> tuple[ComplexArray, ComplexArray]:
        """K (F, p, m) at omega (F,) [rad/s], and its derivatives (F, k, p, m) by x."""

    @abstractmethod
    def parameters(self, K: StateSpace) -> RealArray:
        """Parameters (k,) of a member of the family; raises InputError for other controllers."""

    def units(self, x: RealArray) -> RealArray:
        """Units of steps (k,): the size of each parameter, or a tenth of the median if larger.

        Zero where all parameters are about zero: their sizes tell no unit.
        """
        size = np.abs(x)
        return np.maximum(size, 0.1 * float(np.median(size)))

    def halfspaces(self, stable: bool, fastest: float | None) -> tuple[RealArray, RealArray]:
        """Rows G (r, k) and sides h (r,): controllers with G x <= h meet the demands on poles.

        No rows where a family has no such form; its members are then only checked.
        """
        return np.zeros((0, 0)), np.zeros(0)


@dataclass(frozen=True)
class Modal(Family):
    """Every controller of an order, with second-order blocks in A and free B, C and D.

    A has blocks w [[-b, -a], [1, 0]], and a block -w c if the order is odd. A block may have
    complex or real poles, stable or not. The ``corners`` [rad/s] are the w of the controller for
    which the family is made, so that the parameters are of order one.

    Examples
    --------
    >>> import control
    >>> import numpy as np
    >>> from workbench.synthesis import Modal
    >>> K = control.ss([[-1.0, 2.0], [-2.0, -1.0]], [[1.0], [0.0]], [[0.0, 1.0]], [[0.5]])
    >>> family, x = Modal.of(K)
    >>> bool(np.isclose(family.system(x)(3j), K(3j)))
    True
    """

    corners: tuple[float, ...]
    inputs: int
    outputs: int
    order: int

    @classmethod
    def of(cls, K: StateSpace) -> tuple[Modal, RealArray]:
        """The family that contains a controller, and the controller's parameters.

        Raises InputError for a controller with a mode that no second-order block has.
        """
        blocks, T = _blocks(K.A)
        corners, shapes, changes = (
            zip(*map(_companion, blocks), strict=True) if blocks else ((),) * 3
        )
        family = cls(tuple(corners), K.ninputs, K.noutputs, K.nstates)
        B, C = np.linalg.solve(T, K.B), K.C @ T
        at = 0
        for block, change in zip(blocks, changes, strict=True):
            part = slice(at, at + len(change))
            if block[0, -1] == 0:  # two real modes: a block may hold one large, the other small
                for mode in range(part.start, part.stop):
                    _even(B, C, slice(mode, mode + 1))
            B[part], C[:, part] = np.linalg.solve(change, B[part]), C[:, part] @ change
            _even(B, C, part)
            at = part.stop
        x = np.concatenate([*shapes, B.ravel(), C.ravel(), K.D.ravel()]) if shapes else K.D.ravel()
        return family, np.asarray(x, dtype=float)

    def parameters(self, K: StateSpace) -> RealArray:
        family, x = Modal.of(K)
        if family != self:
            raise InputError(f"the controller has other corners than the family: {family} {self}")
        return x

    def halfspaces(self, stable: bool, fastest: float | None) -> tuple[RealArray, RealArray]:
        # A block s^2 + w b s + w^2 a has stable poles where a, b > 0, and poles of size P at most
        # where |w^2 a| <= P^2 and P^2 + w^2 a >= P |w b|: Jury's triangle, scaled.
        n, m, p = self.order, self.inputs, self.outputs
        rows: list[RealArray] = []
        sides: list[float] = []

        def add(side: float, *terms: tuple[int, float]) -> None:
            row = np.zeros(n + n * m + p * n + p * m)
            for place, value in terms:
                row[place] = value
            rows.append(row)
            sides.append(side)

        for k, w in enumerate(self.corners):
            i, pair = 2 * k, 2 * k + 1 < n
            if stable:
                for place in (i, i + 1)[: 1 + pair]:
                    add(-LEAST_DAMPING, (place, -1.0))
            if fastest is not None:
                size = w / (fastest * (1.0 - POLE_ROOM))
                reach = size**2 if pair else size
                add(1.0, (i, reach))
                add(1.0, (i, -reach))
                if pair:
                    add(1.0, (i, -reach), (i + 1, size))
                    add(1.0, (i, -reach), (i + 1, -size))
        if not rows:
            return np.zeros((0, n + n * m + p * n + p * m)), np.zeros(0)
        return np.array(rows), np.array(sides)

    def matrices(self, x: RealArray) -> tuple[RealArray, RealArray, RealArray, RealArray]:
        """A, B, C and D of the controller with parameters x."""
        n, m, p = self.order, self.inputs, self.outputs
        shape, B, C, D = np.split(x, np.cumsum([n, n * m, p * n]))
        A = np.zeros((n, n))
        for k, w in enumerate(self.corners):
            i = 2 * k
            if i + 1 < n:
                # With b first eigenvalues keep the digits of a slow pole beside a fast one.
                A[i, i], A[i, i + 1], A[i + 1, i] = -w * shape[i + 1], -w * shape[i], w
            else:
                A[i, i] = -w * shape[i]
        return A, B.reshape(n, m), C.reshape(p, n), D.reshape(p, m)

    def system(self, x: RealArray) -> StateSpace:
        import control

        return control.ss(*self.matrices(x))

    def response(self, x: RealArray, omega: RealArray) -> tuple[ComplexArray, ComplexArray]:
        A, B, C, D = self.matrices(x)
        n, m, p, count = self.order, self.inputs, self.outputs, len(omega)
        resolvent = np.linalg.inv(1j * omega[:, None, None] * np.eye(n) - A)
        into, out = resolvent @ B, C @ resolvent
        slopes = np.zeros((count, x.size, p, m), complex)
        for i in range(n):
            w, row, column = self.corners[i // 2], i - i % 2, min(i ^ 1, n - 1)
            slopes[:, i] = -w * out[:, :, row, None] * into[:, None, column, :]
        B_slopes = slopes[:, n : n + n * m].reshape(count, n, m, p, m)
        C_slopes = slopes[:, n + n * m : n + n * m + p * n].reshape(count, p, n, p, m)
        D_slopes = slopes[:, n + n * m + p * n :].reshape(count, p, m, p, m)
        for j in range(m):
            B_slopes[:, :, j, :, j] = out.transpose(0, 2, 1)
        for i in range(p):
            C_slopes[:, i, :, i, :] = into
            for j in range(m):
                D_slopes[:, i, j, i, j] = 1.0
        K: ComplexArray = np.asarray(out @ B + D, dtype=complex)
        return K, slopes


def _even(B: RealArray, C: RealArray, part: slice) -> None:
    """Scale some of the states so that their rows of B and columns of C have one size."""
    out, into = float(np.linalg.norm(C[:, part])), float(np.linalg.norm(B[part]))
    size = np.sqrt(out / into) if out > 0 and into > 0 else 1.0
    B[part], C[:, part] = B[part] * size, C[:, part] / size


def _blocks(A: RealArray) -> tuple[list[RealArray], RealArray]:
    """Real second-order blocks of A's modes, one of first order if n is odd, and their basis."""
    values, vectors = np.linalg.eig(A)
    if len(A) and np.linalg.cond(vectors) > 1e12:
        raise InputError("the controller has a defective mode; perturb or reduce it first")
    pairs = np.flatnonzero(values.imag > 0)
    blocks = [np.array([[v.real, v.imag], [-v.imag, v.real]]) for v in values[pairs]]
    basis = [np.column_stack([vectors[:, i].real, vectors[:, i].imag]) for i in pairs]
    reals = np.flatnonzero(values.imag == 0)
    reals = reals[np.argsort(np.abs(values[reals]))]
    half = len(reals) // 2
    # Combine slow poles with fast ones, since two equal poles have no common block.
    for i, j in zip(reals[:half], reals[half : 2 * half], strict=True):
        blocks.append(np.diag(values[[i, j]].real))
        basis.append(vectors[:, [i, j]].real)
    if len(reals) % 2:
        blocks.append(values[reals[-1:], None].real)
        basis.append(vectors[:, reals[-1:]].real)
    return blocks, np.hstack(basis) if basis else np.zeros((0, 0))


def _companion(block: RealArray) -> tuple[float, list[float], RealArray]:
    """Corner, shape parameters, and the change of state that gives a block the family's form."""
    if len(block) == 1:
        corner = float(abs(block[0, 0])) or 1.0
        return corner, [-block[0, 0] / corner], np.eye(1)
    determinant, trace = float(np.linalg.det(block)), float(np.trace(block))
    corner = float(np.sqrt(abs(determinant))) or 1.0
    # The first state may be any direction u; the second is then (block u - trace u) / corner.
    angles = np.pi * np.arange(STATE_DIRECTIONS) / STATE_DIRECTIONS
    changes = [
        np.column_stack([u, (block @ u - trace * u) / corner])
        for u in np.column_stack([np.cos(angles), np.sin(angles)])
    ]
    best = min(changes, key=np.linalg.cond)
    if np.linalg.cond(best) > 1e10:
        raise InputError(
            "two equal real poles of the controller have no common block; perturb them"
        )
    return corner, [determinant / corner**2, -trace / corner], best
