"""Responses between the lines of records: resonances there are found, noise makes none."""

import control
import numpy as np
import pytest

import workbench as wb
from workbench.errors import InputError
from workbench.uncertainty import CircleCover, Responses, refined_responses
from workbench.uncertainty.responses.between_lines import STRAIGHT
from workbench.uncertainty.responses.ratios import Ratios

OMEGA = np.geomspace(1.0, 100.0, 40)
"""Lines that stand 12 % apart."""
TONES = np.array([17.0, 20.3, 23.9])


def ringing(omega, tone=TONES):
    """Plants with a light resonance: its band of 3 % is far below the distance of lines."""
    s = 1j * np.asarray(omega)[:, None]
    return np.exp(-2e-3 * s) / (s / 2 + 1) / (s**2 / tone**2 + 0.03 * s / tone + 1)


def measured(noise, seed=7, omega=OMEGA):
    rng = np.random.default_rng(seed)
    exact = ringing(omega)
    error = rng.standard_normal((2, *exact.shape)) / np.sqrt(2)
    values = exact * (1 + noise * (error[0] + 1j * error[1]))
    return Responses(omega=omega, values=values, variance=(noise * np.abs(exact)) ** 2)


@pytest.mark.cases(1)
@pytest.mark.parametrize("noise", [0.001, 0.01])
def test_the_true_plants_are_found_between_the_lines(noise):
    fine = refined_responses(measured(noise))
    assert fine.omega.size > OMEGA.size + 10
    missed = np.abs(fine.values / ringing(fine.omega) - 1)
    assert missed.max() < 5 * noise
    radius = np.sqrt(fine.variance) / np.abs(fine.values)
    assert np.mean(missed < 3 * radius) > 0.97


def test_what_was_measured_stays():
    coarse = measured(0.01)
    fine = refined_responses(coarse)
    lines = np.isin(fine.omega, OMEGA)
    assert np.array_equal(fine.omega[lines], OMEGA)
    assert np.array_equal(fine.values[lines], coarse.values)
    assert fine.variance[lines] == pytest.approx(coarse.variance, rel=1e-12)


def test_a_cover_holds_the_plants_between_the_lines():
    fine = np.geomspace(OMEGA[0], OMEGA[-1], 2000)

    def excess(plants):
        """Largest distance of a true plant over the radius, between the lines."""
        cover = wb.solve(CircleCover(plants, 3, zeros=2, confidence=0.99)).answer.model
        nominal = cover.nominal.response(fine)[:, None]
        away = np.abs(ringing(fine) / nominal - 1)
        return (away / np.abs(cover.W_c.response(fine))[:, None]).max()

    assert excess(measured(0.005)) > 1.2
    assert excess(refined_responses(measured(0.005))) < 1.0


def test_straight_responses_need_no_more_frequencies():
    plants = Responses(
        omega=OMEGA, values=1 / (1j * OMEGA[:, None] / [20.0, 30.0] + 1), variance=1e-8
    )
    assert np.array_equal(refined_responses(plants).omega, OMEGA)
    assert STRAIGHT < 0.1


def test_missing_lines_stay_missing():
    coarse = measured(0.005)
    present = np.ones(coarse.values.shape, bool)
    present[25, 1] = False
    plants = Responses(omega=OMEGA, values=coarse.values, present=present, variance=coarse.variance)
    fine = refined_responses(plants)
    beside = (fine.omega > OMEGA[24]) & (fine.omega < OMEGA[26])
    assert beside.sum() > 1
    assert not fine.present[beside, 1].any() and fine.present[beside][:, [0, 2]].all()
    assert fine.present[~beside].all()


def test_regions_of_ratios_grow_with_the_response():
    """Where only y is noisy, the covariance follows the variance of the response."""
    coarse = measured(0.005)
    joint = np.zeros((*coarse.values.shape, 2, 2), complex)
    joint[..., 0, 0] = coarse.variance
    ratios = Ratios(joint, np.ones(3))
    closed = Responses(
        omega=OMEGA, values=coarse.values, variance=coarse.variance, degrees=100.0, ratios=ratios
    )
    fine = refined_responses(closed)
    assert fine.ratios.joint[..., 0, 0].real == pytest.approx(fine.variance, rel=1e-9)


def test_unstable_plants():
    s = 1j * OMEGA[:, None]
    exact = 1 / (s / [4.0, 5.0] - 1) / (s**2 / 400 + 0.002 * s + 1)
    plants = Responses(omega=OMEGA, values=exact, variance=1e-8)
    fine = refined_responses(plants, unstable_poles=1)
    s = 1j * fine.omega[:, None]
    exact = 1 / (s / [4.0, 5.0] - 1) / (s**2 / 400 + 0.002 * s + 1)
    assert np.abs(fine.values / exact - 1).max() < 0.01


def test_regions_come_after():
    from workbench.uncertainty.responses.regions import with_regions

    with pytest.raises(InputError, match="corners of confidence regions"):
        refined_responses(with_regions(measured(0.01), 0.95))


def test_known_plants_keep_their_functions():
    plants = [control.tf([1.0], [1.0, 0.1 * k, 1.0]) for k in (1, 2)]
    omega = np.geomspace(0.1, 10, 12)
    values = np.stack([plant(1j * omega) for plant in plants], axis=1)
    known = Responses(omega=omega, values=values, known=plants)
    assert refined_responses(known).known_plants.keys() == known.known_plants.keys()


def test_sampled_plants():
    plants = [
        control.sample_system(control.tf([1.0], [1 / t**2, 0.02 / t, 1.0]), 0.02) for t in (17, 24)
    ]

    def exact(omega):
        return np.stack([plant(np.exp(0.02j * omega)) for plant in plants], axis=1)

    fine = refined_responses(Responses(omega=OMEGA, values=exact(OMEGA), variance=1e-8, dt=0.02))
    assert fine.omega.size > OMEGA.size + 5
    assert np.abs(fine.values / exact(fine.omega) - 1).max() < 0.01
