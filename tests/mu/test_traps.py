"""Traps on the way to mu, each shown to exist, and shown not to catch the bench."""

import cvxpy as cp
import numpy as np
import pytest
import slycot
from lanes import thinned

import workbench.mu.upper.conic
from workbench.executor import Context
from workbench.mu.lower.bound import lower_bound
from workbench.mu.upper.bound import MuUpperBound, upper_bound
from workbench.mu.upper.conic import _Statement
from workbench.mu.upper.pattern import pattern_of
from workbench.program import find_method
from workbench.solution import solve
from workbench.solvers import Options, Outcome
from workbench.structure import Complex, Full, Real, Structure

TWO = Structure([Complex(1), Complex(1)])
TRIANGULAR = np.array([[1, 1e12], [0, 0.5]])


def random(seed, count, n):
    real, imag = np.random.default_rng(seed).normal(size=(2, count, n, n))
    return real + 1j * imag


def test_ab13md_takes_a_matrix_that_is_not_square_and_says_nothing():
    bound, *_ = slycot.ab13md(np.ones((2, 3), complex), np.array([1, 1]), np.array([2, 2]))
    assert np.isfinite(bound)


def test_ab13md_reports_149011_where_mu_is_1():
    bound, *_ = slycot.ab13md(TRIANGULAR + 0j, np.array([1, 1]), np.array([2, 2]))
    assert bound > 1e5
    assert upper_bound(TRIANGULAR, TWO).value == pytest.approx(1, rel=1e-7)


@pytest.mark.parametrize(
    ("blocks", "looseness"),
    [
        ([Real(1), Real(1)], 0.018),
        ([Real(1), Complex(1)], 0.006),
        ([Real(1), Real(1), Complex(1)], 0.006),
    ],
    ids=["two real", "real and complex", "two real and complex"],
)
def test_ab13md_is_loose_with_real_scalars(blocks, looseness, record_property):
    structure = Structure(blocks)
    M = random(0, 300, structure.rows)
    ours, theirs = (upper_bound(M, structure, method=name).value for name in ("fast", "ab13md"))
    clear = ours > 0.1 * np.linalg.norm(M, 2, axis=(1, 2))
    excess = theirs[clear] / ours[clear] - 1
    record_property("largest excess of AB13MD", float(excess.max()))
    record_property("share of matrices with more than 1e-4", float((excess > 1e-4).mean()))
    assert excess.max() > looseness
    assert excess.min() > -1e-6


def test_ab13md_is_tight_with_complex_blocks():
    M = random(1, 100, 2)
    ours, theirs = (upper_bound(M, TWO, method=name).value for name in ("fast", "ab13md"))
    np.testing.assert_allclose(ours, theirs, rtol=1e-6)


def test_a_peer_reports_what_its_scalings_do_not_attain():
    structure = Structure([Real(1), Real(1)])
    M = random(0, 200, 2)
    reported = np.array([slycot.ab13md(m, np.array([1, 1]), np.array([1, 1]))[0] for m in M])
    proved = upper_bound(M, structure, method="ab13md").value
    assert np.any(proved > reported * (1 + 1e-8))
    assert "at worst" in solve(MuUpperBound(M, structure), method="ab13md").message


def test_the_lmi_stalls_without_balancing(monkeypatch):
    assert upper_bound(TRIANGULAR, TWO, method="clarabel").value == pytest.approx(1, rel=1e-6)

    def unscaled(M, pattern):
        return M, np.ones((len(M), pattern.size)), np.ones(len(M))

    monkeypatch.setattr(workbench.mu.upper.conic, "balanced_batch", unscaled)
    assert upper_bound(TRIANGULAR, TWO, method="clarabel").value > 1e3


def test_the_margin_of_the_lmi_is_unbounded_where_mu_is_0_unless_capped():
    statement = _Statement(pattern_of(Structure([Real(1)])), 1)
    capped = statement.at(np.array([[2j]]), 1.0, np.eye(1, dtype=complex))
    free = cp.Problem(capped.objective, capped.constraints[:-1])
    assert capped.solve(solver="CLARABEL") == pytest.approx(1, rel=1e-6)
    free.solve(solver="CLARABEL")
    assert free.status in ("unbounded", "unbounded_inaccurate")
    solution = solve(MuUpperBound(np.array([[2j]]), Structure([Real(1)])), method="clarabel")
    assert solution.certificate.holds
    assert solution.answer.value < 1e-3


def test_an_infimum_that_is_not_attained_needs_a_d_that_may_grow():
    M = np.array([[1.0, 1.0], [0.0, 1.0]])
    answer = upper_bound(M, TWO)
    assert answer.value == pytest.approx(1, rel=1e-6)
    ratio = answer.D_left[1, 1].real / answer.D_left[0, 0].real
    assert ratio > 1e6
    held = np.diag([1.0, 10.0])
    assert np.linalg.norm(held @ M @ np.linalg.inv(held), 2) > 1.04


def test_a_panic_of_a_solver_is_a_failure_not_a_crash(monkeypatch):
    class Panic(BaseException):
        """As a Rust panic arrives: no Exception."""

    def panics(*args, **options):
        raise Panic("index out of range")

    monkeypatch.setattr(cp.Problem, "get_problem_data", panics)
    solution = solve(MuUpperBound(random(2, 1, 2), TWO), method="clarabel")
    assert (solution.outcome, solution.answer) == ("failed", None)
    assert "Panic: index out of range" in solution.message


@pytest.mark.parametrize("size", [1e-3, 1e-6])
def test_mu_of_a_real_scalar_is_not_continuous(size):
    structure = Structure([Real(1)])
    assert upper_bound([[1.0]], structure).value == pytest.approx(1)
    assert lower_bound([[1.0]], structure).value == pytest.approx(1)
    assert upper_bound([[1 + 1j * size]], structure).value < 1e-6
    assert lower_bound([[1 + 1j * size]], structure).value == 0


def nearly_real(seed):
    """Matrices of nearly real structures, whose best D is nearly singular."""
    rng = np.random.default_rng(seed)
    structure = Structure([[Real(3), Complex(1)], [Real(4), Full(2, 1)], [Real(5)]][seed % 3])
    real, imag = rng.normal(size=(2, 20, structure.columns, structure.rows))
    M = real + 1j * imag * 10 ** rng.uniform(-17, 0, size=(20, 1, 1))
    coupling = 10 ** rng.uniform(-17, 0, size=(20, 1))
    M[:, :, -1] *= coupling
    M[:, -1] *= coupling
    return M, structure


@pytest.mark.cases(1)
@pytest.mark.parametrize("seed", thinned(range(12), 3))
def test_nearly_real_structures_have_bounds_that_hold(seed):
    M, structure = nearly_real(seed)
    solution = solve(MuUpperBound(M, structure))
    assert solution.certificate.valid
    value = solution.answer.value
    assert (value <= np.linalg.norm(M, 2, axis=(1, 2)) * (1 + 1e-6)).all()
    program = MuUpperBound(M, structure)
    _, outcome, message = find_method(program, "fast").answer(program, Context(options=Options()))
    assert (outcome is Outcome.INACCURATE) == ("stopped early" in message)


def test_a_path_that_was_lost_is_taken_up_again():
    # Coupled by 1e-9 only, D wants eigenvalues 1e16 apart, and mu is next to nothing.
    M = np.array([[1, 2, 1e-9], [-2, 1, 1e-9], [1e-9, 1e-9, 1e-9]]) + 0j
    assert upper_bound(M, Structure([Real(2), Complex(1)])).value < 1e-3


@pytest.mark.parametrize("coupling", [1e-8, 1e-4, 1e-2])
def test_a_lower_bound_where_real_blocks_do_nearly_alone(coupling):
    structure = Structure([Real(1), Real(1), Full(1, 1)])
    # det(I - M Delta) = 1 - d1 a - d2 b is zero for d = (2, 1) / 3 without the full block
    M = np.zeros((3, 3), complex)
    M[:2, :2] = np.array([[1 + 1j], [1 + 1j]]) @ np.array([[1, (1 - 2j) / (1 + 1j)]])
    M[2, :2] = M[:2, 2] = coupling
    assert lower_bound(M, structure).value >= 1.5 * (1 - 1e-9)


def test_lower_bounds_of_weakly_coupled_blocks_are_found():
    structure = Structure([Real(1), Real(1), Complex(1), Real(1)])
    M = random(3, 20, 4)
    M[:, 2] *= 1e-4
    M[:, :, 2] *= 1e-4
    lower, upper = lower_bound(M, structure).value, upper_bound(M, structure).value
    assert np.count_nonzero(lower) >= 15
    assert (lower <= upper * (1 + 1e-9)).all()
    assert np.median(lower / upper) > 0.6
