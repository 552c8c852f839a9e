"""Mu over the time of an experiment: designed inputs need less of it."""

from types import SimpleNamespace

import numpy as np
import pytest
from workbench.plants.textbook.estimate_to_mu import TRUE_PLANT
from workbench.plants.textbook.experiment_design import coefficient_slopes, experiment_design
from workbench.plants.textbook.experiment_times import ExperimentTimes

import workbench as wb
from workbench.fitting.rational import Rational


@pytest.fixture(scope="module")
def solved():
    design = wb.solve(experiment_design())
    assert design.certificate.valid
    study = ExperimentTimes(SimpleNamespace(answer=design.answer), 0.95, 20)
    return study, wb.solve(study)


def test_slopes_are_differences():
    omega = np.array([0.3, 1.0, 2.5])
    found = coefficient_slopes(TRUE_PLANT, omega)
    a = np.array([1.0, *np.poly(TRUE_PLANT.poles).real[1:]])
    s = 1j * omega
    for k, step in enumerate(1e-6 * np.eye(3)):
        b, a1, a0 = a + step
        change = b / (s**2 + a1 * s + a0) - TRUE_PLANT.response(omega)
        np.testing.assert_allclose(found[:, k], change / 1e-6, rtol=1e-4)
    assert isinstance(TRUE_PLANT, Rational)


def test_a_limit_of_each_line_spreads_the_power():
    free, bound = (wb.solve(experiment_design(largest=largest)) for largest in (1.0, 0.2))
    assert free.certificate.valid and bound.certificate.valid
    assert bound.answer.power.max() <= 0.2 * (1 + 1e-9)
    assert bound.answer.worst > free.answer.worst


@pytest.mark.slow
def test_designed_inputs_save_time(solved):
    study, solution = solved
    assert solution.certificate.holds, solution
    numbers = solution.metrics
    assert numbers["time_saved"] > 3
    assert numbers["factor_equal_powers_size_drawn_phases"] < 0.4
    assert 0.9 < numbers["factor_equal_powers_size_designed_phases"] <= 1.1
    assert set(study.figures(solution.answer)) == {"mu"}


@pytest.mark.slow
def test_wrong_numbers_are_rejected(solved):
    study, answer = solved[0], solved[1].answer
    for wrong in (
        answer.assign(factor=1.1 * answer["factor"]),
        answer.assign(peak=answer["peak"] * np.array([0.9, 1.0])),
        answer.assign(peak=answer["peak"].isel(spectrum=[1, 0]).drop_vars("spectrum")),
        answer.assign(peak=answer["peak"][..., ::-1, :].drop_vars("periods")),
        answer.assign(needed=3.0 * answer["needed"]),
    ):
        assert not study.certify(wrong, 1e-6).holds
