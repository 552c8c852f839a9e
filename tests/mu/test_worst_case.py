"""Worst-case gains: closed forms, SLICOT's norms of closed loops, and samples."""

from dataclasses import replace

import control
import numpy as np
import pytest
import xarray as xr

from workbench.errors import InputError
from workbench.mu import worst_case_gain
from workbench.mu.robust.skewed_bounds import (
    restored_worst_case,
    stored_worst_case,
    worst_case_checks,
)
from workbench.structure import Complex, Full, Real, Structure
from workbench.uncertainty import feedback, real, tf


def oscillator(damping, share, stiffness=None):
    """x'' + 2 z x' + k x = w with z = damping (1 + share d), and k = 1 + stiffness d'."""
    A, B = [[0, 1], [-1, -2 * damping]], [[0, 0], [-2 * damping * share, 1]]
    C = [[0, 1], [1, 0]]
    if stiffness is not None:
        B = [[0, 0, 0], [-2 * damping * share, -stiffness, 1]]
        C = [[0, 1], [1, 0], [1, 0]]
    return control.ss(A, B, C, np.zeros((len(C), len(B[0]))))


def random_system(seed, structure, size, performance=2, exogenous=1):
    rng = np.random.default_rng(seed)
    A = rng.standard_normal((5, 5))
    A -= (np.linalg.eigvals(A).real.max() + 0.2) * np.eye(5)
    rows, columns = structure.rows, structure.columns
    B, C = (
        rng.standard_normal((5, rows + exogenous)),
        rng.standard_normal((columns + performance, 5)),
    )
    B[:, :rows] *= size
    D = np.zeros((columns + performance, rows + exogenous))
    D[columns:, rows:] = rng.standard_normal((performance, exogenous))
    return control.ss(A, B, C, D)


def gain_at(N, structure, omega, Delta):
    """sigma_max of F_u(N(j omega), Delta), from the transfer function itself."""
    value = N(1j * omega, squeeze=False) if np.isfinite(omega) else N.D
    r, c = structure.rows, structure.columns
    around = Delta @ np.linalg.inv(np.eye(c) - value[:c, :r] @ Delta)
    return np.linalg.norm(value[c:, r:] + value[c:, :r] @ around @ value[:c, r:], 2)


def check(N, structure, found):
    assert found.lower <= found.upper
    assert structure.contains(found.Delta)
    assert np.linalg.norm(found.Delta, 2) <= 1
    assert gain_at(N, structure, found.omega, found.Delta) == pytest.approx(found.lower)


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("damping", "share"),
    [(0.1, 0.5), (0.01, 0.5), pytest.param(0.1, 0.999, marks=pytest.mark.slow)],
)
def test_of_an_uncertain_damping(damping, share):
    N, structure = oscillator(damping, share), Structure([Real(1, name="damping")])
    found = worst_case_gain(N, structure)
    z = damping * (1 - share)
    expected = 1 / (2 * z * np.sqrt(1 - z**2))
    assert found.lower == pytest.approx(expected, rel=1e-5)
    assert found.lower <= expected * (1 + 1e-9)
    assert expected <= found.upper <= 1.011 * expected
    assert found.omega == pytest.approx(np.sqrt(1 - 2 * z**2), rel=1e-3)
    check(N, structure, found)


@pytest.fixture(scope="module")
def claimed():
    structure = Structure([Real(1), Full(2, 2)])
    N = random_system(3, structure, 0.01)
    return N, structure, worst_case_gain(N, structure)


def test_what_is_stored_proves_the_gain_again(claimed):
    N, structure, found = claimed
    again = restored_worst_case(xr.Dataset(stored_worst_case("gain", found)), "gain")
    assert (again.lower, again.upper, again.level) == (found.lower, found.upper, found.level)
    assert all(check.holds for check in worst_case_checks(N, structure, again))


@pytest.mark.parametrize(
    ("change", "name"),
    [
        (lambda f: replace(f, upper=0.99 * f.upper), "upper"),
        (lambda f: replace(f, level=0.95 * f.level, upper=0.95 * f.upper), "upper"),
        (lambda f: replace(f, proof=None), "upper"),
        (lambda f: replace(f, proof=replace(f.proof, intervals=f.proof.intervals[1:])), "upper"),
        (lambda f: replace(f, lower=1.01 * f.lower), "lower"),
        (lambda f: replace(f, lower=np.inf), "lower"),
        (lambda f: replace(f, Delta=0.5 * f.Delta), "lower"),
        (lambda f: replace(f, Delta=2.0 * f.Delta), "lower"),
        (lambda f: replace(f, lower=1.1 * f.upper), "order"),
    ],
)
def test_a_gain_that_is_not_proven_is_refused(claimed, change, name):
    N, structure, found = claimed
    failed = {c.name for c in worst_case_checks(N, structure, change(found)) if not c.holds}
    assert name in failed


def test_an_unproven_gain_claims_nothing_above():
    N, structure = oscillator(0.1, 1.1), Structure([Real(1)])
    found = worst_case_gain(N, structure)
    assert found.upper == np.inf and found.proof is None
    again = restored_worst_case(xr.Dataset(stored_worst_case("gain", found)), "gain")
    assert all(check.holds for check in worst_case_checks(N, structure, again))


@pytest.mark.slow
def test_of_an_uncertain_damping_and_stiffness():
    """Largest at the least of both: 1 / (2 z sqrt(k - z^2)), with 2 z the damping coefficient."""
    N, structure = oscillator(0.05, 0.4, 0.3), Structure([Real(1), Real(1)])
    found = worst_case_gain(N, structure, tolerance=1e-3)
    z, k = 0.05 * 0.6, 0.7
    expected = 1 / (2 * z * np.sqrt(k - z**2))
    assert found.lower == pytest.approx(expected, rel=1e-4)
    assert expected <= found.upper <= 1.002 * expected
    check(N, structure, found)


@pytest.mark.parametrize("stiffness", [None, 0.3])
def test_where_robust_stability_fails(stiffness):
    """Damping may change its sign, for the second case at a frequency that moves with stiffness."""
    N = oscillator(0.1, 1.1, stiffness)
    found = worst_case_gain(N, Structure([Real(1)] * (1 if stiffness is None else 2)))
    assert found.upper == np.inf
    assert "robust stability is not proven" in found.message
    assert found.lower > 100


def tied(share):
    """As `oscillator`, damping and stiffness moved by the same scalar."""
    N = oscillator(0.1, share, 0.3)
    return N, Structure([Real(2)])


@pytest.mark.slow
def test_of_a_scalar_that_moves_damping_and_stiffness():
    N, structure = tied(0.9)
    found = worst_case_gain(N, structure)
    delta = np.linspace(-1, 1, 2001)
    z, k = 0.1 * (1 + 0.9 * delta), 1 + 0.3 * delta
    expected = (1 / (2 * z * np.sqrt(k - z**2))).max()
    assert found.lower == pytest.approx(expected, rel=1e-4)
    assert expected <= found.upper <= 1.03 * expected
    check(N, structure, found)


def test_of_a_full_block_where_the_loop_is_singular():
    structure = Structure([Full(1, 1)])
    N = control.ss(-1, [[1.5, 1]], [[1], [1]], np.zeros((2, 2)))
    found = worst_case_gain(N, structure)
    assert (found.lower, found.upper) == (np.inf, np.inf)
    value = N(1j * found.omega)[0, 0] * found.Delta[0, 0]
    assert value == pytest.approx(1, abs=1e-9)
    assert abs(found.Delta[0, 0]) <= 1


@pytest.mark.parametrize("scale", [1e-8, 1.0, 1e8])
def test_of_a_lag_in_a_loop(scale):
    """N11 = a / (s + 1) and the rest alike: the gain is largest for Delta = 1 at 0."""
    N = control.ss(-1, [[0.5, scale]], [[1], [1]], np.zeros((2, 2)))
    found = worst_case_gain(N, Structure([Complex(1)]), tolerance=1e-3)
    assert found.lower == pytest.approx(scale / 0.5, rel=1e-6)
    assert scale / 0.5 <= found.upper <= 1.002 * scale / 0.5


def test_without_any_part_in_the_performance_it_is_the_norm():
    N = control.append(control.tf(0.5, [1, 1]), control.tf(3, [1, 0.2, 1]))
    norm = control.linfnorm(control.ss(control.tf(3, [1, 0.2, 1])))[0]
    found = worst_case_gain(control.ss(N), Structure([Full(1, 1)]))
    assert found.lower == pytest.approx(norm, rel=1e-4)
    assert norm <= found.upper <= 1.011 * norm


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    "structure",
    [
        Structure([Full(1, 1)]),
        Structure([Complex(2), Full(1, 2)]),
        Structure([Real(1), Real(2)]),
        Structure([Real(1), Full(2, 1)]),
    ],
    ids=lambda s: str(s.to_pairs()),
)
def test_against_samples(structure):
    N = random_system(3, structure, 0.02)
    found = worst_case_gain(N, structure)
    check(N, structure, found)
    assert found.upper < 1.1 * found.lower
    rng = np.random.default_rng(4)
    around = found.omega if 0 < found.omega < np.inf else 1.0
    for omega in [found.omega, *around * np.geomspace(0.5, 2, 30)]:
        for _ in range(30):
            assert gain_at(N, structure, omega, structure.random(rng)) <= found.upper


@pytest.mark.slow
def test_real_scalars_against_norms_of_closed_loops():
    structure = Structure([Real(1), Real(2)])
    N = random_system(5, structure, 0.1)
    found = worst_case_gain(N, structure)
    best = 0.0
    for first in np.linspace(-1, 1, 9):
        for second in np.linspace(-1, 1, 9):
            Delta = np.diag([first, second, second])
            loop = Delta @ np.linalg.inv(np.eye(3) - N.D[:3, :3] @ Delta)
            A = N.A + N.B[:, :3] @ loop @ N.C[:3]
            system = control.ss(A, N.B[:, 3:], N.C[3:], N.D[3:, 3:])
            best = max(best, control.linfnorm(system)[0])
    assert best <= found.upper
    assert best <= found.lower * (1 + 1e-3)


def test_of_nothing():
    found = worst_case_gain(control.ss(-1, [[0.5, 0]], [[1], [0]], 0), Structure([Real(1)]))
    assert found.lower == 0
    assert found.upper < 1e-8
    zero = worst_case_gain(control.ss([], [], [], np.zeros((2, 2))), Structure([Real(1)]))
    assert (zero.lower, zero.upper) == (0, 0)


def test_bad_input_is_refused():
    N = oscillator(0.1, 0.5)
    with pytest.raises(InputError, match="left for performance"):
        worst_case_gain(N, Structure([Real(2)]))
    with pytest.raises(InputError, match="tolerance"):
        worst_case_gain(N, Structure([Real(1)]), tolerance=0.0)
    with pytest.raises(InputError, match="unstable"):
        worst_case_gain(control.ss(1, [[1, 1]], [[1], [1]], 0), Structure([Real(1)]))


@pytest.mark.parametrize(("gain", "largest"), [(lambda k: k - k, 0.0), (lambda k: 1 + k - k, 0.5)])
def test_an_element_that_cancels_costs_nothing(gain, largest):
    """With its channels the search took three minutes for k - k."""
    closed = feedback(tf([1], [1, 1]) * gain(real("k", 2, percent=20)), 1)
    found = worst_case_gain(closed)
    assert found.lower == pytest.approx(largest) and found.upper <= 1.01 * largest
    assert found.holds and found.Delta.shape == (closed.structure.rows, closed.structure.columns)
