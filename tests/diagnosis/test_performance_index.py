"""The index of equation 7.23 against dense grids and results by hand."""

import control
import numpy as np
import pytest
from faulty_plants import random_model
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from workbench.plants.textbook.fault_examples import two_actuators, unstable_sensor

from workbench.diagnosis import (
    FaultModel,
    fault_detection,
    fault_isolation,
    null_space_generator,
    performance_index,
    residual_response,
)
from workbench.errors import InputError, UnknownNameError
from workbench.systems.realisation import realisation

PASS = realisation((np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.eye(1)), 0.0)


def test_by_hand():
    """d / (s + 1) over s / (s + 1) f is 1 / omega: largest where the range begins."""
    system = control.ss([[-1.0]], [[1.0, -1.0]], [[1.0]], [[0.0, 1.0]], inputs=["d", "f"])
    model = FaultModel(system, controls=(), disturbances=("d",), faults=("f",))
    found = performance_index(PASS, model, (0.5, 10.0))
    assert found.lower[0] == pytest.approx(2.0)
    assert found.upper[0] == pytest.approx(2.0, rel=2e-3)
    assert found.omega[0] == pytest.approx(0.5)


def test_a_narrow_peak_between_grid_points_is_found():
    """A resonance of the disturbance, damping 1e-5."""
    w, z = 3.3217, 1e-5
    A = np.array([[0.0, 1.0], [-(w**2), -2 * z * w]])
    system = control.ss(A, [[0.0, 0.0], [w**2, 0.0]], [[1.0, 0.0]], [[0.0, 1.0]], inputs=["d", "f"])
    found = performance_index(
        PASS, FaultModel(system, controls=(), disturbances=("d",), faults=("f",)), (0.1, 100.0)
    )
    assert found.lower[0] <= 1 / (2 * z) * (1 + 1e-6) <= found.upper[0] * (1 + 2e-6)
    assert found.omega[0] == pytest.approx(w, rel=1e-4)


@settings(max_examples=15, deadline=None)
@given(seed=st.integers(0, 10**6), dt=st.sampled_from([0.0, 0.1]))
def test_no_frequency_exceeds_the_bound(seed, dt):
    model = random_model(seed, 3, 2, 1, 0, 3, dt)
    model = FaultModel(
        model.system, controls=model.controls, disturbances=(), faults=("f0",), noise=("f1", "f2")
    )
    found = fault_detection(model, 0.5 if dt else -2.0)
    omega = np.geomspace(1e-2, 30.0, 4000)
    top, base = (
        np.linalg.norm(residual_response(found.Q, model, names, omega)[:, 0], axis=1)
        for names in (model.noise, model.faults)
    )
    assume(base.min() > 1e-6 * top.max())
    index = performance_index(found.Q, model, (1e-2, 30.0))
    ratio = (top / base).max()
    assert index.lower[0] <= index.upper[0]
    assert ratio <= index.upper[0]
    assert index.lower[0] >= ratio * (1 - 1e-2)


def test_decoupled_disturbances_have_the_index_0():
    model = unstable_sensor()
    found = fault_detection(model, -3.0)
    index = performance_index(found.Q, model, (0.1, 10.0))
    assert index.lower[0] == 0.0
    assert index.upper[0] < 1e-9


def test_faults_that_vanish_in_the_range_make_it_infinite():
    """The fault enters by (s^2 + 4) / (s + 1)^2, which is 0 at 2 rad/s."""
    s = control.tf("s")
    row = control.combine_tf([[1 / (s + 1), (s**2 + 4) / (s + 1) ** 2]])
    model = FaultModel(
        control.ss(row, inputs=["d", "f"]), controls=(), disturbances=("d",), faults=("f",)
    )
    assert performance_index(PASS, model, (1.0, 2.0 * 2.0)).upper[0] == np.inf
    assert performance_index(PASS, model, (2.5, 10.0)).upper[0] < 10.0


def test_bad_questions():
    model = two_actuators()
    Q = fault_isolation(model, np.eye(2), -10.0).Q
    for band in [(1.0, 1.0), (0.0, 1.0), (1.0, np.inf), 3.0]:
        with pytest.raises(InputError, match="two frequencies"):
            performance_index(Q, model, band)
    with pytest.raises(InputError, match="tolerance"):
        performance_index(Q, model, (1.0, 2.0), tolerance=0.0)
    with pytest.raises(UnknownNameError):
        performance_index(Q, model, (1.0, 2.0), faults=["w1"])
    with pytest.raises(InputError, match="one disturbance or noise"):
        performance_index(Q, model, (1.0, 2.0), disturbances=())
    with pytest.raises(InputError, match="residual 2 shows none of f_u1"):
        performance_index(Q, model, (1.0, 2.0), faults=["f_u1"])


@pytest.mark.parametrize(("fault", "disturbance"), [(1e12, 1.0), (1.0, 1e-12), (1e-9, 1e6)])
def test_units_of_faults_and_disturbances_do_not_count(fault, disturbance):
    """An index below 1e-10 in the units at hand counted as decoupled."""
    A, C = [[-2.0, 0.0], [1.0, -0.5]], [[0.0, 1.0]]
    B = [[0.0, 2.0 * fault], [0.3 * disturbance, 0.0]]
    plant = control.ss(A, B, C, 0, inputs=["d", "f"], outputs=["y"])
    model = FaultModel(plant, faults=("f",), noise=("d",))
    found = performance_index(null_space_generator(model, poles=-4.0).Q, model, band=(0.01, 100.0))
    truth = 0.15 * abs(100j + 2.0) * disturbance / fault  # 0.3 (s + 2) / 2 at the upper end
    assert found.lower[0] == pytest.approx(truth) and truth <= found.upper[0] < 1.002 * truth
    assert found.holds
