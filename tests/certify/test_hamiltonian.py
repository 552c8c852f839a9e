"""Intervals on which fixed multipliers prove a bound, against closed forms and dense sampling."""

import math
from functools import partial

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from ill_conditioned import ill_conditioned
from lanes import examples

from workbench.certify import hamiltonian
from workbench.certify.interval import certified_interval
from workbench.certify.stable_system import stable_system
from workbench.errors import InputError

up_to_its_ends = partial(certified_interval, end_margin=0.0)

ONE, NONE = np.eye(1), np.zeros((1, 1))


def multipliers(rng, n, real):
    """D of a repeated scalar (n), and G where it is real."""
    X = rng.standard_normal((n, n)) + 1j * rng.standard_normal((n, n))
    G = rng.standard_normal((n, n)) + 1j * rng.standard_normal((n, n))
    return X @ X.conj().T + 0.1 * np.eye(n), real * (G + G.conj().T)


def random_system(rng, states, n):
    A = rng.standard_normal((states, states))
    A -= (np.linalg.eigvals(A).real.max() + 10 ** rng.uniform(-3, 0)) * np.eye(states)
    B, C = rng.standard_normal((states, n)), rng.standard_normal((n, states))
    return control.ss(A, B, C, 0.3 * rng.standard_normal((n, n)))


def least(system, D, G, beta, omega):
    """Smallest eigenvalue of the inequality at frequencies."""
    M = stable_system(system).response(omega)
    twisted = 1j * (G @ M)
    Phi = beta**2 * D - M.conj().mT @ D @ M - twisted - twisted.conj().mT
    return np.linalg.eigvalsh(Phi)[:, 0]


@pytest.mark.parametrize("omega", [0.0, 0.1, 1.0])
def test_of_a_lag_around_what_is_above_its_corner(omega):
    # |1 / (1 + jw)| < beta where w^2 > 1 / beta^2 - 1
    edge = math.sqrt(1 / 0.6**2 - 1)
    assert up_to_its_ends(control.tf(1, [1, 1]), ONE, ONE, NONE, 0.6, omega) is None
    low, high = up_to_its_ends(control.tf(1, [1, 1]), ONE, ONE, NONE, 0.6, 5.0)
    assert low == pytest.approx(edge, rel=1e-5)
    assert low > edge
    assert high == math.inf


def test_around_infinity_and_around_zero():
    lag, lead = control.tf(1, [1, 1]), control.tf([1, 0], [1, 1])
    low, high = up_to_its_ends(lag, ONE, ONE, NONE, 0.6, math.inf)
    assert (low, high) == (pytest.approx(4 / 3, rel=1e-5), math.inf)
    low, high = up_to_its_ends(lead, ONE, ONE, NONE, 0.8, 0.0)
    assert (low, high) == (0.0, pytest.approx(4 / 3, rel=1e-5))
    assert up_to_its_ends(lead, ONE, ONE, NONE, 0.8, math.inf) is None
    assert up_to_its_ends(lag, ONE, ONE, NONE, 1.001, 3.0) == (0.0, math.inf)


def test_of_a_real_scalar():
    # beta^2 - |m|^2 + 2 g Im m > 0 for m = 1 / (1 + jw), |m|^2 = 1 / (1 + w^2) = -Im m / w
    beta, g = 0.5, -0.4
    edge = max(np.roots([beta**2, -2 * g, beta**2 - 1]).real)
    low, high = up_to_its_ends(control.tf(1, [1, 1]), ONE, ONE, g * ONE, beta, 100.0)
    assert edge < low < edge + 2e-6 * 100
    assert high == math.inf


def test_a_narrow_crossing_ends_the_interval():
    resonance = control.tf(1, [1, 2e-6, 1])
    low, high = up_to_its_ends(resonance, ONE, ONE, NONE, 2.5e5, 0.0)
    assert low == 0.0
    assert 0.999 < high < 1.0
    beyond, top = up_to_its_ends(resonance, ONE, ONE, NONE, 2.5e5, math.inf)
    assert 1.0 < beyond < 1.001
    assert top == math.inf


@pytest.mark.cases(0)
@examples(25, 60)
@given(st.integers(0, 10**6), st.booleans(), st.floats(-2, 2))
def test_holds_inside_and_ends_at_a_crossing(seed, real, decade):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 4))
    system = random_system(rng, int(rng.integers(1, 8)), n)
    D, G = multipliers(rng, n, real)
    omega = 10**decade
    at = [b for b in np.geomspace(0.1, 100, 30) if least(system, D, G, b, omega)[0] > 0]
    if not at:
        return
    beta = at[0] * 1.01
    low, high = up_to_its_ends(system, D, D, G, beta, omega)
    assert low < omega < high
    points = np.geomspace(max(low, 1e-4), min(high, 1e6), 2000)
    assert (least(system, D, G, beta, points) > 0).all()
    for end, factor in ((low, -1), (high, 1)):
        if 0 < end < math.inf:
            beyond = max(end + factor * 1e-4 * abs(end - omega), 0.0)
            values = least(system, D, G, beta, np.linspace(end, beyond, 9))
            assert values.min() < 1e-3 * np.linalg.norm(D)


@pytest.mark.parametrize("seed", range(6))
def test_improved_discs_contain_the_eigenvalues_found_one_by_one(seed, monkeypatch):
    given = stable_system(ill_conditioned(seed).system)
    c, r = given.D.shape
    parts = np.eye(c) + 0j, np.eye(r) + 0j, np.zeros((r, c)) + 0j
    level = 1.01 * np.linalg.norm(given.D, 2) + 1e-3
    improved = hamiltonian.ball_discs(given, parts, level, math.inf)
    with monkeypatch.context() as patch:
        patch.setattr(hamiltonian, "_improved_discs", lambda T: None)
        isolated = hamiltonian.ball_discs(given, parts, level, math.inf)
    assert not improved.doubtful()
    away = np.abs(isolated.centre[:, None] - improved.centre)
    assert (away <= improved.radius + isolated.radius[:, None]).any(axis=1).all()
    assert not np.array_equal(isolated.radius, improved.radius)


def test_multipliers_that_are_not_positive_prove_nothing():
    assert up_to_its_ends(control.tf(1, [1, 1]), -ONE, -ONE, NONE, 2.0, 1.0) is None
    assert up_to_its_ends(control.tf(1, [1, 1]), np.nan * ONE, ONE, NONE, 2.0, 1.0) is None


@pytest.mark.parametrize(
    ("system", "words"),
    [
        (control.tf(1, [1, -1]), "unstable: it has the pole 1"),
        (control.tf(1, [1, 0]), "imaginary axis"),
        (control.tf(1, [1, 0, 4]), "imaginary axis"),
        (control.tf([1, 0, 0], [1, 1]), "improper"),
        (control.tf(1, [1, 0.5], 0.1), "sampled every 0.1 s"),
        (control.ss(-1, np.nan, 1, 0), "not finite"),
        (3.0, "float"),
    ],
)
def test_a_system_that_will_not_do(system, words):
    with pytest.raises(InputError, match=words):
        stable_system(system)


def test_response_at_infinity_is_the_direct_term():
    system = stable_system(control.ss(-1, 1, 1, 2))
    assert system.response([0, math.inf]).ravel() == pytest.approx([3, 2])
