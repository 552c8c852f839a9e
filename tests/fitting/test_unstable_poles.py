"""Fits of plants with poles right of the imaginary axis."""

import numpy as np
import pytest

from workbench.errors import InputError
from workbench.fitting import Rational, ResponseFit, fit_response
from workbench.fitting.factored import FactoredRational
from workbench.fitting.response.program import right_check
from workbench.second_opinion.fits import growing_modes
from workbench.solution import solve

OMEGA = np.geomspace(1.0, 1e4, 60)
PLANTS = {
    "one": (Rational([], [100.0, -100.0, -3000.0], 3e7), 1),
    "pair": (Rational([], [3 + 80j, 3 - 80j, -900.0], 5e6), 2),
    "two real": (Rational([-20.0], [40.0, 300.0, -500 + 900j, -500 - 900j], 1e7), 2),
}


@pytest.mark.parametrize("name", PLANTS)
@pytest.mark.parametrize("method", ["vector-fitting", "ipopt", "clarabel", "best"])
def test_an_unstable_plant_is_found_again(name, method):
    plant, count = PLANTS[name]
    data = plant.response(OMEGA)
    fit = ResponseFit(OMEGA, data, plant.order, zeros=plant.zeros.size, unstable_poles=count)
    solution = solve(fit, method=method)
    assert solution.certificate.valid
    np.testing.assert_allclose(solution.answer.response(OMEGA), data, rtol=1e-6)
    assert (solution.answer.poles.real > 0).sum() == count


def test_a_wrong_number_is_found_by_check_and_second_opinion():
    plant, _ = PLANTS["one"]
    for count, holds in ((0, False), (1, True), (2, False)):
        assert right_check(plant.poles, count).holds is holds
        assert growing_modes(plant.state_space(), count, "fit").holds is holds


def test_the_factored_form_keeps_poles_on_their_sides():
    rng = np.random.default_rng(3)
    for plant, count in PLANTS.values():
        form = FactoredRational.of(plant, plant.order - 1, (1.0, 1e4), True, False, count)
        np.testing.assert_allclose(form.response(form.start, OMEGA), plant.response(OMEGA), 1e-5)
        for _ in range(20):
            vector = form.start + rng.normal(size=form.start.size)
            found = form.rational(vector)
            assert (found.poles.real > 0).sum() == count
            np.testing.assert_allclose(
                form.response(vector, OMEGA), found.response(OMEGA), rtol=1e-8
            )
        slopes, step = form.slopes(form.start, OMEGA), 1e-6
        for k in range(form.start.size):
            moved = form.start.copy()
            size = step * max(1.0, abs(moved[k]))
            moved[k] += size
            apart = (form.response(moved, OMEGA) - form.response(form.start, OMEGA)) / size
            np.testing.assert_allclose(apart, slopes[:, k], atol=1e-4 * np.abs(slopes[:, k]).max())


def test_as_a_state_space_of_the_smallest_order():
    plant, count = PLANTS["one"]
    found = fit_response(OMEGA, plant.response(OMEGA), error=1e-6, zeros=0, unstable_poles=count)
    assert found.nstates == 3
    assert (found.poles().real > 0).sum() == 1


def test_what_misfits_is_named():
    data = PLANTS["one"][0].response(OMEGA)
    with pytest.raises(InputError, match="unstable_poles is 4; the order is 3"):
        ResponseFit(OMEGA, data, 3, unstable_poles=4)
    with pytest.raises(InputError, match="unstable_poles"):
        ResponseFit(OMEGA, data, 3, unstable_poles=-1)
    with pytest.raises(InputError, match="SB10YD holds no poles right of the axis"):
        solve(ResponseFit(OMEGA, data, 3, unstable_poles=1), method="sb10yd")
