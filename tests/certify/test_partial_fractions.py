"""Partial fractions of responses, and polynomials of them, against ball arithmetic."""

from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from flint import acb, acb_mat, ctx
from ill_conditioned import ill_conditioned

from workbench.certify.modes import partial_fractions as module
from workbench.certify.modes import power_series
from workbench.certify.modes.modal_response import real_modes
from workbench.certify.modes.partial_fractions import enclosed_fractions
from workbench.certify.modes.power_series import polynomials
from workbench.certify.rounding import Enclosure, exact
from workbench.systems.balancing import with_state_units

BITS = 400


def modal(seed, pairs=5, decades=1.0, damping=(1e-2, 1e-1), outputs=2, inputs=1, mixing=1.0):
    """Modes from 1 to 10^decades rad/s, with gains that differ as much, in mixed coordinates."""
    rng = np.random.default_rng(seed)
    n = 2 * pairs + 1
    A = np.zeros((n, n))
    A[-1, -1] = -(10.0 ** rng.uniform(0, decades))
    for k in range(pairs):
        omega, zeta = 10.0 ** rng.uniform(0, decades), np.exp(rng.uniform(*np.log(damping)))
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = omega * np.array([[-zeta, 1], [-1, -zeta]])
    T = np.linalg.qr(rng.normal(size=(n, n)))[0] + mixing * rng.normal(size=(n, n))
    gains = 10.0 ** rng.uniform(-decades, decades, n)
    B = gains[:, None] * rng.normal(size=(n, inputs))
    C = rng.normal(size=(outputs, n)) / np.roll(gains, 1)
    D = rng.normal(size=(outputs, inputs))
    return T @ A @ np.linalg.inv(T), T @ B, C @ np.linalg.inv(T), D


def nearly_unstable(distance):
    """A pole pair at that distance from the axis, as a share of its frequency, beside others."""
    A, B, C, D = modal(3, pairs=3)
    pair = np.array([[-distance, 1.0], [-1.0, -distance]])
    A = np.block([[A, np.zeros((7, 2))], [np.zeros((2, 7)), pair]])
    return A, np.vstack([B, 1e-3 * np.ones((2, 1))]), np.hstack([C, np.ones((2, 2))]), D


def family():
    yield modal(0)
    yield modal(1, decades=4.0)
    yield modal(2, decades=2.0, damping=(1e-6, 1e-3), outputs=1, inputs=3)
    yield modal(4, pairs=10, outputs=3, inputs=3)
    yield nearly_unstable(1e-6)
    yield nearly_unstable(1e-12)
    A, B, C, D = modal(5)
    yield 1e30 * A, 1e80 * B, 1e-30 * C, D
    yield A, 1e-40 * B, 1e-40 * C, 1e-80 * D
    for seed in (1, 4, 10):
        system = ill_conditioned(seed).system
        yield system.A, system.B, system.C, system.D


def fractions_of(parts):
    return enclosed_fractions(*(exact(part) for part in with_state_units(*parts)))


def balls(matrix):
    rows, columns = np.shape(matrix)
    return acb_mat(rows, columns, [acb(complex(entry)) for entry in np.ravel(matrix)])


def response(parts, omega):
    """The exact response, as an `acb_mat`; numbers in a chain of balls."""
    A, B, C, D = map(balls, parts)
    s = acb_mat(A.nrows(), A.nrows())
    for k in range(A.nrows()):
        s[k, k] = acb(0, 1) * omega
    return D + C * (s - A).solve(B)


def distance(found, true):
    """Spectral norm of the difference of two `acb_mat`, up to a share of 1e-9."""
    entries = [complex(entry.mid()) for entry in (found - true).entries()]
    return float(np.linalg.norm(np.reshape(entries, (found.nrows(), -1)), 2)) * (1 - 1e-9)


def fractions_at(fractions, omega):
    sums = [acb(0)] * fractions.D.size
    total = acb_mat(*fractions.D.shape, sums) + balls(fractions.D)
    for k, pole in enumerate(fractions.poles.tolist()):
        product = balls(fractions.out[:, [k]]) * balls(fractions.into[[k]])
        total += product * (1 / (acb(0, omega) - acb(pole)))
    return total


def tried(poles, rng):
    near = np.abs(poles.imag)[:, None] + np.abs(poles.real)[:, None] * rng.normal(size=3)
    return np.abs(np.concatenate([near.ravel(), np.abs(poles) * rng.uniform(0, 3), [0.0]]))


def assert_errors_hold(fractions, parts, omega):
    with ctx.workprec(BITS):
        for at in omega:
            resolvent = (1 + 1e-12) / np.abs(1j * at - fractions.poles)[None]
            missed = distance(fractions_at(fractions, at), response(parts, at))
            assert missed <= fractions.error(resolvent)[0]


@pytest.mark.parametrize("number", range(11))
def test_the_error_of_the_fractions_is_a_bound(number):
    parts = list(family())[number]
    fractions = fractions_of(parts)
    assert fractions is not None
    omega = tried(fractions.poles, np.random.default_rng(0))[:30]
    assert_errors_hold(fractions, parts, omega.tolist())


@pytest.mark.parametrize("share", [1e-14, 1e-10])
def test_it_holds_for_every_matrix_enclosed(share):
    parts, rng = modal(6), np.random.default_rng(1)
    enclosed = [Enclosure(part, share * np.abs(part)) for part in parts]
    fractions = enclosed_fractions(*enclosed)
    for _ in range(5):
        other = [
            part + share * np.abs(part) * (1 - 1e-3) * rng.choice([-1.0, 1.0], part.shape)
            for part in parts
        ]
        assert_errors_hold(fractions, other, tried(fractions.poles, rng)[::4].tolist())


@pytest.mark.parametrize("place", range(4))
def test_it_holds_for_every_one_of_the_matrices_enclosed(place):
    """One of A, B, C and D has errors, which nothing else covers."""
    parts, rng = modal(6), np.random.default_rng(place)
    share = np.where(np.arange(4) == place, 1e-9, 0.0)
    rads = [e * np.abs(X) for X, e in zip(parts, share, strict=True)]
    fractions = enclosed_fractions(*map(Enclosure, parts, rads))
    omega = tried(fractions.poles, rng)[::5].tolist()
    for _ in range(5):
        other = [
            X + (1 - 1e-3) * rad * rng.choice([-1.0, 1.0], X.shape)
            for X, rad in zip(parts, rads, strict=True)
        ]
        assert_errors_hold(fractions, other, omega)


@pytest.mark.parametrize(("left", "right"), [(1e-6, 0.0), (0.0, 1e-6), (1e-9, 1e-9)])
def test_it_holds_for_any_eigenvectors_and_inverse(left, right, monkeypatch):
    rng = np.random.default_rng(0)

    def poor(A):
        values, first, V, W = real_modes(A)
        V, W = (X * (1 + e * rng.normal(size=X.shape)) for X, e in ((V, right), (W, left)))
        return values, first, V, W

    monkeypatch.setattr(module, "real_modes", poor)
    for seed in range(3):
        parts = modal(seed)
        fractions = fractions_of(parts)
        assert_errors_hold(fractions, parts, tried(fractions.poles, rng)[::3].tolist())


@pytest.mark.parametrize("beyond", [1e-12, 1e-3, 1.0])
def test_what_is_not_stable_has_none(beyond):
    assert fractions_of(nearly_unstable(-beyond)) is None


def test_dependent_eigenvectors_prove_nothing_of_the_response():
    A = -np.eye(6) + 100.0 * np.eye(6, k=1)
    fractions = fractions_of((A, np.ones((6, 1)), np.ones((1, 6)), np.zeros((1, 1))))
    resolvent = 1 / np.abs(1j - fractions.poles)[None]
    assert fractions.error(resolvent) > 1e20


def test_no_states_and_no_finite_entries():
    nothing = np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.ones((1, 1))
    assert fractions_of(nothing) is None
    A, B, C, D = map(exact, modal(0))
    assert enclosed_fractions(A, Enclosure(np.inf * B.mid, B.rad), C, D) is None


@pytest.mark.parametrize(("terms", "rest"), [(16, 1e-6), (3, 1e-1), (5, 1e-2)])
@pytest.mark.parametrize("number", range(11))
def test_polynomials_are_near_the_response(number, terms, rest, monkeypatch):
    monkeypatch.setattr(power_series, "TERMS", terms)
    monkeypatch.setattr(power_series, "REST", rest)
    parts, rng = list(family())[number], np.random.default_rng(2)
    found = polynomials(fractions_of(parts))
    assert found is not None
    middle, half = (list(map(Fraction, part.tolist())) for part in (found.middle, found.half))
    ends = sorted((m - h, m + h) for m, h in zip(middle[1:], half[1:], strict=True))
    assert ends[0][0] <= 0
    assert all(high >= low for (_, high), (low, _) in pairwise(ends))
    assert ends[-1][1] >= half[0]  # from where the first interval reaches infinity
    chosen = np.unique(np.append(rng.integers(len(half), size=15), [0, 1]))
    with ctx.workprec(BITS):
        for k in chosen.tolist():
            for t in (-1.0, rng.uniform(-1, 1), 1.0):
                t, h = (abs(t) if k == 0 else t), acb(float(found.half[k]))
                at = h / t if k == 0 else acb(float(found.middle[k])) + h * t
                g = acb_mat(*found.terms.shape[2:], [acb(0)] * found.terms[0, 0].size)
                for m, term in enumerate(found.terms[k]):
                    g += balls(term) * acb(t) ** m
                missed = distance(g, response(parts, at))
                assert missed <= found.error[k]


def test_extreme_sizes_have_none():
    A, B, C, D = modal(0)
    assert polynomials(fractions_of((A, 1e-120 * B, C, 1e-120 * D))) is None
    assert polynomials(fractions_of((1e-110 * A, B, 1e-110 * C, D))) is None
