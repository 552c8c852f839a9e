"""Modal realisations of two masses on springs."""

import control
import numpy as np
import pytest

from workbench.errors import InputError
from workbench.systems.realisation import modal_form

STIFFNESS = np.array([[300.0, -50.0], [-50.0, 900.0]])
DAMPING = 0.01 * STIFFNESS


def two_masses():
    A = np.block([[np.zeros((2, 2)), np.eye(2)], [-STIFFNESS, -DAMPING]])
    return A, np.array([[0.0], [0.0], [1.0], [0.5]]), np.array([[1.0, 1.0, 0.0, 0.0]])


def test_states_are_the_resonances_and_the_response_is_kept():
    matrices = two_masses()
    A, B, C = modal_form(*matrices)
    np.testing.assert_allclose(C, [[1, 0, 1, 0]], atol=1e-9)
    np.testing.assert_allclose(A[:2, 2:], 0.0, atol=1e-9)
    np.testing.assert_allclose(A[2:, :2], 0.0, atol=1e-9)
    # proportional damping: poles of each undamped frequency w are -0.005 w^2 +- j w_d
    w2 = np.linalg.eigvalsh(STIFFNESS)
    for k, block in enumerate((A[:2, :2], A[2:, 2:])):
        assert block[0, 0] == pytest.approx(-0.005 * w2[k])
        assert abs(block[0, 1]) == pytest.approx(np.sqrt(w2[k] - (0.005 * w2[k]) ** 2))
    s = 3.0 + 12.0j
    assert control.ss(A, B, C, 0)(s) == pytest.approx(control.ss(*matrices, 0)(s), rel=1e-9)


def test_a_real_pole_is_named():
    with pytest.raises(InputError, match="need complex poles"):
        modal_form(np.diag([-1.0, -2.0]), np.ones((2, 1)), np.ones((1, 2)))
