"""Residuals with noise of gain 1: against results by hand, other generators, published gaps."""

import control
import numpy as np
import pytest
from faulty_plants import random_model

from workbench.diagnosis import (
    FaultModel,
    model_matching,
    null_space_generator,
    residual_response,
    whitened_residual,
)
from workbench.errors import InputError
from workbench.systems.realisation import realisation


def scalar(noise_zero, direct=1.0):
    """y = (s + 1)/(s + 2) f + (direct s + noise_zero)/(s + 2) w."""
    B = [[-1.0, noise_zero - 2.0 * direct]]
    system = control.ss([[-2.0]], B, [[1.0]], [[1.0, direct]], inputs=["f", "w"])
    return FaultModel(system, faults=("f",), noise=("w",))


def noisy(seed, dt=0.0):
    """A model with two outputs, a control, two faults and three noises, two at the outputs."""
    model = random_model(seed, 3, 2, 1, 0, 3, dt)
    faults, noise = model.faults[:2], model.faults[2:]
    model = FaultModel(
        model.system, controls=model.controls, disturbances=(), faults=faults, noise=noise
    ).with_sensor_faults()
    return FaultModel(
        model.system,
        controls=model.controls,
        disturbances=(),
        faults=faults,
        noise=(*noise, *model.faults[2:]),
    )


@pytest.mark.parametrize(("zero", "gap"), [(3.0, 1.0), (0.5, 2.0), (-0.5, 2.0)])
def test_by_hand(zero, gap):
    """r = (s + 1)/(s + |zero|) f + all-pass w: the larger of 1 and 1 / |zero|."""
    found = whitened_residual(scalar(zero), -5.0)
    assert found.gaps[0] == pytest.approx(gap, rel=3e-4)
    assert found.gaps[0] <= gap
    assert found.generator.Q.poles().real.max() < 0.0


@pytest.mark.parametrize("dt", [0.0, 0.1])
def test_noise_has_gain_1_in_every_direction(dt):
    model = noisy(11, dt)
    found = whitened_residual(model, 0.3 if dt else -4.0)
    omega = np.geomspace(1e-2, 30.0, 60)
    R_w = residual_response(found.generator.Q, model, model.noise, omega)
    np.testing.assert_allclose(np.linalg.svd(R_w, compute_uv=False), 1.0, rtol=1e-6)
    assert np.abs(residual_response(found.generator.Q, model, model.controls, omega)).max() < 1e-8
    R_f = residual_response(found.generator.Q, model, model.faults, omega)
    reached = np.linalg.norm(R_f, axis=1).max(axis=0)
    assert (found.gaps >= reached * (1 - 1e-2)).all()
    assert (np.linalg.norm(R_f, axis=1).max(axis=0) <= found.gaps * (1 + 1e-3)).all()


def test_no_other_generator_has_a_larger_gap():
    model = noisy(5)
    found = whitened_residual(model, -4.0)
    base = null_space_generator(model, -4.0)
    omega = np.geomspace(1e-3, 1e3, 400)
    rng = np.random.default_rng(0)
    matched = model_matching(
        model, realisation((-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2))), 0.0), -4.0
    )
    tried = [base.Q, matched.generator.Q]
    tried += [
        realisation((base.Q.A, base.Q.B, M @ base.Q.C, M @ base.Q.D), 0.0)
        for M in rng.standard_normal((20, 1, 2))
    ]
    for Q in tried:
        R_f, R_w = (
            residual_response(Q, model, names, omega) for names in (model.faults, model.noise)
        )
        gaps = np.linalg.norm(R_f, axis=1).max(axis=0) / np.linalg.norm(R_w, 2, axis=(1, 2)).max()
        assert (gaps <= found.gaps * (1 + 1e-3)).all()


def test_noise_that_does_not_reach_high_frequencies():
    """w / (s + 2) under (s + 1) / (s + 2) f: the gap grows with bandwidth."""
    model = scalar(1.0, 0.0)
    with pytest.raises(InputError, match="give a regularisation"):
        whitened_residual(model, -3.0)
    gaps = [whitened_residual(model, -3.0, regularisation=eps).gaps[0] for eps in (0.1, 0.01)]
    assert gaps[1] > 5 * gaps[0] > 5


def test_bad_questions():
    with pytest.raises(InputError, match="no noise"):
        whitened_residual(FaultModel(scalar(3.0).system, faults=("f", "w")), -1.0)
    for bad in (-1.0, np.nan, "small"):
        with pytest.raises(InputError, match="regularisation is"):
            whitened_residual(scalar(3.0), -1.0, regularisation=bad)


@pytest.mark.parametrize("dt", [0.01, 1e-3])
@pytest.mark.parametrize("den", [[1, 0.2, 1], [1, 1, 0], [1, 2, 3, 1]])
def test_noise_of_a_transfer_function_that_is_sampled_fast_is_made_white(den, dt):
    """SciPy's solver refused one of these, and was far off for others."""
    G = control.ss(control.sample_system(control.tf([1], den), dt))
    B, D = np.hstack([G.B, G.B, 0 * G.B]), [[0.0, 0.0, 1.0]]
    model = FaultModel(
        control.ss(G.A, B, G.C, D, dt, inputs=["f", "w", "v"], outputs=["y"]),
        faults=("f",),
        noise=("w", "v"),
    )
    R = whitened_residual(model, poles=0.9).generator.R
    z = np.exp(1j * np.geomspace(1e-2, 3.0, 40))
    response = np.moveaxis(R(z), -1, 0)[:, 0, 1:]
    np.testing.assert_allclose((np.abs(response) ** 2).sum(axis=1), 1.0, rtol=1e-4)
