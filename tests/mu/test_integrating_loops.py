"""Ordinary loops with integrators, as transfer functions: margins in closed form, in any unit."""

import control
import numpy as np
import pytest

from workbench.mu import loop_margins
from workbench.mu.margins.classical import classical_margins
from workbench.systems.conversion import as_system


def pi_on_an_integrator(seed):
    """Plant k/(a s), a PI, the crossover [rad/s] and the phase margin [deg] of their loop."""
    rng = np.random.default_rng(seed)
    proportional, integral, k, a = 10 ** rng.uniform(-2, 2, 4)
    unit = 10 ** rng.uniform(-6, 6)  # of time
    plant = control.tf([k * unit], [a, 0.0])
    controller = control.tf([proportional, integral * unit], [1.0, 0.0])
    g, i = k * unit / a, integral * unit
    # w^4 = g^2 (p^2 w^2 + i^2) where |L| = 1
    square = ((g * proportional) ** 2 + np.sqrt((g * proportional) ** 4 + 4 * (g * i) ** 2)) / 2
    crossover = np.sqrt(square)
    return plant, controller, crossover, np.degrees(np.arctan2(proportional * crossover, i))


@pytest.mark.parametrize("seed", range(60))
def test_a_pi_on_an_integrator(seed):
    """104 of 200 such loops had no phase margin: poles at 0 had become dust of 1e-17."""
    plant, controller, crossover, phase = pi_on_an_integrator(seed)
    for loop in (plant * controller, control.series(plant, controller)):
        found = classical_margins(loop)
        assert found.phase_deg == pytest.approx(phase, rel=1e-6)
        assert found.phases_deg[:, 1] == pytest.approx([crossover], rel=1e-6)
        assert found.delay == pytest.approx(np.radians(phase) / crossover, rel=1e-6)
        assert found.stable and found.gain == (0.0, np.inf)


@pytest.mark.parametrize("seed", range(6))
def test_all_margins_of_such_a_loop(seed):
    plant, controller, _, phase = pi_on_an_integrator(seed)
    for found in (loop_margins(plant * controller), loop_margins(plant, controller)):
        assert found.holds, found.certificate.failures
        for margins in found.classical.values():
            assert margins.phase_deg == pytest.approx(phase, rel=1e-6)


@pytest.mark.parametrize("seed", range(20))
def test_three_integrators_and_a_double_zero(seed):
    """L = k (s + z)^2 / s^3: k z crosses where w^3 = k (w^2 + z^2)."""
    rng = np.random.default_rng(seed)
    unit = 10 ** rng.uniform(-6, 6)
    k, z = 10 ** rng.uniform(-1, 1, 2) * unit
    found = classical_margins(control.tf(k * np.poly([-z, -z]), [1.0, 0.0, 0.0, 0.0]))
    crossover = np.roots([1.0, -k, 0.0, -k * z * z])
    w = float(crossover[np.abs(crossover.imag) < 1e-9 * np.abs(crossover)].real.max())
    phase = 2 * np.degrees(np.arctan2(w, z)) - 90.0  # -270 + 180 + 2 atan(w / z)
    assert found.phases_deg[:, 1] == pytest.approx([w], rel=1e-6)
    assert found.phases_deg[:, 0] == pytest.approx([phase], abs=1e-5)
    # On the real axis at w = z, where L = k (2 j z^2) / (-j z^3) = -2 k / z.
    assert found.gains[0] == pytest.approx([z / (2 * k), z], rel=1e-6)


def test_poles_at_zero_are_exact_and_signals_keep_their_names():
    system = control.tf([2.0, 1.0], [1.0, 3.0, 0.0, 0.0], inputs="u", outputs="y")
    found = as_system(system, "plant")
    poles = np.sort(np.abs(found.poles()))
    assert poles[:2].tolist() == [0.0, 0.0] and poles[2] == pytest.approx(3.0)
    assert found.input_labels == ["u"] and found.output_labels == ["y"]
    s = np.array([0.3j, 2.0j])
    assert found(s) == pytest.approx(system(s))
