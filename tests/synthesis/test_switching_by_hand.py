"""Inequalities of switched systems of one state, where P is a number, decided by hand."""

import numpy as np
import pytest

from workbench.synthesis import Dwell, Mode, SwitchedStability

THREE = SwitchedStability(
    (
        Mode("a", [[0.5]], shortest_samples=None),
        Mode("b", [[0.8]], shortest_samples=1),
        Mode("c", [[1.1]], shortest_samples=1, longest_samples=2),
    )
)
"""a: 0.25^n (p_b, p_c) < p_a; b: 0.64 (p_a, p_c) < p_b; c: 1.21 and 1.4641 (p_a, p_b) < p_c."""
PLANTS = SwitchedStability(
    (
        Mode("a", [[[0.9]], [[0.5]]], shortest_samples=None),
        Mode("b", [[[1.0]], [[0.25]]], shortest_samples=1, longest_samples=1),
    )
)
"""Of the first plant: 0.81 p_b < p_a and p_a < p_b."""


def failed(program, samples, *P):
    answer = Dwell(samples, np.array(P, dtype=float).reshape(len(P), 1, 1))
    return {check.name for check in program.checks(answer, 1e-6) if not check.holds}


@pytest.mark.parametrize(
    ("P", "fails"),
    [
        ((1.0, 1.0, 1.5), set()),
        ((1.0, 1.0, 1.46), {"c, entries"}),  # after two samples
        ((1.0, 1.0, 1.2), {"c, entries"}),
        ((1.0, 0.95, 1.5), {"b, entries"}),  # from c
        ((1.6, 1.0, 2.5), {"b, entries"}),  # from both
        ((0.3, 1.0, 1.5), {"a, entries"}),
        ((1.0, -1.0, 1.5), {"positive"}),
    ],
)
def test_every_mode_is_entered_lower_from_every_other(P, fails):
    assert failed(THREE, 1, *P) == fails


def test_a_longer_dwell_is_easier():
    assert failed(THREE, 2, 0.3, 1.0, 1.5) == set()
    assert failed(THREE, 0, 1.0, 1.0, 1.5) == {"dimensions"}


def test_v_may_not_stay_as_it_is():
    """0.25 * 4 = 1, exactly."""
    two = SwitchedStability(
        (
            Mode("a", [[0.5]], shortest_samples=None),
            Mode("b", [[1.5]], shortest_samples=1, longest_samples=1),
        )
    )
    assert failed(two, 1, 1.0, 3.9) == set()
    assert failed(two, 1, 1.0, 4.0) == {"a, entries"}


@pytest.mark.parametrize(("P", "fails"), [((1.0, 1.1), set()), ((1.0, 1.3), {"a, entries"})])
def test_every_plant_counts(P, fails):
    assert failed(PLANTS, 1, *P) == fails
    swapped = (
        Mode(
            one.name,
            one.A[::-1],
            shortest_samples=one.shortest_samples,
            longest_samples=one.longest_samples,
        )
        for one in PLANTS.modes
    )
    assert failed(SwitchedStability(tuple(swapped)), 1, *P) == fails


@pytest.mark.parametrize(
    ("shear", "rate", "fails"),
    [(0.7, None, set()), (0.7, 0.8, {"a, decay"}), (2.0, None, {"a, decay"})],
)
def test_a_mode_without_a_longest_stay_falls_in_every_sample(shear, rate, fails):
    """With P = I, |A| is 0.96 for a shear of 0.7; over the rate it is above 1."""
    A = np.array([[0.5, shear], [0.0, 0.5]])
    modes = (
        Mode("a", A, shortest_samples=None, rate=rate),
        Mode("b", 0.1 * np.eye(2), shortest_samples=1, longest_samples=3),
    )
    program = SwitchedStability(modes)
    answer = Dwell(20, np.stack([np.eye(2), 0.9 * np.eye(2)]))
    checks = program.checks(answer, 1e-6)
    assert {check.name for check in checks if not check.holds} == fails
    assert [check.name for check in checks if "decay" in check.name] == ["a, decay"]


def test_both_sought_modes_keep_the_dwell_of_an_unstable_switching():
    """The dwell of two stays is the shorter of both: the longest of those that grow."""
    one, other = np.array([[0.9, 0.0], [4.0, 0.9]]), np.array([[0.9, 4.0], [0.0, 0.9]])
    program = SwitchedStability(
        (Mode("a", one, shortest_samples=None), Mode("b", other, shortest_samples=None))
    )
    found, _ = program.destabilising
    stays = np.arange(1, 200)
    unstable = [
        min(n, m)
        for n in stays
        for m in (n, n + 1)
        if np.abs(
            np.linalg.eigvals(np.linalg.matrix_power(one, n) @ np.linalg.matrix_power(other, m))
        ).max()
        > 1
    ]
    assert found == max(unstable)


@pytest.mark.parametrize(("less", "found"), [(1e-7, 0), (-1e-7, 1)])
def test_what_decays_slowly_does_not_grow(less, found):
    """One sample of each: an eigenvalue of 0.5 * 2 (1 - less), and a norm above 1."""
    other = Mode(
        "b",
        2.0 * (1 - less) * np.array([[1.0, 0.3], [0.0, 0.5]]),
        shortest_samples=1,
        longest_samples=1,
    )
    program = SwitchedStability((Mode("a", 0.5 * np.eye(2), shortest_samples=None), other))
    assert program.destabilising[0] == found
