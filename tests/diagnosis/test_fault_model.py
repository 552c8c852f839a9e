"""Faults of every kind enter a model as the equations state."""

import control
import numpy as np
import pytest
from faulty_plants import response_at

from workbench.diagnosis import FaultModel, multiplicative_lft
from workbench.errors import InputError, UnknownNameError

A = np.array([[0.0, 1.0], [-4.0, -0.5]])
B = np.array([[0.0], [2.0]])
C = np.array([[1.0, 0.0], [0.0, 3.0]])
D = np.array([[0.0], [0.5]])
SYSTEM = control.ss(A, B, C, D, inputs=["u"], outputs=["x", "v"])
MODEL = FaultModel(SYSTEM, controls=("u",))


def test_actuator_and_sensor_faults_enter_at_their_signals():
    model = MODEL.with_actuator_faults().with_sensor_faults("v")
    assert model.faults == ("f_u", "f_v")
    s = 0.3 + 1.1j
    G = response_at(model.system, s)
    np.testing.assert_allclose(G[:, 1], G[:, 0])
    np.testing.assert_allclose(G[:, 2], [0.0, 1.0], atol=1e-15)


def test_a_process_fault_is_equation_7_5():
    model = MODEL.with_fault("f", [1.0, -2.0], R2=[0.0, 0.7])
    s = 0.2 + 0.9j
    expected = C @ np.linalg.solve(s * np.eye(2) - A, [1.0, -2.0]) + [0.0, 0.7]
    np.testing.assert_allclose(response_at(model.system, s)[:, 1], expected)


def test_a_parameter_of_one_entry_is_equation_7_2():
    """A change of a_21 enters by I_2: with f = delta x_1 the model moves like the changed model."""
    dA = np.array([[0.0, 0.0], [1.0, 0.0]])
    model = MODEL.with_multiplicative_fault("stiffness", dA=dA)
    assert model.faults == ("stiffness",)
    entry, through = model.matrices(["stiffness"])
    np.testing.assert_allclose(entry[:, 0], [0.0, 1.0])
    np.testing.assert_allclose(through, 0.0)
    delta, s = -0.3, 0.1 + 1.3j
    x = np.linalg.solve(s * np.eye(2) - A - delta * dA, B)
    changed = C @ x + D
    f = delta * x[0]
    np.testing.assert_allclose(response_at(model.system, s) @ [1.0, f[0]], changed[:, 0])


def test_a_parameter_of_rank_two_has_two_inputs_and_one_repeated_block():
    dA, dB = np.array([[0.0, 0.0], [1.0, 0.2]]), np.array([[0.7], [0.0]])
    model = MODEL.with_multiplicative_fault("mass", dA=dA, dB=dB)
    assert model.faults == ("mass_1", "mass_2")
    plant = multiplicative_lft(MODEL, {"mass": (dA, dB, None, None)})
    assert plant.structure.to_pairs() == [(-2, 0)]
    delta, s = 0.4, 0.2 + 0.8j
    M = response_at(plant.system, s)
    # upper LFT with delta I
    closed = M[2:, 2:] + M[2:, :2] @ np.linalg.solve(np.eye(2) / delta - M[:2, :2], M[:2, 2:])
    x = np.linalg.solve(s * np.eye(2) - A - delta * dA, B + delta * dB)
    np.testing.assert_allclose(closed, C @ x + D, rtol=1e-10)


def test_names_that_do_not_fit():
    with pytest.raises(UnknownNameError, match="did you mean"):
        FaultModel(control.ss(A, B, C, D, inputs=["motor"]), controls=("moter",))
    with pytest.raises(InputError, match="stands in controls and in faults"):
        FaultModel(SYSTEM, controls=("u",), faults=("u",))
    with pytest.raises(InputError, match="neither controls nor"):
        FaultModel(SYSTEM)
    with pytest.raises(InputError, match="already has an input"):
        MODEL.with_fault("u", [1.0, 0.0])
    with pytest.raises(UnknownNameError):
        MODEL.with_sensor_faults("y7")


@pytest.mark.parametrize(
    ("entry", "words"),
    [
        ([1.0, np.nan], "not finite"),
        ([0.0, 0.0], "enters nowhere"),
        ([1.0], "2 states"),
    ],
)
def test_entries_that_do_not_fit(entry, words):
    with pytest.raises(InputError, match=words):
        MODEL.with_fault("f", entry)


def test_systems_that_are_none():
    with pytest.raises(InputError, match="converts a TransferFunction"):
        FaultModel(control.tf(1, [1, 1]), controls=("u",))
    spoilt = control.ss(A, B, C, D, inputs=["u"])
    spoilt.A[0, 0] = np.nan
    with pytest.raises(InputError, match="A of the system"):
        FaultModel(spoilt, controls=("u",))
    with pytest.raises(InputError, match="dt=True"):
        FaultModel(control.ss(A, B, C, D, True, inputs=["u"]), controls=("u",))
    with pytest.raises(InputError, match="changes nothing"):
        MODEL.with_multiplicative_fault("p", dA=np.zeros((2, 2)))
    with pytest.raises(InputError, match=r"dA of fault 'p' has shape \(3, 3\)"):
        MODEL.with_multiplicative_fault("p", dA=np.eye(3))
    with pytest.raises(InputError, match="changes is empty"):
        multiplicative_lft(MODEL, {})
