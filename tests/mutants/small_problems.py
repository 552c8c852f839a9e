"""Small problems of Programs that have no tight one."""

from __future__ import annotations

from dataclasses import replace

import control
import cvxpy as cp
import numpy as np
from tight_problems import PROGRAMS

from workbench.conic import ConeFactor, ConeKind, ConicForm, ConicProgram, CvxpyProgram
from workbench.fitting import ResponseFit
from workbench.geometry import NarrowestStadium
from workbench.identification import ClosedLoopFit, RationalModelFit
from workbench.program import Program
from workbench.synthesis import Implementation


def rational_fit() -> Program:
    omega = np.geomspace(0.1, 100.0, 25)
    s = 1j * omega
    return ResponseFit(omega, (s + 4.0) / (s**2 + s + 9.0) * (1 + 0.05 * np.exp(s)), 2)


def mu_synthesis() -> Program:
    """With a start, which the method of a fixed order needs: it moves the pole from 1 to -2."""
    return replace(PROGRAMS["mu_synthesis"](), start=control.ss([], [], [], [[-3.0]]))


def hinf_of_order_one() -> Program:
    return replace(PROGRAMS["hinf"](), order=1)


def h2_of_order_one() -> Program:
    return replace(PROGRAMS["h2"](), order=1)


def given_angle() -> Program:
    return NarrowestStadium(np.random.default_rng(3).normal(size=(7, 2)) @ [1.0, 1j], angle=0.3)


def implementation() -> Program:
    """A gain and a slow pole around a first-order plant."""
    s = control.tf("s")
    return Implementation(1 / (s + 1), (s + 1) / (s + 0.1), dt=0.05, delay_samples=0.5)


def rational_model() -> Program:
    """A mode with a little that no model of two poles has."""
    omega = np.geomspace(0.1, 100.0, 40)
    response = rational_fit().response
    response = np.interp(omega, np.geomspace(0.1, 100.0, 25), response)
    return RationalModelFit(omega, response, 1e-4 * np.abs(response) ** 2, orders=(2,))


def closed_loop_fit() -> Program:
    """A first-order plant in a loop with a gain, moved by a random reference."""
    rng = np.random.default_rng(0)
    r, e = rng.standard_normal(600), 0.1 * rng.standard_normal(600)
    x, u, y = 0.0, np.zeros(600), np.zeros(600)
    for t in range(600):
        y[t] = x + e[t]
        u[t] = r[t] - 0.3 * y[t]
        x = 0.8 * x + u[t]
    gain = control.ss([], [], [], [[0.3]], 1.0)
    return ClosedLoopFit(u, y, orders=(1,), excitation=r, controller=gain, direct=False)


def conic_program() -> Program:
    """The least x that is 1 or more."""
    cone = ConeFactor(ConeKind.NONNEGATIVE, 1)
    return ConicProgram(ConicForm([1.0], [[-1.0]], [-1.0], [cone]))


def cvxpy_program() -> Program:
    """The nearest point of a plane to the origin."""
    x = cp.Variable(2, name="x")
    return CvxpyProgram(cp.Problem(cp.Minimize(cp.norm(x)), [x[0] + 2 * x[1] == 5]))


OTHERS = {
    make.__name__: make
    for make in (
        conic_program, cvxpy_program, closed_loop_fit, implementation, rational_model,
        rational_fit, given_angle, mu_synthesis, hinf_of_order_one, h2_of_order_one,
    )
}  # fmt: skip
