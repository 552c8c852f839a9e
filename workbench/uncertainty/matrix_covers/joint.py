"""Joint optimisation of both weights of a cover over given poles, by successive semidefinite
programs.

The weights' squares L = W_1 W_1^~ and R = W_2^~ W_2 are linear in unknowns. Containment is

    [[L, X_k], [X_k^*, R]] >= 0    at every frequency, for every plant,

which is convex. The logarithm of the volume, m log det L + p log det R, is concave; its
linearisation at the weights of the previous round is minimised. Only plants near the boundary of
the sets are constraints; where others then lie outside, they are added and the program is solved
again.
"""

from __future__ import annotations

import numpy as np

from workbench._core.arrays import Array, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.executor import Context
from workbench.systems.realisation import transposed_system
from workbench.uncertainty.covers.weights import CONSTANT_DECADES, beyond
from workbench.uncertainty.matrix_covers.cover import MatrixCover
from workbench.uncertainty.matrix_covers.responses import system_response
from workbench.uncertainty.matrix_covers.semidefinite import Inequality, least
from workbench.uncertainty.matrix_covers.sets.shapes import between_weights, ctranspose
from workbench.uncertainty.matrix_covers.squares import ShapedSquare
from workbench.uncertainty.matrix_covers.weights import FittedWeight, thinned

ROUNDS = 6
"""Largest number of rounds, each with a new linearisation of the volume. They end earlier by
`IMPROVEMENT`. With half of them sets may be larger; double costs time only where they still
improve.
"""
IMPROVEMENT = 2e-3
"""Least decrease of the mean logarithm of the radius for another round. It is 0.2 % of a size,
which no controller notices. Half may take a round more; double ends earlier, with sets 0.2 %
larger.
"""
NEAR = 0.8
"""A plant is a constraint if its norm of Delta is at least this share of the largest one at its
frequency. Others that reach the boundary in a round are found by `ADDITIONS`. Half takes more
constraints and longer; double, above 1, takes none at first.
"""
ADDITIONS = 6
"""Largest number of times that plants outside are added to the constraints of a round. They end
earlier once none is outside. With half of them a plant may stay outside, and the gain is raised;
double costs time only.
"""
OUTSIDE = 1e-4
"""A plant counts as outside if its norm of Delta exceeds 1 by this. The gain is raised by as much
at the end. With half of it more constraints are added; double widens sets by 1e-4.
"""
LASTING = 0.25
"""Least share of the given weights' squares that must remain outside the given frequencies. A
weight must not vanish where nothing is known: half of its size is kept, over all rounds. With half
of it weights fall to 0.35 there; with double of it they must stay at 0.7, and sets in the band are
larger.
"""


def smaller_weights(
    program: MatrixCover, W_1: FittedWeight, W_2: FittedWeight, context: Context
) -> tuple[StateSpace, StateSpace]:
    """Weights, in the bilinear plane, with the poles of given ones and with smaller sets if
    possible.

    Raises SolverError if a program has no answer.
    """
    fine, shares = program.for_fits()
    left, right = transposed_system(W_1.system), W_2.system
    state, before = _Round(fine, left, right), np.inf
    lasting = state.outer_squares()
    active = state.near() & np.isin(np.arange(fine.axis.size), thinned(fine.axis.size))[:, None]
    for _ in context.track(range(ROUNDS), "joint weights"):
        radius = float(shares @ state.log_radius())
        if radius > before - IMPROVEMENT:
            break
        before = radius
        for _ in range(ADDITIONS):
            left, right = state.solved((W_1.poles, W_2.poles), active, shares, lasting, context)
            found = _Round(fine, left, right)
            outside = found.outside() & ~active
            if not outside.any():
                break
            active |= outside
        state = found
        active |= state.near() & active.any(axis=1, keepdims=True)
    return transposed_system(left), right


class _Round:
    """The program linearised at the weights of the previous round; ``left`` is the transposed
    W_1.
    """

    def __init__(self, program: MatrixCover, left: StateSpace, right: StateSpace) -> None:
        self.program, self.grid = program, beyond(program.axis)
        self.inside = slice(CONSTANT_DECADES, len(self.grid) - CONSTANT_DECADES)
        self.W = system_response(left, self.grid), system_response(right, self.grid)
        W_1, W_2 = self.W[0][self.inside].swapaxes(-2, -1), self.W[1][self.inside]
        M = between_weights(W_1, program.matrices_to_cover, W_2)
        self.norms = np.linalg.norm(M, 2, axis=(2, 3))
        self.scale = self.norms.max()
        self.M = M / self.scale
        # the left weight includes the scale
        self.own = self.W[0] * self.scale, self.W[1]
        self.outer = np.r_[0:CONSTANT_DECADES, self.inside.stop : len(self.grid)]

    def near(self) -> np.ndarray:
        """Mask of the plants (F, N) near the boundary of the sets."""
        found: np.ndarray = self.norms >= NEAR * self.norms.max(axis=1, keepdims=True)
        return found

    def outside(self) -> np.ndarray:
        """Mask of the plants (F, N) that are outside, and farther outside than at the neighbouring
        frequencies.
        """
        beside = np.pad(self.norms, ((1, 1), (0, 0)), constant_values=-np.inf)
        peak = (self.norms >= beside[:-2]) & (self.norms >= beside[2:])
        found: np.ndarray = peak & (self.norms > 1 + OUTSIDE)
        return found

    def outer_squares(self) -> list[Array]:
        """Squares of both weights (E, n, n) at the frequencies outside the given ones."""
        outer = [W[self.outer] for W in self.own]
        return [ctranspose(W) @ W for W in outer]

    def log_radius(self) -> RealArray:
        """Logarithm of the mean radius (F,) of the sets, enlarged so that they contain all
        plants.
        """
        logs = [np.linalg.slogdet(W[self.inside])[1] / W.shape[-1] for W in self.W]
        return logs[0] + logs[1] + np.log(self.scale)

    def solved(
        self,
        poles: tuple[list[Array], list[Array]],
        active: np.ndarray,
        shares: RealArray,
        lasting: list[Array],
        context: Context,
    ) -> tuple[StateSpace, StateSpace]:
        """The transposed W_1, and W_2, that minimise the linearised volume, and keep a share of the
        squares ``lasting`` outside the given frequencies.
        """
        program, W, ends = self.program, self.own, self.outer
        # both in units of the previous round
        roots = [np.linalg.inv(each) for each in W]
        left, right = (
            ShapedSquare(self.grid, np.linalg.norm(each, axis=1), shape, its)
            for each, shape, its in zip(W, (program.left, program.right), poles, strict=True)
        )
        weight = np.zeros(len(self.grid))
        weight[self.inside] = shares
        slope = np.concatenate(
            [
                square.slope(weight / root.shape[-1], root)
                for square, root in zip((left, right), roots, strict=True)
            ]
        )
        numbers, plants = np.nonzero(active)
        used, place = np.unique(numbers, return_inverse=True)
        L, R = (
            square.at(used + CONSTANT_DECADES, root[used + CONSTANT_DECADES])
            for square, root in zip((left, right), roots, strict=True)
        )
        L = L[0].conj(), L[1].conj()
        M = self.M[numbers, plants]
        limits = [_block_inequality((L[0][place], L[1][place]), (R[0][place], R[1][place]), M)]
        parts = (left, right), roots, lasting, (0, len(left))
        for square, root, outer, before in zip(*parts, strict=True):
            coefficients, constant = square.at(ends, root[ends])
            kept = LASTING * ctranspose(root[ends]) @ outer @ root[ends]
            after = slope.size - before - len(square)
            wide = np.pad(coefficients, ((0, 0), (before, after), (0, 0), (0, 0)))
            limits.append((wide, constant - kept))
        found = least(slope, [left, right], limits, context)
        return left.weight(found[: len(left)]), right.weight(found[len(left) :])


def _block_inequality(L: Inequality, R: Inequality, M: Array) -> Inequality:
    """The matrix [[L, M], [M^*, R]], with the unknowns of L before those of R."""
    f, (p, m) = len(M), M.shape[1:]
    a, b = L[0].shape[1], R[0].shape[1]
    coefficients = np.zeros((f, a + b, p + m, p + m), complex)
    coefficients[:, :a, :p, :p], coefficients[:, a:, p:, p:] = L[0], R[0]
    constant = np.concatenate(
        [np.concatenate([L[1], M], axis=2), np.concatenate([ctranspose(M), R[1]], axis=2)],
        axis=1,
    )
    return coefficients, constant
