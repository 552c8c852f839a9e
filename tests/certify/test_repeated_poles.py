"""The Hamiltonian in balls finds the crossings of repeated poles, which have no modes."""

import math
from functools import partial
from pathlib import Path

import control
import numpy as np
import pytest
import scipy.linalg

from workbench.certify.eigenvalues import separate_pole_discs
from workbench.certify.hamiltonian import ball_discs
from workbench.certify.interval import certified_interval
from workbench.certify.modes.enclosed_realisation import responds_sharply
from workbench.certify.rounding import Enclosure
from workbench.certify.stability import stability_check
from workbench.certify.stable_system import StableSystem, stable_system
from workbench.errors import InputError
from workbench.mu import peak
from workbench.structure import Complex, Structure

up_to_its_ends = partial(certified_interval, end_margin=0.0)

ONE = (np.eye(1) + 0j, np.eye(1) + 0j, np.zeros((1, 1)) + 0j)


def lags(count: int) -> StableSystem:
    """1 / (s + 1)^count, as a chain: one Jordan block."""
    A = -np.eye(count) + np.diag(np.ones(count - 1), -1)
    B, C = np.eye(count, 1), np.eye(1, count, count - 1)
    given = tuple(np.zeros(part.shape) for part in (A, B, C, np.zeros((1, 1))))
    return StableSystem(A, B, C, np.zeros((1, 1)), -np.ones(count, complex), given)


@pytest.mark.parametrize("count", [2, 4, 8])
@pytest.mark.parametrize("level", [0.5, 0.9])
def test_the_crossing_is_enclosed(count, level):
    crossing = math.sqrt(level ** (-2 / count) - 1)
    discs = ball_discs(lags(count), ONE, level, math.inf)
    assert discs is not None
    meets = np.abs(discs.centre.imag) <= discs.radius
    assert sorted(discs.centre.real[meets]) == pytest.approx([-crossing, crossing], rel=1e-9)


def test_a_level_that_the_response_exceeds_is_not_proven():
    assert ball_discs(lags(4), ONE, 0.5, 0.1) is None


@pytest.mark.parametrize("count", [2, 6])
def test_no_interval_reaches_over_the_crossing(count):
    import control

    given = lags(count)
    system = stable_system(control.ss(given.A, given.B, given.C, given.D))
    low, high = up_to_its_ends(system, *ONE, 0.5, math.inf)
    crossing = math.sqrt(0.5 ** (-2 / count) - 1)
    assert crossing <= low < crossing * 1.001
    assert high == math.inf


def test_repeated_poles_that_no_output_sees_do_not_blur_the_others():
    """A chain of equal poles hangs on the loop: it is proven stable, and left out of responses."""
    A, B = np.zeros((6, 6)), np.eye(6, 1)
    A[:2, :2] = [[-0.01, 1.0], [-1.0, -0.01]]
    A[2:, 2:] = -5000.0 * np.eye(4) + 300.0 * np.diag(np.ones(3), -1)
    A[2, 0] = 7.0
    found = stable_system(control.ss(A, B, np.eye(1, 6), 0))
    assert len(found.A) == 2
    assert peak(control.ss(A, B, np.eye(1, 6), 0), Structure([Complex(1)])).upper < 50.06
    A[5, 5] = 1e-3
    with pytest.raises(InputError, match="unstable"):
        stable_system(control.ss(A, B, np.eye(1, 6), 0))


@pytest.mark.cases(0)
def test_coordinates_of_sixteen_equal_poles_are_not_worked_in():
    """A loop with a Laguerre filter: its modal form in balls places the poles, and blurs all else.

    Its responses were taken for those of the loop, up to 1e32 in place of 3.3.
    """
    parts = np.load(Path(__file__).parent / "data" / "laguerre_loop.npz")
    A, B, C, D = (parts[name] for name in "ABCD")
    stable = stable_system(control.StateSpace(A, B, C, D, remove_useless_states=False))
    omega = np.array([0.0, 1.0, 100.0, 1e4])
    plain = C @ np.linalg.solve(1j * omega[:, None, None] * np.eye(len(A)) - A, B) + D
    np.testing.assert_allclose(stable.response(omega), plain, rtol=1e-6, atol=1e-6)


@pytest.mark.slow
def test_a_resonance_before_a_chain_of_forty_equal_lags_is_proven_stable():
    """The eigenvectors have no condition, and balls separate no modes; the blocks are clear."""
    lag, rng = 3770.0, np.random.default_rng(0)
    A = np.zeros((42, 42))
    A[2:, 2:] = lag * (np.tril(rng.standard_normal((40, 40)), -1) - np.eye(40))
    A[:2, :2], A[2, :2] = [[-10.0, 200.0], [-200.0, -10.0]], 1e4
    B, C = np.eye(42, 1), np.ones((1, 42))
    system = stable_system(control.ss(A, B, C, 0))
    assert system.poles.real.max() == pytest.approx(-10.0)
    assert stability_check(control.ss(A, B, C, 0)).holds
    A[0, 0] = 30.0  # the resonance becomes unstable
    with pytest.raises(InputError, match="unstable: it has the pole"):
        stable_system(control.ss(A, B, C, 0))
    assert not stability_check(control.ss(A, B, C, 0)).holds


def test_blocks_are_those_of_every_matrix_enclosed():
    """An entry that only may be there joins two states: [-1 1; 2 -1] has the pole 0.414."""
    mid = np.array([[-1.0, 1.0], [0.0, -1.0]])
    apart, joined = (Enclosure(mid, np.array([[0.0, 0.0], [rad, 0.0]])) for rad in (0.0, 2.0))
    assert separate_pole_discs(apart).rightmost == pytest.approx(-1.0)
    assert separate_pole_discs(joined).rightmost >= math.sqrt(2) - 1
    assert separate_pole_discs(Enclosure(np.zeros((0, 0)), np.zeros((0, 0)))).rightmost == -math.inf


@pytest.mark.parametrize("seed", range(5))
def test_the_distance_of_repeated_poles_is_sharp(seed):
    """Doubles alone tell a tenth to a half of it, or nothing, as the last bits will have it."""
    turn = np.linalg.qr(np.random.default_rng(seed).normal(size=(6, 6)))[0]
    A = turn @ (-np.eye(6) + np.diag(np.full(5, 1.7), -1)) @ turn.T
    found = stability_check(control.ss(A, np.ones((6, 1)), np.ones((1, 6)), 0.0))
    assert found.value == pytest.approx(-1.0, abs=0.01)


def turned_lags(count, seed):
    """A chain of equal lags beside a resonance, in orthogonal coordinates at random."""
    chain = -np.eye(count) + np.diag(np.ones(count - 1), 1)
    A = scipy.linalg.block_diag(chain, [[-0.01, 1.0], [-1.0, -0.01]])
    B = np.concatenate([np.eye(count)[:, -1:], [[0.1], [0.0]]])
    C = np.concatenate([np.eye(count)[:1], [[0.1, 0.1]]], axis=1)
    T = np.linalg.qr(np.random.default_rng(seed).standard_normal(A.shape))[0]
    return T @ A @ T.T, T @ B, C @ T.T, np.zeros((1, 1))


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("count", [9, 15])
def test_modes_of_nearly_equal_poles_do_not_blur_the_response(count, seed):
    """Their modal coordinates gave responses off by up to 160 %, and peaks too large by as much."""
    A, B, C, D = turned_lags(count, seed)
    omega = np.array([0.0, 0.5, 1.0, 2.0])
    exact = [(C @ np.linalg.solve(1j * w * np.eye(len(A)) - A, B))[0, 0] for w in omega]
    found = stable_system(control.ss(A, B, C, D)).response(omega)[:, 0, 0]
    np.testing.assert_allclose(found, exact, rtol=1e-9)


@pytest.mark.parametrize("seed", range(2))
def test_a_peak_beside_many_equal_poles_is_narrow(seed):
    found = peak(control.ss(*turned_lags(15, seed)), Structure([Complex(1)]))
    assert found.upper <= found.lower * 1.0021


def enclosed(matrix, error):
    matrix = np.array(matrix)
    return Enclosure(matrix, np.full(matrix.shape, error))


@pytest.mark.parametrize("damped", [1e-20, 0.0, 0.5])
def test_a_block_of_two_real_poles_needs_no_damping_on_its_diagonal(damped):
    """Its poles are near -2 and -8, whatever stands in the corner."""
    form = [[-10.0, 4.0], [-4.0, -damped]], [[1.0], [1.0]], [[1.0, 1.0]]
    plain = tuple(enclosed(part, 0.0) for part in form)
    assert responds_sharply(tuple(enclosed(part, 1e-9) for part in form), plain)


def test_what_a_slow_pole_leaves_open_is_seen():
    """An error of 1e-9 beside a pole at -1e-10 is no small one."""
    form = [[-1e-10, 0.0], [0.0, -1.0]], [[1.0], [1.0]], [[1.0, 1.0]]
    plain = tuple(enclosed(part, 0.0) for part in form)
    assert not responds_sharply(tuple(enclosed(part, 1e-9) for part in form), plain)
