"""The level that no controller reaches at a single frequency."""

import control
import numpy as np
import pytest
from scipy.optimize import minimize

from workbench import Options, solve
from workbench.certify.norms import certified_norm
from workbench.synthesis import HinfSynthesis
from workbench.synthesis.h_infinity.singular_plants.single_frequencies import (
    single_frequency_level,
)
from workbench.systems.standard_plant import standard_plant
from workbench.uncertainty import GeneralisedPlant

PEAK = 1 / (0.1 * np.sqrt(1 - 0.05**2))
"""Peak of 1 / (s^2 + 0.1 s + 1)."""


def static(seed):
    """A random plant without states: three outputs and inputs, one control and measurement."""
    D = np.random.default_rng(seed).normal(size=(4, 4))
    D[3, 3] = 0.0
    return GeneralisedPlant(control.ss([], [], [], D), None, 1, 1)


def beside_a_resonance():
    """A resonance that K does not reach, and x' = x + w + u with y = x and no cost on u."""
    A = [[0.0, 1, 0], [-1, -0.1, 0], [0, 0, 1]]
    B = [[0.0, 0, 0], [1, 0, 0], [0, 1, 1]]
    C = [[1.0, 0, 0], [0, 0, 1], [0, 0, 1]]
    return GeneralisedPlant(control.ss(A, B, C, np.zeros((3, 3))), None, 1, 1)


@pytest.mark.parametrize("seed", range(3))
def test_some_response_attains_the_level_and_none_is_below(seed):
    D = np.asarray(static(seed).system.D)
    P11, P12, P21 = D[:3, :3], D[:3, 3:], D[3:, :3]
    found = minimize(
        lambda q: np.linalg.norm(P11 + q[0] * P12 @ P21, 2), [0.0], method="Nelder-Mead",
        options={"xatol": 1e-10, "fatol": 1e-12},
    )  # fmt: skip
    assert single_frequency_level(standard_plant(static(seed))) == pytest.approx(
        found.fun, rel=1e-5
    )


def test_no_loop_has_a_lower_norm():
    rng = np.random.default_rng(7)
    A = rng.normal(size=(4, 4))
    A -= (np.linalg.eigvals(A).real.max() + 0.5) * np.eye(4)
    B, C = rng.normal(size=(4, 4)), rng.normal(size=(4, 4))
    plant = GeneralisedPlant(control.ss(A, B, C, np.zeros((4, 4))), None, 2, 1)
    level = single_frequency_level(standard_plant(plant))
    loops = (plant.close(control.ss([], [], [], 0.1 * rng.normal(size=(2, 1)))) for _ in range(40))
    norms = [certified_norm(loop) for loop in loops if loop.poles().real.max() < 0]
    assert len(norms) > 10
    assert 0.0 < level <= min(norms)


def test_nothing_is_left_where_every_direction_is_reached_and_shown():
    system = control.ss([[-1.0]], [[1.0, 1]], [[1.0], [1]], np.zeros((2, 2)))
    plant = GeneralisedPlant(system, None, 1, 1)
    assert single_frequency_level(standard_plant(plant)) == 0.0


def test_a_gain_for_a_singular_plant_is_proven_to_be_the_best():
    program = HinfSynthesis(beside_a_resonance(), order=0)
    solution = solve(program, method="bfgs", options=Options(seed=0))
    assert solution.certificate.holds
    assert solution.answer.least == pytest.approx(PEAK, rel=1e-5)
    assert solution.answer.norm == pytest.approx(PEAK, rel=1e-3)
