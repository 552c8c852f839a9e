"""What second opinions do differently for many states, against what they do for few."""

import control
import numpy as np
import pytest
from lanes import thinned

from workbench.second_opinion import powers, responses, simulation


def loop(seed, n):
    """A stable loop of lightly damped modes."""
    rng = np.random.default_rng(seed)
    A = np.zeros((n, n))
    for k, omega in enumerate(np.geomspace(1.0, 100.0, n // 2)):
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = omega * np.array([[-0.02, 1.0], [-1.0, -0.02]])
    Q = np.linalg.qr(rng.normal(size=(n, n)))[0]
    parts = Q @ A @ Q.T, rng.normal(size=(n, 2)), rng.normal(size=(3, n)), np.ones((3, 2))
    return control.ss(*parts)


@pytest.mark.parametrize("dt", [0.0, 0.01])
def test_responses_by_substitution_are_those_by_elimination(monkeypatch, dt):
    system = loop(1, 70)
    system = system.sample(dt, "bilinear") if dt else system
    omega = np.append(np.geomspace(0.1, 300.0, 90), [0.0, np.inf])
    quick = responses.plain_response(system, omega)
    assert responses._triangle.cache_info().currsize
    monkeypatch.setattr(responses, "FEWEST_STATES", 1000)
    slow = responses.plain_response(system, omega)
    np.testing.assert_allclose(quick, slow, rtol=0, atol=1e-9 * np.abs(slow).max())


def test_a_triangle_that_hides_a_pole_is_not_used():
    A = np.diag(-np.geomspace(1e-6, 1e6, 60))
    assert responses._triangle(A.tobytes(), 60, False) is None


@pytest.mark.parametrize("shift", thinned([0.0, 0.021, 0.5], 3))
def test_powers_fall_or_grow_as_those_of_few_states(monkeypatch, shift):
    A = loop(2, 104).A + shift * np.eye(104)
    many = powers.growth(A, 0.0)
    monkeypatch.setattr(powers, "MANY_STATES", 1000)
    rate, rounding = powers.growth(A, 0.0)
    assert (many[0] <= many[1]) == (rate <= rounding) == (shift < 0.02)
    assert many[0] >= rate - rounding  # of a stable loop it is above the limit


def test_simulation_by_blocks_is_the_recursion():
    rng = np.random.default_rng(4)
    A = rng.normal(size=(7, 7)) / 4
    B, C, D = rng.normal(size=(7, 2)), rng.normal(size=(3, 7)), rng.normal(size=(3, 2))
    for samples in (1, simulation.BLOCK, 3 * simulation.BLOCK + 5):
        w = rng.normal(size=(samples, 2))
        x, z = np.zeros(7), []
        for row in w:
            z.append(C @ x + D @ row)
            x = A @ x + B @ row
        np.testing.assert_allclose(simulation._Blocks(A, B, C, D).run(w), z, rtol=0, atol=1e-10)
