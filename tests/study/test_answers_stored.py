"""Answers of functions in a Study: stored, restored, and certified as part of it."""

from dataclasses import dataclass

import control
import numpy as np
import pytest

from workbench import solve
from workbench.errors import InputError
from workbench.geometry import SmallestCircle, smallest_circle
from workbench.mu import PeakChecker, WorstCaseChecker, nu_gap, peak, worst_case_gain
from workbench.structure import Complex, Structure
from workbench.study import Study, answers, array, dim, part
from workbench.study.packing import unpacked_datasets
from workbench.synthesis import LoopWeights, least_mu

N = control.ss(-np.eye(2), np.eye(2), [[0.5, 0.1], [0.1, 0.5]], np.zeros((2, 2)))
WHOLE, ONE = Structure([Complex(1), Complex(1)]), Structure([Complex(1)])
POINTS = [0.0, 1.0, 1j]
WEIGHTS = LoopWeights(*np.array([[0.5], [0.2], [0.1]]), np.array([0.3 + 0j]))


@dataclass(frozen=True)
class Everything(Study):
    """One answer of each kind that is stored."""

    bound = dim("lower", "upper")

    @part
    def system(self):
        return N

    @answers
    def found(self, system):
        return {
            "peak": peak(system, WHOLE),
            ("gain", 1): worst_case_gain(system, ONE),
            "circle": smallest_circle(POINTS),
            "least": least_mu(WEIGHTS),
            "missing": None,
        }

    @found.checkers
    def of_the_data(self, system):
        return {
            "peak": PeakChecker(system, WHOLE),
            ("gain", 1): WorstCaseChecker(system, ONE),
            "circle": SmallestCircle(POINTS),
            "least": least_mu(WEIGHTS)._checked_by[0],
            "missing": PeakChecker(system, WHOLE),
        }

    height = array(
        dims=bound,
        unit="1",
        meaning="bounds",
        value=lambda found: [found["peak"].lower, found["peak"].upper],
    )


@pytest.fixture(scope="module")
def solved():
    study = Everything()
    return study, solve(study)


def test_their_certificates_are_part_of_the_study_s(solved):
    _, solution = solved
    assert solution.holds, solution.certificate.failures
    names = {check.name for check in solution.certificate.checks}
    assert {"found: upper", "found: containment", "found: lower"} <= names
    opinions = {check.name for check in solution.certificate.checks if check.opinion}
    assert {"found: nearly singular", "found: drawn"} <= opinions
    assert all(check.over for check in solution.certificate.checks)


def _failures(study, answer):
    return [one for one in study.certify(answer, 1e-6).checks if not one.holds]


SPOILT = {"bounds": ("peak", 0.98), "radius": ("circle", 0.98), "lower": ("least", 1.02)}


@pytest.mark.parametrize("name", SPOILT)
def test_a_claim_that_is_too_good_fails(solved, name):
    study, solution = solved
    spoilt = solution.answer.copy(deep=True)
    spoilt[f"found_{name}"] = spoilt[f"found_{name}"] * SPOILT[name][1]
    failures = _failures(study, spoilt)
    assert any(check.where.startswith(SPOILT[name][0]) for check in failures)
    assert study.certify(solution.answer.copy(deep=True), 1e-6).holds


def test_answers_that_are_worse_than_the_arrays_made_of_them_fail(solved):
    study, solution = solved
    spoilt = solution.answer.copy(deep=True)
    spoilt["found_bounds"] = spoilt["found_bounds"] * np.tile([0.9, 1.1], 2)
    (failure,) = _failures(study, spoilt)
    assert (failure.name, failure.where) == ("arrays of answers", "height")


def test_a_restored_answer_is_the_one_that_was_found(solved):
    _, solution = solved
    stored = unpacked_datasets("found", solution.answer)
    assert list(stored) == ["peak", "gain 1", "circle", "least"]
    again = PeakChecker(N, WHOLE).restored_answer("found", stored["peak"])
    assert [again.lower, again.upper] == solution.answer["height"].values.tolist()
    circle = SmallestCircle(POINTS).restored_answer("found", stored["circle"])
    assert circle.radius == smallest_circle(POINTS).radius


def test_what_cannot_be_stored_is_named():
    lag = control.ss(-1.0, 1.0, 1.0, 0.0)

    def study(answer, checker):
        class Wrong(Study):
            """One answer."""

            @answers
            def found(self):
                return answer

            if checker is not None:
                of_it = found.checkers(lambda: checker)

        return Wrong()

    gap = nu_gap(lag, lag)
    for answer, checker, words in (
        ({"a": gap}, None, "need @found.checkers"),
        ({"a": gap}, {"a": gap._checked_by[0]}, "a NuGap cannot be stored in a Study"),
        ({"a": 1.0}, {"a": SmallestCircle(POINTS)}, "gave a float for 'a'; it needs an Answer"),
        ({"a": gap}, {"b": SmallestCircle(POINTS)}, "no checker for 'a'; there are 'b'"),
    ):
        with pytest.raises(InputError, match=words):
            study(answer, checker).compute(None)
