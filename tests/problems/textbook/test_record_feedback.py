"""Feedback from records of an unstable plant, and what the records must be like."""

import numpy as np
import pytest
from workbench.plants.textbook.record_feedback import A, B, record_feedback
from workbench.plants.textbook.record_lengths import RADII, record_lengths

import workbench as wb


@pytest.fixture(scope="module")
def solved():
    study = record_lengths(draws=1)
    return study, wb.solve(study)


@pytest.mark.cases(1)
@pytest.mark.parametrize("criterion", ["decay", "h2", "hinf"])
def test_the_gain_stabilises_the_plant_that_made_the_record(criterion):
    for draw in range(3):
        solution = wb.solve(record_feedback(criterion, draw=draw))
        assert solution.certificate.valid, solution
        assert np.abs(np.linalg.eigvals(A + B @ solution.answer.K)).max() < 1


@pytest.mark.cases(0)
def test_what_is_known_of_the_noise_matters_more_than_its_length(solved):
    solution = solved[1]
    assert solution.certificate.holds
    level = solution.answer["level"]
    assert level.sel(known="each sample", radius=RADII[-1]).isnull().all()
    long, short = (level.isel(experiments=k, draw=0) for k in (-1, 0))
    energy, sample = (level.sel(known=known) for known in ("energy", "each sample"))
    assert (energy < sample).where(sample.notnull(), True).all()
    assert (long.sel(known="energy") < short.sel(known="energy")).all()


@pytest.mark.cases(0)
def test_wrong_norms_and_verdicts_are_rejected(solved):
    study, answer = solved[0], solved[1].answer
    assert study.certify(answer, 1e-6).holds
    for wrong in (
        answer.assign(level=0.9 * answer["level"]),
        answer.assign(true_norm=2 * answer["true_norm"]),
        answer.assign(verdict=-answer["verdict"]),
    ):
        assert not study.certify(wrong, 1e-6).holds
