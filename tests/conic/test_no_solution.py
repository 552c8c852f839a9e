"""What certificates say of a claim that there is no solution, or no least value."""

import math
from fractions import Fraction

import conic_programs as known
import numpy as np
import pytest
import xarray as xr
from flint import fmpq
from hypothesis import given
from hypothesis import strategies as st
from lanes import examples

from workbench.certify.cones.membership import fraction, in_cone, in_dual_cone
from workbench.certify.cones.rays import excluded_radius, rounded_down
from workbench.certify.known_plants.exact_function import exact_rational
from workbench.conic import ConeFactor, ConeKind, ConicForm, ConicProgram, NoLeastValue, NoSolution
from workbench.errors import InputError
from workbench.executor import Context
from workbench.program import methods
from workbench.solution import solve
from workbench.solvers import Options, Outcome, conic_solvers

SOLVERS = [solver.name for solver in conic_solvers()]


def cases(programs):
    return pytest.mark.parametrize("form", programs.values(), ids=list(programs))


def claimed(form, claim, options=None):
    """The solution of a program of which a method claims that it has none."""

    class Claimed(ConicProgram):
        pass

    def answer(program, context):
        return None, claim, "so the solver said"

    from workbench import method

    method(Claimed, "claim", optimal=True)(answer)
    assert "claim" in methods(Claimed)
    return solve(Claimed(form), method="claim", options=options)


# --- claims of being infeasible -----------------------------------------------------------------


@cases(known.INFEASIBLE)
def test_an_infeasible_program_has_an_exact_ray(form):
    solution = claimed(form, Outcome.INFEASIBLE)
    assert solution.outcome is Outcome.INFEASIBLE and solution.certificate.holds
    y = [fraction(value) for value in solution.answer["y"]]
    A = [[Fraction(float(value)) for value in row] for row in form.A.toarray()]
    assert all(sum(a[j] * q for a, q in zip(A, y, strict=True)) == 0 for j in range(form.c.size))
    assert sum(Fraction(float(p)) * q for p, q in zip(form.b, y, strict=True)) < 0
    assert solution.proof.metrics(solution.answer) == {"radius": math.inf}


@pytest.mark.parametrize("name", SOLVERS)
@cases(known.INFEASIBLE)
def test_every_solver_that_claims_it_gets_the_certificate(form, name):
    solution = solve(ConicProgram(form), method=name)
    if name == "cvxopt" and form is known.INFEASIBLE["badly scaled"]:
        assert solution.claim is Outcome.UNBOUNDED  # which is false
        assert solution.outcome is Outcome.NO_CLAIM
    else:
        assert solution.claim is solution.outcome is Outcome.INFEASIBLE


@examples(10, 100)
@given(st.integers(0, 10**6))
def test_random_infeasible_programs_are_proven(seed):
    for form in (known.infeasible_lp(seed, 12, 4), known.infeasible_sdp(seed, 3, 3)):
        assert claimed(form, Outcome.INFEASIBLE).outcome is Outcome.INFEASIBLE


@cases(known.WEAKLY_INFEASIBLE | known.IRRATIONAL)
def test_without_a_rational_ray_only_solutions_up_to_a_radius_are_excluded(form):
    solution = claimed(form, Outcome.INFEASIBLE)
    assert solution.outcome is Outcome.NONE_UP_TO_R
    assert solution.certificate.valid and not solution.certificate.holds
    radius = solution.proof.metrics(solution.answer)["radius"]
    assert 1e3 < radius < math.inf and f"{radius:.6g}" in solution.message


@cases(known.SOLVABLE | {"far": known.FAR})
def test_a_false_claim_of_a_solvable_program_is_no_proof(form):
    solution = claimed(form, Outcome.INFEASIBLE)
    assert solution.outcome in (Outcome.NONE_UP_TO_R, Outcome.NO_CLAIM)
    if solution.outcome is Outcome.NONE_UP_TO_R:  # true: its solutions lie beyond
        least = 1e6 if form is known.FAR else 1.0
        assert 0.0 < solution.proof.metrics(solution.answer)["radius"] <= least


def test_a_program_with_the_solution_0_excludes_nothing():
    form = known.form([0], [[-1], [1]], [1, 1], known.nonnegative(2))
    solution = claimed(form, Outcome.INFEASIBLE)
    assert solution.outcome is Outcome.NO_CLAIM and solution.certificate is None
    assert "speaks against a solution" in solution.message


@pytest.mark.parametrize("claim", [Outcome.INFEASIBLE, Outcome.UNBOUNDED])
def test_the_time_limit_ends_the_search_for_a_proof(claim):
    form = known.infeasible_lp(0)
    solution = claimed(form, claim, Options(time_limit=1e-9))
    assert solution.outcome is Outcome.NO_CLAIM and solution.certificate is None
    assert "search for a ray: time limit of 1e-09 s reached" in solution.message


# --- claims of being unbounded ------------------------------------------------------------------


@cases(known.UNBOUNDED)
def test_an_unbounded_program_has_a_solution_and_a_ray(form):
    solution = claimed(form, Outcome.UNBOUNDED)
    assert solution.outcome is Outcome.UNBOUNDED and solution.certificate.holds


@cases(known.FALLING_WITHOUT_RAY | known.SOLVABLE | known.INFEASIBLE | {"far": known.FAR})
def test_what_no_ray_proves_unbounded_is_no_claim(form):
    assert claimed(form, Outcome.UNBOUNDED).outcome is Outcome.NO_CLAIM


@cases(known.UNBOUNDED)
def test_what_is_unbounded_is_not_infeasible(form):
    outcome = claimed(form, Outcome.INFEASIBLE).outcome
    assert outcome in (Outcome.NO_CLAIM, Outcome.NONE_UP_TO_R)


def test_a_ray_without_a_solution_is_no_proof():
    form = known.form([1, 0], [[0, 1], [0, -1]], [-1, 0], known.nonnegative(2))
    solution = claimed(form, Outcome.UNBOUNDED)
    assert solution.outcome is Outcome.NO_CLAIM
    assert "no solution was found" in solution.message


# --- solvable programs --------------------------------------------------------------------------


@pytest.mark.parametrize("name", SOLVERS)
@cases(known.SOLVABLE)
def test_a_solvable_program_has_an_exact_bound(form, name):
    solution = solve(ConicProgram(form), method=name)
    assert solution.outcome is Outcome.SOLVED and solution.proof is None
    assert abs(solution.certificate.gap.value) < 1e-6


@cases(known.SOLVABLE)
def test_a_wrong_answer_or_dual_point_is_rejected(form):
    program = ConicProgram(form)
    answer = solve(program).answer
    for wrong in (
        answer.assign(x=answer["x"] + 0.1),
        answer.assign(x=answer["x"] - 0.1),
        answer.assign(x=answer["x"] * np.nan),
        answer.assign(dual=answer["dual"][::-1].copy(data=answer["dual"].values[::-1])),
        answer.drop_vars("dual"),
    ):
        if not wrong.identical(answer):
            assert not program.certify(wrong, 1e-6, optimal=True).holds


# --- proofs that are none -----------------------------------------------------------------------


@cases(known.INFEASIBLE)
def test_a_spoilt_ray_proves_nothing_or_less(form):
    proof = NoSolution(form)
    y = proof.respond(None, Context())[0]["y"]
    assert proof.certify({"y": y}, 1e-6).holds
    tiny = fmpq(1, 10**40)
    largest = max(range(len(y)), key=lambda i: abs(y[i]))
    spoilt = {
        "nothing": [fmpq(0)] * len(y),
        "turned over": [-value for value in y],
        "one entry moved": [v + tiny * (i == largest) for i, v in enumerate(y)],
        "rounded": [exact_rational(float(fraction(v)) * (1 + 1e-12 * i)) for i, v in enumerate(y)],
        "too short": y[:-1],
    }
    for name, wrong in spoilt.items():
        if wrong != y and any(a != 0 for a in form.A.toarray()[largest]):
            assert excluded_radius(form, wrong) < math.inf, name
            if len(wrong) == len(y):
                assert not proof.certify({"y": wrong}, 1e-6).holds, name


@cases(known.UNBOUNDED)
def test_a_spoilt_proof_of_being_unbounded_is_rejected(form):
    claim = NoLeastValue(form)
    found = claim.respond(None, Context())[0]
    assert claim.certify(found, 1e-6).holds
    x, ray = found["x"], found["ray"]
    far = [value - 10**6 for value in x], [value + 10**6 for value in x]
    for wrong in (
        {"x": x, "ray": [-value for value in ray]},
        {"x": x, "ray": [fmpq(0)] * len(ray)},
    ):
        assert not claim.certify(wrong, 1e-6).holds
    assert not all(claim.certify({"x": one, "ray": ray}, 1e-6).holds for one in far)


def test_the_ray_of_another_program_is_no_proof():
    one, other = known.infeasible_lp(3), known.infeasible_lp(4)
    y = NoSolution(one).respond(None, Context())[0]
    assert not NoSolution(other).certify(y, 1e-6).holds


@pytest.mark.parametrize("text", ["", "x", "1/0", "0.5", "nan", "1/2/3"])
def test_a_proof_that_holds_no_rational_numbers_is_refused(text):
    proof = NoSolution(known.INFEASIBLE["x >= 1, x <= 0"])
    with pytest.raises(InputError, match="no rational number"):
        proof.from_dataset(xr.Dataset({"y": ("row", ["1", text])}))
    with pytest.raises(InputError, match="2 entries along row"):
        proof.from_dataset(xr.Dataset({"y": ("row", ["1"])}))


# --- cones --------------------------------------------------------------------------------------

rationals = st.fractions(-4, 4, max_denominator=6).map(lambda q: fmpq(q.numerator, q.denominator))


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    "cone",
    [known.equal(3), known.nonnegative(3), known.second_order(3), known.semidefinite(2)],
    ids=lambda cone: cone.kind,
)
@given(s=st.lists(rationals, min_size=3, max_size=3), y=st.lists(rationals, min_size=3, max_size=3))
def test_a_cone_and_its_dual_have_no_negative_product(cone, s, y):
    if in_cone(cone, s) and in_dual_cone(cone, y):
        assert sum((a * b for a, b in zip(s, y, strict=True)), start=fmpq(0)) >= 0


@given(st.lists(st.integers(-3, 3), min_size=9, max_size=9))
def test_a_gram_matrix_is_in_the_cone_and_a_step_below_its_edge_is_not(entries):
    G = np.array(entries).reshape(3, 3)
    cone = known.semidefinite(3)
    places = [(i, j) for j in range(3) for i in range(j + 1)]
    S = G @ G.T
    assert in_cone(cone, [fmpq(int(S[p])) for p in places])
    assert in_dual_cone(cone, [fmpq(int(S[p]) * (1 if p[0] == p[1] else 2)) for p in places])
    lowered = [fmpq(int(S[p])) - fmpq(p[0] == p[1], 10**30) for p in places]
    singular = round(float(np.linalg.det(G))) == 0
    assert in_cone(cone, lowered) is not singular


@given(st.fractions(min_value=Fraction(1, 10**400)))
def test_a_radius_is_rounded_downward(value):
    found = rounded_down(value)
    above = math.nextafter(found, math.inf)
    assert Fraction(found) <= value and (math.isinf(above) or value < Fraction(above))


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"b": [1.0]}, "shapes"),
        ({"A": [[np.nan], [1.0]]}, "finite"),
        ({"cones": (ConeFactor(ConeKind.NONNEGATIVE, 3),)}, "3 rows, A has 2"),
        (
            {"cones": (ConeFactor(ConeKind.NONNEGATIVE, 2), ConeFactor(ConeKind.ZERO, 0))},
            "size of 1",
        ),
    ],
)
def test_data_that_make_no_conic_form_are_an_error(changes, words):
    given = {"c": [1.0], "A": [[1.0], [1.0]], "b": [0.0, 0.0], "cones": (known.nonnegative(2),)}
    with pytest.raises(InputError, match=words):
        ConicForm(**given | changes)
