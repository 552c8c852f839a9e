"""Peaks and curves of robust performance of a closed plant."""

import control
import numpy as np
import pytest

from workbench.errors import InputError
from workbench.mu import conditions, performance_peak, performance_sweep
from workbench.uncertainty import UncertaintyModel, generalised_plant

OMEGA = np.geomspace(0.01, 100, 30)
K = control.ss([], [], [], [[2.0]])


@pytest.fixture(scope="module")
def plant():
    """A first-order lag with 30 % of uncertainty, W_p = 1 / (s + 1)."""
    lag = UncertaintyModel(control.tf(1, [1, 1]), control.tf(0.3, 1))
    return generalised_plant(
        [(lag, "u", "y"), (control.tf(1, [1, 1]), "e", "z")],
        {"e": "w - y"},
        exogenous="w",
        control="u",
        performance="z",
        measurement="e",
    )


def exact(omega):
    """|W_p S| + |W_c T|."""
    s = 1j * omega
    L = 2 / (s + 1)
    return np.abs(1 / (s + 1) / (1 + L)) + 0.3 * np.abs(L / (1 + L))


def test_the_peak_is_that_of_the_closed_form(plant):
    found = performance_peak(plant, K, tolerance=1e-4)
    top = exact(np.geomspace(1e-4, 1e3, 5000)).max()
    assert found.lower <= top * (1 + 1e-9)
    assert top <= found.upper <= top * (1 + 2e-4)
    same = conditions(plant, K, tolerance=1e-4).robust_performance
    assert found.upper == pytest.approx(same.upper, rel=2e-4)


def test_the_curve_is_that_of_the_closed_form(plant):
    found = performance_sweep(plant, K, OMEGA)
    np.testing.assert_allclose(found.upper, exact(OMEGA), rtol=1e-6)
    assert (found.lower <= found.upper).all()


def test_an_unstable_loop_has_no_peak(plant):
    assert performance_peak(plant, -K) is None


def test_without_perturbation_it_is_the_norm(plant):
    found = performance_peak(plant.nominal(), K)
    assert found.upper == pytest.approx(1 / 3, rel=2e-3)


def test_a_system_is_no_plant(plant):
    with pytest.raises(InputError, match="GeneralisedPlant"):
        performance_peak(plant.system, K)
