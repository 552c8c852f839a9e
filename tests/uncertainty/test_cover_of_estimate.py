"""The cover of one estimated plant holds it as often as it says, at all frequencies together."""

import control
import numpy as np
import pytest

import workbench as wb
from workbench.errors import InputError
from workbench.identification import RationalModelFit
from workbench.synthesis import HinfSynthesis
from workbench.systems.connection import generalised_plant
from workbench.uncertainty import cover_of_estimate

OMEGA = np.geomspace(1.0, 300.0, 60)
FINE = np.geomspace(1.0, 300.0, 400)


def plant(omega):
    s = 1j * omega
    return (40 * (s + 30) / (s**2 + 2 * s + 400) / (s + 5))[:, None, None]


def fitted(rng, **more):
    truth = plant(OMEGA)
    deviation = 0.03 * np.maximum(np.abs(truth), 0.05 * np.abs(truth).max())
    parts = rng.standard_normal((2, *truth.shape))
    noisy = truth + deviation * (parts[0] + 1j * parts[1]) / np.sqrt(2)
    program = RationalModelFit(OMEGA, noisy, deviation**2, orders=(3,), excess=2, **more)
    solution = wb.solve(program)
    assert solution.certificate.valid, solution.certificate.failures
    return program.uncertainty(solution.answer.model)


def share_held(records, seed):
    rng, held = np.random.default_rng(seed), []
    for _ in range(records):
        uncertainty = fitted(rng)
        away = np.abs(uncertainty.model.response(FINE) - plant(FINE))
        held.append((away <= uncertainty.radius(FINE, confidence=0.95, everywhere=True)).all())
    return np.mean(held)


@pytest.mark.cases(0)
def test_discs_hold_the_plant_everywhere():
    assert share_held(60, 0) >= 0.93


@pytest.mark.slow
def test_discs_hold_the_plant_everywhere_in_a_thousand_records():
    assert share_held(1000, 1) >= 0.95


@pytest.mark.parametrize("form", ["multiplicative", "additive"])
def test_the_cover_holds_the_discs(form):
    uncertainty = fitted(np.random.default_rng(2))
    cover = cover_of_estimate(uncertainty, 4, confidence=0.99, form=form)
    radius = uncertainty.radius(FINE, confidence=0.99, everywhere=True)[:, 0, 0]
    size = np.abs(cover.W_c.response(FINE))
    if form == "multiplicative":
        size = size * np.abs(cover.nominal.response(FINE))
    assert (size >= radius * (1 - 1e-6)).all()
    assert np.median(size / radius) < 1.6
    assert (np.abs(plant(FINE)[:, 0, 0] - cover.nominal.response(FINE)) <= size).all()


def test_a_controller_is_robust_to_the_uncertainty_of_the_estimate():
    uncertainty = fitted(np.random.default_rng(3))
    cover = cover_of_estimate(uncertainty, 3)
    weight = control.tf([0.5, 8.0], [1.0, 0.08])
    systems = cover.systems()
    setting = generalised_plant(
        [(systems["G"], "v", "g"), (systems["W_c"], "u", "z"), (weight, "e", "ew")],
        {"v": "u + w", "e": "r - g"},
        exogenous=("w", "r"),
        performance=("z", "ew"),
        control="u",
        measurement="e",
    )
    solution = wb.solve(HinfSynthesis(setting))
    assert solution.certificate.valid
    K = solution.answer.K
    loop = control.feedback(control.series(K, control.ss(uncertainty.model.lti)), 1)
    assert loop.poles().real.max() < 0
    s = 1j * FINE
    T = np.asarray(loop(s))
    # Small gain: the nominal loop allows every plant of the cover, the true one among them.
    peak = np.max(np.abs(T * cover.W_c.response(FINE)))
    assert peak <= solution.answer.norm * (1 + 1e-6)


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"confidence": 1.0}, "between 0 and 1"),
        ({"entry": (1, 0)}, "entry"),
        ({"order": -1}, "order"),
    ],
)
def test_bad_requests_are_named(changes, words):
    uncertainty = fitted(np.random.default_rng(4))
    with pytest.raises(InputError, match=words):
        cover_of_estimate(**({"uncertainty": uncertainty, "order": 2} | changes))


def test_a_delay_is_refused():
    uncertainty = fitted(np.random.default_rng(5), delay_bounds=(0.0, 1e-2))
    with pytest.raises(InputError, match="delay"):
        cover_of_estimate(uncertainty, 2)
