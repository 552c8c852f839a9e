"""Small conic programs whose status is known: infeasible, unbounded, weakly so, or neither."""

from __future__ import annotations

import numpy as np

from workbench.conic import ConeFactor, ConeKind, ConicForm


def nonnegative(size):
    return ConeFactor(ConeKind.NONNEGATIVE, size)


def equal(size):
    return ConeFactor(ConeKind.ZERO, size)


def second_order(size):
    return ConeFactor(ConeKind.SECOND_ORDER, size)


def semidefinite(order):
    return ConeFactor(ConeKind.SEMIDEFINITE, order)


def form(c, A, b, *cones):
    return ConicForm(np.array(c, float), np.array(A, float), np.array(b, float), cones)


def infeasible_lp(seed, rows=30, columns=8):
    """Random rows of which a random positive combination is 0'x <= -1."""
    rng = np.random.default_rng(seed)
    A, b, y = rng.normal(size=(rows, columns)), rng.normal(size=rows), rng.uniform(0.1, 1, rows)
    A[-1] = -(y[:-1] @ A[:-1]) / y[-1]
    b -= y * (b @ y + 1) / (y @ y)
    return ConicForm(rng.normal(size=columns), A, b, (nonnegative(rows),))


def infeasible_sdp(seed, order=5, columns=4):
    """Random matrices orthogonal to a positive definite one, but for the right-hand side."""
    rng = np.random.default_rng(seed)
    root = rng.normal(size=(order, order))
    Y = root @ root.T / order + 0.1 * np.eye(order)
    places = [(i, j) for j in range(order) for i in range(j + 1)]
    y = np.array([Y[i, j] * (1 if i == j else 2) for i, j in places])
    A, b = rng.normal(size=(len(places), columns)), rng.normal(size=len(places))
    A -= np.outer(y, (y @ A) / (y @ y))
    b -= y * (b @ y + 1) / (y @ y)
    return ConicForm(np.zeros(columns), A, b, (semidefinite(order),))


def badly_scaled(seed):
    """An infeasible linear program with rows and columns between 1e-6 and 1e6 of their size."""
    rng, good = np.random.default_rng(seed), infeasible_lp(seed)
    rows, columns = 10.0 ** rng.uniform(-6, 6, 30), 10.0 ** rng.uniform(-6, 6, 8)
    return ConicForm(good.c, rows[:, None] * good.A.toarray() * columns, rows * good.b, good.cones)


def lyapunov(A):
    """P >= 0 with A'P + PA <= -1, the inequality of a stable A."""
    n = len(A)
    places = [(i, j) for j in range(n) for i in range(j + 1)]
    columns = []
    for i, j in places:
        E = np.zeros((n, n))
        E[i, j] = E[j, i] = 1.0
        L = A.T @ E + E @ A
        columns.append([*(L[p] for p in places), *(-E[p] for p in places)])
    b = [*(-1.0 if i == j else 0.0 for i, j in places), *np.zeros(len(places))]
    return form(np.zeros(n * (n + 1) // 2), np.array(columns).T, b, *(semidefinite(n),) * 2)


INFEASIBLE = {
    "x >= 1, x <= 0": form([1], [[-1], [1]], [-1, 0], nonnegative(2)),
    "x + y = -1, x, y >= 0": form(
        [1, 1], [[1, 1], [-1, 0], [0, -1]], [-1, 0, 0], equal(1), nonnegative(2)
    ),
    "linear": infeasible_lp(0),
    "badly scaled": badly_scaled(1),
    "|x| <= 1, x_1 >= 2": form(
        [0, 0],
        [[0, 0], [-1, 0], [0, -1], [-1, 0]],
        [1, 0, 0, -2],
        *(second_order(3), nonnegative(1)),
    ),
    "|x| <= 1, 3 x_1 + 4 x_2 = 6": form(
        [0, 0], [[0, 0], [-1, 0], [0, -1], [3, 4]], [1, 0, 0, 6], second_order(3), equal(1)
    ),
    "[x 1; 1 -x] >= 0": form([0], [[-1], [0], [1]], [0, 1, 0], semidefinite(2)),
    "semidefinite": infeasible_sdp(2),
    "an oscillator is not stable": lyapunov(np.array([[0.0, 1.0], [-1.0, 0.0]])),
    "a triangular unstable matrix": lyapunov(np.array([[1.0, 2.0], [0.0, -1.0]])),
}
WEAKLY_INFEASIBLE = {
    "[x 1; 1 0] >= 0": form([0], [[-1], [0], [0]], [0, 1, 0], semidefinite(2)),
    "|(x, 1)| <= x": form([0], [[-1], [-1], [0]], [0, 0, 1], second_order(3)),
}
"""Solutions exist but for an error as small as one likes: no ray proves anything."""
IRRATIONAL = {
    "unstable, eigenvectors irrational": lyapunov(
        np.array([[0.3, -1.1, 0.2], [0.7, 0.1, -0.4], [0.5, 0.9, -1.3]])
    )
}
"""Infeasible, with rays in a face of the cone that has no rational point but 0."""
UNBOUNDED = {
    "x <= 1": form([1], [[1]], [1], nonnegative(1)),
    "x + y = 1, y >= 0": form([1, 0], [[1, 1], [0, -1]], [1, 0], equal(1), nonnegative(1)),
    "|x| <= y": form([0, -1], [[0, -1], [-1, 0]], [0, 0], second_order(2)),
    "[x y; y z] >= 0": form([0, -1, 0], -np.eye(3), np.zeros(3), semidefinite(2)),
    "y = 1 by two inequalities": form([-1, 0], [[0, 1], [0, -1], [-1, 0]], [1, -1, 0],
                                      nonnegative(3)),
}  # fmt: skip
FALLING_WITHOUT_RAY = {
    "[y x; x 1] >= 0": form([-1, 0], [[0, -1], [-1, 0], [0, 0]], [0, 0, 1], semidefinite(2)),
}
"""x grows without limit, but along a parabola: no ray shows it."""
SOLVABLE = {
    "1 <= x <= 2": form([1], [[-1], [1]], [-1, 2], nonnegative(2)),
    "|x| <= 1, x_1 >= 1/2": form(
        [0, 1],
        [[0, 0], [-1, 0], [0, -1], [-1, 0]],
        [1, 0, 0, -0.5],
        *(second_order(3), nonnegative(1)),
    ),
    "[x 1; 1 y] >= 0": form([1, 1], [[-1, 0], [0, 0], [0, -1]], [0, 1, 0], semidefinite(2)),
}
FAR = form([1], [[-1e-6], [1]], [-1, 1e9], nonnegative(2))
"""1e6 <= x <= 1e9: a solution, but a large one."""
