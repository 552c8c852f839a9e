"""Plants drawn from the set of a record, and sizes of their loops, by other formulas."""

import numpy as np
import pytest
from scipy.linalg import solve_discrete_are, solve_discrete_lyapunov

from workbench.second_opinion import recorded_plants as drawn

RNG = np.random.default_rng(0)
Z, PLANT = RNG.standard_normal((3, 25)), np.array([[0.5, 0.2, 1.0], [0.0, 0.8, 0.3]])
AFTER = PLANT @ Z + 0.1 * RNG.standard_normal((2, 25))
WEIGHT = np.diag(RNG.uniform(0.5, 2.0, 25))
ENERGY = np.array([[1.0, 0.2], [0.2, 0.8]])
LOOP = np.array([[0.5, 0.4], [-0.3, 0.7]])


@pytest.mark.parametrize("weight", [None, WEIGHT], ids=["plain", "weighted"])
def test_drawn_plants_are_on_the_edge_and_larger_changes_outside(weight):
    about = Z, AFTER, weight, ENERGY
    centre, left, right = drawn.edge_plants(*about)
    change = drawn.drawn_changes(left, right)
    assert abs(drawn.excess_energy(centre + change, *about)) < 1e-7
    assert drawn.excess_energy(centre + 1.01 * change, *about) > 1e-3
    assert drawn.excess_energy(centre + 0.5 * change, *about) < 0


def test_sizes_of_a_loop():
    seen, entering = np.array([[1.0, 2.0]]), np.array([[1.0], [0.5]])
    P = solve_discrete_lyapunov(LOOP.T, seen.T @ seen)
    h2 = np.sqrt(entering.T @ P @ entering).item()
    assert drawn.largest_h2(LOOP[None], entering, seen) == pytest.approx(h2, rel=1e-12)
    angle = np.linspace(0, np.pi, 100_001)
    z = np.exp(1j * angle)[:, None, None]
    gain = np.abs(seen @ np.linalg.inv(z * np.eye(2) - LOOP) @ entering).ravel()
    size, where = drawn.largest_response(LOOP[None], entering, seen)
    assert size == pytest.approx(gain.max(), rel=1e-8)
    assert where == pytest.approx(angle[gain.argmax()], abs=1e-3)
    assert drawn.fastest_loop(LOOP[None], 1.0) < 0
    radius = np.abs(np.linalg.eigvals(LOOP)).max()
    assert drawn.fastest_loop(LOOP[None], 0.999 * radius) > 0
    assert drawn.fastest_loop(LOOP[None], 1.001 * radius) < 0


def test_an_unstable_loop_has_no_norm():
    assert drawn.largest_h2(1.5 * LOOP[None] / 0.7, np.eye(2), np.eye(2)) == np.inf


def test_the_least_cost_is_that_of_the_riccati_equation():
    V, C = np.array([[0.3], [0.1]]), np.eye(2)
    P = drawn.least_cost(LOOP, V, C)
    game = solve_discrete_are(LOOP, V, C.T @ C, -np.eye(1))
    np.testing.assert_allclose(P, game, rtol=1e-8)
    assert drawn.least_cost(LOOP, 10 * V, C) is None
