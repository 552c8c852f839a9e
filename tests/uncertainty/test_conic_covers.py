"""Covers by cone programs: certified, optimal for their poles, beside the two other methods."""

import numpy as np
import pytest
from scipy.optimize import minimize
from test_covers import FORMS, KINDS, NOMINAL, OMEGA, assert_covers, family, program_of

import workbench as wb
from workbench.errors import InputError
from workbench.fitting.response.numerator import NumeratorBasis, with_numerator
from workbench.program import methods
from workbench.solvers import conic_solvers
from workbench.uncertainty import Responses, StadiumCover
from workbench.uncertainty.covers.conic import ROUNDS

SOLVERS = [solver.name for solver in conic_solvers()]


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("solver", SOLVERS)
def test_a_family_is_covered_with_smaller_sets_than_by_the_steps(kind, form, solver):
    program = program_of(kind, Responses(omega=OMEGA, values=family(1)), form=form)
    solution = wb.solve(program, method=solver)
    assert_covers(program, solution)
    steps = wb.solve(program, method="steps").answer
    assert program.objective(solution.answer) < 0.9 * program.objective(steps)


@pytest.mark.cases(1)
@pytest.mark.parametrize("kind", KINDS)
def test_the_solvers_agree_on_the_nominal(kind):
    program = program_of(kind, Responses(omega=OMEGA, values=family(2)))
    found = [
        wb.solve(program, method=solver).answer.model.nominal.response(OMEGA) for solver in SOLVERS
    ]
    for other in found[1:]:
        np.testing.assert_allclose(other, found[0], rtol=1e-3)


def test_of_additive_circles_no_numerator_has_smaller_sets():
    """The cone program of circles does not depend on its start where sizes are absolute."""
    responses = Responses(omega=OMEGA, values=family(3))
    program = program_of("circle", responses, form="additive", zeros=1)
    nominal = wb.solve(program, method="clarabel").answer.model.nominal
    basis = NumeratorBasis.over(OMEGA / 30, 1 / program.unit, nominal.poles / 30, 1)

    def size(shape):
        N = with_numerator(basis, shape, nominal.poles, 30.0).response(OMEGA)
        radius = np.abs(responses.values - N[:, None]).max(axis=1) / program.unit
        return float(responses.shares @ radius**2)

    known = np.concatenate([(each(nominal.response(OMEGA)) / program.unit)
                            for each in (np.real, np.imag)])  # fmt: skip
    at = basis.columns.T @ known
    assert minimize(size, at, method="Nelder-Mead").fun > size(at) * (1 - 1e-5)


def test_a_minimum_phase_real_weight_is_kept():
    program = program_of("stadium", Responses(omega=OMEGA, values=family(4)), minimum_phase=True)
    assert_covers(program, wb.solve(program, method="clarabel"))


def test_a_given_nominal_leaves_nothing_to_choose():
    program = program_of("circle", Responses(omega=OMEGA, values=family(1)), nominal=NOMINAL)
    with pytest.raises(InputError, match="nominal is given; take steps or joint"):
        wb.solve(program, method="clarabel")


def test_a_refused_program_is_a_failure_in_the_words_of_the_solver(monkeypatch):
    from workbench.uncertainty.covers import conic

    def refuses(problem, *_):
        return wb.Outcome.FAILED, "clarabel: no"

    monkeypatch.setattr(conic, "solve_conic", refuses)
    solution = wb.solve(
        program_of("circle", Responses(omega=OMEGA, values=family(1))), method="clarabel"
    )
    assert solution.answer is None and "clarabel: no" in solution.message
    assert ROUNDS > 1


def test_three_really_different_methods_are_there():
    assert {"steps", "joint", "clarabel"} <= set(methods(StadiumCover))
