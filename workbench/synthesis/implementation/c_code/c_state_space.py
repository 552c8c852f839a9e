"""C code of a state space: a step, anti-windup at its limits, and a start without a bump."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from scipy.linalg import null_space, solve_discrete_are

from workbench.arrays import RealArray
from workbench.errors import SolverError
from workbench.heavy_types import StateSpace

CONDITIONING_NOISE = 1e-4
"""Error of a control, over the controller's own gain, in the design of the anti-windup gain."""

Number = Callable[[float], str]
"""Function of a number that gives its C literal."""


def step_code(K: StateSpace, name: str, number: Number, H: RealArray | None) -> str:
    """Body of the step: outputs first, then limits, then the states that they are known to."""
    n, m, p = K.nstates, K.ninputs, K.noutputs
    x, y = [f"x{i}" for i in range(n)], [f"y[{j}]" for j in range(m)]
    lines = [f"const {name}_real x{i} = state->x[{i}];" for i in range(n)]
    for i in range(p):
        terms = [*zip(K.C[i], x, strict=True), *zip(K.D[i], y, strict=True)]
        lines.append(f"u[{i}] = {_sum(terms, number)};")
    if H is not None:
        for i in range(p):
            lines += [
                f"const {name}_real w{i} = u[{i}];",
                f"if (u[{i}] < {name}_lowest[{i}])",
                f"    u[{i}] = {name}_lowest[{i}];",
                f"else if (u[{i}] > {name}_highest[{i}])",
                f"    u[{i}] = {name}_highest[{i}];",
            ]
    for i in range(n):
        terms = [*zip(K.A[i], x, strict=True), *zip(K.B[i], y, strict=True)]
        if H is not None:
            terms += [(H[i, j], f"(u[{j}] - w{j})") for j in range(p)]
        lines.append(f"state->x[{i}] = {_sum(terms, number)};")
    if n == 0:
        lines.append("(void)state;")
    if not any(f"y[{j}]" in line for line in lines for j in range(m)):
        lines.append("(void)y;")
    return "".join(f"    {line}\n" for line in lines)


def start_code(K: StateSpace, number: Number) -> str:
    """Body of the start: states from which the step answers measurements y with controls u."""
    from_y, from_u = start_gains(K)
    sums = []
    for i in range(K.nstates):
        terms = [(value, f"y[{j}]") for j, value in enumerate(from_y[i])]
        terms += [(value, f"u[{j}]") for j, value in enumerate(from_u[i])]
        sums.append(_sum(terms, number))
    lines = [f"state->x[{i}] = {value};" for i, value in enumerate(sums or ["0"])]
    lines += [f"(void){word};" for word in "yu" if not any(f"{word}[" in each for each in sums)]
    return "".join(f"    {line}\n" for line in lines)


def _sum(terms: Sequence[tuple[float, str]], number: Number) -> str:
    """Sum of products, without those of zero."""
    there = [f"{number(float(value))} * {word}" for value, word in terms if value != 0.0]
    return " + ".join(there).replace("+ -", "- ") or "0"


def start_gains(K: StateSpace) -> tuple[RealArray, RealArray]:
    """Gains (n, inputs) and (n, outputs) from y and u to a state that gives u and moves least.

    Of the states with C x + D y = u it is the one for which x+ - x is the least: with an integrator
    and y = 0, the state at which u stays as it is.
    """
    A, B, C, D = (np.asarray(part, dtype=float) for part in (K.A, K.B, K.C, K.D))
    moves = A - np.eye(len(A))
    back = np.linalg.pinv(C)
    free = null_space(C) if len(A) else np.zeros((0, 0))
    inner = free @ np.linalg.pinv(moves @ free) if free.size else np.zeros_like(moves)
    from_u = back - inner @ moves @ back
    return -from_u @ D - inner @ B, from_u


def anti_windup_gain(K: StateSpace) -> RealArray:
    """Gain H (n, outputs) of x+ = A x + B y + H (u - w), u the limited control and w the wanted.

    The limited control is taken as a measurement of the wanted one (conditioning technique: R.
    Hanus, M. Kinnaert, J.-L. Henrotte, Automatica 23, 1987): the gain is that of the Kalman filter
    whose noise enters as the controller's measurements do, B / D where the controller has a stable
    inverse. A - H C is stable, so that a controller that is held at its limits forgets how long.

    Raises SolverError where the Riccati equation has no solution.
    """
    A, B, C, D = (np.asarray(part, dtype=float) for part in (K.A, K.B, K.C, K.D))
    if not len(A):
        return np.zeros((0, len(C)))
    size = float(np.abs(D).max() + np.abs(C).max() * np.abs(B).max()) or 1.0
    noise = (CONDITIONING_NOISE * size) ** 2 * np.eye(len(C))
    try:
        P = solve_discrete_are(A.T, C.T, B @ B.T, D @ D.T + noise, s=B @ D.T)
    except (np.linalg.LinAlgError, ValueError) as error:
        raise SolverError(
            f"there is no anti-windup gain: {error}; a pole on the unit circle that no measurement "
            "moves? remove it, or give no limits"
        ) from None
    gain: RealArray = np.linalg.solve(C @ P @ C.T + D @ D.T + noise, (A @ P @ C.T + B @ D.T).T).T
    return gain
