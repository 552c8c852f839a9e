"""A plant of two channels, covered by one matrix Delta, beside what the package dkpy finds."""

import numpy as np
import pytest

import workbench as wb
from workbench.uncertainty import MatrixCover, MatrixResponses
from workbench.uncertainty.matrix_covers.sets.program import MatrixSets


@pytest.fixture(scope="module")
def solution():
    return wb.solve(wb.load("two-by-two/matrix-cover", plants=6, frequencies=40))


@pytest.mark.slow
def test_the_certificate_holds_at_every_frequency(solution):
    assert solution.certificate.holds, solution.certificate
    assert any("every frequency" in check.over for check in solution.certificate.checks)


@pytest.mark.slow
def test_the_weights_come_near_the_smallest_sets_of_any_order(solution):
    metrics = solution.task.metrics(solution.answer)
    assert 1.0 <= metrics["inflation_mean"] <= 1.15
    assert metrics["least_gap"] <= 1e-6


@pytest.mark.slow
@pytest.mark.parametrize("form", ["additive", "output", "inverse-additive"])
def test_sets_and_weights_are_smaller_than_those_of_dkpy_on_its_own_example(form):
    """The same least traces; with fewer poles, smaller sets in the mean (by 5 to 12 %)."""
    dkpy = pytest.importorskip("dkpy")
    example = dkpy.example_multimodel_uncertainty()
    omega = np.asarray(example["omega"])
    plants = example["complex_response_offnominal_list"]
    values = np.moveaxis(np.asarray(plants), 0, 1)
    program = MatrixCover(
        MatrixResponses(omega, values),
        example["system_nominal"],
        form=form,
        left_order=4,
        right_order=3,
    )
    kind = {"output": "multiplicative_output"}.get(form, form.replace("-", "_"))
    nominal = example["complex_response_nominal"]
    residuals = dkpy.compute_uncertainty_residual_response(nominal, plants, {kind})[kind]
    W = dkpy.compute_uncertainty_weight_response(residuals, "diagonal", "diagonal")

    traces = MatrixSets(program.deviations, left="diagonal", right="diagonal", size="trace")
    found = wb.solve(traces)
    theirs = np.prod([np.linalg.norm(each, axis=(1, 2)) / np.sqrt(2) for each in W], axis=0)
    np.testing.assert_allclose(traces.sizes(found.answer), theirs, rtol=1e-5)

    fitted = [
        dkpy.fit_uncertainty_weight(each, omega, o)
        for each, o in zip(W, ([4, 5], [3, 5]), strict=True)
    ]
    logs = [
        np.log(np.abs(np.linalg.det(np.moveaxis(each(1j * omega), -1, 0)))) / 2 for each in fitted
    ]
    ours = wb.solve(program)
    assert ours.certificate.holds
    radius = np.exp(program.responses.shares @ sum(logs))
    assert program.metrics(ours.answer)["radius_mean"] <= 0.97 * radius
