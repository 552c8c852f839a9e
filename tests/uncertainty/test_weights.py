"""Weights stay tame where no response is known: between the frequencies and beyond them."""

import numpy as np
import pytest
from workbench.plants.cd_drive.uncertainty.measured_drives import measured_drives

import workbench as wb
from workbench.fitting import Rational
from workbench.uncertainty import CircleCover, Responses, StadiumCover
from workbench.uncertainty.covers.weights import between, beyond, needed_radius, resolved

OMEGA = np.geomspace(1.0, 100.0, 60)


def test_a_resonance_between_two_frequencies_is_damped():
    between = np.sqrt(OMEGA[30] * OMEGA[31])
    pole = between * complex(-1e-6, 1.0)
    sharp = Rational([-1.0, -2.0], [pole, pole.conjugate()], 1.0)
    tame = resolved(sharp, OMEGA)
    dense = np.geomspace(1.0, 100.0, 100_000)
    seen = np.abs(tame.response(OMEGA)).max()
    assert np.abs(sharp.response(dense)).max() > 1000 * seen
    assert np.abs(tame.response(dense)).max() < 2 * seen
    assert np.allclose(np.abs(tame.poles.imag), between)


@pytest.mark.parametrize("method", ["steps", pytest.param("joint", marks=pytest.mark.slow)])
def test_weights_hold_their_size_beyond_the_frequencies(method):
    rng = np.random.default_rng(3)
    s = 1j * OMEGA[:, None]
    corner = 10 * (1 + 0.1 * rng.uniform(-1, 1, 8))
    values = (1 + 0.1 * rng.uniform(-1, 1, 8)) * corner**2 / (s**2 + 0.4 * corner * s + corner**2)
    program = StadiumCover(
        Responses(omega=OMEGA, values=values), 2, zeros=0, complex_order=2, real_order=2
    )
    model = wb.solve(program, method=method).answer.model
    for weight in (model.W_c, model.W_r):
        size = np.abs(weight.response(OMEGA)).max()
        assert np.abs(weight.response(np.geomspace(1e-3, 1e5, 10_000))).max() < 3 * size


def test_a_complex_weight_has_no_resonance_between_coarse_frequencies():
    """Sets that all but vanish tempted a fit of order 4 to a spike between two of them."""
    drives = measured_drives("focus", 120, 5.0, 5000.0, gain="agc")
    solution = wb.solve(CircleCover(drives, 4, zeros=2, complex_order=4), method="steps")
    weight = solution.answer.model.W_c
    dense = np.geomspace(drives.omega[0], drives.omega[-1], 100_000)
    at_drives = np.log(np.abs(weight.response(drives.omega)))
    joined = np.exp(np.interp(np.log(dense), np.log(drives.omega), at_drives))
    assert solution.certificate.holds
    assert np.max(np.abs(weight.response(dense)) / joined) < 3


def test_frequencies_between_resolve_two_percent_and_those_beyond_reach_two_decades():
    steps = np.diff(np.log(np.union1d(OMEGA, between(OMEGA))))
    assert steps.min() > 0.01 and steps.max() <= 0.02
    assert beyond(OMEGA)[[0, -1]] == pytest.approx([0.01, 1e4])


def test_a_set_on_a_line_has_a_thousandth_of_its_extent_as_radius():
    away = np.array([[-2.0, 1.0, 2.0], [-2.0, 0.5j, 2.0]])
    assert needed_radius(away, np.array([2.0, 2.0 + 0j])) == pytest.approx([0.002, 0.5])
