"""H-infinity controllers of sampled plants, by norms and a peer that share nothing with ours."""

import control
import numpy as np
import pytest
from lanes import thinned
from plants import random_plant, scalar_plant
from slycot import sb10dd

from workbench.synthesis import MixedSensitivity, hinf

ARC = np.exp(1j * np.linspace(0.0, np.pi, 4001))


def largest_gain(loop):
    """Over the unit circle, from the definition C (z - A)^-1 B + D."""
    inside = np.linalg.solve(ARC[:, None, None] * np.eye(loop.nstates) - loop.A, loop.B)
    return np.linalg.norm(loop.C @ inside + loop.D, 2, axis=(1, 2)).max()


def bounded_real(loop, gamma, steps=3000):
    """Whether the worst disturbance of so many samples gains less than gamma, by recursion."""
    A, B, C, D = loop.A, loop.B, loop.C, loop.D
    X = np.zeros_like(A)
    for _ in range(steps):
        left = gamma**2 * np.eye(B.shape[1]) - B.T @ X @ B - D.T @ D
        if not np.linalg.eigvalsh(left)[0] > 0.0:
            return False
        gain = B.T @ X @ A + D.T @ C
        new = A.T @ X @ A + C.T @ C + gain.T @ np.linalg.solve(left, gain)
        X = (new + new.T) / 2
    return True


@pytest.mark.parametrize("seed", thinned(range(10), 3))
def test_the_norm_of_a_sampled_loop(seed):
    plant = random_plant(seed, 0.1)
    answer = hinf(plant)
    loop = plant.close(answer.K)
    assert np.abs(loop.poles()).max() < 1.0
    assert largest_gain(loop) == pytest.approx(answer.norm, rel=1e-5)
    assert answer.norm <= answer.gamma * (1 + 1e-6)
    assert bounded_real(loop, answer.norm * 1.01)
    assert not bounded_real(loop, answer.norm * 0.99)


@pytest.mark.parametrize("seed", thinned(range(10), 3))
def test_no_sampled_controller_of_slicot_is_better(seed):
    """SB10DD solves discrete Riccati equations, and no bilinear transformation."""
    plant = random_plant(seed, 0.1)
    system, answer = plant.system, hinf(plant)
    sizes = (system.nstates, system.ninputs, system.noutputs, plant.controls, plant.measurements)
    matrices = (system.A, system.B, system.C, system.D)
    theirs = sb10dd(*sizes, 1.002 * answer.gamma, *matrices)
    loop = plant.close(control.ss(*theirs[1:5], 0.1))
    assert largest_gain(loop) <= 1.0021 * answer.gamma
    for share in (0.997, 0.99, 0.95):
        try:
            theirs = sb10dd(*sizes, share * answer.gamma, *matrices)
        except ArithmeticError:
            continue
        loop = plant.close(control.ss(*theirs[1:5], 0.1))
        stable = np.abs(loop.poles()).max() < 1.0
        assert not stable or largest_gain(loop) >= 0.998 * answer.norm


def test_a_direct_term_from_control_to_measurement_changes_nothing():
    system = scalar_plant(1.0)
    norms = []
    for D22 in (0.0, 0.7):
        D = np.array(system.D)
        D[2, 2] = D22
        answer = hinf(control.ss([[1.2]], system.B, system.C, D, 0.1), measurements=1, controls=1)
        assert answer.K.dt == 0.1
        norms.append(answer.norm)
    assert norms[1] == pytest.approx(norms[0], rel=1e-6)
    assert norms[0] == pytest.approx(2.1534, rel=1e-3)  # it is made up to 1e-3 above the least


def test_sampled_mixed_sensitivity():
    G = control.tf([1.0], [1.0, -0.5], 0.1)
    W_S = control.tf([1.0, -0.3], [1.0, -0.9], 0.1)
    program = MixedSensitivity(G, W_S=W_S, W_KS=1.0)
    answer = hinf(program.plant)
    S = control.feedback(1, G * control.ss2tf(answer.K))
    stack = [W_S * S, control.ss2tf(answer.K) * S]
    gain = np.sqrt(sum(np.abs(part(ARC)) ** 2 for part in stack)).max()
    assert gain == pytest.approx(answer.norm, rel=1e-5)
