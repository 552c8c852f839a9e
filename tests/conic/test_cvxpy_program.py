"""A user's problem of CVXPY: its value by other mathematics, its variables, what is refused."""

import cvxpy as cp
import numpy as np
import pytest
import xarray as xr
from scipy.linalg import solve_continuous_lyapunov
from scipy.optimize import linprog, lsq_linear

import workbench as wb
from workbench.conic import CvxpyProgram
from workbench.conic.canonical import FormSolver
from workbench.errors import InputError
from workbench.program import methods
from workbench.second_opinion import lagrangians
from workbench.solvers import Outcome

SOLVERS = ("clarabel", "scs", "cvxopt")


def linear():
    """The value by HiGHS."""
    rng = np.random.default_rng(3)
    A, b, c = rng.normal(size=(12, 4)), rng.uniform(1, 2, 12), rng.normal(size=4)
    x = cp.Variable(4, name="x", bounds=[-3, 3])
    value = linprog(c, A, b, bounds=(-3, 3)).fun
    return cp.Problem(cp.Minimize(c @ x), [A @ x <= b]), value


def bounded_least_squares():
    rng = np.random.default_rng(4)
    A, b = rng.normal(size=(15, 4)), rng.normal(size=15)
    x = cp.Variable(4, nonneg=True)
    value = 2 * lsq_linear(A, b, (0, np.inf), method="bvls").cost
    return cp.Problem(cp.Minimize(cp.sum_squares(A @ x - b))), value


def smallest_eigenvalue():
    """The least of a unit trace; of a complex matrix."""
    rng = np.random.default_rng(5)
    C = rng.normal(size=(4, 4)) + 1j * rng.normal(size=(4, 4))
    C = C + C.conj().T
    X = cp.Variable((4, 4), hermitian=True)
    problem = cp.Problem(cp.Minimize(cp.real(cp.trace(C @ X))), [X >> 0, cp.trace(X) == 1])
    return problem, np.linalg.eigvalsh(C)[0]


def lyapunov():
    """The trace of the least P with A'P + PA + Q <= 0 is that of the equation's solution."""
    A = np.array([[-1.0, 2.0, 0.0], [0.0, -2.0, 1.0], [0.5, 0.0, -3.0]])
    P = cp.Variable((3, 3), PSD=True, name="P")
    value = np.trace(solve_continuous_lyapunov(A.T, -np.eye(3)))
    return cp.Problem(cp.Minimize(cp.trace(P)), [A.T @ P + P @ A + np.eye(3) << 0]), value


def largest_of_a_ball():
    """The largest c'x + 7 with |x - a| <= 2, as a maximum."""
    c, a = np.array([3.0, -4.0]), np.array([1.0, 2.0])
    x = cp.Variable(2, name="x")
    return cp.Problem(cp.Maximize(c @ x + 7), [cp.SOC(2, x - a)]), c @ a + 7 + 2 * 5.0


def least_product():
    """The largest geometric mean of lengths that add up to 6: all are 2."""
    x = cp.Variable(3)
    return cp.Problem(cp.Maximize(cp.geo_mean(x)), [cp.sum(x) <= 6]), 2.0


def complex_norm():
    z = cp.Variable(2, complex=True)
    return cp.Problem(cp.Minimize(cp.norm(z)), [z[0] + 1j * z[1] == 2j]), np.sqrt(2.0)


def cube_and_inverse():
    """x^3 + 3 / x is least at x = 1."""
    x = cp.Variable()
    return cp.Problem(cp.Minimize(x**3 + 3 * cp.inv_pos(x))), 4.0


def of_a_parameter():
    a = cp.Parameter(value=-2.0)
    x = cp.Variable(name="x")
    return cp.Problem(cp.Maximize(a * x), [x >= 3]), -6.0


def constant():
    return cp.Problem(cp.Maximize(5), [cp.Constant(1) <= 2]), 5.0


def nothing_asked():
    return cp.Problem(cp.Minimize(0 * cp.Variable(2)[0] - 3)), -3.0


PROBLEMS = {
    make.__name__: make
    for make in (
        linear, bounded_least_squares, smallest_eigenvalue, lyapunov, largest_of_a_ball,
        least_product, complex_norm, cube_and_inverse, of_a_parameter, constant, nothing_asked,
    )
}  # fmt: skip


@pytest.mark.parametrize("name", PROBLEMS)
def test_value_and_bound_are_those_of_other_mathematics(name):
    problem, value = PROBLEMS[name]()
    solution = wb.solve(problem)
    assert solution.outcome is Outcome.SOLVED and solution.holds, solution.certificate
    assert solution.value == pytest.approx(value, abs=2e-6 * (1 + abs(value)))
    best = -1 if problem.objective.NAME == "minimize" else 1
    assert best * (solution.metrics["bound"] - value) >= -1e-12 * (1 + abs(value))
    assert problem.status == "optimal" and problem.value == pytest.approx(solution.value)
    assert [one.name for one in solution.certificate.checks if one.opinion] == [
        *("drawn members", "A'y in fractions", "Lagrangian")
    ]


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("make", [linear, lyapunov, largest_of_a_ball])
def test_any_solver_is_asked_by_its_name(make, solver):
    problem, value = make()
    solution = wb.solve(problem, method=solver)
    assert solution.outcome is Outcome.SOLVED and solver in solution.message
    assert solution.value == pytest.approx(value, rel=1e-5)


def test_a_solver_of_quadratic_programs_takes_one(monkeypatch):
    from workbench import program, solvers
    from workbench.conic import conic_solver

    methods(CvxpyProgram)
    monkeypatch.setattr(solvers, "_CONIC", [*solvers._CONIC])
    known = {kind: dict(entries) for kind, entries in program._METHODS.items()}
    monkeypatch.setattr(program, "_METHODS", known)
    conic_solver("osqp")
    problem, value = bounded_least_squares()
    assert wb.solve(problem, method="osqp").value == pytest.approx(value, rel=1e-5)
    with pytest.raises(InputError, match="osqp takes linear cones only, it has second-order ones"):
        wb.solve(largest_of_a_ball()[0], method="osqp")


# --- what the user's problem holds behind it ------------------------------------------------------


@pytest.mark.parametrize("make", [linear, lyapunov, largest_of_a_ball, of_a_parameter])
def test_variables_and_dual_variables_are_as_behind_solve_of_cvxpy(make):
    problem, _ = make()
    wb.solve(problem)
    found = [one.value for one in problem.variables()]
    duals = [np.hstack([np.ravel(part.value) for part in one.dual_variables])
             for one in problem.constraints]  # fmt: skip
    problem.solve(solver="CLARABEL")
    for value, one in zip(found, problem.variables(), strict=True):
        np.testing.assert_allclose(value, one.value, atol=1e-4)
    for value, one in zip(duals, problem.constraints, strict=True):
        own = np.hstack([np.ravel(part.value) for part in one.dual_variables])
        np.testing.assert_allclose(value, own, atol=1e-3)


@pytest.mark.parametrize(
    ("objective", "constraints", "status", "value"),
    [
        (cp.Minimize, lambda x: [x >= 1, x <= 0], "infeasible", np.inf),
        (cp.Maximize, lambda x: [x >= 1, x <= 0], "infeasible", -np.inf),
        (cp.Minimize, lambda x: [x <= 1], "unbounded", -np.inf),
        (cp.Maximize, lambda x: [x >= 1], "unbounded", np.inf),
        (cp.Maximize, lambda x: [], "unbounded", np.inf),
        (cp.Minimize, lambda x: [x**2 <= -1], "infeasible", np.inf),
    ],
)
def test_what_is_proven_of_no_answer_is_said_by_the_problem(objective, constraints, status, value):
    x = cp.Variable()
    x.value = 7.0
    problem = cp.Problem(objective(x), constraints(x))
    solution = wb.solve(problem)
    assert solution.outcome == status and solution.holds
    assert (problem.status, problem.value, x.value) == (status, value, None)


def test_a_constant_that_is_false_is_infeasible():
    assert wb.solve(cp.Problem(cp.Minimize(3), [cp.Constant(1) <= 0])).outcome == "infeasible"


def test_without_a_certificate_nothing_is_kept():
    """[x 1; 1 0] is nearly semidefinite for a large x: no ray shows that it never is."""
    x = cp.Variable()
    x.value = 7.0
    problem = cp.Problem(cp.Minimize(0), [cp.bmat([[x, 1], [1, 0]]) >> 0])
    for solver in SOLVERS:
        solution = wb.solve(problem, method=solver)
        assert not solution.holds and solution.outcome in ("failed", "no solution up to R")
        assert "no solution has max |x| < R = " in solution.message
        assert (problem.status, problem.value, x.value) == (None, None, None)


def test_asked_as_a_program_the_problem_is_left_as_it_is():
    problem, value = largest_of_a_ball()
    (x,) = problem.variables()
    x.value = [7.0, 7.0]
    assert wb.solve(CvxpyProgram(problem)).value == pytest.approx(value)
    assert x.value.tolist() == [7.0, 7.0] and problem.status is None
    assert all(two.value is None for one in problem.constraints for two in one.dual_variables)


def test_another_value_of_a_parameter_is_another_program():
    problem, _ = of_a_parameter()
    program = CvxpyProgram(problem)
    assert wb.solve(program).value == pytest.approx(-6.0)
    problem.parameters()[0].value = -4.0
    assert wb.solve(problem).value == pytest.approx(-12.0)
    assert program.metrics(xr.Dataset({"x": 3.0}))["value"] == -6.0


def test_a_constant_that_is_changed_within_is_noticed():
    b = np.array([1.0, 2.0])
    x = cp.Variable(2)
    program = CvxpyProgram(cp.Problem(cp.Minimize(cp.sum(x)), [x >= b]))
    wb.solve(program)
    program.stated.constants()[0].value[0] = 5.0
    with pytest.raises(InputError, match="the data of this CvxpyProgram were changed"):
        wb.solve(program)


def test_variables_without_a_name_or_with_one_twice_are_told_apart():
    one, two, three = cp.Variable(name="x"), cp.Variable(name="x"), cp.Variable()
    problem = cp.Problem(cp.Minimize(one + 2 * two + 3 * three), [one >= 1, two >= 2, three >= 3])
    answer = wb.solve(problem).answer
    values = {name: round(float(answer[name]), 5) for name in ("x_1", "x_2", "variable_3")}
    assert values == {"x_1": 1.0, "x_2": 2.0, "variable_3": 3.0}


# --- gaps ---------------------------------------------------------------------------------------


def gap_of_one():
    """The least z_01 of these matrices is 0, no dual point shows more than -1."""
    Z = cp.Variable((3, 3), symmetric=True, name="Z")
    rows = [Z[0, 0] == 0, Z[2, 2] == Z[0, 1] + 1, Z[0, 2] == 0, Z[1, 2] == 0]
    return CvxpyProgram(cp.Problem(cp.Minimize(Z[0, 1]), [Z >> 0, *rows]))


def test_a_gap_between_a_problem_and_its_dual_stays_open():
    program = gap_of_one()
    best = xr.Dataset({"Z": (("i", "j"), np.diag([0.0, 0.0, 1.0]))})
    dual = ["0"] * program.conic_form().b.size
    certificate = program.certify(best.assign(canonical_dual=("row", dual)), 1e-6, optimal=True)
    assert certificate.valid and not certificate.holds and certificate.gap.value == np.inf
    certificate = program.certify(program.witnessed(best), 1e-6, optimal=True)
    assert certificate.valid and not certificate.holds and certificate.gap.value >= 1 - 1e-6


@pytest.mark.parametrize("size", [1e-10, 1e-5, 1e5, 1e10])
def test_units_change_an_answer_by_their_factor(size):
    x = cp.Variable(2, name="x")
    problem = cp.Problem(cp.Minimize(size * cp.norm(x)), [x[0] + x[1] >= 2, x[1] >= 0.5])
    solution = wb.solve(problem)
    assert solution.holds, solution.certificate
    assert solution.metrics["bound"] <= size * np.sqrt(2) * (1 + 1e-14)
    assert solution.value == pytest.approx(size * np.sqrt(2), abs=1e-6 * (1 + size))
    wide = cp.Problem(cp.Minimize(cp.sum(x)), [x[0] >= size, x[1] >= 1 / size])
    assert wb.solve(wide).holds
    assert x.value == pytest.approx([size, 1 / size], abs=1e-5 * (1 + size + 1 / size))


# --- wrong answers ------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def solved():
    problem, _ = largest_of_a_ball()
    program = CvxpyProgram(problem)
    return program, wb.solve(program).answer


def test_wrong_answers_are_rejected(solved):
    program, answer = solved
    assert program.certify(answer, 1e-6, optimal=True).holds
    turned = [f"-{text}".replace("--", "") for text in answer["canonical_dual"].values]
    for wrong in (
        answer.assign(x=answer["x"] + 0.01),
        answer.assign(x=answer["x"] - 0.01),
        answer.assign(x=-answer["x"]),
        answer.assign(x=answer["x"] * np.nan),
        answer.assign(canonical_dual=("row", turned)),
        answer.drop_vars("canonical_dual"),
    ):
        assert not program.certify(wrong, 1e-6, optimal=True).holds
    with pytest.raises(InputError, match=r"an answer needs x of shape \(2,\)"):
        program.certify(answer.assign(x=("i", [1.0])), 1e-6)


def test_an_answer_outside_of_the_domain_of_an_atom_is_rejected():
    """CVXPY evaluates a cube, which is convex on one side only, on both."""
    x = cp.Variable(name="x")
    program = CvxpyProgram(cp.Problem(cp.Minimize(x), [cp.power(x, 3) <= 1]))
    certificate = program.certify(xr.Dataset({"x": -5.0}), 1e-6)
    assert {one.name for one in certificate.checks if not one.holds} == {"domain"}


VARIABLES = {
    "nonneg": ({"shape": 2, "nonneg": True}, [1.0, -0.1]),
    "nonpos": ({"shape": 2, "nonpos": True}, [0.1, -1.0]),
    "bounds": ({"shape": 2, "bounds": [0, [1, 2]]}, [1.1, 1.0]),
    "symmetric": ({"shape": (2, 2), "symmetric": True}, [[1.0, 0.1], [0.2, 1.0]]),
    "PSD": ({"shape": (2, 2), "PSD": True}, [[1.0, 2.0], [2.0, 1.0]]),
    "NSD": ({"shape": (2, 2), "NSD": True}, [[-1.0, 2.0], [2.0, -1.0]]),
    "diag": ({"shape": (2, 2), "diag": True}, [[1.0, 0.1], [0.1, 1.0]]),
    "sparsity": ({"shape": (2, 2), "sparsity": [(0,), (0,)]}, [[1.0, 0.0], [0.1, 0.0]]),
    "imag": ({"shape": 2, "imag": True}, [1j, 0.1]),
    "hermitian": ({"shape": (2, 2), "hermitian": True}, [[1.0, 1j], [1j, 1.0]]),
    "real": ({"shape": 2}, [1j, 1.0]),
}


@pytest.mark.parametrize("name", VARIABLES)
def test_a_variable_that_is_not_what_it_is_declared_to_be_is_rejected(name):
    keywords, wrong = VARIABLES[name]
    x = cp.Variable(name="x", **keywords)
    program = CvxpyProgram(cp.Problem(cp.Minimize(cp.sum(cp.abs(x)))))
    dims = [f"x_{k}" for k in range(len(x.shape))]
    certificate = program.certify(xr.Dataset({"x": (dims, np.array(wrong))}), 1e-6)
    assert "variables" in {one.name for one in certificate.checks if not one.holds}
    solution = wb.solve(program)
    assert solution.holds, solution


def test_a_large_entry_excuses_no_small_one():
    x = cp.Variable(2, name="x")
    program = CvxpyProgram(cp.Problem(cp.Minimize(cp.sum(x)), [x >= np.array([1e12, 1.0])]))
    assert not program.certify(xr.Dataset({"x": ("i", [1e12, 0.0])}), 1e-6).valid
    assert program.certify(xr.Dataset({"x": ("i", [1e12 - 1e-3, 1.0])}), 1e-6).valid


# --- the second way -----------------------------------------------------------------------------


@pytest.mark.parametrize("make", [linear, lyapunov, largest_of_a_ball, smallest_eigenvalue])
def test_a_lagrangian_finds_a_bound_or_a_sign_that_is_wrong(make):
    problem, _ = make()
    program = CvxpyProgram(problem)
    answer = wb.solve(program).answer
    bound = float(program.bound(answer))
    duals = program.dual_values([*answer["canonical_dual"].values])

    def found(duals, bound, sign):
        with program.at(answer):
            return lagrangians.lagrangian_above(program.stated, duals, bound, sign, []).holds

    turned = {name: -np.asarray(value) for name, value in duals.items()}
    assert found(duals, bound, program.sign)
    assert not found(duals, bound + 1e-4, program.sign)
    assert not found(turned, bound, program.sign)
    assert not found(duals, bound, -program.sign)


def test_a_form_with_a_wrong_sign_is_found(monkeypatch):
    """Its bound is exact, and of another problem."""
    honest = FormSolver.apply

    def wrong(self, program):
        data, inverse = honest(self, program)
        return data | {"c": 0.9 * data["c"]}, inverse

    monkeypatch.setattr(FormSolver, "apply", wrong)
    problem, _ = lyapunov()
    certificate = wb.solve(problem).certificate
    assert not certificate.holds
    failed = {one.name for one in certificate.checks if not one.holds}
    assert failed <= {"Lagrangian"} and (failed or certificate.gap.value > 0.01)


# --- what is refused ----------------------------------------------------------------------------


def refused():
    x, n = cp.Variable(3), cp.Variable(name="n", integer=True)
    u, p = cp.Variable(pos=True), cp.Parameter(name="p")
    X = cp.Variable((2, 2), PSD=True)
    one = [x >= 1]
    return {
        "integer": (cp.Minimize(n), [n >= 1.5], "integer or boolean variables: n; no bound"),
        "no value": (cp.Minimize(p * x[0]), one, "parameters without a value: p; set"),
        "concave": (cp.Minimize(cp.sqrt(x[0])), one, "the objective cannot be told to be convex"),
        "not convex": (cp.Minimize(x[0]), [cp.sqrt(x[1]) <= 1, cp.norm(x) >= 1],
                       "constraint 1 and constraint 2 cannot be told to be convex"),
        "quasiconvex": (cp.Minimize(cp.ceil(x[0])), one, r"\(quasiconvex: bisect its value\)"),
        "geometric": (cp.Minimize(u * u), [u * u >= 2], "a geometric program; state it in"),
        "NaN": (cp.Minimize(x[0]), [x[0] >= np.nan], "constraint 1 has a number that is not fin"),
        "infinite": (cp.Minimize(np.inf * x[0]), one, "the objective has a number that is not"),
        "power cone": (cp.Minimize(0), [cp.PowCone3D(x[0], x[1], x[2], 0.3)],
                       "constraint 1 is a PowCone3D; checked are"),
        "exponential": (cp.Minimize(cp.exp(x[0])), one, "needs a cone without proofs here"),
        "exponent": (cp.Minimize(cp.power(x[0], np.pi)), one, "replaces an exponent of Power"),
        "quadrature": (cp.Minimize(cp.quantum_rel_entr(np.eye(2), X)), [], "another problem"),
        "finite set": (cp.Minimize(0), [cp.FiniteSet(x[0], [1, 2])], "constraint 1 is a Finite"),
    }  # fmt: skip


@pytest.mark.parametrize("case", refused())
def test_what_cannot_be_certified_is_refused_by_name(case):
    objective, constraints, words = refused()[case]
    with pytest.raises(InputError, match=words):
        wb.solve(cp.Problem(objective, constraints))


def test_what_is_no_problem_is_refused():
    with pytest.raises(InputError, match=r"a cvxpy\.Problem is needed, not Minimize"):
        wb.solve(cp.Minimize(cp.Variable()))
    with pytest.raises(InputError, match=r"a cvxpy\.Problem is needed, not int"):
        CvxpyProgram(3)
