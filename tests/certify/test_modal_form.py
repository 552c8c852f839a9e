"""Modal coordinates from eigenvectors in doubles: a similarity, enclosed, or none at all."""

import control
import numpy as np
import pytest
from flint import acb, ctx

from workbench.certify.balls import enclosed, identity
from workbench.certify.modes.modal_form import (
    FEWEST_QUICK,
    PRECISIONS,
    modal_form_of,
    quick_modal_form_of,
    real_balls,
)
from workbench.certify.rounding import exact
from workbench.certify.stable_system import stable_system


def modes(rng, states, slowest, fastest, damping=0.01):
    """A realisation of light modes in random orthonormal coordinates."""
    A = np.zeros((states, states))
    for k, omega in enumerate(np.geomspace(slowest, fastest, states // 2)):
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = omega * np.array([[-damping, 1], [-1, -damping]])
    if states % 2:
        A[-1, -1] = -fastest
    Q, _ = np.linalg.qr(rng.normal(size=(states, states)))
    return Q @ A @ Q.T, Q @ rng.normal(size=(states, 2)), rng.normal(size=(3, states)) @ Q.T


def response(parts, omega):
    """C (j omega - A)^-1 B in balls of enclosures."""
    A, B, C = map(enclosed, parts)
    return C * (acb(0, omega) * identity(A.nrows()) - A).solve(B)


@pytest.mark.parametrize("states", [FEWEST_QUICK, FEWEST_QUICK + 1, 48])
@pytest.mark.parametrize("fastest", [10.0, 1e6])
@pytest.mark.parametrize("skewed", [0.0, 0.3])
def test_the_response_is_that_of_the_given_realisation(states, fastest, skewed):
    rng = np.random.default_rng(states)
    A, B, C = modes(rng, states, 1.0, fastest)
    T = np.eye(states) + skewed * rng.normal(size=(states, states)) / np.sqrt(states)
    A, B, C = np.linalg.solve(T, A @ T), np.linalg.solve(T, B), C @ T
    found = quick_modal_form_of([real_balls(part) for part in (A, B, C)], PRECISIONS[0])
    assert found is not None
    scale = np.abs(A).max()
    for omega in (0.0, 1.3, 0.37 * fastest):
        with ctx.workprec(PRECISIONS[-1]):
            given = response(map(exact, (A, B, C)), omega)
            enclosure = response(found, omega)
            assert enclosure.overlaps(given)
            radius = max(float((abs(entry)).rad()) for entry in enclosure.entries())
            assert radius < 1e-9 * scale * max(abs(complex(x.mid())) for x in given.entries())


def test_every_entry_is_that_of_an_exact_similarity():
    """T^-1 A T, T^-1 B and C T have the same Markov parameters C A^k B, exactly."""
    A, B, C = modes(np.random.default_rng(3), 40, 1.0, 5.0)
    found = quick_modal_form_of([real_balls(part) for part in (A, B, C)], PRECISIONS[0])
    with ctx.workprec(PRECISIONS[-1]):
        ours, given = list(map(enclosed, found)), [enclosed(exact(part)) for part in (A, B, C)]
        for _ in range(4):
            assert (ours[2] * ours[1]).overlaps(given[2] * given[1])
            ours[1], given[1] = ours[0] * ours[1], given[0] * given[1]


@pytest.mark.parametrize("states", [FEWEST_QUICK - 1, 2, 1])
def test_few_states_are_left_to_balls(states):
    A, B, C = modes(np.random.default_rng(1), states, 1.0, 2.0)
    assert quick_modal_form_of([real_balls(part) for part in (A, B, C)], PRECISIONS[0]) is None


def test_dependent_eigenvectors_are_refused():
    chain = -np.eye(40) + np.diag(np.ones(39), -1)
    parts = [real_balls(part) for part in (chain, np.eye(40, 1), np.eye(1, 40, 39))]
    assert quick_modal_form_of(parts, PRECISIONS[0]) is None
    zero = [real_balls(part) for part in (np.zeros((40, 40)), np.eye(40, 1), np.eye(1, 40))]
    found = quick_modal_form_of(zero, PRECISIONS[0])  # every vector is an eigenvector
    assert found is not None and not found[0].mid.any()


def test_it_is_as_sharp_as_the_one_in_balls():
    A, B, C = modes(np.random.default_rng(5), 40, 1.0, 1e3, damping=1e-5)
    parts = [real_balls(part) for part in (A, B, C)]
    quick, slow = (form(parts, PRECISIONS[0]) for form in (quick_modal_form_of, modal_form_of))
    for one, other in zip(quick, slow, strict=True):
        assert one.rad.max() <= 4 * other.rad.max()


def test_a_large_system_of_light_modes_is_proven_stable_in_these_coordinates():
    A, B, C = modes(np.random.default_rng(7), 80, 1.0, 1e3, damping=1e-6)
    stable = stable_system(control.ss(A, B, C, np.zeros((3, 2))))
    assert stable.source is not None  # it was not taken as it is
    size = np.abs(stable.poles)
    np.testing.assert_allclose(-stable.poles.real, 1e-6 * size, rtol=1e-3)


def test_entries_that_are_not_finite_have_no_quick_form():
    n = FEWEST_QUICK
    A = -np.eye(n)
    A[0, 1] = np.nan
    parts = [real_balls(part) for part in (A, np.ones((n, 1)), np.ones((1, n)))]
    assert quick_modal_form_of(parts, PRECISIONS[0]) is None
