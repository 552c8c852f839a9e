"""Slow unstable modes beside fast poles: whether inputs reach them is seen in the entries."""

import control
import numpy as np
import pytest

from workbench.errors import InputError
from workbench.synthesis import H2Synthesis, HinfSynthesis
from workbench.synthesis.h_infinity.assumptions import unreached_mode
from workbench.systems.balancing import balanced
from workbench.uncertainty import GeneralisedPlant


def graded(rng, fast, *, hidden, coupling):
    """A and B with an unstable slow block and a stable block `fast` times as fast.

    In the coordinates of the blocks neither inputs nor fast states move the slow states of a hidden
    block. The blocks' states are then mixed by `coupling`, and all states get random units.
    """
    slow, inputs, root = int(rng.integers(1, 4)), int(rng.integers(1, 3)), np.sqrt(fast)
    S = rng.standard_normal((slow, slow))
    S += np.eye(slow) * (10 ** rng.uniform(-3, 1) - np.linalg.eigvals(S).real.max())
    F = rng.standard_normal((2, 2))
    F = fast * (F - np.eye(2) * (abs(F).sum() + 1))
    into = np.zeros((slow, 2 + inputs)) if hidden else rng.standard_normal((slow, 2 + inputs))
    into[:, :2] *= root
    A = np.block([[S, into[:, :2]], [rng.standard_normal((2, slow)) * root, F]])
    B = np.vstack([into[:, 2:], root * rng.standard_normal((2, inputs))])
    if coupling:
        T, V = np.eye(slow + 2), np.eye(slow + 2)
        T[:slow, slow:] = coupling / root * rng.standard_normal((slow, 2))
        V[slow:, :slow] = coupling / root * rng.standard_normal((2, slow))
        T = T @ V
        A, B = T @ A @ np.linalg.inv(T), T @ B
    units, order = 2.0 ** rng.integers(-20, 21, slow + 2), rng.permutation(slow + 2)
    C = np.append(np.ones(slow), [root, root])[None]
    A, B, _ = balanced(A * units[:, None] / units, B * units[:, None], C / units)
    return A[np.ix_(order, order)], B[order]


@pytest.mark.parametrize("coupling", [0.0, 0.1, 1.0])
@pytest.mark.parametrize("fast", [1e3, 1e6, 1e9, 1e12, 1e14])
@pytest.mark.parametrize("hidden", [False, True])
def test_slow_modes_are_judged_by_their_entries(hidden, fast, coupling):
    """Beside poles of 1e12, half of the modes that inputs reach were refused."""
    wrong = []
    for seed in range(20):
        rng = np.random.default_rng([69, seed])
        A, B = graded(rng, fast, hidden=hidden, coupling=coupling)
        if (unreached_mode(A, B) is not None) != hidden:
            wrong.append(seed)
    assert not wrong


def test_an_entry_of_the_size_of_rounding_reaches_nothing():
    A, B = np.array([[-1.0, 0.0], [1e-17, 1.0]]), np.array([[1.0], [0.0]])
    assert unreached_mode(A, B) == 1.0
    A[1, 0] = 1e-10
    assert unreached_mode(A, B) is None


def test_two_integrators_of_which_one_is_reached():
    A, B = np.zeros((2, 2)), np.array([[1.0], [0.0]])
    assert unreached_mode(A, B) == 0.0
    assert unreached_mode(np.array([[0.0, 0.0], [1.0, 0.0]]), B) is None


def plant_beside(fast, slow_gain):
    """A plant with poles at 0.5 and -fast; the input moves the slow state by `slow_gain`."""
    A = np.diag([0.5, -fast])
    B = np.array([[1.0, 0.0, slow_gain], [0.0, 0.0, fast]])
    C = np.array([[1.0, 0.0], [0.0, 0.0], [1.0, 1.0]])
    D = np.array([[0.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]])
    return GeneralisedPlant(control.ss(A, B, C, D), None, 1, 1)


@pytest.mark.parametrize("kind", [H2Synthesis, HinfSynthesis])
def test_a_plant_with_a_fast_pole_can_be_posed(kind):
    assert kind(plant_beside(1e12, 0.01)).plant is not None
    with pytest.raises(InputError, match=r"mode 0.5"):
        kind(plant_beside(1e12, 0.0))
