"""C code of a state space: a step, anti-windup at its limits, and a start without a bump."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

import numpy as np
from scipy.linalg import null_space, solve_discrete_are

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import SolverError
from workbench.synthesis.implementation.working_point.actuator import Actuator

CONDITIONING_NOISE = 1e-4
"""Error of a control, over the controller's own gain, in the design of the anti-windup gain."""

Number = Callable[[float], str]
"""Function of a number that gives its C literal."""


def step_code(
    K: StateSpace, name: str, number: Number, H: RealArray | None, actuator: Actuator
) -> str:
    """Body of the step: outputs first, then limits, then the states that they are known to."""
    n, p = K.nstates, K.noutputs
    x, y = [f"x{i}" for i in range(n)], _inputs(K, actuator)
    lines = _errors(K, name, actuator)
    lines += [f"const {name}_real x{i} = state->x[{i}];" for i in range(n)]
    for i in range(p):
        terms = [*zip(K.C[i], x, strict=True), *zip(K.D[i], y, strict=True)]
        rest = f"{name}_rest[{i}] + " if actuator.point else ""
        lines.append(f"u[{i}] = {rest}{_sum(terms, number)};".replace("+ -", "- "))
    if H is not None:
        for i in range(p):
            lines += [f"const {name}_real w{i} = u[{i}];", *_limited(i, name, actuator)]
    for i in range(n):
        terms = [*zip(K.A[i], x, strict=True), *zip(K.B[i], y, strict=True)]
        if H is not None:
            terms += [(H[i, j], f"(u[{j}] - w{j})") for j in range(p)]
        lines.append(f"state->x[{i}] = {_sum(terms, number)};")
    if actuator.step is not None:
        lines += [f"state->before[{i}] = u[{i}];" for i in range(p)]
    if n == 0 and actuator.step is None:
        lines.append("(void)state;")
    return "".join(f"    {line}\n" for line in lines + _unused(lines, y))


def start_code(K: StateSpace, name: str, number: Number, actuator: Actuator) -> str:
    """Body of the start: states from which the step answers measurements y with controls u."""
    from_y, from_u = start_gains(K)
    y = _inputs(K, actuator)
    u = [f"(u[{j}] - {name}_rest[{j}])" if actuator.point else f"u[{j}]" for j in range(K.noutputs)]
    sums = []
    for i in range(K.nstates):
        terms = [*zip(from_y[i], y, strict=True), *zip(from_u[i], u, strict=True)]
        sums.append(_sum(terms, number))
    lines = _errors(K, name, actuator)
    lines += [f"state->x[{i}] = {value};" for i, value in enumerate(sums or ["0"])]
    if actuator.step is not None:
        lines += [f"state->before[{i}] = u[{i}];" for i in range(K.noutputs)]
    lines += _unused(lines, y)
    if not any("u[" in line for line in lines):
        lines.append("(void)u;")
    return "".join(f"    {line}\n" for line in lines)


def _inputs(K: StateSpace, actuator: Actuator) -> list[str]:
    """Names of the controller's inputs: errors where the user's signals are given."""
    word = "e" if actuator.point else "y"
    return [f"{word}[{j}]" for j in range(K.ninputs)]


def _errors(K: StateSpace, name: str, actuator: Actuator) -> list[str]:
    """The line that makes errors of the set-points and the measurements."""
    if actuator.point is None:
        return []
    one = "r[{0}] - y[{0}]" if actuator.sign < 0 else "y[{0}] - r[{0}]"
    apart = ", ".join(one.format(j) for j in range(K.ninputs))
    return [f"const {name}_real e[{K.ninputs}] = {{{apart}}};"]


def _limited(i: int, name: str, actuator: Actuator) -> list[str]:
    """Lines that keep control i within its change in a sample, then within its limits."""
    bounds = []
    if actuator.step is not None:
        before, change = f"state->before[{i}]", f"{name}_change[{i}]"
        bounds.append((f"{before} - {change}", f"{before} + {change}"))
    if actuator.lowest is not None:
        bounds.append((f"{name}_lowest[{i}]", f"{name}_highest[{i}]"))
    return [
        line
        for low, high in bounds
        for line in (
            f"if (u[{i}] < {low})",
            f"    u[{i}] = {low};",
            f"else if (u[{i}] > {high})",
            f"    u[{i}] = {high};",
        )
    ]


def _unused(lines: Sequence[str], inputs: Sequence[str]) -> list[str]:
    """A line against a warning, where no line uses an input."""
    word = inputs[0][0]
    used = any(re.search(rf"\b{word}\[\d+\](?! =)", line) for line in lines)
    return [] if used else [f"(void){word};"]


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
