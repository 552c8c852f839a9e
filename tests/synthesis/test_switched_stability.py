"""Dwell times of switched systems: closed forms, a published example, wrong input."""

import math
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import expm

import workbench as wb
from workbench.errors import InputError
from workbench.solvers import conic_solvers
from workbench.synthesis import Dwell, Mode, SwitchedStability

FIRST = np.array([[0.0, 1.0], [-10.0, -1.0]])
SECOND = np.array([[0.0, 1.0], [-0.1, -0.5]])
STABLE = np.diag([0.9, 0.5])


def geromel_colaneri(step):
    """The pair of Geromel and Colaneri (2006), sampled."""
    return SwitchedStability(
        (
            Mode("first", expm(step * FIRST), shortest_samples=None),
            Mode("second", expm(step * SECOND), shortest_samples=None),
        )
    )


@pytest.mark.parametrize("solver", [each.name for each in conic_solvers()])
def test_published_example(solver):
    solution = wb.solve(geromel_colaneri(0.5), method=solver)
    assert solution.answer.samples == 6  # as printed there for T = 0.5
    assert solution.certificate.valid
    assert solution.certificate.gap.value == pytest.approx(0.0)  # 5 samples are unstable


def test_published_example_in_continuous_time():
    answer = wb.solve(geromel_colaneri(0.04)).answer
    assert 0.04 * (answer.samples - 1) < 2.76 + 0.04  # their bound: 2.76 s
    assert 0.04 * answer.samples > 2.70  # no less is stable, they find


@pytest.mark.cases(0)
@pytest.mark.parametrize("method", [None, "descent"])
@settings(max_examples=15, deadline=None)
@given(a=st.floats(0.5, 0.97), b=st.floats(1.02, 1.5), longest=st.integers(1, 12))
def test_one_state_has_a_closed_form(method, a, b, longest):
    exact = longest * math.log(b) / -math.log(a)
    if abs(exact - round(exact)) < 1e-3:
        return
    program = SwitchedStability(
        (
            Mode("in", [[a]], shortest_samples=None),
            Mode("out", [[b]], shortest_samples=1, longest_samples=longest),
        )
    )
    solution = wb.solve(program, method=method)
    assert solution.certificate.valid
    assert solution.answer.samples == math.floor(exact) + 1
    assert program.destabilising[0] == math.floor(exact)


def test_modes_that_commute_may_switch_at_any_time():
    program = SwitchedStability(
        (
            Mode("a", STABLE, shortest_samples=None),
            Mode("b", np.diag([0.2, 0.99]), shortest_samples=1),
        )
    )
    assert wb.solve(program).answer.samples == 1
    assert program.destabilising == (0, "")


def test_one_family_of_functions_needs_as_long_as_each_plant():
    plants = [0.9, 0.8]
    each = [
        wb.solve(
            SwitchedStability(
                (
                    Mode("in", [[a]], shortest_samples=None),
                    Mode("out", [[1.1]], shortest_samples=1, longest_samples=5),
                )
            )
        )
        for a in plants
    ]
    both = wb.solve(
        SwitchedStability(
            (
                Mode("in", np.reshape(plants, (2, 1, 1)), shortest_samples=None),
                Mode("out", np.full((2, 1, 1), 1.1), shortest_samples=1, longest_samples=5),
            )
        )
    )
    assert both.answer.samples == max(one.answer.samples for one in each)


@pytest.mark.parametrize("unit", [1e-8, 1e-4, 1e4, 1e8])
def test_units_of_a_state_that_one_mode_only_uses(unit):
    """A controller that listens in one mode and acts in the other, as K' does."""

    def program(unit):
        clean = np.array([[0.9, 0.0], [unit, 0.2]])
        defect = np.array([[0.9, 0.3 / unit], [unit, 0.2]])
        return SwitchedStability(
            (
                Mode("clean", clean, shortest_samples=None),
                Mode("defect", defect, shortest_samples=1, longest_samples=6),
            )
        )

    solution = wb.solve(program(unit))
    assert solution.certificate.valid
    assert solution.answer.samples == wb.solve(program(1.0)).answer.samples > 1


def test_a_wrong_answer_fails_its_check():
    program = geromel_colaneri(0.5)
    answer = wb.solve(program).answer
    shorter = program.certify(replace(answer, samples=5), 1e-6)
    assert not shorter.valid
    assert not program.certify(Dwell(6, np.stack([np.eye(2)] * 2)), 1e-6).valid
    assert not program.certify(Dwell(6, -answer.P), 1e-6).valid
    assert not program.certify(Dwell(6, answer.P[:1]), 1e-6).valid


def test_it_is_stored_and_read_back():
    program = geromel_colaneri(0.5)
    answer = wb.solve(program).answer
    again = program.from_dataset(program.to_dataset(answer))
    assert again.samples == answer.samples
    np.testing.assert_array_equal(again.P, answer.P)
    assert set(program.figures(answer)) == {"entries"}


def test_no_dwell_within_the_limit():
    program = SwitchedStability(
        (
            Mode("in", [[0.99]], shortest_samples=None),
            Mode("out", [[2.0]], shortest_samples=1, longest_samples=9),
        ),
        limit_samples=20,
    )
    solution = wb.solve(program)
    assert solution.answer is None
    assert solution.claim is wb.Outcome.INFEASIBLE
    assert solution.outcome is wb.Outcome.NO_CLAIM


def test_with_a_rate_the_dwell_holds_for_all_of_the_hull():
    rng = np.random.default_rng(3)
    clean = np.array([[[0.9, 0.5 + d], [-0.1 + d, 0.8]] for d in (-0.05, 0.05)])
    defect = np.array([[[0.9, -0.1 + d], [0.6, 0.9 - d]] for d in (-0.05, 0.05)])
    assert abs(np.linalg.eigvals(clean[0] @ defect[0])).max() > 1.0  # some dwell is needed
    modes = (
        Mode("clean", clean, shortest_samples=None, rate=0.97),
        Mode("defect", defect, shortest_samples=1, longest_samples=4),
    )
    solution = wb.solve(SwitchedStability(modes))
    assert solution.certificate.valid, solution.certificate.failures
    P_c, P_o = solution.answer.P
    for share in rng.uniform(size=20):
        A = share * clean[0] + (1 - share) * clean[1]
        x = rng.normal(size=2)
        after = np.linalg.matrix_power(A, solution.answer.samples) @ x
        assert after @ P_o @ after < x @ P_c @ x
    single = wb.solve(SwitchedStability((Mode("clean", clean, shortest_samples=None), modes[1])))
    assert single.answer.samples <= solution.answer.samples


@pytest.mark.parametrize(
    ("modes", "words"),
    [
        (lambda: [Mode("a", STABLE, shortest_samples=None)], "two at least"),
        (
            lambda: [Mode("a", STABLE, shortest_samples=None), Mode("b", [[0.5]])],
            "same plants and states",
        ),
        (lambda: [Mode("a", STABLE), Mode("b", STABLE)], "sought"),
        (
            lambda: [Mode("a", STABLE, shortest_samples=None), Mode("b", 2 * STABLE)],
            "no longest stay",
        ),
        (
            lambda: [Mode("a", STABLE, shortest_samples=None, longest_samples=5)],
            "longest must be None",
        ),
        (lambda: [Mode("a", STABLE, shortest_samples=0)], "positive number of samples"),
        (lambda: [Mode("a", STABLE, shortest_samples=1.5)], "positive number of samples"),
        (
            lambda: [Mode("a", STABLE, shortest_samples=1, longest_samples=-3)],
            "positive number of samples",
        ),
        (lambda: [Mode("a", STABLE, shortest_samples=4, longest_samples=3)], "less than shortest"),
        (lambda: [Mode("a", [[np.nan]])], "not finite"),
        (lambda: [Mode("a", np.ones((2, 3)))], "square"),
        (lambda: [Mode("a", STABLE, rate=1.5)], "rate is 1.5"),
        (
            lambda: [Mode("a", STABLE, shortest_samples=1, longest_samples=9, rate=0.9)],
            "must have no longest stay",
        ),
        (
            lambda: [Mode("a", STABLE, shortest_samples=None, rate=0.01), Mode("b", STABLE)],
            "above the spectral",
        ),
        (lambda: [Mode("a", "nothing")], "no array"),
    ],
)
def test_wrong_input_is_named(modes, words):
    with pytest.raises(InputError, match=words):
        SwitchedStability(tuple(modes()))


def test_a_limit_must_be_positive():
    with pytest.raises(InputError, match="limit"):
        SwitchedStability(
            (Mode("a", STABLE, shortest_samples=None), Mode("b", STABLE)), limit_samples=0
        )


def turning(rng, violation, condition):
    """A mode that turns and grows by a violation in coordinates of a condition, and its V."""
    left, right = (np.linalg.qr(rng.normal(size=(2, 2)))[0] for _ in range(2))
    T = left @ np.diag([1.0, condition]) @ right
    angle = rng.uniform(0.3, 2.8)
    turn = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]])
    back = np.linalg.inv(T)
    return (1 + violation) * T @ turn @ back, T, back.T @ back


def determinant(A):
    """The exact determinant of a matrix of doubles."""
    (a, b), (c, d) = [[Fraction(float(entry)) for entry in row] for row in A]
    return a * d - b * c


@pytest.mark.parametrize("seed", range(40))
def test_what_is_exactly_unstable_is_refused_in_any_coordinates(seed):
    """A mode whose determinant is above 1 has a pole outside the circle, whatever doubles say."""
    rng = np.random.default_rng(seed)
    condition, size = 10 ** rng.uniform(4, 5), 10 ** rng.uniform(-7, -3)
    A, _, P = turning(rng, size, condition)
    stays = int(rng.integers(1, 30))
    rests = Mode("rests", (1 - 1e-9) * np.eye(2), shortest_samples=None)
    program = SwitchedStability(
        (Mode("grows", A, shortest_samples=stays, longest_samples=stays + 2), rests)
    )
    assert determinant(A) > 1
    answer = Dwell(1, np.stack([P, P]))
    assert not all(check.holds for check in program.checks(answer, 1e-6))
    assert not program.second_opinion(answer)[0].holds


@pytest.mark.cases(1)
@pytest.mark.parametrize("seed", range(20))
def test_what_is_just_stable_is_accepted_in_any_coordinates(seed):
    rng = np.random.default_rng(seed)
    A, T, P = turning(rng, -(10 ** rng.uniform(-7, -3)), 10 ** rng.uniform(2, 4))
    B = 0.9 * T @ np.diag([1.0, 0.3]) @ np.linalg.inv(T)
    program = SwitchedStability((Mode("turns", A), Mode("rests", B, shortest_samples=None)))
    certificate = program.certify(Dwell(1, np.stack([P, P])), 1e-6)
    assert certificate.valid, certificate.failures
