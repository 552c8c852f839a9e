"""Variants of the stadiums: their checks can fail, and the stored costs are those of the covers."""

from types import SimpleNamespace

import numpy as np
import pytest
from workbench.plants.cd_drive.control.cover_variants import VARIANTS, CoverVariants, needs

import workbench as wb


@pytest.fixture(scope="module")
def solved(covered):
    """One cover in place of all three: nothing costs anything then."""
    cover, answer = covered("focus", "stadium", "steps")
    run = SimpleNamespace(data=cover.to_dataset(answer), task=cover)
    study = CoverVariants("focus", dict.fromkeys(VARIANTS, run))
    return study, wb.solve(study)


@pytest.mark.cases(0)
def test_the_same_cover_costs_nothing(solved):
    study, solution = solved
    numbers = study.metrics(solution.answer)
    for name in ("minimum_phase", "extrapolated"):
        assert numbers[f"peak_{name}"] == pytest.approx(numbers["peak_default"], rel=1e-9)
        assert numbers[f"width_over_default_{name}"] == 1.0
    assert numbers["peak_lower_default"] <= numbers["peak_default"]
    assert numbers["fitted_length_peak_default"] > 0.1


def test_a_cover_that_is_not_of_minimum_phase_fails(solved):
    """The default cover has zeros on the right."""
    failed = [check.name for check in solved[1].certificate.checks if not check.holds]
    assert failed == ["minimum phase"]


def test_wrong_numbers_are_rejected(solved):
    study, answer = solved[0], solved[1].answer
    for wrong, name in (
        (answer.assign(mu=1.01 * answer["mu"]), "curves"),
        (answer.assign(peak=answer["peak"] * np.array([1.01, 1.0])), "peaks"),
    ):
        failed = {check.name for check in study.certify(wrong, 1e-6).checks if not check.holds}
        assert name in failed


def test_its_table_and_figure_show_every_variant(solved):
    study, solution = solved
    assert all(f"| {name}" in study.tables(solution.answer)["costs"] for name in VARIANTS)
    drawn = study.figures(solution.answer)["curves"]
    assert all(len(panel.lines) >= len(VARIANTS) for panel in drawn.axes)


def test_its_needs_differ_in_one_parameter_each():
    every = needs("focus", frequencies=50, content=0.8)
    assert [*every] == ["default", "minimum_phase", "extrapolated"]
    assert every["minimum_phase"].parameters["minimum_phase"] is True
    assert every["extrapolated"].parameters["content"] == 0.8
