"""Parity relations against sums over recorded samples."""

import numpy as np
import pytest
from faulty_plants import random_model
from hypothesis import given, settings
from hypothesis import strategies as st
from workbench.plants.textbook.fault_examples import two_actuators

from workbench.diagnosis import FaultModel, parity_relation
from workbench.errors import InputError

ORDER = 4
"""Samples before the present one in the window of a parity relation."""


def recorded(model, rng, steps=40, quiet=()):
    """The inputs, by name, and the outputs of a simulation from a random state."""
    inputs = {
        name: rng.standard_normal(steps) * (name not in quiet) for name in model.system.input_labels
    }
    u = np.array(list(inputs.values()))
    x, y = rng.standard_normal(model.system.nstates), []
    for k in range(steps):
        y.append(model.system.C @ x + model.system.D @ u[:, k])
        x = model.system.A @ x + model.system.B @ u[:, k]
    return inputs, np.array(y)


def residual_of(relation, model, inputs, y):
    u = np.array([inputs[name] for name in model.controls]).T
    order = len(relation.v) - 1
    return np.array(
        [
            (relation.v * y[k - order : k + 1]).sum() - (relation.w * u[k - order : k + 1]).sum()
            for k in range(order, len(y))
        ]
    )


@settings(max_examples=20, deadline=None)
@given(seed=st.integers(0, 10**6), disturbances=st.integers(0, 2))
def test_a_record_without_faults_leaves_nothing(seed, disturbances):
    model = random_model(seed, 4, 3, 1, disturbances, 1, 0.1)
    relation = parity_relation(model, ORDER)
    assert np.linalg.norm(relation.v) == pytest.approx(1.0)
    assert relation.index == 0.0
    rng = np.random.default_rng(seed)
    quiet = residual_of(relation, model, *recorded(model, rng, quiet=model.faults))
    loud = residual_of(relation, model, *recorded(model, rng))
    assert np.abs(quiet).max() < 1e-8 * np.abs(loud).max()


def test_the_filter_is_the_sum():
    model = random_model(5, 3, 2, 1, 0, 1, 0.1)
    relation = parity_relation(model, 3)
    inputs, y = recorded(model, np.random.default_rng(0))
    Q = relation.generator.Q
    np.testing.assert_allclose(Q.poles(), 0.0, atol=1e-3)
    into = np.hstack([y, np.array([inputs[name] for name in model.controls]).T])
    x, found = np.zeros(Q.nstates), []
    for row in into:
        found.append((Q.C @ x + Q.D @ row)[0])
        x = Q.A @ x + Q.B @ row
    np.testing.assert_allclose(found[3:], residual_of(relation, model, inputs, y), atol=1e-10)


def test_no_other_vector_has_a_smaller_index():
    """With as many disturbances as outputs the index follows from a generalised eigenvalue."""
    model = random_model(8, 3, 2, 1, 2, 1, 0.1)
    relation = parity_relation(model, ORDER)
    assert relation.index > 0.0
    A, C, p = model.system.A, model.system.C, 2
    O_matrix = np.vstack([C @ np.linalg.matrix_power(A, k) for k in range(ORDER + 1)])

    def toeplitz(names):
        B, D = model.matrices(names)
        T = np.zeros(((ORDER + 1) * p, (ORDER + 1) * len(names)))
        for i in range(ORDER + 1):
            for j in range(i + 1):
                block = D if i == j else C @ np.linalg.matrix_power(A, i - j - 1) @ B
                T[i * p : (i + 1) * p, j * len(names) : (j + 1) * len(names)] = block
        return T

    T_f, T_d = toeplitz(model.faults), toeplitz(model.disturbances)

    def index(v):
        return np.linalg.norm(v @ T_d) / np.linalg.norm(v @ T_f)

    v = relation.v.reshape(-1)
    np.testing.assert_allclose(v @ O_matrix, 0.0, atol=1e-10)
    assert index(v) == pytest.approx(relation.index)
    U = np.linalg.svd(O_matrix)[0][:, 3:].T
    rng = np.random.default_rng(1)
    assert min(index(rng.standard_normal(len(U)) @ U) for _ in range(500)) > relation.index
    near = [index(v + 1e-3 * rng.standard_normal(len(U)) @ U) for _ in range(50)]
    assert min(near) >= relation.index * (1 - 1e-9)


def test_bad_questions():
    with pytest.raises(InputError, match="for sampled models"):
        parity_relation(two_actuators(), 3)
    model = random_model(2, 4, 1, 1, 0, 1, 0.1)
    with pytest.raises(InputError, match="raise the order"):
        parity_relation(model, 1)
    with pytest.raises(InputError, match="must not be negative"):
        parity_relation(model, -1)
    with pytest.raises(InputError, match="whole number"):
        parity_relation(model, 1.5)
    with pytest.raises(InputError, match="no fault"):
        parity_relation(FaultModel(model.system, controls=("u0",), disturbances=("f0",)), 2)
