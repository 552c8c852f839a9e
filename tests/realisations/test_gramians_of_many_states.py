"""Gramians of many states, whose sums over samples are taken in doubles."""

import control
import numpy as np

from workbench.realisations import gramians


def test_fifty_states():
    rng = np.random.default_rng(3)
    A = np.diag(-np.geomspace(0.1, 100.0, 45)) + 0.01 * rng.standard_normal((45, 45))
    found = gramians(control.ss(A, rng.standard_normal((45, 1)), np.ones((1, 45)), 0.0))
    assert found.holds, found.certificate
    assert [check.opinion for check in found.certificate.checks].count(True) == 2
