"""Covers chosen for a loop: they contain the plants, and lower the mu of the loop."""

from copy import copy
from dataclasses import replace

import control
import numpy as np
import pytest

from workbench.errors import InputError
from workbench.executor import Context
from workbench.fitting.rational import Rational, from_system
from workbench.synthesis import ControlCover
from workbench.uncertainty import Responses, contains
from workbench.uncertainty.covers.everywhere import containment_check

OMEGA = np.geomspace(0.05, 20.0, 40)


@pytest.fixture(scope="module")
def cover():
    """A damped mass with a stiffness of 0.7 to 1.3, and a gain of 0.9 to 1.1."""
    s = 1j * OMEGA
    plants = [g / (s**2 + 0.6 * s + k) for k in (0.7, 1.0, 1.3) for g in (0.9, 1.1)]
    return ControlCover(
        Responses(OMEGA, np.array(plants).T),
        3,
        performance=lambda omega: 0.5 / (1j * omega + 0.05),
        control=lambda omega: 0.02 * np.ones(omega.shape),
        sensor=lambda omega: 1 / (1 + 1j * omega / 50),
        lowest=0.005,
    )


@pytest.fixture(scope="module")
def parts():
    K = control.tf([2.0, 3.0, 1.0], [0.05, 1.0, 0.01])
    return {
        "nominal": from_system(control.tf(1.0, [1.0, 0.6, 1.0])),
        "real": Rational([], [-0.5 + 1j, -0.5 - 1j], 0.05),
        "controller": from_system(K),
    }


def largest(loop):
    return loop.weights.mu(loop.T).max()


def test_the_loop_is_that_of_its_transfer_functions(cover, parts):
    loop = cover.loop(parts)
    s = 1j * cover.omega
    assert cover.omega[0] == pytest.approx(0.005)
    L = parts["controller"].response(cover.omega) / (s**2 + 0.6 * s + 1) / (1 + s / 50)
    np.testing.assert_allclose(loop.T, L / (1 + L), rtol=1e-9)
    np.testing.assert_allclose(loop.weights.control, 0.02 * abs(s**2 + 0.6 * s + 1), rtol=1e-9)


def test_the_radius_reaches_the_farthest_plant(cover, parts):
    """The distance of each deviation from the segment of the real weight, by brute force."""
    loop = cover.loop(parts)
    known = np.isin(cover.omega, OMEGA)
    s = 1j * OMEGA
    nominal, end = 1 / (s**2 + 0.6 * s + 1), parts["real"].response(OMEGA)
    away = cover.responses.values / nominal[:, None] - 1
    x = np.linspace(-1, 1, 20_001)
    needed = [
        max(abs(each - x * tip).min() for each in row) for row, tip in zip(away, end, strict=True)
    ]
    np.testing.assert_allclose(loop.radius[known], needed, rtol=1e-4, atol=1e-6)


def test_a_chosen_weight_lowers_mu_and_its_model_holds_the_plants(cover, parts):
    *_, last = cover.chosen(parts, ["real"], Context())
    assert last["nominal"] is parts["nominal"]
    assert largest(cover.loop(last)) < 0.99 * largest(cover.loop(parts))
    model = cover.model(last, Context())
    assert contains(model, cover.responses)
    assert (model.W_r.poles.real < 0).all()


def test_known_plants_are_held_at_every_frequency(cover, parts):
    systems = [control.tf(g, [1.0, 0.6, k]) for k in (0.7, 1.0, 1.3) for g in (0.9, 1.1)]
    known = copy(cover)
    known.responses = replace(cover.responses, known=systems)
    model = known.model(parts, Context())
    assert containment_check(model, known.responses).holds
    assert not containment_check(cover.model(parts, Context()), known.responses).holds


def test_an_unstable_loop_has_no_model(cover, parts):
    wrong = parts | {"controller": from_system(control.tf([50.0], [0.2, 1.0]))}
    assert cover.loop(wrong) is None
    with pytest.raises(InputError, match="unstable"):
        cover.model(wrong, Context())
