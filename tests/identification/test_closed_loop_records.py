"""Methods for closed loops on a loop whose plant, controller and noise are known."""

import control
import numpy as np
import pytest

from workbench import solve
from workbench.errors import InputError
from workbench.identification import ClosedLoopFit, StateSpaceFit
from workbench.program import methods

FREQUENCY = np.linspace(0.01, 0.4, 20)
CONTROLLER = control.ss([[0.5]], [[-0.05]], [[1.0]], [[0.3]], 1.0)


def plant(frequency=FREQUENCY):
    z = np.exp(2j * np.pi * frequency)
    return (z + 0.5) / (z**2 - 1.5 * z + 0.7)


def loop(samples=12000, noise=0.3, seed=0):
    """r, u and y of the loop u = r - C y; the noise of y is strongly coloured."""
    rng = np.random.default_rng(seed)
    r, e = rng.standard_normal(samples), noise * rng.standard_normal(samples)
    x, xc, v = np.zeros(2), 0.0, 0.0
    u, y = np.zeros(samples), np.zeros(samples)
    for t in range(samples):
        v = 0.95 * v + e[t]
        y[t] = x[0] + v + 2.0
        u[t] = r[t] - xc - 0.3 * y[t]
        xc = 0.5 * xc - 0.05 * y[t]
        x = np.array([1.5 * x[0] + x[1] + u[t], -0.7 * x[0] + 0.5 * u[t]])
    return r[:, None], u[:, None], y[:, None]


def distance(model):
    return float(np.max(np.abs(model.response(FREQUENCY)[:, 0, 0] - plant())) / abs(plant()).max())


@pytest.fixture(scope="module")
def program():
    r, u, y = loop()
    return ClosedLoopFit(
        u, y, orders=(2, 3), excitation=r, controller=CONTROLLER, direct=False
    )  # fmt: skip


@pytest.mark.cases(0)
@pytest.mark.parametrize("name", ["direct", "two-stage", "instrumental-variables", "indirect"])
def test_each_method_finds_the_plant(program, name):
    solution = solve(program, method=name)
    assert solution.certificate.valid, solution.certificate.failures
    assert distance(solution.answer.simulator) < 0.065


def test_a_method_for_open_loops_is_biased(program):
    plain = solve(
        StateSpaceFit(program.u, program.y, orders=(2,), assume="open loop"), method="arx"
    )
    assert distance(plain.answer.simulator) > 0.08


def test_what_is_missing_is_said(program):
    assert "indirect" in methods(program)
    without = ClosedLoopFit(program.u, program.y, excitation=program.excitation, orders=(2,))
    with pytest.raises(InputError, match="controller"):
        solve(without, method="indirect")
    with pytest.raises(InputError, match="excitation is missing"):
        ClosedLoopFit(program.u, program.y)
    with pytest.raises(InputError, match="controller has 2 inputs"):
        wide = control.ss([], [], [], np.zeros((1, 2)), 1.0)
        ClosedLoopFit(program.u, program.y, excitation=program.excitation, controller=wide)
    with pytest.raises(InputError, match="continuous time"):
        slow = control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]])
        ClosedLoopFit(program.u, program.y, excitation=program.excitation, controller=slow)
    with pytest.raises(InputError, match="must be equal"):
        ClosedLoopFit(program.u, program.y, excitation=program.excitation[:-1])
