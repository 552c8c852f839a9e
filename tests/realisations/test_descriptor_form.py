"""Descriptor systems become systems of states with the same response."""

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.realisations import from_descriptor
from workbench.synthesis import hinf
from workbench.uncertainty import GeneralisedPlant

POINTS = (0.5j, 2.0 + 1.0j, 10.0)


def response(A, B, C, D, E, s):
    """The response of a descriptor system at a point, by its definition."""
    A, B, C, D, E = map(np.atleast_2d, (A, B, C, D, E))
    return C @ np.linalg.solve(s * E - A, B) + D


def assert_same(G, *parts, rate=1.0):
    for s in POINTS:
        np.testing.assert_allclose(np.atleast_2d(G(rate * s)), response(*parts, rate * s), 1e-8)


@settings(max_examples=40)
@given(st.integers(0, 10**6), st.integers(1, 7), st.data())
def test_a_random_one_has_the_rank_of_E_as_order(seed, n, data):
    rank = data.draw(st.integers(0, n))
    rng = np.random.default_rng(seed)
    A, B, C, D = (rng.standard_normal(shape) for shape in ((n, n), (n, 2), (3, n), (3, 2)))
    U, V = (np.linalg.qr(rng.standard_normal((n, n)))[0] for _ in range(2))
    E = U @ np.diag((np.arange(n) < rank) * rng.uniform(0.5, 2.0, n)) @ V
    G = from_descriptor(A, B, C, D, E)
    assert G.nstates == rank
    assert_same(G, A, B, C, D, E)


@pytest.mark.parametrize("rate", [1e-6, 1.0, 1e6])
def test_two_masses_held_together_are_one(rate):
    """Index 3: the force in the rod is an output, and told without a derivative."""
    m1, m2, k = 1.0, 2.0, 3.0
    E = np.diag([1, 1, m1, m2, 0.0])
    A = np.zeros((5, 5))
    A[0, 2] = A[1, 3] = A[2, 4] = A[4, 0] = 1.0
    A[3, 4] = A[4, 1] = -1.0
    A[2, 0] = -k
    A = A.copy()
    A[:4] *= rate
    B, C = rate * np.eye(5)[:, [2]], np.eye(5)[[0, 4]]
    G = from_descriptor(A, B, C, np.zeros((2, 1)), E)
    assert G.nstates == 2
    np.testing.assert_allclose(np.abs(G.poles()) / rate, np.sqrt(k / (m1 + m2)), rtol=1e-10)
    assert_same(G, A, B, C, np.zeros((2, 1)), E, rate=rate)


def test_a_derivative_that_no_output_shows_does_no_harm():
    A, B, C, E = [[0, 1], [1, 0]], [[0], [-1]], [[1, 0]], [[1, 0], [0, 0]]
    assert_same(from_descriptor(A, B, C, [[0]], E), A, B, C, [[0]], E)


def test_a_derivative_that_an_output_shows_is_refused():
    with pytest.raises(InputError, match="derivative of an input"):
        from_descriptor([[1, 0], [0, 1]], [[0], [1]], [[1, 0]], [[0]], [[0, 1], [0, 0]])


def test_equations_alone_are_a_gain_and_sampled_time_is_kept():
    G = from_descriptor([[2.0]], [[1.0]], [[1.0]], [[0.0]], [[0.0]], dt=0.1)
    assert (G.nstates, G.dt) == (0, 0.1)
    assert float(G.D[0, 0]) == pytest.approx(-0.5)


def test_synthesis_takes_the_states():
    G = control.ss([[-1.0]], [[1.0, 0, 1]], [[1.0], [0], [1]], [[0, 0, 0], [0, 0, 1], [0, 1, 0]])
    E, A = np.diag([2.0, 0.0]), np.array([[-2.0, 1.0], [0.0, -1.0]])
    B, C = np.vstack([2 * G.B, np.zeros((1, 3))]), np.hstack([G.C, np.zeros((3, 1))])
    plant = GeneralisedPlant(from_descriptor(A, B, C, G.D, E), None, 1, 1)
    assert hinf(plant).norm == pytest.approx(hinf(G, measurements=1, controls=1).norm, rel=1e-6)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"E": np.eye(3)}, "E has shape"),
        ({"B": np.ones((3, 1))}, "B has shape"),
        ({"A": np.full((2, 2), np.nan)}, "A"),
        ({"C": np.ones((1, 3))}, "C has shape"),
        ({"D": np.ones((2, 2))}, "D has shape"),
        ({"A": np.diag([1.0, 0.0]), "E": np.zeros((2, 2))}, "singular for every s"),
        ({"A": "x"}, "A"),
        ({"dt": -1.0}, "-1"),
    ],
)
def test_bad_input_is_named(change, words):
    parts = {"A": -np.eye(2), "B": np.ones((2, 1)), "C": np.ones((1, 2)), "D": [[0.0]]}
    with pytest.raises(InputError, match=words):
        from_descriptor(**({"E": np.eye(2)} | parts | change))
