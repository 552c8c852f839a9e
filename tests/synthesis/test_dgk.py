"""Multipliers with G and full D: their slopes, what they prove, and the iterations with them."""

import control
import numpy as np
import pytest
from workbench.plants.mass_spring.plant import two_mass_plant
from workbench.plants.textbook.first_order import unstable_first_order

import workbench as wb
from workbench.mu import upper_bound
from workbench.structure import Complex, Full, Real, Structure
from workbench.synthesis import MuSynthesis
from workbench.synthesis.mu.biquads import Biquads
from workbench.synthesis.mu.d_step import LoopResponse
from workbench.synthesis.mu.multipliers.dg_step import without_G
from workbench.synthesis.mu.multipliers.functions import Multipliers
from workbench.synthesis.mu.multipliers.scaled_loop import ScaledLoop
from workbench.synthesis.mu.multipliers.scaled_plant import Multiplied
from workbench.synthesis.mu.scaling_fit import diagonals
from workbench.systems.generalised_plant import GeneralisedPlant

OMEGA = np.geomspace(0.1, 10, 5)
STRUCTURES = [
    [Real(1), Full(2, 1)],
    [Full(1, 2), Real(2)],
    [Complex(3), Full(1, 2)],
    [Full(1, 2), Real(2), Complex(2)],
]


def random_loop(blocks, seed):
    rng = np.random.default_rng(seed)
    structure = Structure(blocks)
    scalings = Multipliers(structure, 1)
    x = 0.2 * rng.normal(size=(scalings.rows, 5))
    x[scalings.minus, 0] = 0.0
    size = len(OMEGA), structure.columns + 2, structure.rows + 1
    return structure, scalings, x, rng.normal(size=size) + 1j * rng.normal(size=size)


@pytest.mark.parametrize("blocks", STRUCTURES)
def test_slopes_of_the_bound_are_those_of_differences(blocks):
    _, scalings, x, M = random_loop(blocks, 0)
    for f in range(len(OMEGA)):
        slope = ScaledLoop.of(scalings, M, OMEGA, x).slope(np.eye(len(OMEGA))[f])
        for i, k in np.ndindex(x.shape):
            if scalings.channels <= i < scalings.functions.rows and k == 0:
                continue  # the gain of m_- is that of m_+
            step = np.zeros_like(x)
            step[i, k] = 1e-6
            above, below = (
                ScaledLoop.of(scalings, M, OMEGA, x + sign * step).log_beta[f] for sign in (1, -1)
            )
            assert slope[i, k] == pytest.approx((above - below) / 2e-6, abs=1e-6)


@pytest.mark.parametrize("blocks", STRUCTURES)
@pytest.mark.parametrize("seed", range(3))
def test_what_multipliers_prove_is_never_below_the_least_bound(blocks, seed):
    structure, scalings, x, M = random_loop(blocks, seed)
    whole = structure.with_performance(2, 1)
    proven = np.exp(ScaledLoop.of(scalings, M, OMEGA, x).log_beta)
    least = upper_bound(M, whole).value
    assert (proven >= least * (1 - 1e-6)).all()


@pytest.mark.parametrize("blocks", STRUCTURES)
def test_the_first_multipliers_prove_what_the_scalings_of_d_k_iteration_prove(blocks):
    structure = Structure(blocks)
    whole = structure.with_performance(2, 1)
    functions, rng = Biquads(len(structure), 2), np.random.default_rng(7)
    D = 0.5 * rng.normal(size=(len(structure), functions.size))
    size = len(OMEGA), whole.columns, whole.rows
    loop = LoopResponse(OMEGA, rng.normal(size=size) + 1j * rng.normal(size=size))
    multipliers, x = without_G(whole, loop, D)
    proven = ScaledLoop.of(multipliers, loop.M, OMEGA, x).log_beta
    if all(block.rows == 1 or isinstance(block, Full) for block in structure):
        rows, columns = diagonals(whole, functions.log_magnitude(D, OMEGA)[0])
        scaled = np.exp(rows)[:, :, None] * loop.M * np.exp(-columns)[:, None, :]
        expected = np.log(np.linalg.norm(scaled, 2, axis=(1, 2)))
        np.testing.assert_allclose(proven, expected, rtol=1e-9)
    with_G = Multipliers(structure, 2)
    same = ScaledLoop.of(with_G, loop.M, OMEGA, with_G.carried(multipliers, x, 0.0)).log_beta
    np.testing.assert_allclose(same, proven, rtol=1e-9)


def test_the_first_full_d_is_the_optimal_one_at_the_peak():
    structure = Structure([Complex(2)]).with_performance(2, 1)
    rng = np.random.default_rng(7)
    size = len(OMEGA), structure.columns, structure.rows
    loop = LoopResponse(OMEGA, rng.normal(size=size) + 0j)  # its best D is real
    D = 0.5 * rng.normal(size=(1, Biquads(1, 2).size))
    multipliers, x = without_G(structure, loop, D)
    bound = upper_bound(loop.M, structure)
    worst = int(np.argmax(bound.value))
    proven = np.exp(ScaledLoop.of(multipliers, loop.M, OMEGA, x).log_beta)
    assert proven[worst] == pytest.approx(bound.value[worst], rel=1e-6)


def test_a_controller_of_norm_one_for_the_scaled_plant_holds_the_bound_of_the_loop():
    from workbench.synthesis.mu.multipliers.k_step import dgk_k_step

    plant = two_mass_plant()
    blocks = Structure(plant.structure.blocks)
    scalings = Multipliers(blocks, 1)
    rng = np.random.default_rng(1)
    x = 0.3 * rng.normal(size=(scalings.rows, 5))
    x[scalings.minus, 0] = 0.0
    program = MuSynthesis(plant)

    K, beta = dgk_k_step(program, scalings, x, 3.0)
    found = program.certified_peak(K)
    assert found is not None  # it stabilises the plant itself
    assert found.upper <= beta * 1.001
    assert Multiplied.of(plant, scalings, x).plant(beta).states > plant.system.nstates


def test_where_nothing_acts_on_the_performance_there_is_nothing_to_fit():
    B, C = np.zeros((1, 3)), np.zeros((3, 1))
    B[0, 2] = C[2, 0] = 1.0
    system = control.ss([[-1.0]], B, C, np.zeros((3, 3)))
    plant = GeneralisedPlant(system, Structure([Real(1)]), 1, 1)
    solution = wb.solve(MuSynthesis(plant), method="dgk")
    assert solution.certificate.holds and solution.answer.upper == 0.0


@pytest.mark.slow
def test_without_real_scalars_it_is_d_k_iteration():
    plant = unstable_first_order()
    first, second = (wb.solve(MuSynthesis(plant), method=name).answer for name in ("dk", "dgk"))
    assert first.upper == second.upper
    assert len(first.history) == len(second.history)


@pytest.mark.slow
def test_g_lowers_the_mixed_peak_of_two_masses_far_below_d_k_iteration():
    solution = wb.solve(MuSynthesis(two_mass_plant()), method="dgk")
    assert solution.certificate.holds, solution.certificate
    assert solution.answer.upper < 0.9  # D-K iteration: 1.074


@pytest.mark.slow
def test_a_full_d_lowers_the_peak_of_a_repeated_scalar():
    rng = np.random.default_rng(2)
    A = rng.normal(size=(4, 4))
    A -= (np.linalg.eigvals(A).real.max() + 0.3) * np.eye(4)
    B, C, D = rng.normal(size=(4, 5)), rng.normal(size=(5, 4)), np.zeros((5, 5))
    D[3, 4], D[4, 3], C[3], B[:, 3] = 1.0, 0.3, 0.0, 0.0
    system = control.ss(A, B, C, D)
    repeated = MuSynthesis(GeneralisedPlant(system, Structure([Complex(2)]), 1, 1))
    block = MuSynthesis(GeneralisedPlant(system, Structure([Full(2, 2)]), 1, 1))
    scalar = wb.solve(block, method="dk").answer.K  # one function for both channels
    full = wb.solve(repeated, method="dk")
    assert full.certificate.holds
    assert full.answer.upper <= repeated.certified_peak(scalar).upper * (1 + 1e-3)
