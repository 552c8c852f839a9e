"""Mu of rank one in closed form, and a loop with one channel."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from workbench.errors import InputError, UnknownNameError
from workbench.geometry import Stadium
from workbench.mu import RankOneLoop, lower_bound, rank_one_mu, upper_bound
from workbench.structure import Complex, Real, Structure
from workbench.uncertainty import UncertaintyModel, generalised_plant
from workbench.uncertainty.covers.sets import stadiums_about_nominal

number = st.floats(-3, 3, allow_nan=False).map(lambda x: round(x, 3))


@given(number, number, st.floats(0.1, 3))
def test_rank_one_mu_is_the_nearest_real_scalar(real, imaginary, others):
    """Against a search over x and t: 1 / mu is the least t that lets |1 - x c| <= t others."""
    c = complex(real, imaginary)
    x = np.linspace(-20, 20, 400_001)
    needed = np.maximum(np.abs(1 - x * c) / others, np.abs(x))
    assert rank_one_mu(np.array(c), np.array(others)) == pytest.approx(1 / needed.min(), rel=1e-3)


def test_rank_one_mu_lies_between_the_bounds():
    rng = np.random.default_rng(5)
    left, right = rng.normal(size=(2, 50, 3)) + 1j * rng.normal(size=(2, 50, 3))
    M = left[:, :, None] * right[:, None, :]
    c = np.diagonal(M, axis1=1, axis2=2)
    exact = rank_one_mu(c[:, 0], np.abs(c[:, 1:]).sum(axis=1))
    structure = Structure([Real(1), Complex(1), Complex(1)])
    np.testing.assert_allclose(upper_bound(M, structure).value, exact, rtol=1e-5)
    lower = lower_bound(M, structure).value
    assert (lower <= exact * (1 + 1e-9)).all()
    np.testing.assert_allclose(lower, exact, rtol=1e-3)


OMEGA = np.geomspace(0.01, 100, 40)
K = control.ss(-2.0, 1.0, 3.0, 0.5)
G = control.tf([4.0], [1.0, 0.4, 1.0])


def plant(W_r=None):
    """A lightly damped mass, W_p = 3 / (s + 1), multiplicative uncertainty of size 1."""
    return generalised_plant(
        [
            (UncertaintyModel(G, control.tf(1, 1), W_r), "u", "y"),
            (control.tf([3.0], [1.0, 1.0]), "e", "z"),
            (control.tf(0.2, 1), "u", "effort"),
        ],
        {"e": "w - y"},
        exogenous="w",
        control="u",
        performance=["z", "effort"],
        measurement="e",
    )


def test_a_loop_is_that_of_its_transfer_functions():
    loop = RankOneLoop.of(plant(), K, "z", "w", OMEGA)
    s = 1j * OMEGA
    L = G(s) * K(s)
    np.testing.assert_allclose(loop.uncertain, -L / (1 + L), rtol=1e-10)
    np.testing.assert_allclose(loop.performance, 3 / (s + 1) / (1 + L), rtol=1e-10)
    effort = RankOneLoop.of(plant(), K, "effort", "w", OMEGA)
    np.testing.assert_allclose(effort.performance, 0.2 * K(s) / (1 + L), rtol=1e-10)


def test_its_mu_over_sets_is_that_of_the_matrix():
    rng = np.random.default_rng(4)
    radius, length, angle = rng.uniform(0.1, 1.0, (3, 40))
    sets = Stadium(np.zeros(40, complex), radius, length, np.pi * angle)
    loop = RankOneLoop.of(plant(), K, "z", "w", OMEGA)
    u = loop.uncertain
    left = [length * np.exp(1j * sets.angle) * u, radius * u, loop.performance]
    M = np.array(left).T[:, :, None] * np.ones((40, 1, 3))
    expected = upper_bound(M, Structure([Real(1), Complex(1), Complex(1)])).value
    np.testing.assert_allclose(loop.mu(sets), expected, rtol=1e-5)


def test_stadiums_of_least_mu_hold_the_deviations_and_hurt_no_more_than_the_narrowest():
    rng = np.random.default_rng(6)
    away = 0.3 * (rng.normal(size=(8, 5)) + 1j * rng.normal(size=(8, 5)))
    omega = OMEGA[::5]
    loop = RankOneLoop.of(plant(), K, "z", "w", omega)
    found = loop.stadiums_of_least_mu(omega, away)
    turned = away * np.exp(-1j * found.angle)[:, None]
    length = found.half_length[:, None]
    distance = np.abs(turned - np.clip(turned.real, -length, length))
    assert (distance <= found.radius[:, None] * (1 + 1e-9)).all()
    narrow = loop.mu(stadiums_about_nominal(away))
    assert (loop.mu(found) <= narrow * (1 + 1e-12)).all()
    assert (loop.mu(found) < 0.95 * narrow).any()


def test_other_perturbations_and_names_are_refused():
    with pytest.raises(InputError, match="one complex scalar"):
        RankOneLoop.of(plant(control.tf(0.5, 1)), K, "z", "w", OMEGA)
    with pytest.raises(UnknownNameError, match="exogenous input"):
        RankOneLoop.of(plant(), K, "z", "v", OMEGA)
