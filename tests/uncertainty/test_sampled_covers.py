"""Covers of sampled plants of one channel: fitted in the bilinear plane, true on the circle."""

import control
import numpy as np
import pytest
from lanes import thinned

import workbench as wb
from workbench.errors import InputError
from workbench.fitting.rational import Rational
from workbench.mu import robust_stability
from workbench.uncertainty import (
    CircleCover,
    Responses,
    StadiumCover,
    UncertaintyModel,
    feedback,
    widened_responses,
)

T = 0.05
OMEGA = np.geomspace(0.1, 0.98 * np.pi / T, 60)


def plant(gain, w, z):
    return control.sample_system(control.tf([gain * w**2], [1, 2 * z * w, w**2]), T, "zoh")


DRAWS = np.random.default_rng(0).uniform(-1, 1, (6, 3))
PLANTS = [plant(1 + 0.2 * a, 10 * (1 + 0.1 * b), 0.1 * (1 + 0.3 * c)) for a, b, c in DRAWS]
VALUES = np.array([[complex(each(np.exp(1j * w * T))) for each in PLANTS] for w in OMEGA])


def solved(program, method="steps"):
    solution = wb.solve(program, method=method)
    assert solution.certificate is not None, solution.message
    assert solution.certificate.holds, solution.certificate
    return solution.answer.model


def excess(model, plants, omega):
    """Largest distance of plants beyond the sets of a model on the circle, by its systems alone."""
    z = np.exp(1j * omega * T)
    of = {name: np.array([complex(G(x)) for x in z]) for name, G in model.systems().items()}
    away = np.array([[complex(each(x)) for each in plants] for x in z]) / of["G"][:, None] - 1
    if "W_r" in of:
        W = of["W_r"][:, None]
        away = away - np.clip((away / W).real, -1, 1) * W
    return (np.abs(away) / np.abs(of["W_c"])[:, None]).max() - 1


@pytest.mark.parametrize("kind", [CircleCover, StadiumCover])
@pytest.mark.parametrize("method", thinned(["steps", "joint", "clarabel"], 3))
def test_measured_plants_lie_in_the_sampled_model(kind, method):
    model = solved(kind(Responses(omega=OMEGA, values=VALUES, dt=T), 3), method)
    assert model.dt == model.lti.dt == T
    assert excess(model, PLANTS, OMEGA) <= 1e-6


@pytest.mark.cases(1)
@pytest.mark.parametrize("kind", [CircleCover, StadiumCover])
def test_known_plants_are_covered_at_every_frequency_up_to_half_the_rate(kind):
    program = kind(Responses(omega=OMEGA[::6], values=VALUES[::6], dt=T, known=PLANTS), 3)
    model = solved(program)
    fine = np.concatenate([np.geomspace(1e-3, 0.999 * np.pi / T, 2000), [np.pi / T * (1 - 1e-9)]])
    assert excess(model, PLANTS, fine) <= 1e-5


def test_a_sampled_cover_is_the_continuous_one_of_the_bilinear_plane():
    responses = Responses(omega=OMEGA, values=VALUES, dt=T)
    sampled = CircleCover(responses, 3)
    plane = CircleCover(Responses(omega=2 / T * np.tan(OMEGA * T / 2), values=VALUES), 3)
    found = [wb.solve(program, method="steps").answer for program in (sampled, plane)]
    np.testing.assert_allclose(found[0].second.radius, found[1].second.radius, rtol=1e-2)


def test_the_model_goes_into_robust_stability_as_it_is():
    model = UncertaintyModel(PLANTS[0], control.tf([0.3], [1], T))
    K = control.tf([0.02], [1, -1], T)
    found = robust_stability(feedback(model * K, 1))
    L = PLANTS[0] * K
    z = np.exp(1j * T * np.linspace(1e-4, np.pi / T, 20001))
    peak = max(abs(0.3 * complex(L(x)) / (1 + complex(L(x)))) for x in z)
    assert found.lower == pytest.approx(1 / peak, rel=1e-3)


def test_a_delay_of_whole_samples_and_a_direct_term_are_covered():
    late = [each * control.tf([1], [1, 0, 0], T) + 0.1 for each in PLANTS]
    values = np.array([[complex(each(np.exp(1j * w * T))) for each in late] for w in OMEGA])
    model = solved(CircleCover(Responses(omega=OMEGA, values=values, dt=T, known=late), 4))
    assert excess(model, late, np.geomspace(1e-2, 0.999 * np.pi / T, 500)) <= 1e-5


def test_thinned_widened_and_stored_responses_keep_their_sampling_time():
    responses = Responses(omega=OMEGA, values=VALUES, dt=T)
    assert responses.thinned(10).dt == widened_responses(responses, 0.9).dt == T
    program = CircleCover(responses, 3)
    answer = wb.solve(program, method="steps").answer
    back = program.from_dataset(program.to_dataset(answer))
    assert back.model.dt == T
    assert "sampled every 0.05 s" in repr(back.model)
    assert program.figures(answer)
    assert back.model.plot().axes[0].lines[0].get_xdata().max() <= 0.5 / T


@pytest.mark.parametrize(
    ("call", "words"),
    [
        (
            lambda: Responses(omega=OMEGA * 2, values=VALUES, dt=T),
            "half the sampling rate is 10 Hz",
        ),
        (lambda: Responses(omega=OMEGA, values=VALUES, dt=-T), "dt is -0.05"),
        (lambda: Responses(omega=OMEGA, values=VALUES, dt="fast"), "dt"),
        (
            lambda: Responses(omega=OMEGA, values=VALUES, known=PLANTS),
            "plant 1 has dt = 0.05; 0.0 is needed",
        ),
        (
            lambda: Responses(
                omega=OMEGA, values=VALUES, dt=T, known=[control.tf([1], [1, 1])] * 6
            ),
            "plant 1 has dt = 0.0; 0.05 is needed",
        ),
        (
            lambda: Responses(
                omega=OMEGA, values=VALUES, dt=T, known=[control.tf([1], [1, -1.5], T)] * 6
            ),
            "plant 1 is unstable",
        ),
        (
            lambda: Responses(
                omega=OMEGA, values=VALUES, dt=T, known=[control.tf([1], [1, 1], T)] * 6
            ),
            "z = -1",
        ),
        (
            lambda: CircleCover(
                Responses(omega=OMEGA, values=VALUES, dt=T), 2, nominal=control.tf([1], [1, 1])
            ),
            "the given nominal has dt = 0.0; 0.05 is needed",
        ),
        (
            lambda: UncertaintyModel(PLANTS[0], control.tf([1], [1, 1])),
            "W_c has dt = 0.0; 0.05 is needed",
        ),
        (
            lambda: UncertaintyModel(Rational([], [-1.0], 1.0), control.tf([1], [1, 0.5], T)),
            "W_c has dt = 0.05; 0.0 is needed",
        ),
    ],
)
def test_bad_input_is_named(call, words):
    with pytest.raises(InputError, match=words):
        call()
