"""From one estimate to mu: three sets, their controllers, and how often they hold the truth."""

from types import SimpleNamespace

import control
import numpy as np
import pytest
from workbench.plants.textbook.estimate_regions import FORMS, EstimateRegions
from workbench.plants.textbook.estimate_to_mu import (
    TRUE_PLANT,
    estimate_to_mu,
    noisy_estimate,
    region_of,
    weighted_loop,
)

import workbench as wb
from workbench.synthesis import HinfSynthesis
from workbench.uncertainty import EstimateRegion


@pytest.fixture(scope="module")
def solved():
    """The study with H-infinity controllers of the estimate in place of the mu controllers."""
    estimate = EstimateRegion(noisy_estimate(0.2, 0))
    K = wb.solve(HinfSynthesis(weighted_loop(estimate))).answer.K
    designs = {form: SimpleNamespace(answer=SimpleNamespace(K=K)) for form in FORMS}
    study = EstimateRegions(designs, 0.2, 0.95, 0, 10)
    return study, wb.solve(study)


@pytest.mark.slow
def test_three_sets_three_designs_and_the_truth(solved):
    study, solution = solved
    assert solution.certificate.holds, solution
    answer = solution.answer
    assert (answer["true_gain"] <= answer["gain"].sel(shape="ball").max("member") * 1.01).all()
    upper = answer["peak"].sel(bound="upper")
    assert (answer["gain"].sel(shape="ball").max("member") <= upper.sel(region="ball")).all()
    assert set(study.figures(answer)) == {"regions"}
    assert "needed size" in next(iter(study.tables(answer).values()))


@pytest.mark.slow
def test_wrong_numbers_are_rejected(solved):
    study, answer = solved[0], solved[1].answer
    for wrong in (
        answer.assign(peak=0.5 * answer["peak"]),
        answer.assign(peak=answer["peak"] * np.array([0.9, 1.0])),
        answer.assign(needed=3.0 * answer["needed"]),
    ):
        assert not study.certify(wrong, 1e-6).holds


@pytest.mark.slow
@pytest.mark.parametrize("form", FORMS)
def test_a_controller_for_the_set_is_certified_and_stabilises_the_truth(form):
    solution = wb.solve(estimate_to_mu(form), method="dk")
    assert solution.certificate.valid, solution
    assert solution.answer.upper < 0.85
    parts = TRUE_PLANT.state_space()
    plant = control.ss(parts.A, parts.B, parts.C, parts.D)
    assert control.feedback(plant, solution.answer.K).poles().real.max() < 0


@pytest.mark.parametrize("form", FORMS)
def test_every_form_is_a_block_with_the_estimate_in_its_middle(form):
    estimate = noisy_estimate(0.2, 1)
    part = region_of(estimate, form, 0.9)
    omega = np.geomspace(0.1, 10.0, 20)
    nominal = estimate.model.response(omega)[:, 0, 0]
    np.testing.assert_allclose(part.lti(1j * omega), nominal, rtol=1e-8)
    assert weighted_loop(part).structure == part.structure
