"""Responses of full factorials against those of one combination at a time."""

import numpy as np

from workbench.uncertainty.parametric_models.factorial import factorial_response
from workbench.uncertainty.parametric_models.model import parametric_lft
from workbench.uncertainty.parametric_models.parameters import Parameter, level_deltas


def test_factorials_come_in_the_order_of_their_deltas():
    omega = np.geomspace(1.0, 1e4, 8)

    def model(a, idle, b, c):  # b twice, idle nowhere
        A = [[-a * b, 1.0], [0.0, -b]]
        return A, [[c], [1.0]], [[1.0, b], [a, 0.0], [0.0, c]], np.zeros((3, 1))

    parts = [Parameter(n, v, 0.3) for n, v in (("a", 50.0), ("idle", 1), ("b", 2.0), ("c", 0.5))]
    uncertain = parametric_lft(model, parts, inputs=["u"], outputs=["x", "y", "z"])
    found = factorial_response(uncertain, omega, [-1.0, 0.0, 1.0])
    assert found.shape == (3, 3, 3, 3, len(omega), 3, 1)
    one_by_one = uncertain.response(omega, level_deltas(parts, 3))
    np.testing.assert_allclose(found.reshape(one_by_one.shape), one_by_one, rtol=1e-10)
