"""The jump of real mu, by two routes of its own."""

import numpy as np
import pytest
from workbench.plants.textbook.real_mu_jump import PARTS, SIZES, exact_mu, real_mu_jump

import workbench as wb


@pytest.fixture(scope="module")
def solved():
    study = real_mu_jump()
    return study, wb.solve(study)


def smallest(p, share, count=2001):
    """Least size of d that solves the equation but for the complex parts, on a grid."""
    c = np.array([1 + 1j * p, 1 - 3j * p])
    d = np.linspace(-1, 1, count)
    values = c[0] * d[:, None] + c[1] * d
    size = np.maximum(abs(d[:, None]), abs(d))
    left = abs(1 - values)
    enough = left <= share * abs(c).sum() * size  # what complex parts of that size make up for
    return size[enough].min()


@pytest.mark.cases(2)
@pytest.mark.parametrize("share", PARTS[1:])
@pytest.mark.parametrize("p", [0.0, 1e-3, 0.03, 0.3])
def test_the_value_by_hand_is_that_of_a_grid(p, share):
    assert exact_mu(p, share) == pytest.approx(1 / smallest(p, share), rel=5e-3)


def test_real_mu_jumps_and_a_complex_part_makes_it_continuous(solved):
    study, solution = solved
    assert solution.certificate.holds
    numbers = study.metrics(solution.answer)
    assert numbers["jump_real"] == pytest.approx(1 / 3, rel=1e-6)
    assert 0 <= numbers["jump_at_most_complex_0.01"] < 1e-3
    assert 0 <= numbers["jump_at_most_complex_0.1"] < 1e-4


def test_it_is_the_same_at_every_other_parameter(solved):
    exact = solved[1].answer["exact"].sel(complex_part=0.0)
    others = exact.where(exact["p"] != 0.0, drop=True)
    np.testing.assert_allclose(others, 4 / 3)
    assert others.size == 2 * len(SIZES)


def test_mu_grows_with_the_complex_part(solved):
    assert np.all(np.diff(solved[1].answer["exact"].sel(p=0.0).values) > 0)


def test_a_wrong_value_is_rejected(solved):
    study, answer = solved[0], solved[1].answer
    assert study.certify(answer, 1e-6).holds
    for factor in (0.99, 1.01):
        wrong = answer.assign(exact=factor * answer["exact"])
        assert not study.certify(wrong, 1e-6).holds
    apart = answer.assign(bounds=answer["bounds"] * np.array([0.9, 1.0]))
    assert not study.certify(apart, 1e-6).holds
