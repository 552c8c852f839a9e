"""Residual generators of least order: decoupled, stable, with the wanted structure."""

import control
import numpy as np
import pytest
from faulty_plants import random_model, residual_at, response_at
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from workbench.plants.textbook.fault_examples import (
    four_compartments,
    two_actuators,
    unstable_sensor,
    unstable_sensor_residual,
)

from workbench.diagnosis import (
    FaultModel,
    attainable_structures,
    detectability,
    fault_detection,
    fault_isolation,
    residual_response,
    structure_matrix,
)
from workbench.errors import InputError, SolverError

POINTS = (0.3 + 0.7j, 1.9 - 0.4j, 0.1 + 4.0j)
"""Values of s or z at which residuals are computed from the matrices."""


@pytest.mark.cases(0)
@settings(max_examples=30, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    states=st.integers(0, 5),
    outputs=st.integers(1, 3),
    disturbances=st.integers(0, 2),
    dt=st.sampled_from([0.0, 0.2]),
)
def test_controls_and_disturbances_are_decoupled(seed, states, outputs, disturbances, dt):
    model = random_model(seed, states, outputs, 1, disturbances, 2, dt)
    assume(detectability(model).weak.all())
    found = fault_detection(model, 0.4 if dt else -2.0)
    assert found.Q.poles() == pytest.approx(0.4 if dt else -2.0, rel=1e-2)
    for s in POINTS:
        size = max(np.abs(residual_at(found.Q, model, f, s)).max() for f in model.faults)
        for name in (*model.controls, *model.disturbances):
            assert np.abs(residual_at(found.Q, model, name, s)).max() < 1e-7 * max(size, 1e-3)
        for j, name in enumerate(model.faults):
            direct = residual_at(found.Q, model, name, s)
            np.testing.assert_allclose(
                response_at(found.R, s, [j]), direct, atol=1e-6 * max(size, 1e-3)
            )


def test_every_attainable_structure_is_attained():
    model = four_compartments()
    S = attainable_structures(model)[::3]
    found = fault_isolation(model, S, -3.0)
    np.testing.assert_array_equal(structure_matrix(found.Q, model), S)
    gains = np.array(
        [np.abs(residual_at(found.Q, model, f, POINTS[0]))[:, 0] for f in model.faults]
    )
    assert gains.T[~S].max() < 1e-10 < 1e-6 < gains.T[S].min()


def test_strong_structures_react_at_their_frequencies():
    model = four_compartments()
    S = attainable_structures(model, omega=[0.0, 1.0])[::4]
    found = fault_isolation(model, S, -3.0, omega=[0.0, 1.0])
    np.testing.assert_array_equal(structure_matrix(found.Q, model, omega=[0.0, 1.0]), S)


def test_the_published_residual_of_an_unstable_plant():
    """Example 5.4 of Varga (2017): the generator has order 1 and is unique up to its gain."""
    model = unstable_sensor()
    found = fault_detection(model, -3.0, omega=0.0)
    assert found.Q.nstates == 1
    omega = np.array([0.1, 1.0, 10.0])
    published = unstable_sensor_residual(1j * omega)
    ours = np.array([response_at(found.Q, 1j * w) for w in omega])
    gain = ours[0, 0, 1] / published[0, 0, 1]
    np.testing.assert_allclose(ours, gain * published, atol=1e-12)
    # [(s+2)/(s+3), (s-3)/(s+3)] from the faults
    s = 1j * omega
    expected = gain * np.array([(s + 2) / (s + 3), (s - 3) / (s + 3)]).T[:, None, :]
    np.testing.assert_allclose(
        residual_response(found.Q, model, model.faults, omega), expected, atol=1e-12
    )


@pytest.mark.parametrize(("row", "order"), [([0, 1], 1), ([1, 0], 2), ([1, 1], 1)])
def test_published_least_orders(row, order):
    """Xiong and Saif (2000), example 1: least orders from FDITOOLS' own tests."""
    A = [
        [-9.9477, -0.7476, 0.2632, -5.0337],
        [52.1659, 2.7452, 5.5532, -24.4221],
        [26.0922, 2.6361, -4.1975, -19.2774],
        [0.0, 0.0, 1.0, 0.0],
    ]
    B_u = [[0.4422, 0.1761], [3.5446, -7.5922], [-5.52, 4.49], [0.0, 0.0]]
    B_d = [[0.0, 0.0], [0.0, 1.0], [1.0, 0.0], [0.0, 0.0]]
    C = [[1.0, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 1, 1, 1]]
    system = control.ss(
        A, np.hstack([B_u, B_d]), C, np.zeros((4, 4)), inputs=["u1", "u2", "d1", "d2"]
    )
    model = FaultModel(
        system, controls=("u1", "u2"), disturbances=("d1", "d2")
    ).with_actuator_faults("u1")
    model = model.with_sensor_faults("y[2]")
    assert fault_isolation(model, [row], -1.0).Q.nstates == order


def test_triplex_sensors_need_no_dynamics():
    """Three sensors of one quantity: differences, whatever the plant (Varga, example 5.10)."""
    rng = np.random.default_rng(3)
    A, B = rng.standard_normal((3, 3)), rng.standard_normal((3, 2))
    C = np.ones((3, 1)) * rng.standard_normal((1, 3))
    system = control.ss(A, B, C, np.zeros((3, 2)), inputs=["u", "d"])
    model = FaultModel(system, controls=("u",), disturbances=("d",)).with_sensor_faults()
    S = [[0, 1, 1], [1, 0, 1], [1, 1, 0]]
    found = fault_isolation(model, S, -1.0, omega=0.0)
    assert found.Q.nstates == 0
    expected = np.array([[0, 1, -1], [1, 0, -1], [1, -1, 0]])
    np.testing.assert_allclose(np.abs(found.Q.D[:, :3]), np.abs(expected), atol=1e-9)
    np.testing.assert_allclose(found.Q.D.sum(axis=1), 0.0, atol=1e-9)


def test_poles_are_those_of_the_list():
    model = two_actuators()
    found = fault_isolation(model, np.eye(2), [-3.0 + 1.0j, -3.0 - 1.0j, -7.0])
    np.testing.assert_allclose(sorted(found.Q.poles().imag), [-1, -1, 1, 1], atol=1e-8)
    with pytest.raises(InputError, match="conjugate"):
        fault_isolation(model, np.eye(2), [-3.0 + 1.0j, -4.0])
    with pytest.raises(InputError, match="order 2: give as many"):
        fault_isolation(model, np.eye(2), [-3.0])


@pytest.mark.parametrize("pole", [0.0, 1.0, [-1.0, 2.0]])
def test_unstable_generators_are_refused(pole):
    with pytest.raises(InputError, match="unstable residual generator is asked for"):
        fault_detection(two_actuators(), pole)


@pytest.mark.parametrize(
    ("poles", "words"), [(np.nan, "must be finite"), ("fast", "one number"), ([], "give as many")]
)
def test_poles_that_are_none(poles, words):
    with pytest.raises(InputError, match=words):
        fault_detection(two_actuators(), poles)


def test_what_cannot_be_detected_is_named():
    B = np.array([[1.0, 2.0, 0.0], [0.0, 0.0, 1.0]])
    system = control.ss(-np.eye(2), B, np.eye(2), np.zeros((2, 3)), inputs=["d", "f1", "f2"])
    model = FaultModel(system, controls=(), disturbances=("d",), faults=("f1", "f2"))
    with pytest.raises(InputError, match="f1 cannot be told from the disturbance d"):
        fault_detection(model, -1.0)
    with pytest.raises(InputError, match=r"row 1 .* not attainable: f_u cannot be told .* f_y2"):
        fault_isolation(unstable_sensor(), np.eye(2), -1.0)
    blind = FaultModel(
        control.ss(-np.eye(2), np.eye(2), [[1.0, 0.0]], [[0.0, 0.0]], inputs=["u", "f"]),
        controls=("u",),
        faults=("f",),
    )
    with pytest.raises(InputError, match="f moves no output"):
        fault_detection(blind, -1.0)
    high_pass = control.ss([[-1.0]], [[-1.0]], [[1.0]], [[1.0]], inputs=["f"])
    with pytest.raises(InputError, match="f leaves nothing at 0 rad/s"):
        fault_detection(FaultModel(high_pass, faults=("f",)), -1.0, omega=0.0)


@pytest.mark.parametrize(
    ("structure", "words"),
    [
        ([[1, 0, 0]], "has 2 faults"),
        ([[2, 0]], "0 and 1 only"),
        ([[1, 0], [0, 0]], "row 2 of structure is zero"),
    ],
)
def test_structures_that_are_none(structure, words):
    with pytest.raises(InputError, match=words):
        fault_isolation(two_actuators(), structure, -1.0)


def test_generators_of_other_models_are_refused():
    found = fault_detection(unstable_sensor(), -3.0)
    with pytest.raises(InputError, match="3 outputs and 1 controls"):
        residual_response(found.Q, four_compartments(), ["f1"], 1.0)


def test_orders_that_rounding_spoils_are_not_given():
    """Thirty states, one output: the least order is near 30."""
    with pytest.raises(SolverError, match="rounding leaves a gain"):
        fault_detection(random_model(30, 30, 1, 1, 0, 2), -2.0, omega=0.0)


def test_many_states_with_enough_outputs():
    model = random_model(30, 30, 6, 1, 2, 2)
    found = fault_detection(model, -2.0, omega=0.0)
    assert found.Q.nstates == 7
    assert structure_matrix(found.Q, model, omega=0.0).all()
    leak = [np.abs(residual_at(found.Q, model, name, 1j)).max() for name in ("u0", "d0", "d1")]
    assert max(leak) < 1e-10
