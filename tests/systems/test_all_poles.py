"""Transfer functions as state-space systems: every pole and every coefficient stays."""

import control
import numpy as np
import pytest

from workbench.systems.conversion import as_system


def test_a_cancelled_pole_stays():
    """python-control leaves it out, and with it that the loop is unstable inside."""
    found = as_system(control.tf([1.0, -1.0], [1.0, 1.0, -2.0]), "G")
    assert np.sort(found.poles().real) == pytest.approx([-2.0, 1.0])


@pytest.mark.parametrize("unit", [1e-6, 1.0, 1e6])
@pytest.mark.parametrize("dt", [0, 0.1])
def test_no_coefficient_is_too_small(unit, dt):
    """SciPy takes coefficients below 1e-14 of the largest one for 0."""
    powers = unit ** np.arange(4.0)
    G = control.tf([5e4, -5.0] * powers[1::-1], [3.0, 2.0, 5.0, 1.0] * powers[::-1] / 7.0, dt)
    found = as_system(G, "G")
    s = np.exp(1j * dt * np.array([0.1, 3.0])) if dt else 1j * np.array([0.1, 3.0]) / unit
    assert found(s) == pytest.approx(G(s), rel=1e-12)
    assert found.dt == G.dt and found.input_labels == G.input_labels
