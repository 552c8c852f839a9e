"""The upper bound by its own method, by SLICOT and by conic solvers: none beats the first."""

import numpy as np
import pytest
from lanes import thinned

from workbench.errors import InputError
from workbench.mu.upper.bound import MuUpperBound, upper_bound
from workbench.solution import solve
from workbench.solvers import Options, Outcome
from workbench.structure import Complex, Full, Real, Structure


def random_structure(rng, simple):
    """Up to four blocks, for AB13MD only simple ones."""
    sizes = rng.choice([1, 1, 2, 3], size=(rng.integers(1, 5), 2))
    kinds = rng.integers(3, size=len(sizes))
    pairs = zip(kinds, sizes, strict=True)
    if simple:
        return Structure([(Real(1), Complex(1), Full(n, n))[k] for k, (n, _) in pairs])
    return Structure([(Real(n), Complex(n), Full(n, m))[k] for k, (n, m) in pairs])


def random_batch(rng, structure, count):
    """Full matrices, real ones, nearly real ones, ill-balanced, nearly rank one, sparse."""
    real, imag = rng.normal(size=(2, count, structure.columns, structure.rows))
    M = real + 1j * imag
    shapes = (
        M,
        real + 0j,
        real + 1e-3j * imag,
        M * np.exp(3 * rng.normal(size=structure.columns))[:, None],
        M[..., :1] @ M[..., :1, :] + 1e-3 * M,
        M * (rng.random(M.shape) < 0.5),
    )
    return shapes[rng.integers(len(shapes))]


@pytest.mark.parametrize("seed", thinned(range(40), 4))
def test_never_above_ab13md(seed):
    rng = np.random.default_rng(seed)
    structure = random_structure(rng, simple=True)
    M = random_batch(rng, structure, 5)
    solution = solve(MuUpperBound(M, structure))
    assert solution.certificate.holds
    peer = upper_bound(M, structure, method="ab13md").value
    floor = 1e-7 * np.abs(M).max((-2, -1))  # where both mean zero
    assert np.all(solution.answer.value <= peer * (1 + 1e-6) + floor)


@pytest.mark.parametrize("seed", thinned(range(12), 3))
def test_never_above_the_semidefinite_program(seed):
    rng = np.random.default_rng(seed)
    structure = random_structure(rng, simple=False)
    M = random_batch(rng, structure, 2)
    solution = solve(MuUpperBound(M, structure))
    assert solution.certificate.holds
    peer = solve(MuUpperBound(M, structure), method="clarabel")
    assert peer.certificate.holds
    floor = 1e-7 * np.abs(M).max((-2, -1))
    assert np.all(solution.answer.value <= peer.answer.value * (1 + 1e-5) + floor)
    assert np.all(peer.answer.value <= solution.answer.value * (1 + 1e-3) + 1e4 * floor)


@pytest.mark.parametrize("size", thinned([8, 6, 10, 12], 4))
def test_larger_sizes(size):
    rng = np.random.default_rng(size)
    structure = Structure([Real(1), Real(2), Complex(size - 5), Full(2, 2)])
    real, imag = rng.normal(size=(2, 2, size, size))
    M = real + 1j * imag
    solution = solve(MuUpperBound(M, structure))
    assert solution.outcome is Outcome.SOLVED
    assert "early" not in solution.message


@pytest.mark.parametrize("name", ["cvxopt", "scs"])
def test_other_conic_solvers_agree(name):
    rng = np.random.default_rng(3)
    structure = Structure([Real(1), Complex(1), Full(2, 2)])
    real, imag = rng.normal(size=(2, 2, 4, 4))
    M = real + 1j * imag
    answer = upper_bound(M, structure, method=name, options=Options(tolerance="low"))
    assert answer.value == pytest.approx(upper_bound(M, structure).value, rel=1e-3)


def test_a_sweep_is_as_good_as_each_of_its_matrices():
    rng = np.random.default_rng(4)
    structure = Structure([Real(1), Complex(1), Full(2, 2)])
    C, B = rng.normal(size=(2, 4, 4))
    poles = -np.array([0.1, 1, 3, 10]) + 1j * np.array([1, 2, 0, 0])
    omega = np.logspace(-1, 1, 60)
    M = C * (1 / (1j * omega[:, None, None] - poles)) @ B
    sweep = upper_bound(M, structure).value
    alone = np.array([upper_bound(one, structure).value for one in M])
    assert sweep == pytest.approx(alone, rel=1e-6)


def test_ab13md_is_loose_where_two_real_scalars_meet():
    rng = np.random.default_rng(0)
    structure = Structure([Real(1), Real(1), Full(2, 2)])
    real, imag = rng.normal(size=(2, 40, 4, 4))
    M = real + 1j * imag
    ours, theirs = (upper_bound(M, structure, method=name).value for name in ("fast", "ab13md"))
    assert np.all(ours <= theirs * (1 + 1e-6))
    assert np.max(theirs / ours) > 1 + 1e-4


def test_ab13md_says_what_it_reported_and_what_it_proved():
    structure = Structure([Complex(1), Complex(1)])
    solution = solve(MuUpperBound(np.array([[1.0, 2.0], [3.0, 4.0]]), structure), method="ab13md")
    assert "reported" in solution.message and "prove" in solution.message
    assert solution.certificate.holds


@pytest.mark.parametrize("block", [Real(2), Complex(2), Full(1, 2)])
def test_ab13md_refuses_what_it_would_answer_wrongly(block):
    structure = Structure([block])
    with pytest.raises(InputError, match="ab13md"):
        upper_bound(np.ones((structure.columns, structure.rows)), structure, method="ab13md")


def test_early_stops_are_told_and_still_certified():
    solution = solve(
        MuUpperBound(np.array([[1.0, 2.0], [3.0, 4.0j]]), Structure([Real(1), Complex(1)])),
        options=Options(tolerance=1e-18),
    )
    assert "early" in solution.message
    assert solution.certificate.valid


def test_a_solver_that_fails_from_the_start_gives_no_answer_of_another(monkeypatch):
    """The bound of balancing is valid, but no work of the solver that is asked."""
    from workbench.mu.upper import conic

    monkeypatch.setattr(conic, "solve_conic", lambda *_: (Outcome.FAILED, "it broke"))
    M = np.random.default_rng(0).standard_normal((3, 3))
    solution = solve(MuUpperBound(M, Structure([Complex(1)] * 3)), method="clarabel")
    assert (solution.outcome, solution.message) == ("failed", "it broke")
