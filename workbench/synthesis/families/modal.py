"""All controllers of an order, and constant gains, which are the controllers of order zero."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from workbench._core.arrays import ComplexArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.input_checks import need_whole
from workbench.synthesis.families.family import POLE_ROOM, Family, need_size
from workbench.synthesis.families.least_squares import combined
from workbench.synthesis.reduction import truncation
from workbench.synthesis.reduction.kept_part import kept_and_stable
from workbench.systems.generalised_plant import response
from workbench.systems.realisation import in_parallel, realisation

LEAST_DAMPING = 1e-6
"""Least coefficient a and b of a block that must be stable."""
STATE_DIRECTIONS = 24
"""Number of directions of a second-order block's first state that are tried for good
conditioning.
"""


@dataclass(frozen=True)
class Modal(Family):
    """All controllers of an order, with second-order blocks in A and free B, C and D.

    A has blocks w [[-b, -a], [1, 0]], and a block -w c if the order is odd. A block may have
    complex or real poles, stable or not. The ``corners`` [rad/s] are the w; they scale the
    parameters to about one. If none are given, they come from a start, and the numbers of inputs
    and outputs from the plant.

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

    order: int
    corners: tuple[float, ...] | None = field(default=None, kw_only=True)
    inputs: int | None = field(default=None, kw_only=True)
    outputs: int | None = field(default=None, kw_only=True)

    def __post_init__(self) -> None:
        need_whole(self.order, "order")
        if self.order < 0:
            raise InputError(f"order is {self.order}; it must be 0 or more")
        blocks = (self.order + 1) // 2
        if self.corners is not None and len(self.corners) != blocks:
            raise InputError(
                f"{len(self.corners)} corners for order {self.order}; there must be {blocks}, one "
                "for each pair of states, or none"
            )

    @classmethod
    def of(cls, controller: StateSpace) -> tuple[Modal, RealArray]:
        """The family that contains a controller, and the controller's parameters.

        Raises InputError for a controller with a mode that no second-order block can represent.
        """
        return Modal(controller.nstates).about(controller)

    def about(self, controller: StateSpace) -> tuple[Modal, RealArray]:
        if controller.nstates != self.order:
            raise InputError(
                f"the controller has {controller.nstates} states, a member of {self} {self.order}"
            )
        blocks, T = _second_order_blocks(controller.A)
        corners, shapes, changes = (
            zip(*map(_family_form, blocks), strict=True) if blocks else ((),) * 3
        )
        family = replace(
            self, corners=tuple(corners), inputs=controller.ninputs, outputs=controller.noutputs
        )
        B, C = np.linalg.solve(T, controller.B), controller.C @ T
        at = 0
        for block, change in zip(blocks, changes, strict=True):
            part = slice(at, at + len(change))
            if block[0, -1] == 0:  # two real modes: one may be large, one small
                for mode in range(part.start, part.stop):
                    _equalise_norms(B, C, slice(mode, mode + 1))
            B[part], C[:, part] = np.linalg.solve(change, B[part]), C[:, part] @ change
            _equalise_norms(B, C, part)
            at = part.stop
        x = (
            np.concatenate([*shapes, B.ravel(), C.ravel(), controller.D.ravel()])
            if shapes
            else controller.D.ravel()
        )
        return family, np.asarray(x, dtype=float)

    def sized(self, inputs: int, outputs: int) -> Modal:
        if self.inputs is None or self.outputs is None:
            return replace(self, inputs=inputs, outputs=outputs)
        need_size(self, (self.inputs, self.outputs), inputs, outputs, "leave both numbers out")
        return self

    def examples(self, omega: float, gain: float) -> Sequence[StateSpace]:
        import control

        n, (_, m, p) = self.order, self._shape
        rates = omega * np.geomspace(0.3, 3.0, max(n, 1))[:n]
        return [
            control.StateSpace(
                -np.diag(rates),
                np.zeros((n, m)),
                np.zeros((p, n)),
                np.zeros((p, m)),
                remove_useless_states=False,
            )
        ]

    def settings(self, controller: StateSpace) -> Mapping[str, float]:
        if self.order:
            return {}
        if controller.D.size == 1:
            return {"gain": float(controller.D[0, 0])}
        return {
            f"gain {i + 1},{j + 1}": float(controller.D[i, j])
            for i, j in np.ndindex(controller.D.shape)
        }

    @property
    def count(self) -> int:
        n, (_, m, p) = self.order, self._shape
        return n + n * m + p * n + p * m

    def nearest(
        self, controller: StateSpace, omega: RealArray, weight: RealArray
    ) -> StateSpace | None:
        """The controller reduced to the order by balanced singular perturbation; for order 0, gains
        by least squares.
        """
        n, (_, m, p) = self.order, self._shape
        if n == 0:
            basis = np.eye(p * m).reshape(p * m, p, m)
            shape = (len(omega), *basis.shape)
            gains, _ = combined(np.broadcast_to(basis, shape), response(controller, omega), weight)
            return realisation((np.zeros((0, 0)), np.zeros((0, m)), np.zeros((p, 0)),
                                gains.reshape(p, m)), 0.0)  # fmt: skip
        if controller.nstates > n:
            least, reduced = truncation.matchdc(
                kept_and_stable((controller.A, controller.B, controller.C, controller.D))
            )
            if least > n:
                return None
            controller = realisation(reduced(n), 0.0)
        spare = self.examples(float(np.median(omega)), 0.0)[0]
        left = n - controller.nstates
        idle = (spare.A[n - left :, n - left :], spare.B[n - left :], spare.C[:, n - left :])
        return realisation(
            in_parallel(
                (controller.A, controller.B, controller.C, controller.D),
                (*idle, 0.0 * controller.D),
            ),
            0.0,
        )

    @property
    def _shape(self) -> tuple[tuple[float, ...], int, int]:
        """Corners, numbers of inputs and of outputs; by default corners of 1 rad/s and one of
        each.
        """
        corners = (1.0,) * ((self.order + 1) // 2) if self.corners is None else self.corners
        return corners, self.inputs or 1, self.outputs or 1

    def parameters(self, controller: StateSpace) -> RealArray:
        family, x = self.about(controller)
        if family != self:
            raise InputError(f"the controller has other corners than the family: {family} {self}")
        return x

    def halfspaces(self, stable: bool, fastest: float | None) -> tuple[RealArray, RealArray]:
        # A block s^2 + w b s + w^2 a has stable poles if a, b > 0. Its poles have a size of at most
        # P if |w^2 a| <= P^2 and P^2 + w^2 a >= P |w b|, which is Jury's triangle, scaled.
        n, (corners, m, p) = self.order, self._shape
        rows: list[RealArray] = []
        sides: list[float] = []

        def add(side: float, *terms: tuple[int, float]) -> None:
            row = np.zeros(n + n * m + p * n + p * m)
            for place, value in terms:
                row[place] = value
            rows.append(row)
            sides.append(side)

        for k, w in enumerate(corners):
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
        n, (corners, m, p) = self.order, self._shape
        shape, B, C, D = np.split(x, np.cumsum([n, n * m, p * n]))
        A = np.zeros((n, n))
        for k, w in enumerate(corners):
            i = 2 * k
            if i + 1 < n:
                # With b in the first entry, computed eigenvalues keep the digits of a slow pole
                # beside a fast one.
                A[i, i], A[i, i + 1], A[i + 1, i] = -w * shape[i + 1], -w * shape[i], w
            else:
                A[i, i] = -w * shape[i]
        return A, B.reshape(n, m), C.reshape(p, n), D.reshape(p, m)

    def system(self, x: RealArray) -> StateSpace:
        import control

        return control.ss(*self.matrices(x))

    def response(self, x: RealArray, omega: RealArray) -> tuple[ComplexArray, ComplexArray]:
        A, B, C, D = self.matrices(x)
        n, (corners, m, p), count = self.order, self._shape, len(omega)
        resolvent = np.linalg.inv(1j * omega[:, None, None] * np.eye(n) - A)
        into, out = resolvent @ B, C @ resolvent
        slopes = np.zeros((count, x.size, p, m), complex)
        for i in range(n):
            w, row, column = corners[i // 2], i - i % 2, min(i ^ 1, n - 1)
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


@dataclass(frozen=True)
class Static(Modal):
    """Constant gains: u = D y. The parameters are the entries of D, row by row.

    Examples
    --------
    >>> from workbench.synthesis import Static
    >>> Static().system([2.0]).D.tolist()
    [[2.0]]
    """

    order: int = field(default=0, init=False)


def _equalise_norms(B: RealArray, C: RealArray, part: slice) -> None:
    """Scale some states so that their rows of B and their columns of C have equal norms."""
    out, into = float(np.linalg.norm(C[:, part])), float(np.linalg.norm(B[part]))
    size = np.sqrt(out / into) if out > 0 and into > 0 else 1.0
    B[part], C[:, part] = B[part] * size, C[:, part] / size


def _second_order_blocks(A: RealArray) -> tuple[list[RealArray], RealArray]:
    """Real second-order blocks of A's modes, and one of first order if n is odd; with their
    basis.
    """
    values, vectors = np.linalg.eig(A)
    if len(A) and np.linalg.cond(vectors) > 1e12:
        raise InputError("the controller has a defective mode; perturb or reduce it first")
    pairs = np.flatnonzero(values.imag > 0)
    blocks = [np.array([[v.real, v.imag], [-v.imag, v.real]]) for v in values[pairs]]
    basis = [np.column_stack([vectors[:, i].real, vectors[:, i].imag]) for i in pairs]
    reals = np.flatnonzero(values.imag == 0)
    reals = reals[np.argsort(np.abs(values[reals]))]
    half = len(reals) // 2
    # Combine slow poles with fast ones, since two equal poles cannot form a block.
    for i, j in zip(reals[:half], reals[half : 2 * half], strict=True):
        blocks.append(np.diag(values[[i, j]].real))
        basis.append(vectors[:, [i, j]].real)
    if len(reals) % 2:
        blocks.append(values[reals[-1:], None].real)
        basis.append(vectors[:, reals[-1:]].real)
    return blocks, np.hstack(basis) if basis else np.zeros((0, 0))


def _family_form(block: RealArray) -> tuple[float, list[float], RealArray]:
    """Corner, shape parameters, and the change of coordinates that gives a block the family's
    form.
    """
    if len(block) == 1:
        corner = float(abs(block[0, 0])) or 1.0
        return corner, [-block[0, 0] / corner], np.eye(1)
    determinant, trace = float(np.linalg.det(block)), float(np.trace(block))
    corner = float(np.sqrt(abs(determinant))) or 1.0
    # Any direction u may be the first state; the second one is then (block u - trace u) / corner.
    angles = np.pi * np.arange(STATE_DIRECTIONS) / STATE_DIRECTIONS
    changes = [
        np.column_stack([u, (block @ u - trace * u) / corner])
        for u in np.column_stack([np.cos(angles), np.sin(angles)])
    ]
    best = min(changes, key=np.linalg.cond)
    if np.linalg.cond(best) > 1e10:
        raise InputError(
            "two equal real poles of the controller cannot form a second-order block; perturb them"
        )
    return corner, [determinant / corner**2, -trace / corner], best
