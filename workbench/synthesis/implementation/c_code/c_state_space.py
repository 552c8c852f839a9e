"""C code of a state space: a step, anti-windup at the limits, and a start without a bump."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

import numpy as np
from scipy.linalg import null_space

from workbench._core.arrays import RealArray
from workbench._core.heavy_types import StateSpace
from workbench.errors import SolverError
from workbench.synthesis.implementation.working_point.actuator import Actuator
from workbench.systems.equations.riccati import sampled_solution

CONDITIONING_NOISE = 1e-4
"""Assumed error of a control in the design of the anti-windup gain, relative to the controller's
gain.
"""
GAIN_ROUNDING = 1e-12
"""Rounding of a gain of the start, relative to the terms of its sum. Smaller gains are zero but for
rounding, and are left out of the code; the control at the start changes by no more than this.
"""

Number = Callable[[float], str]
"""Function: number -> its C literal."""


def step_code(
    K: StateSpace, name: str, number: Number, H: RealArray | None, actuator: Actuator
) -> str:
    """Body of the step: first the outputs, then the limits, then the states with anti-windup."""
    n, p = K.nstates, K.noutputs
    x, y = [f"x{i}" for i in range(n)], _inputs(K, actuator)
    lines = _errors(K, name, actuator)
    lines += [f"const {name}_real x{i} = state->x[{i}];" for i in range(n)]
    for i in range(p):
        terms = [*zip(K.C[i], x, strict=True), *zip(K.D[i], y, strict=True)]
        rest = f"{name}_rest[{i}] + " if actuator.point else ""
        lines.append(f"u[{i}] = {rest}{_sum_text(terms, number)};".replace("+ -", "- "))
    if H is not None:
        for i in range(p):
            lines += [f"const {name}_real w{i} = u[{i}];", *_limit_lines(i, name, actuator)]
    for i in range(n):
        terms = [*zip(K.A[i], x, strict=True), *zip(K.B[i], y, strict=True)]
        if H is not None:
            terms += [(H[i, j], f"(u[{j}] - w{j})") for j in range(p)]
        lines.append(f"state->x[{i}] = {_sum_text(terms, number)};")
    if actuator.step is not None:
        lines += [f"state->before[{i}] = u[{i}];" for i in range(p)]
    if actuator.approach is not None:
        lines += [
            f"state->apart[{j}] -= {number(float(share))} * state->apart[{j}];"
            for j, share in enumerate(actuator.approach)
        ]
    if n == 0 and actuator.step is None and actuator.approach is None:
        lines.append("(void)state;")
    return "".join(f"    {line}\n" for line in lines + _unused_line(lines, y))


def start_code(K: StateSpace, name: str, number: Number, actuator: Actuator) -> str:
    """Body of the start: states from which a step with measurements y gives the controls u.

    Filtered set-points start at the measurements, so that there are no errors then.
    """
    from_y, from_u = start_gains(K)
    if actuator.approach is not None:
        from_y = np.zeros_like(from_y)
    y = _inputs(K, actuator)
    u = [f"(u[{j}] - {name}_rest[{j}])" if actuator.point else f"u[{j}]" for j in range(K.noutputs)]
    sums = []
    for i in range(K.nstates):
        terms = [*zip(from_y[i], y, strict=True), *zip(from_u[i], u, strict=True)]
        sums.append(_sum_text(terms, number))
    if actuator.approach is None:
        lines = _errors(K, name, actuator)
    else:
        lines = [
            f"state->setpoint[{j}] = r[{j}]; state->apart[{j}] = y[{j}] - r[{j}];"
            for j in range(K.ninputs)
        ]
    lines += [f"state->x[{i}] = {value};" for i, value in enumerate(sums or ["0"])]
    if actuator.step is not None:
        lines += [f"state->before[{i}] = u[{i}];" for i in range(K.noutputs)]
    if actuator.approach is None:
        lines += _unused_line(lines, y)
    if not any("u[" in line for line in lines):
        lines.append("(void)u;")
    return "".join(f"    {line}\n" for line in lines)


def _inputs(K: StateSpace, actuator: Actuator) -> list[str]:
    """Names of the controller's inputs: errors e if the code takes the user's signals."""
    word = "e" if actuator.point else "y"
    return [f"{word}[{j}]" for j in range(K.ninputs)]


def _errors(K: StateSpace, name: str, actuator: Actuator) -> list[str]:
    """The lines that compute errors from set-points, perhaps filtered, and measurements."""
    if actuator.point is None:
        return []
    one = "r[{0}] - y[{0}]" if actuator.sign < 0 else "y[{0}] - r[{0}]"
    lines = []
    if actuator.approach is not None:
        one += " + state->apart[{0}]" if actuator.sign < 0 else " - state->apart[{0}]"
        for j in range(K.ninputs):
            lines += [
                f"state->apart[{j}] += state->setpoint[{j}] - r[{j}];",
                f"state->setpoint[{j}] = r[{j}];",
            ]
    errors = ", ".join(one.format(j) for j in range(K.ninputs))
    return [*lines, f"const {name}_real e[{K.ninputs}] = {{{errors}}};"]


def _limit_lines(i: int, name: str, actuator: Actuator) -> list[str]:
    """Lines that limit the change of control i in a sample, and then its value."""
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


def _unused_line(lines: Sequence[str], inputs: Sequence[str]) -> list[str]:
    """A line that avoids a compiler warning if no line uses an input."""
    word = inputs[0][0]
    used = any(re.search(rf"\b{word}\[\d+\](?! =)", line) for line in lines)
    return [] if used else [f"(void){word};"]


def _sum_text(terms: Sequence[tuple[float, str]], number: Number) -> str:
    """Text of a sum of products without terms that are zero."""
    there = [f"{number(float(value))} * {word}" for value, word in terms if value != 0.0]
    return " + ".join(there).replace("+ -", "- ") or "0"


def start_gains(K: StateSpace) -> tuple[RealArray, RealArray]:
    """Gains (n, inputs) and (n, outputs) from y and u to a state that gives u and changes least.

    Among the states with C x + D y = u it is the one with the smallest x+ - x. With an integrator
    and y = 0, u stays constant at this state.
    """
    A, B, C, D = (np.asarray(part, dtype=float) for part in (K.A, K.B, K.C, K.D))
    moves = A - np.eye(len(A))
    back = np.linalg.pinv(C)
    free = null_space(C) if len(A) else np.zeros((0, 0))
    inner = free @ np.linalg.pinv(moves @ free) if free.size else np.zeros_like(moves)
    from_u = _difference(back, (inner @ moves, back))
    from_y = _difference(np.zeros((len(A), D.shape[1])), (from_u, D), (inner, B))
    return from_y, from_u


def _difference(first: RealArray, *products: tuple[RealArray, RealArray]) -> RealArray:
    """``first`` (n, k) less products of pairs of matrices (n, m) and (m, k).

    Numbers below `GAIN_ROUNDING`, relative to the terms of their sum, become exact zeros.
    """
    total, size = first.copy(), np.linalg.norm(first, axis=1, keepdims=True) * np.ones(first.shape)
    for left, right in products:
        total -= left @ right
        rows, columns = np.linalg.norm(left, axis=1), np.linalg.norm(right, axis=0)
        size += np.outer(rows, columns)
    kept: RealArray = np.where(np.abs(total) > GAIN_ROUNDING * size, total, 0.0)
    return kept


def anti_windup_gain(K: StateSpace) -> RealArray:
    """Gain H (n, outputs) in x+ = A x + B y + H (u - w), for the limited control u and the wanted
    one w.

    The limited control serves as a measurement of the wanted one (conditioning technique: R. Hanus,
    M. Kinnaert, J.-L. Henrotte, Automatica 23, 1987). The gain is that of a Kalman filter whose
    noise enters like the controller's measurements; it is B / D if the controller has a stable
    inverse. A - H C is stable, so a controller at its limits forgets how long it has been there.

    Raises SolverError if the Riccati equation has no solution.
    """
    A, B, C, D = (np.asarray(part, dtype=float) for part in (K.A, K.B, K.C, K.D))
    if not len(A):
        return np.zeros((0, len(C)))
    size = float(np.abs(D).max() + np.abs(C).max() * np.abs(B).max()) or 1.0
    noise = CONDITIONING_NOISE * size * np.eye(len(C))
    entering = np.vstack([B.T, np.zeros((len(C), len(A)))])
    try:
        P = sampled_solution(A.T, C.T, entering, np.vstack([D.T, noise]))
    except np.linalg.LinAlgError as error:
        raise SolverError(
            f"there is no anti-windup gain: {error}; a pole on the unit circle that no measurement "
            "moves? remove it, or give no limits"
        ) from None
    spread = C @ P @ C.T + D @ D.T + noise @ noise
    gain: RealArray = np.linalg.solve(spread, (A @ P @ C.T + B @ D.T).T).T
    return gain
