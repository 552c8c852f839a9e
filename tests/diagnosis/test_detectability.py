"""Detectability against ranks at random points, and structures against published ones."""

from itertools import product

import control
import numpy as np
import pytest
from faulty_plants import random_model, response_at
from hypothesis import given, settings
from hypothesis import strategies as st
from workbench.plants.textbook.fault_examples import four_compartments, unstable_sensor

from workbench.diagnosis import (
    FaultModel,
    attainable_structures,
    detectability,
    isolability,
    masking_inputs,
    unattainable_faults,
)
from workbench.errors import InputError, UnknownNameError

YUAN_WEAK = """00010011 01101110 01111101 01111111 10101110 10111101 10111111 11001100 11011111
11100110 11101010 11101110 11110101 11110111 11111001 11111011 11111101 11111111"""
YUAN_STRONG = """00010011 01101110 01111101 01111111 10101110 10111101 10111111 11001100 11011111
11101110 11111101 11111111"""


def rank_at(model, names, s):
    columns = [list(model.system.input_labels).index(name) for name in names]
    return np.linalg.matrix_rank(response_at(model.system, s, columns), tol=1e-7) if names else 0


def as_words(rows):
    return {"".join(str(int(one)) for one in row) for row in rows}


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    outputs=st.integers(1, 3),
    disturbances=st.integers(0, 3),
    dt=st.sampled_from([0.0, 0.1]),
)
def test_structures_are_those_of_ranks_at_random_points(seed, outputs, disturbances, dt):
    model = random_model(seed, 3, outputs, 1, disturbances, 3, dt)
    rng = np.random.default_rng(seed + 1)
    s = complex(*rng.uniform(1.0, 2.0, 2))
    expected = set()
    for row in product((False, True), repeat=3):
        out = [name for name, one in zip(model.faults, row, strict=True) if not one]
        base = rank_at(model, (*model.disturbances, *out), s)
        ones = [name for name, one in zip(model.faults, row, strict=True) if one]
        if ones and all(
            rank_at(model, (*model.disturbances, *out, name), s) > base for name in ones
        ):
            expected.add("".join(str(int(one)) for one in row))
    assert as_words(attainable_structures(model)) == expected


@pytest.mark.cases(0)
def test_the_published_structures_of_a_cascade():
    model = four_compartments()
    assert as_words(attainable_structures(model)) == set(YUAN_WEAK.split())
    assert as_words(attainable_structures(model, omega=[0.0, 1.0])) == set(YUAN_STRONG.split())


def test_the_published_structures_of_an_aircraft():
    """Linearised Boeing 747 (Varga 2007): five elevator and stabiliser faults, badly scaled."""
    A = [
        [-0.4861, 0.000317, -0.5588, 0, -2.04e-6],
        [0, -0.0199, 3.0796, -9.8048, 8.98e-5],
        [1.0053, -0.0021, -0.5211, 0, 9.30e-6],
        [1, 0, 0, 0, 0],
        [0, 0, -92.6, 92.6, 0],
    ]
    B, D = np.zeros((5, 9)), np.zeros((6, 9))
    B[0] = [-0.1455, -0.1455, -0.1494, -0.1494, -1.286, 0.0013, 0.0035, 0.0035, 0.0013]
    B[1] = D[1] = [0, 0, 0, 0, -0.3122, 0.1999, 0.1999, 0.1999, 0.1999]
    B[2] = [-0.0071, -0.0071, -0.0074, -0.0074, -0.0676, -4e-4, -4e-4, -4e-4, -4e-4]
    C = np.vstack([np.eye(5)[2], A[1], np.eye(5)[3], np.eye(5)[0], A[4], np.eye(5)[4]])
    names = tuple(f"u{k}" for k in range(9))
    plant = FaultModel(control.ss(A, B, C, D, inputs=list(names)), controls=names)
    model = plant.with_actuator_faults(*names[:5])
    weak = "00001 00110 00111 11000 11001 11110 11111"
    assert as_words(attainable_structures(model)) == set(weak.split())
    strong = "00111 11001 11110 11111"
    assert as_words(attainable_structures(model, omega=[0.0, 1.0])) == set(strong.split())


def test_a_pole_at_the_frequency_and_a_zero_at_it():
    """y = f / s: strong at 0, where the plant has a pole; y = s / (s + 1) f: not."""
    integrator = control.ss([[0.0]], [[1.0]], [[1.0]], [[0.0]], inputs=["f"])
    assert detectability(FaultModel(integrator, faults=("f",))).strong.all()
    high_pass = control.ss([[-1.0]], [[-1.0]], [[1.0]], [[1.0]], inputs=["f"])
    found = detectability(FaultModel(high_pass, faults=("f",)), omega=[0.0, 1.0])
    assert found.weak.all()
    assert found.strong.tolist() == [[False, True]]


def test_a_zero_of_the_disturbance_at_the_frequency():
    """A published example: u / s in both outputs, s / (s + 3) d in the second; weak, not strong."""
    # states: 1/s of u, 1/(s+2) of f, 1/(s+3) of d
    system = control.ss(
        np.diag([0.0, -2.0, -3.0]),
        np.eye(3)[:, [0, 2, 1]],
        [[1.0, -1.0, 0.0], [1.0, 1.0, -3.0]],
        [[0.0, 0.0, 1.0], [0.0, 1.0, 0.0]],
        inputs=["u", "d", "f"],
    )
    found = detectability(
        FaultModel(system, controls=("u",), disturbances=("d",), faults=("f",)), omega=[0.0, 1.0]
    )
    assert found.weak.all()
    assert found.strong.tolist() == [[False, True]]


def test_a_zero_of_the_disturbance_that_costs_nothing():
    """y = [s / (s + 1) d, s / (s + 1) d + f]: the difference shows f at every frequency."""
    system = control.ss(
        [[-1.0]],
        [[-1.0, 0.0]],
        [[1.0], [1.0]],
        [[1.0, 0.0], [1.0, 1.0]],
        inputs=["d", "f"],
    )
    found = detectability(
        FaultModel(system, controls=(), disturbances=("d",), faults=("f",)), omega=0.0
    )
    assert found.strong.all()


def test_a_mode_that_only_faults_reach_makes_a_zero_of_the_residual():
    """y = (u + d) / (s + 1) + f / s: what a stable residual shows of the integrator is f alone."""
    system = control.ss(
        np.diag([-1.0, 0.0]),
        [[1.0, 0.0], [0.0, 1.0]],
        [[1.0, 1.0], [1.0, 0.0]],
        np.zeros((2, 2)),
        inputs=["u", "f"],
    )
    assert detectability(FaultModel(system, controls=("u",), faults=("f",))).strong.all()


def test_what_masks_a_fault():
    """The disturbance d1 acts as f1 does, d2 acts elsewhere."""
    B = np.array([[1.0, 0.0, 2.0, 0.0], [0.0, 1.0, 0.0, 1.0], [0.0, 0.0, 0.0, 1.0]])
    system = control.ss(
        -np.diag([1.0, 2.0, 3.0]), B, np.eye(3), np.zeros((3, 4)), inputs=["d1", "d2", "f1", "f2"]
    )
    model = FaultModel(system, controls=(), disturbances=("d1", "d2"), faults=("f1", "f2"))
    found = detectability(model)
    assert found.weak.tolist() == [False, True]
    assert found.masked_by == (("d1",), ())
    with pytest.raises(InputError, match="does not hide"):
        masking_inputs(model, "f2", model.disturbances)


def test_isolability_of_an_actuator_and_a_sensor():
    model = unstable_sensor()
    found = isolability(model)
    assert not found.any()  # one residual only, d decoupled
    assert unattainable_faults(model, (True, True)) == ()
    assert unattainable_faults(model, (True, False)) == ("f_u",)


def test_bad_questions():
    model = unstable_sensor()
    with pytest.raises(InputError, match="from 0 on"):
        detectability(model, omega=-1.0)
    with pytest.raises(InputError, match="from 0 on"):
        detectability(model, omega=np.nan)
    with pytest.raises(UnknownNameError):
        detectability(model, decoupled=["f_x"])
    with pytest.raises(InputError, match="every fault is decoupled"):
        detectability(model, decoupled=model.faults)
    with pytest.raises(InputError, match="no fault"):
        isolability(FaultModel(model.system, controls=("u",), disturbances=("d", "f_u", "f_y2")))
    with pytest.raises(InputError, match="must be a FaultModel"):
        attainable_structures(model.system)
    with pytest.raises(InputError, match="frequencies up to"):
        detectability(random_model(1, dt=0.1), omega=40.0)
