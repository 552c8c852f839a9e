"""Dwell times by descent: closed forms, the published example, agreement with the conic solvers."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from test_switched_stability import geromel_colaneri

import workbench as wb
from workbench.program import methods
from workbench.synthesis import Mode, SwitchedStability
from workbench.synthesis.switching.descent import Inequalities, _p_norm


def drawn(seed, states=3, plants=1, longest=6):
    """A stable mode whose dwell is sought, and one that may grow while it lasts."""
    rng = np.random.default_rng(seed)
    stable, other = rng.normal(size=(2, plants, states, states))
    stable *= 0.9 / np.abs(np.linalg.eigvals(stable)).max(axis=1)[:, None, None]
    other *= 1.05 / np.abs(np.linalg.eigvals(other)).max(axis=1)[:, None, None]
    return SwitchedStability(
        (
            Mode("in", stable, shortest_samples=None),
            Mode("out", other, shortest_samples=1, longest_samples=longest),
        ),
        limit_samples=1000,
    )


@pytest.mark.parametrize(("step", "dwell"), [(0.5, 6), (0.04, 69)])
def test_published_example(step, dwell):
    solution = wb.solve(geromel_colaneri(step), method="descent")
    assert solution.certificate.valid
    assert solution.answer.samples == dwell


@pytest.mark.cases(0)
@settings(max_examples=8, deadline=None)
@given(st.integers(0, 10**6), st.integers(2, 4), st.integers(1, 2))
def test_it_agrees_with_linear_matrix_inequalities(seed, states, plants):
    """Both are proven; what one misses is a matter of its accuracy, one sample of these."""
    program = drawn(seed, states, plants)
    found = {name: wb.solve(program, method=name) for name in ("descent", "clarabel")}
    if found["clarabel"].answer is None:  # two plants may have no function in common
        assert found["descent"].answer is None
        return
    assert all(one.certificate.valid for one in found.values())
    dwell = {name: one.answer.samples for name, one in found.items()}
    assert abs(dwell["descent"] - dwell["clarabel"]) <= 1, dwell


def test_the_gradient_is_exact():
    rng = np.random.default_rng(0)
    held = Inequalities(
        rng.normal(size=(4, 3, 3)), np.array([0, 1, 0, 1]), np.array([1, 0, 0, 1]),
        np.array([1.0, 1.0, 0.2, 0.05]),
    )  # fmt: skip
    R = np.triu(rng.normal(size=(2, 3, 3))) + 2 * np.eye(3)
    for power in (1, 8):
        _, gradient, _ = _p_norm(held, R, power)
        for place in np.ndindex(R.shape):
            move = np.zeros(R.shape)
            move[place] = 1e-6
            up, down = (_p_norm(held, R + sign * move, power)[0] for sign in (1, -1))
            assert (up - down) / 2e-6 == pytest.approx(gradient[place], rel=1e-5, abs=1e-6)


def test_the_norm_is_above_the_largest_and_approaches_it():
    rng = np.random.default_rng(1)
    held = Inequalities(rng.normal(size=(5, 2, 2)), np.zeros(5, int), np.zeros(5, int), np.ones(5))
    R = np.eye(2)[None]
    largest = 2 * np.log(np.linalg.norm(held.A, 2, axis=(1, 2)).max())
    values = [_p_norm(held, R, power) for power in (1, 4, 16, 64)]
    assert all(worst == pytest.approx(largest) for _, _, worst in values)
    above = [value - largest for value, _, _ in values]
    assert all(0 <= finer <= coarser for coarser, finer in pairwise(above))
    assert above[-1] < 0.05


@pytest.mark.parametrize("unit", [1e-8, 1e8])
def test_units_of_a_state_do_not_matter(unit):
    clean = np.array([[0.9, 0.0], [unit, 0.2]])
    defect = np.array([[0.9, 0.3 / unit], [unit, 0.2]])
    program = SwitchedStability(
        (
            Mode("clean", clean, shortest_samples=None),
            Mode("defect", defect, shortest_samples=1, longest_samples=6),
        )
    )
    solution = wb.solve(program, method="descent")
    assert solution.certificate.valid
    assert solution.answer.samples == wb.solve(program, method="clarabel").answer.samples


def test_a_rate_is_kept():
    plants = np.array([[[0.9, 0.1], [0.0, 0.8]], [[0.85, -0.1], [0.1, 0.8]]])
    grows = np.stack([1.1 * np.eye(2)] * 2)
    program = SwitchedStability(
        (
            Mode("in", plants, shortest_samples=None, rate=0.95),
            Mode("out", grows, shortest_samples=1, longest_samples=3),
        )
    )
    solution = wb.solve(program, method="descent")
    assert solution.certificate.valid
    assert solution.answer.samples == wb.solve(program, method="clarabel").answer.samples


def test_what_it_cannot_prove_is_a_failure_that_says_so():
    program = SwitchedStability(
        (
            Mode("in", [[0.99]], shortest_samples=None),
            Mode("out", [[2.0]], shortest_samples=1, longest_samples=9),
        ),
        limit_samples=20,
    )
    solution = wb.solve(program, method="descent")
    assert solution.answer is None
    assert solution.outcome is wb.Outcome.FAILED
    assert "no dwell up to 20 samples" in solution.message


def test_three_really_different_methods_are_there():
    assert {"clarabel", "scs", "descent"} <= set(methods(SwitchedStability))
