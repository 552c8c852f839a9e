"""Least H-infinity errors against a reference model, continuous and sampled."""

import control
import numpy as np
import pytest
from faulty_plants import residual_at
from workbench.plants.textbook.fault_examples import two_actuators

from workbench.diagnosis import (
    FaultModel,
    matching_bound,
    model_matching,
    null_space_generator,
    residual_response,
)
from workbench.errors import InputError
from workbench.systems.realisation import realisation

LOW_PASS = realisation((-10 * np.eye(2), np.eye(2), 10 * np.eye(2), np.zeros((2, 2))), 0.0)


def with_faults_and_noise(G_f, G_w):
    """The model y = G_f f + G_w w with a row of faults and a row of noises."""
    faults = [f"f{k}" for k in range(len(G_f))]
    noise = [f"w{k}" for k in range(len(G_w))]
    system = control.ss(control.combine_tf([[*G_f, *G_w]]), inputs=[*faults, *noise], outputs=["y"])
    return FaultModel(system, faults=tuple(faults), noise=tuple(noise))


def test_two_actuators_in_noise():
    model = two_actuators()
    found = model_matching(model, LOW_PASS, -10.0)
    assert found.generator.Q.poles().real.max() < -1.0
    omega = np.geomspace(1e-2, 1e3, 120)
    for name in model.controls:
        assert (
            max(np.abs(residual_at(found.generator.Q, model, name, 1j * w)).max() for w in omega)
            < 1e-9
        )
    R = residual_response(found.generator.Q, model, (*model.faults, *model.noise), omega)
    R[:, :, :2] -= (10 / (1j * omega + 10))[:, None, None] * np.eye(2)
    sizes = np.linalg.norm(R, 2, axis=(1, 2))
    assert sizes.max() == pytest.approx(found.norm, rel=1e-3)
    bound = matching_bound(model, null_space_generator(model, -10.0).Q, LOW_PASS, omega)
    assert (bound <= sizes * (1 + 1e-9)).all()
    assert found.norm == pytest.approx(bound.max(), rel=1e-3)


def test_the_bound_of_one_output_is_a_projection_by_hand():
    """Varga's example 5.14: f / (s + 1) + w / (s + 2), M_r = 1 / (s + 3)."""
    s = control.tf("s")
    model = with_faults_and_noise([1 / (s + 1)], [1 / (s + 2)])
    M_r = 1 / (s + 3)
    found = model_matching(model, M_r, -5.0)
    omega = np.array([0.0, 0.5, 2.0])
    f, w, m = (1 / (1j * omega + a) for a in (1, 2, 3))
    expected = np.abs(m) * np.abs(w) / np.sqrt(np.abs(f) ** 2 + np.abs(w) ** 2)
    bound = matching_bound(model, null_space_generator(model, -5.0).Q, M_r, omega)
    np.testing.assert_allclose(bound, expected, rtol=1e-9)
    assert expected.max() <= found.norm < 1.05 * expected.max()


def test_a_published_model_with_two_faults_and_noise():
    """Varga's example 5.6, M_r = [1 1]: 1 / sqrt(2) at 0 for any generator, by hand."""
    system = control.ss(
        np.diag([-2.0, -3.0]),
        [[-1.0, -1.0, 0.0, 1.0], [-1.0, 0.0, 0.0, 0.0]],
        np.eye(2),
        [[1.0, 1.0, 0.0, 0.0], [1.0, 0.0, 1.0, 0.0]],
        inputs=["u", "f1", "f2", "w"],
    )
    model = FaultModel(system, controls=("u",), disturbances=(), faults=("f1", "f2"), noise=("w",))
    M_r = realisation((np.zeros((0, 0)), np.zeros((0, 2)), np.zeros((1, 0)), np.ones((1, 2))), 0.0)
    found = model_matching(model, M_r, -3.0)
    Q_1 = null_space_generator(model, -3.0).Q
    omega = np.array([0.0, 1.0, 5.0])
    bound = matching_bound(model, Q_1, M_r, omega)
    np.testing.assert_allclose(bound, 1 / np.sqrt(omega**2 + 2), rtol=1e-9)
    assert found.norm == pytest.approx(1 / np.sqrt(2), rel=2e-3)
    assert found.generator.Q.poles().real.max() < 0.0


def test_without_noise_the_reference_is_met():
    s = control.tf("s")
    model = with_faults_and_noise([(s + 2) / (s + 1)], [])
    found = model_matching(model, 1 / (s + 3), -5.0, gamma=1e-3)
    assert found.norm < 2e-3


def test_sampled():
    import scipy.signal

    model, dt = two_actuators(), 0.1
    parts = [np.asarray(getattr(model.system, name)) for name in "ABCD"]
    A, B, C, D, _ = scipy.signal.cont2discrete(parts, dt)
    sampled = FaultModel(
        control.ss(A, B, C, D, dt, inputs=model.system.input_labels, outputs=model.outputs),
        controls=model.controls,
        faults=model.faults,
        noise=model.noise,
    )
    pole = np.exp(-1.0)
    M_r = realisation((pole * np.eye(2), np.eye(2), (1 - pole) * np.eye(2), np.zeros((2, 2))), dt)
    norms = [model_matching(sampled, M_r, pole).norm for pole in (0.3, 0.5, [0.2, 0.4])]
    assert norms == pytest.approx([norms[0]] * 3, rel=2e-3)  # whatever the basis
    omega = np.linspace(0.0, np.pi / dt, 200)
    bound = matching_bound(sampled, null_space_generator(sampled, 0.3).Q, M_r, omega)
    assert bound.max() <= norms[0] < 1.05 * bound.max()


def test_references_that_do_not_fit():
    model = two_actuators()
    with pytest.raises(InputError, match="the model has 2 faults"):
        model_matching(model, control.tf(1, [1, 1]), -1.0)
    with pytest.raises(InputError, match="the reference is unstable"):
        model_matching(
            model, realisation((np.eye(2), np.eye(2), np.eye(2), 0 * np.eye(2)), 0.0), -1.0
        )
    with pytest.raises(InputError, match="sampling time"):
        model_matching(
            model, realisation((0.1 * np.eye(2), np.eye(2), np.eye(2), 0 * np.eye(2)), 0.5), -1.0
        )
    with pytest.raises(InputError, match="unstable residual generator"):
        model_matching(model, LOW_PASS, 1.0)


def test_disturbances_that_leave_no_residual():
    system = control.ss([[-1.0]], [[1.0, 1.0]], [[1.0]], [[0.0, 0.0]], inputs=["d", "f"])
    model = FaultModel(system, controls=(), disturbances=("d",), faults=("f",))
    with pytest.raises(InputError, match="d can imitate every fault"):
        model_matching(model, control.tf(1, [1, 1]), -1.0)
