"""Mixed and complex mu of the two masses."""

import numpy as np
import pytest
from workbench.plants.mass_spring.analysis import KINDS, QUESTIONS
from workbench.plants.mass_spring.equations import characteristic_roots, real_spring_mu


@pytest.fixture(scope="module")
def solved(answered):
    return answered("mass-spring/analysis")


def failures(study, answer):
    return {check.name for check in study.checks(answer, 1e-6) if not check.holds}


def test_the_certificate_holds(solved):
    _, solution = solved
    assert solution.certificate.failures == ()


def test_peaks_are_certified_closely(solved):
    study, solution = solved
    numbers = study.metrics(solution.answer)
    for kind in KINDS:
        for after in ("", "_stability"):
            low, high = (numbers[f"{name}_{kind}{after}"] for name in ("peak_lower", "peak"))
            assert low <= high <= low * (1 + 5e-3)
    assert numbers["peak_mixed"] <= numbers["peak_complex"] * (1 + 1e-3)


def test_a_real_spring_is_robustly_stable_and_a_complex_one_is_not(solved):
    study, solution = solved
    numbers = study.metrics(solution.answer)
    # A spring of 2 + 0.8 delta is gone at delta = -2.5, and the free mass with it.
    assert numbers["peak_lower_mixed_stability"] == pytest.approx(1 / 2.5, rel=1e-9)
    assert numbers["frequency_mixed_stability_rad_s"] == 0.0
    assert numbers["peak_lower_complex_stability"] > 1


def test_springs_beyond_the_margin_are_unstable():
    assert characteristic_roots(-2.4).real.max() < 0 < characteristic_roots(-2.6).real.max()


def test_mu_of_a_real_spring_is_below_that_of_a_complex_one(solved):
    _, solution = solved
    omega = solution.answer["peer_omega"].values
    complex_ = solution.answer["upper"].sel(question="stability", kind="complex", omega=omega)
    assert (real_spring_mu(omega) <= complex_.values * (1 + 1e-9)).all()


@pytest.mark.cases(2)
@pytest.mark.parametrize(
    ("name", "factor", "failing"),
    [
        ("lower", 1.1, "lower below upper"),
        ("peer", 0.9, "conic bounds"),
        ("peer", 1.1, "conic bounds of performance"),
        ("peak", 0.9, "peaks"),
        ("Delta", 0.9, "singular"),
        ("upper", 0.9, "never below mu"),
        ("upper", 1.1, "exact"),
        ("pole", 1.1, "rightmost pole"),
    ],
)
def test_what_is_wrong_is_found(solved, name, factor, failing):
    study, solution = solved
    answer = solution.answer.copy(deep=True)
    answer[name] = answer[name] * factor
    assert failing in failures(study, answer)


def test_a_mixed_bound_above_the_complex_one_is_found(solved):
    study, solution = solved
    answer = solution.answer.copy(deep=True)
    answer["upper"].loc[{"kind": "mixed"}] *= 1.1
    assert "real below complex" in failures(study, answer)


def test_the_run_is_stored_and_shown(solved):
    study, solution = solved
    stored = study.from_dataset(study.to_dataset(solution.answer))
    assert all(check.holds for check in study.checks(stored, 1e-6))
    assert stored.sizes["question"] == len(QUESTIONS)
    assert np.isfinite(stored["Delta"]).all()
    assert study.figures(stored).keys() == {"mu"}
