"""Sums of stable, boundary and antistable parts, against partial fractions known beforehand."""

import dataclasses

import control
import numpy as np
import pytest

from workbench.certify.realisations.parts import boundary_projector, nearest_doubles
from workbench.errors import InputError
from workbench.realisations import hankel_values, stable_part

tf = control.tf
RNG = np.random.default_rng(11)


def gain(system, points):
    return np.array([np.atleast_2d(system(s)) for s in points])


CASES = {
    "lag": (tf([1.0], [1.0, 1.0]), 1, 0, 0),
    "static": (tf([2.0], [1.0]), 0, 0, 0),
    "integrator": (tf([1.0], [1.0, 0.0]), 0, 1, 0),
    "two integrators and a lag": (tf([1.0, 2.0], [1.0, 1.0, 0.0, 0.0]), 1, 2, 0),
    "PID": (tf([2.0, 1.0], [0.1, 1.0]) + tf([1.0], [1.0, 0.0]), 1, 1, 0),
    "undamped": (tf([1.0], [1.0, 0.0, 4.0]) * tf([1.0], [1.0, -1.0]), 0, 2, 1),
    "undamped twice": (tf([1.0], np.polymul([1, 0, 4], [1, 0, 4])) * tf([1], [1, 1]), 1, 4, 0),
    "lightly damped and an integrator": (tf([1.0], [1.0, 1e-9, 1.0]) * tf([1], [1, 0]), 2, 1, 0),
    "slow unit": (tf([1e-6], [1.0, 1e-6, 0.0]), 1, 1, 0),
    "fast unit": (tf([1e6], [1.0, 1e6, 0.0]), 1, 1, 0),
    "mirrored poles": (tf([1.0], [1.0, 0.0, -1.0]), 1, 0, 1),
    "mirrored poles and an integrator": (tf([1.0], [1.0, 0.0, -1.0, 0.0]), 1, 1, 1),
    "irrational mirrored poles": (tf([1.0], [1.0, 0.0, -2.0]), 1, 0, 1),
    "sampled integrator": (tf([1.0], [1.0, -1.5, 0.5], 0.1), 1, 1, 0),
    "sampled, a pole at -1": (tf([1.0], [1.0, 0.5, -0.5], 0.1), 1, 1, 0),
    "sampled, 2 and a half": (tf([1.0], np.poly([1.0, 1.0, 0.5, 2.0]), 0.1), 1, 2, 1),
    "sampled, a delay": (tf([1.0], [1.0, -1.0, 0.0], 0.1), 1, 1, 0),
    "three channels": (
        control.append(tf([1], [1, 0]), tf([1], [1, 1]), tf([1], [1, -1, 0])),
        *(1, 2, 1),
    ),
    "chain": (tf([1.0], np.poly([-1.0] * 8 + [0.0, 0.0])), 8, 2, 0),
}


@pytest.mark.parametrize("name", CASES)
def test_parts_have_their_poles_and_their_sum_is_the_system(name):
    system, *counts = CASES[name]
    parts = stable_part(system)
    of = parts.stable, parts.boundary, parts.antistable
    assert [one.nstates for one in of] == counts
    assert parts.holds, parts.certificate
    size = 1.0 if system.dt or not system.poles().size else max(abs(system.poles()).max(), 1e-12)
    points = size * 2.0 * np.exp(1j * np.array([0.3, 1.7, 2.9]))
    total = sum(gain(one, points) for one in of)
    assert total == pytest.approx(gain(system, points), rel=1e-9, abs=1e-12 * abs(total).max())


def test_integrators_are_exact_and_their_gain_is_right():
    parts = stable_part(tf([1.0, 2.0], [1.0, 1.0, 0.0, 0.0]))  # 2 / s^2 - 1 / s + 1 / (s + 1)
    A, B, C = parts.boundary.A, parts.boundary.B, parts.boundary.C
    assert parts.boundary.poles().tolist() == [0.0, 0.0] and not (A @ A).any()
    assert (C @ B).item() == pytest.approx(-1.0, rel=1e-14)
    assert (C @ A @ B).item() == pytest.approx(2.0, rel=1e-14)
    assert parts.error < 1e-15 and parts.boundary_error < 1e-14
    sampled = stable_part(tf([1.0], [1.0, -1.5, 0.5], 0.1))
    assert sampled.boundary.poles().tolist() == [1.0]


def test_the_error_is_that_of_the_largest_gain():
    """Against 50 digits: each part once more by the residues of its poles."""
    parts = stable_part(tf([1.0], [1.0, 0.0, -1.0]))  # 0.5 / (s - 1) - 0.5 / (s + 1)
    omega = 1j * np.geomspace(1e-3, 1e3, 50)
    for part, exact in ((parts.stable, -0.5 / (omega + 1)), (parts.antistable, 0.5 / (omega - 1))):
        assert abs(gain(part, omega).ravel() - exact).max() <= parts.error + 1e-15


def test_a_random_system():
    A = RNG.standard_normal((8, 8))
    system = control.ss(
        A, RNG.standard_normal((8, 2)), RNG.standard_normal((3, 8)), np.ones((3, 2))
    )
    parts = stable_part(system)
    assert parts.stable.nstates + parts.antistable.nstates == 8 and parts.holds
    assert (parts.stable.D == 1.0).all() and not parts.antistable.D.any()
    omega = 1j * np.geomspace(1e-2, 1e2, 30)
    apart = gain(parts.stable, omega) + gain(parts.antistable, omega) - gain(system, omega)
    assert np.linalg.norm(apart, 2, axis=(1, 2)).max() <= parts.error + 1e-13
    assert hankel_values(parts).holds


def test_the_projector_is_exact():
    A = np.array([[-1.0, 2.0], [0.0, 0.0]])
    assert nearest_doubles(boundary_projector(A, False)).tolist() == [[0.0, 2.0], [0.0, 1.0]]
    assert boundary_projector(np.array([[0.0, 1.0], [2.0, 0.0]]), False) is None
    assert nearest_doubles(boundary_projector(np.eye(2), True)).tolist() == [[1.0, 0.0], [0.0, 1.0]]
    tiny = np.array([[5e-324]])
    assert boundary_projector(tiny, False) is None


def test_what_matrices_do_not_say_is_refused():
    T = RNG.standard_normal((4, 4))
    A = np.zeros((4, 4))
    A[0, 0], A[2, 3] = -1.0, 1.0
    moved = control.ss(T @ A @ np.linalg.inv(T), T[:, :1], T[:1], 0.0)
    with pytest.raises(InputError, match="do not say that they are on it: give it as a transfer"):
        stable_part(moved)
    with pytest.raises(InputError, match="improper"):
        stable_part(tf([1.0, 0.0, 0.0], [1.0, 1.0]))
    with pytest.raises(InputError, match="0 inputs and 0 outputs"):
        stable_part(control.ss([], [], [], np.zeros((0, 0))))


def test_wrong_claims_fail():
    parts = stable_part(tf([1.0, 2.0], [1.0, 1.0, -3.0, 0.0]))
    checker = parts._checked_by[0]
    A, B, C, D = (getattr(parts.stable, name) for name in "ABCD")
    spoilt = {
        "error": parts.error / 4,
        "boundary_error": parts.boundary_error / 4,
        "stable": control.ss(A, B * (1 + 1e-12), C, D),
        "boundary": control.ss(1e-12, parts.boundary.B, parts.boundary.C, 0.0),
        "antistable": control.ss(-parts.antistable.A, parts.antistable.B, parts.antistable.C, 0.0),
    }
    for name, value in spoilt.items():
        wrong = dataclasses.replace(parts, **{name: value}).with_checker(checker)
        assert not wrong.holds, name
