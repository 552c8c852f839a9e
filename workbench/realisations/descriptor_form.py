"""Descriptor systems E x' = A x + B u, y = C x + D u, converted exactly to state space."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from workbench._core.arrays import EPS, ComplexArray, RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import InputError
from workbench.input_checks import as_array, need_time_base
from workbench.systems.balancing import balancing
from workbench.systems.realisation import Matrices, realisation

RANK_ROUNDING = 100.0
"""Singular values below this multiple of rounding, in balanced units, count as zero."""
KEPT_DIGITS = 1e-6
"""Largest relative difference between responses of the descriptor form and of the state space."""
TEST_POINTS = (0.3 + 0.9j, 1.0 + 0.2j, 4.0 + 3.0j)
"""Points at which they are compared, relative to the speed of the system."""

Descriptor = tuple[RealArray, RealArray, RealArray, RealArray, RealArray]
"""E, A, B, C and D."""


def from_descriptor(
    A: ArrayLike, B: ArrayLike, C: ArrayLike, D: ArrayLike, E: ArrayLike, *, dt: float = 0.0
) -> StateSpace:
    """The state-space system with the response of a descriptor system.

    Equations without a derivative are solved, and constraints on the states are removed together
    with the states that they determine, until E is invertible. Nothing is approximated.

    Parameters
    ----------
    A, E
        Square matrices (n, n) of E x' = A x + B u; E may be singular.
    B, C, D
        Matrices (n, m), (p, n) and (p, m).
    dt
        Sampling time [s]; 0: continuous time.

    Raises
    ------
    InputError
        The shapes do not fit, an entry is not finite, s E - A is singular for every s, the response
        contains a derivative of an input, or rounding hides a rank.

    References
    ----------
    L. Dai, Singular Control Systems (1989), chapter 1.

    Examples
    --------
    A resistor beside a capacitor, with the current through both as an equation of its own:

    >>> from workbench.realisations import from_descriptor
    >>> E, A = [[1.0, 0.0], [0.0, 0.0]], [[0.0, 1.0], [-1.0, -2.0]]
    >>> G = from_descriptor(A, [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]], E)
    >>> G.nstates, G.poles().real.round(3).tolist(), round(float(G(0.0).real), 3)
    (1, [-0.5], 1.0)
    """
    need_time_base(dt)
    given = _checked(A, B, C, D, E)
    rate = _speed(given[0], given[1])
    timed = (given[0] * rate, *given[1:])
    parts = _regular(_balanced(timed))
    lowered, known = _without_algebraic_states(parts), [_response(timed, s) for s in TEST_POINTS]
    states = (np.eye(len(lowered[0])), *lowered)
    for s, before in zip(TEST_POINTS, known, strict=True):
        apart = np.abs(_response(states, s) - before).max(initial=0.0)
        if not apart <= KEPT_DIGITS * np.abs(before).max(initial=0.0) + EPS:
            raise InputError(
                f"rounding hides a rank of E or A: responses differ by {apart:.2g} after reduction;"
                " give the equations in units in which their entries are of similar size"
            )
    A1, B1, C1, D1 = lowered
    return realisation((A1 * rate, B1 * rate, C1, D1), dt)


def _checked(A: ArrayLike, B: ArrayLike, C: ArrayLike, D: ArrayLike, E: ArrayLike) -> Descriptor:
    """E, A, B, C and D as finite matrices whose shapes agree."""
    found = {"A": A, "B": B, "C": C, "D": D, "E": E}
    parts = {name: np.atleast_2d(as_array(value, name)) for name, value in found.items()}
    n, m, p = len(parts["A"]), parts["B"].shape[-1], len(parts["C"])
    needed = {"A": (n, n), "B": (n, m), "C": (p, n), "D": (p, m), "E": (n, n)}
    for name, shape in needed.items():
        if parts[name].shape != shape:
            raise InputError(f"{name} has shape {parts[name].shape}; {shape} is needed")
        if not np.isfinite(parts[name]).all():
            raise InputError(f"{name} is not finite everywhere")
    return parts["E"], parts["A"], parts["B"], parts["C"], parts["D"]


def _speed(E: RealArray, A: RealArray) -> float:
    """A frequency [rad/s] at which E and A have equal weight."""
    sizes = float(np.abs(A).max(initial=0.0)), float(np.abs(E).max(initial=0.0))
    return sizes[0] / sizes[1] if all(sizes) else 1.0


def _balanced(parts: Descriptor) -> Descriptor:
    """The same system with equations and states scaled to similar size."""
    E, A, B, C, D = parts
    rows, columns = balancing(np.abs(E) + np.abs(A), 0)
    left, right = rows[:, None], columns[None, :]
    return left * E * right, left * A * right, left * B, C * right, D


def _regular(parts: Descriptor) -> Descriptor:
    """The matrices, unchanged; raises InputError if s E - A is singular for every s."""
    E, A = parts[:2]
    sizes = [np.linalg.svd(s * E - A, compute_uv=False) for s in TEST_POINTS]
    if max(float(size[-1]) for size in sizes) <= RANK_ROUNDING * EPS * len(A):
        raise InputError(
            "s E - A is singular for every s: some states are not determined, or some equations "
            "contradict each other"
        )
    return parts


def _without_algebraic_states(parts: Descriptor) -> Matrices:
    """A, B, C and D of a state-space system: constraints are removed, algebraic equations are
    solved.

    The transposed system is used too: it has no constraint where this one has a constraint on
    states that inputs move at once, if no output shows the derivative of the input.
    """
    turned = stuck = False
    while True:
        parts, rank = _with_identity_first(parts)
        _, A, B, _, _ = parts
        W, sizes, _ = np.linalg.svd(A[rank:, rank:])
        free = int((sizes > _least(A)).sum())
        if free == len(sizes):
            A, B, C, D = _without_last_states(parts, rank)
            return (A.T, C.T, B.T, D.T) if turned else (A, B, C, D)
        none = W[:, free:].T @ B[rank:]
        turn, moved, _ = np.linalg.svd(none)
        tied = int((moved > _least(B)).sum())
        if tied < len(none):
            order = np.hstack([W[:, :free], W[:, free:] @ turn])
            parts, stuck = _without_constraints(parts, rank, order.T, len(none) - tied), False
        elif stuck:
            raise InputError(
                "the response contains a derivative of an input, which no system of states has: "
                "leave that output out, or filter that input"
            )
        else:
            parts, turned, stuck = _transposed(parts), not turned, True


def _with_identity_first(parts: Descriptor) -> tuple[Descriptor, int]:
    """The system with E = diag(1, 0), and the rank of E."""
    E, A, B, C, D = parts
    U, values, Vh = np.linalg.svd(E)
    rank = int((values > _least(E)).sum())
    scale = np.ones(len(E))
    scale[:rank] = values[:rank]
    A, B = U.T @ A @ Vh.T / scale[:, None], U.T @ B / scale[:, None]
    return (np.diag((np.arange(len(E)) < rank).astype(float)), A, B, C @ Vh.T, D), rank


def _without_last_states(parts: Descriptor, rank: int) -> Matrices:
    """The system without the states that its last equations determine."""
    _, A, B, C, D = parts
    last = np.linalg.solve(A[rank:, rank:], np.hstack([A[rank:, :rank], B[rank:]]))
    x, u = last[:, :rank], last[:, rank:]
    A1, B1 = A[:rank, :rank] - A[:rank, rank:] @ x, B[:rank] - A[:rank, rank:] @ u
    return A1, B1, C[:, :rank] - C[:, rank:] @ x, D - C[:, rank:] @ u


def _without_constraints(parts: Descriptor, rank: int, rows: RealArray, count: int) -> Descriptor:
    """The system on those states that its last `count` equations allow, after a rotation of the
    last states.
    """
    E, A, B, C, D = parts
    n = len(A)
    turned = np.eye(n)
    turned[rank:, rank:] = rows
    A, B = turned @ A, turned @ B
    _, sizes, Vh = np.linalg.svd(A[n - count :, :rank])
    Z = Vh[int((sizes > _least(A)).sum()) :].T
    columns = np.hstack([np.vstack([Z, np.zeros((n - rank, Z.shape[1]))]), np.eye(n)[:, rank:]])
    kept = slice(0, n - count)
    return (E @ columns)[kept], (A @ columns)[kept], B[kept], C @ columns, D


def _transposed(parts: Descriptor) -> Descriptor:
    E, A, B, C, D = parts
    return E.T, A.T, C.T, B.T, D.T


def _least(M: RealArray) -> float:
    """Bound below which a singular value of a matrix counts as zero."""
    return RANK_ROUNDING * EPS * float(np.abs(M).max(initial=0.0)) * max(M.shape)


def _response(parts: Descriptor | tuple[RealArray, ...], s: complex) -> ComplexArray:
    """The response of a descriptor system at a point."""
    E, A, B, C, D = parts
    found: ComplexArray = np.asarray(C @ np.linalg.solve(s * E - A, B) + D, dtype=complex)
    return found
