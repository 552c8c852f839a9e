"""The problem of two failing actuators: certified, and checks that can fail."""

import numpy as np
import pytest
from workbench.plants.textbook.fault_detection import detection
from workbench.plants.textbook.fault_examples import YUAN_ROWS

import workbench as wb


@pytest.fixture(scope="module")
def solved():
    study = detection(frequencies=30)
    return study, wb.solve(study)


@pytest.mark.cases(0)
def test_it_is_certified_and_agrees_with_the_literature(solved):
    study, solution = solved
    assert solution.certificate.holds, solution.certificate
    found = study.metrics(solution.answer)
    assert found["rows_weak"] == YUAN_ROWS["weak"]
    assert found["rows_strong"] == YUAN_ROWS["strong"]
    assert found["norm"] - found["bound"] < 2e-3
    assert found["norm_exact"] > 2 * found["norm"]
    assert found["fault_gain_exact"] == pytest.approx(1.0)


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("name", "place", "failing"),
    [
        ("exact_D", (0, 0), "decoupling exact"),
        ("approximate_D", (0, 3), "decoupling approximate"),
        ("exact_A", (0, 1), "poles exact"),
        ("example_B", (0, 1), "example 5.4"),
    ],
)
def test_another_generator_fails(solved, name, place, failing):
    study, solution = solved
    spoilt = solution.answer.copy(deep=True)
    values = spoilt[name].values.copy()
    values[place] += 1e3 if name == "exact_A" else 1e-3
    spoilt[name] = (spoilt[name].dims, values)
    assert any(text.startswith(failing) for text in study.certify(spoilt, 1e-6).failures)


def test_a_smaller_norm_is_not_believed(solved):
    study, solution = solved
    spoilt = solution.answer.copy(deep=True)
    spoilt["norm"] = 0.99 * spoilt["norm"]
    assert not study.certify(spoilt, 1e-6).valid


def test_controls_reach_residuals_only_where_the_plant_is_another(solved):
    _, solution = solved
    step = solution.answer["step"].sel(input=["u1", "u2"])
    assert np.abs(step.sel(curve="nominal")).max() < 1e-6
    assert np.abs(step.sel(curve="most")).max() > 0.1
