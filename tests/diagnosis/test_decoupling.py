"""Minimal polynomial bases of the left null space."""

import control
import numpy as np
import pytest
from faulty_plants import random_model, response_at
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.diagnosis import FaultModel
from workbench.diagnosis.models.decoupling import Parity


def polynomial_at(parity, s):
    """The basis N(s) (rows, p) in the outputs' own units, at an s that is not scaled."""
    powers = [(s / parity.rate) ** np.arange(len(v)) for v in parity.basis]
    rows = [power @ v for power, v in zip(powers, parity.basis, strict=True)]
    return np.array(rows) / parity.y_units


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 10**6),
    outputs=st.integers(1, 4),
    disturbances=st.integers(0, 2),
    dt=st.sampled_from([0.0, 0.1]),
)
def test_a_basis_is_whole_and_annihilates(seed, outputs, disturbances, dt):
    model = random_model(seed, 4, outputs, 1, disturbances, 1, dt)
    parity = Parity(model, model.disturbances)
    assert len(parity.basis) == max(outputs - disturbances, 0)
    if not parity.basis:
        return
    for s in (0.4 + 1.1j, 2.0 - 0.3j):
        N = polynomial_at(parity, s)
        G = response_at(model.system, s, range(1, 1 + disturbances))
        assert np.linalg.matrix_rank(N, tol=1e-9) == len(N)
        np.testing.assert_allclose(N @ G, 0.0, atol=1e-8 * np.linalg.norm(N))
    orders = sum(len(v) - 1 for v in parity.basis)
    assert orders == 4 if disturbances == 0 else orders <= 4  # the observability indices' sum


def test_no_row_vanishes_at_a_zero_of_the_disturbance():
    """d goes through (s - 1) / (s + 2): the basis has full rank at 1 as well."""
    rng = np.random.default_rng(4)
    plant = control.ss(
        -np.diag([1.0, 2.5, 4.0]), rng.standard_normal((3, 1)), rng.standard_normal((3, 3)), 0.0
    )
    weighted = plant * control.ss([[-2.0]], [[1.0]], [[-3.0]], [[1.0]])
    weighted.set_inputs(["d"])
    parity = Parity(FaultModel(weighted, controls=(), disturbances=("d",)), ("d",))
    assert np.abs(response_at(weighted, 1.0)).max() < 1e-12
    sizes = np.linalg.svd(polynomial_at(parity, 1.0), compute_uv=False)
    assert len(sizes) == 2
    assert sizes[-1] > 1e-2 * sizes[0]


def test_states_that_only_faults_reach_are_not_decoupled():
    """Order 0 is enough for y = [u + f / (s + 1), u], because only the fault excites the pole."""
    system = control.ss(
        [[-1.0]], [[0.0, 1.0]], [[1.0], [0.0]], [[1.0, 0.0], [1.0, 0.0]], inputs=["u", "f"]
    )
    parity = Parity(FaultModel(system, controls=("u",), disturbances=(), faults=("f",)), ())
    assert sorted(len(v) for v in parity.basis) == [1, 1]
    assert parity.rest[0] == pytest.approx(np.array([[-1.0]]))
