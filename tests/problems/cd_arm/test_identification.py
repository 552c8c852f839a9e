"""The measured CD-player arm: its record, its model, and a public package's model beside it."""

import sys

import numpy as np
import pytest
from workbench.plants.bench.cd_arm import PeerComparison, fit
from workbench.plants.cd_arm import identification

from workbench import load, solve
from workbench.errors import InputError


def test_record():
    u, y = identification.read_record()
    assert u.shape == y.shape == (2048, 2)
    np.testing.assert_allclose(u[0], [0.0531, -0.0313])
    np.testing.assert_allclose(y[0], [0.0495, 0.0342])


def test_subspace_model_of_low_order():
    program = load("cd-arm/identification", highest_order=6)
    assert program.orders == (2, 4, 6)
    solution = solve(program, method="subspace")
    assert solution.certificate.holds
    metrics = program.metrics(solution.answer)
    assert metrics["fit_one_step_y1"] > 85
    assert metrics["fit_free_run_y2"] > 75


@pytest.fixture(scope="module")
def model():
    program = load("cd-arm/identification")
    return program, solve(program)


@pytest.mark.slow
def test_prediction_error_models(model):
    program, solution = model
    assert solution.certificate.holds
    metrics = program.metrics(solution.answer)
    assert metrics["order"] == metrics["order_free_run"] == 14
    assert metrics["fit_one_step_y1"] > 96
    assert metrics["fit_one_step_y2"] > 94
    assert metrics["fit_free_run_y1"] > 74
    assert metrics["fit_free_run_y2"] > 82


@pytest.mark.slow
def test_every_fit_is_at_least_as_good_as_the_package(model):
    pytest.importorskip("sippy_unipi")
    program, solution = model
    compared = solve(PeerComparison(program, solution.answer))
    assert compared.certificate.holds


@pytest.mark.cases(0)
def test_package_finds_a_model():
    pytest.importorskip("sippy_unipi")
    program = load("cd-arm/identification", highest_order=4)
    assert np.isfinite(program.validate(fit("CVA", 15, 4))).all()


def test_without_the_package(monkeypatch):
    monkeypatch.setitem(sys.modules, "sippy_unipi", None)
    with pytest.raises(InputError, match=r"pip install 'robust-workbench\[benchmark\]'"):
        fit("CVA", 15, 4)
