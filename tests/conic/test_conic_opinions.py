"""Proofs of conic programs are tried in fractions; no large row excuses a small one."""

import numpy as np
import pytest
import xarray as xr

import workbench as wb
from workbench.conic import ConeFactor, ConeKind, ConicForm, ConicProgram, claims
from workbench.conic import program as programs
from workbench.second_opinion import conic_proofs

NONNEGATIVE = (ConeFactor(ConeKind.NONNEGATIVE, 2),)


def test_a_large_row_excuses_no_small_one():
    """x >= 1e12 beside y >= 1: y = 0 is no solution."""
    form = ConicForm([1.0, 1.0], -np.eye(2), [-1e12, -1.0], NONNEGATIVE)
    program = ConicProgram(form)
    wrong = xr.Dataset({"x": ("column", [1e12, 0.0])})
    assert not program.checks(wrong, 1e-6)[0].holds
    assert not program.certify(wrong, 1e-6).valid
    assert program.certify(xr.Dataset({"x": ("column", [1e12, 1.0])}), 1e-6).valid


def optimal():
    """A bounded program of each kind of cone, solved."""
    form = ConicForm(
        [1.0, 0.0],
        [[-1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0], [0.0, 0.0]],
        [-2.0, 5.0, 0.0, 0.0, 1.0],
        (*NONNEGATIVE, ConeFactor(ConeKind.SECOND_ORDER, 3)),
    )
    return wb.solve(ConicProgram(form), method="clarabel")


def infeasible():
    form = ConicForm([1.0], [[-1.0], [1.0]], [-2.0, 1.0], NONNEGATIVE)
    return wb.solve(ConicProgram(form), method="clarabel")


def unbounded():
    form = ConicForm([-1.0], [[-1.0], [0.0]], [0.0, 1.0], NONNEGATIVE)
    return wb.solve(ConicProgram(form), method="clarabel")


@pytest.mark.parametrize("case", [optimal, infeasible, unbounded])
def test_honest_proofs_hold_by_both(case):
    solution = case()
    assert solution.holds, solution.certificate
    assert any(check.opinion for check in solution.certificate.checks)


def test_a_kernel_that_forgets_the_residual_is_found(monkeypatch):
    """A'y is taken as 0: a ray that separates nothing passes the kernel, not the opinion."""
    monkeypatch.setattr(claims, "excluded_radius", lambda form, y: float("inf"))
    form = ConicForm([1.0], [[-1.0], [1.0]], [-2.0, 1.0], NONNEGATIVE)
    certificate = claims.NoSolution(form).certify({"y": [2, 1]}, 0.0)
    failed = {check.name for check in certificate.checks if not check.holds}
    assert failed == {"separation in fractions"}


def test_a_kernel_that_turns_the_sign_of_the_bound_is_found(monkeypatch):
    program, answer = optimal().task, optimal().answer
    honest = programs.dual_bound
    monkeypatch.setattr(programs, "dual_bound", lambda form, y: -honest(form, y))
    failed = {check.name for check in program.second_opinion(answer) if not check.holds}
    assert failed == {"weak duality"}


def test_a_dual_point_that_is_none_is_found():
    program, answer = optimal().task, optimal().answer
    text = [str(value) for value in answer["dual"].values]
    text[0] = "7/3"
    wrong = answer.assign(dual=("row", text))
    names = {check.name for check in program.second_opinion(wrong) if not check.holds}
    assert "A'y in fractions" in names


def test_a_ray_that_rises_or_leaves_is_found():
    solution = unbounded()
    program, x, ray = solution.proof, solution.answer["x"], solution.answer["ray"]
    assert program.second_opinion({"x": x, "ray": ray})[0].holds
    assert not program.second_opinion({"x": x, "ray": [-value for value in ray]})[0].holds
    assert not program.second_opinion({"x": [value - 10**9 for value in x], "ray": ray})[0].holds


CONES = (
    ConeFactor(ConeKind.ZERO, 1),
    ConeFactor(ConeKind.NONNEGATIVE, 2),
    ConeFactor(ConeKind.SECOND_ORDER, 3),
    ConeFactor(ConeKind.SEMIDEFINITE, 2),
)
BORDER = np.array([0.0, 0.5, 0.0, 1.5, 0.9, 1.2, 1.0, 0.5, 0.25])
"""A slack on the border of each cone."""


@pytest.mark.parametrize("row", [None, 0, 2, 3, 6, 8])
def test_an_answer_without_a_dual_point_has_a_second_opinion(row):
    """A row moved out of its cone is found from fractions, by as much as the kernel says."""
    rng = np.random.default_rng(1)
    A, x = rng.normal(size=(BORDER.size, 4)), rng.normal(size=4)
    moved = BORDER - (0.0 if row is None else 1e-3 * np.eye(BORDER.size)[row])
    program = ConicProgram(ConicForm(rng.normal(size=4), A, A @ x + moved, CONES))
    answer = xr.Dataset({"x": ("column", x)})
    outside = program.checks(answer, 1.0)[0].value
    (check,) = program.second_opinion(answer)
    assert check.holds and (outside > 1e-5) is (row is not None)
    found = conic_proofs.inside(program.form, x, 0.0)
    assert found.value == pytest.approx(max(outside, 0.0), abs=1e-12)
