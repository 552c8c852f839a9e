"""Data of the central path: a point, a step from it, its equations, scratch arrays."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from workbench._core.compiled import compiled
from workbench.mu.upper.newton import square
from workbench.mu.upper.pattern import Pattern


class Point(NamedTuple):
    """A point of the path and its multipliers: S, B = D_r and Z are (r, r), the others (N, N)."""

    D: np.ndarray
    G: np.ndarray
    S: np.ndarray
    B: np.ndarray
    Z: np.ndarray
    W: np.ndarray
    LS: np.ndarray
    LD: np.ndarray
    S_inverse: np.ndarray
    D_inverse: np.ndarray


class Direction(NamedTuple):
    """A step of the unknowns (m,), and the resulting change of the matrices of a point."""

    dx: np.ndarray
    dD: np.ndarray
    dG: np.ndarray
    dS: np.ndarray
    dB: np.ndarray
    dZ: np.ndarray
    dW: np.ndarray


class NewtonSystem(NamedTuple):
    """H (m, m), factored; u, b and the solutions for them, and right-hand sides (m,)."""

    H: np.ndarray
    u: np.ndarray
    b: np.ndarray
    toward_u: np.ndarray
    toward_b: np.ndarray
    pull: np.ndarray
    other: np.ndarray


class Scratch(NamedTuple):
    """Space for intermediate results; ``no_S`` and ``no_D`` are zero between steps."""

    part: np.ndarray
    skew: np.ndarray
    QD: np.ndarray
    work_D: np.ndarray
    no_D: np.ndarray
    V: np.ndarray
    Q: np.ndarray
    work: np.ndarray
    no_S: np.ndarray
    Y: np.ndarray
    MX: np.ndarray
    MXM: np.ndarray
    T: np.ndarray
    U: np.ndarray
    value: np.ndarray


@compiled
def path_state(
    M: np.ndarray, pattern: Pattern, m: int
) -> tuple[Point, Direction, NewtonSystem, Scratch]:
    """Zero arrays for all data of a path of M (c, r) with m unknowns."""
    c, r = M.shape
    N = pattern.size
    point = Point(
        square(N),
        square(N),
        square(r),
        square(r),
        square(r),
        square(N),
        square(r),
        square(N),
        square(r),
        square(N),
    )
    step = Direction(np.zeros(m), square(N), square(N), square(r), square(r), square(r), square(N))
    system = NewtonSystem(
        np.zeros((m, m)),
        np.zeros(m),
        np.zeros(m),
        np.zeros(m),
        np.zeros(m),
        np.zeros(m),
        np.zeros(m),
    )
    scratch = Scratch(
        square(N),
        square(N),
        square(N),
        square(N),
        square(N),
        square(r),
        square(r),
        square(r),
        square(r),
        np.zeros((c, r), np.complex128),
        np.zeros((c, r), np.complex128),
        square(c),
        square(c + r),
        square(c + r),
        np.zeros(pattern.fixed.size, np.complex128),
    )
    return point, step, system, scratch
