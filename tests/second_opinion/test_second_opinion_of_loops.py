"""The second opinion of loops accepts true peaks and refuses false ones."""

import control
import numpy as np
import pytest

from workbench.mu import performance_peak
from workbench.second_opinion import loops
from workbench.second_opinion.perturbations import constant_perturbations, vertex_perturbations
from workbench.second_opinion.responses import (
    lower_closed,
    plain_response,
    tried_frequencies,
    upper_closed,
)
from workbench.second_opinion.simulation import _Blocks, energy_ratio
from workbench.structure import Complex, Full, Real, Structure
from workbench.systems.generalised_plant import GeneralisedPlant

STRUCTURE = Structure([Real(2), Complex(1), Full(2, 1)])


def resonance(damping: float = 1e-3) -> control.StateSpace:
    """1 / (s^2 + 2 damping s + 1): peak 1 / (2 damping) almost."""
    return control.ss([[-2 * damping, -1.0], [1.0, 0.0]], [[1.0], [0.0]], [[0.0, 1.0]], 0.0)


def loop_with_a_peak() -> tuple[GeneralisedPlant, control.StateSpace, float, float]:
    """A plant with a complex perturbation of its input, a controller, and the loop's true peak."""
    s = control.ss([[-0.1, 0.0], [1.0, 0.0]], [[1.0], [0.0]], [[0.0, 1.0]], 0.0)
    A, B, C = s.A, s.B, s.C
    P = control.ss(
        A, np.hstack([B, B, B]), np.vstack([0 * C, C, C]),
        [[0, 0, 0.3], [0, 0, 0], [0, 0, 0]],
    )  # fmt: skip
    K = control.ss([[-10.0]], [[1.0]], [[95.0]], [[-10.0]])
    plant = GeneralisedPlant(P, Structure([Complex(1)]), 1, 1)
    peak = performance_peak(plant, K)
    assert peak is not None
    return plant, K, peak.upper, peak.omega


def opinion(claimed_share: float) -> list:
    plant, K, peak, omega = loop_with_a_peak()
    loop, claim = plant.close(K), (plant.structure, claimed_share * peak, omega)
    return [
        loops.powers_fall(loop.A, loop.dt),
        loops.gain(plant.system, K, *claim),
        *loops.in_time(loop, *claim),
    ]


def test_a_true_peak_is_accepted():
    assert all(check.holds for check in opinion(1.0))


@pytest.mark.parametrize("share", [0.9, 0.5, 1e-3])
def test_a_false_peak_is_refused(share):
    assert not all(check.holds for check in opinion(share))


@pytest.mark.parametrize("damping", [1e-2, 1e-5, 1e-8])
def test_a_resonance_is_not_overlooked(damping):
    true = 1 / (2 * damping * np.sqrt(1 - damping**2))
    assert loops.gain(resonance(damping), None, None, 1.001 * true).holds
    assert not loops.gain(resonance(damping), None, None, 0.99 * true).holds


def test_a_claim_of_zero_holds_for_a_loop_that_vanishes():
    """And for no other: any perturbation is smaller than one without bound."""
    for gain, holds in ((0.0, True), (1e-6, False)):
        loop = control.ss([[-1.0]], [[0.0, gain]], [[0.0], [1.0]], np.zeros((2, 2)))
        claim = Structure([Complex(1)]), 0.0
        checks = [loops.gain(loop, None, *claim), *loops.in_time(loop, *claim)]
        assert all(check.holds for check in checks) is holds


def test_an_unstable_loop_is_refused():
    assert not loops.powers_fall(resonance(-1e-6).A, 0).holds


@pytest.mark.parametrize("dt", [0, 0.1])
def test_energies_rise_to_the_norm_and_not_above(dt):
    system = control.ss([[-0.5, -2.0], [2.0, -0.3]], [[1.0], [1.0]], [[1.0, 0.5]], 0.1)
    system = control.sample_system(system, dt) if dt else system
    norm, omega = control.linfnorm(system)
    parts = system.A, system.B, system.C, system.D
    assert 0.97 * norm < energy_ratio(parts, system.dt, omega) <= norm * (1 + 1e-9)
    assert energy_ratio(parts, system.dt, np.nan) <= norm * (1 + 1e-9)


def test_rounding_of_a_simulation_is_no_accusation():
    """Integer similarities, exact in doubles, of condition 1e10: 0.02 to 3 % are rounding.

    Processors round differently, so which loops rounding raises above their norm is counted.
    """
    A, ones, D = np.diag([-1.0, -2.0, -3.0, -8.0, -30.0, -100.0]), np.eye(6), np.zeros((1, 1))
    A[0, 1] = 2.0
    raised = 0
    for seed in range(12):
        rng = np.random.default_rng(seed)
        B, C = rng.integers(1, 4, (6, 1)), rng.integers(1, 4, (1, 6))
        T = ones + np.triu(rng.integers(-1000, 1000, (6, 6)), 1)
        back = np.round(np.linalg.inv(T))
        assert np.array_equal(T @ back, ones)
        norm, omega = float((C @ np.linalg.solve(-A, B))[0, 0]), 1e-3
        parts = T @ A @ back, T @ B, C @ back, D
        raised += energy_ratio(parts, 0, omega, np.inf) > norm * (1 + 1e-4)
        assert energy_ratio(parts, 0, omega, norm) <= norm * (1 + 1e-6)
        assert energy_ratio((A, B, C, D), 0, omega, 0.9 * norm) > 0.99 * norm
    assert raised >= 1


def test_responses_and_closings_agree_with_those_of_realisations():
    plant, K, _, _ = loop_with_a_peak()
    omega = np.array([0.1, 1.0, 30.0])
    closed = lower_closed(plain_response(plant.system, omega), plain_response(K, omega))
    assert closed == pytest.approx(plain_response(plant.close(K), omega), rel=1e-10)
    Delta = np.array([[0.4]])
    matrices = loops.perturbed(plant.close(K), Delta)
    expected = plain_response(control.ss(*matrices), omega)
    assert upper_closed(closed, Delta) == pytest.approx(expected, rel=1e-10)


def test_perturbations_are_of_the_structure_and_in_its_ball():
    for Delta in (*vertex_perturbations(STRUCTURE, 30), *constant_perturbations(STRUCTURE, 30)):
        assert STRUCTURE.contains(Delta)
        assert np.linalg.norm(Delta, 2) <= 1 + 1e-12
    assert (np.linalg.norm(vertex_perturbations(STRUCTURE, 30), 2, axis=(1, 2)) > 1 - 1e-12).all()
    assert np.isrealobj(constant_perturbations(STRUCTURE, 3))


def test_frequencies_are_dense_where_it_matters():
    poles = np.array([-1e-6 + 5j, -1e-6 - 5j, -2.0])
    grid = tried_frequencies(poles, omega=3.0)
    assert np.sum(np.abs(grid - 5.0) < 1e-5) == 13
    assert np.sum(np.abs(grid - 3.0) < 0.2) >= 21
    assert grid[0] == 0.0
    assert grid[-1] == np.inf
    assert tried_frequencies(np.array([0.5]), dt=0.1)[-1] == pytest.approx(10 * np.pi)


@pytest.mark.parametrize("n", [0, 1, 7])
@pytest.mark.parametrize("samples", [1, 16, 1000])
def test_simulated_blocks_are_the_recursion(n, samples):
    rng = np.random.default_rng(n)
    A, B, C, D = (rng.standard_normal(shape) for shape in ((n, n), (n, 3), (2, n), (2, 3)))
    A *= 0.2
    loop = _Blocks(A, B, C, D)
    for blocks, parts in ((loop, (A, B, C, D)), (loop.adjoint(), (A.T, C.T, B.T, D.T))):
        A_, B_, C_, D_ = parts
        w = rng.standard_normal((samples, B_.shape[1]))
        x, expected = np.zeros(n), []
        for drive in w:
            expected.append(C_ @ x + D_ @ drive)
            x = A_ @ x + B_ @ drive
        np.testing.assert_allclose(blocks.run(w), expected, rtol=1e-12, atol=1e-12)
