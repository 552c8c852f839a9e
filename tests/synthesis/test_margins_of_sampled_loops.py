"""Margins of sampled loops whose responses are known in closed form."""

import math

import control
import numpy as np
import pytest

from workbench.synthesis.implementation import sampled_loop
from workbench.synthesis.implementation.sampled_loop import _crossings, _delay_margin, _margins
from workbench.synthesis.implementation.sampled_response import HeldPlantLoop
from workbench.systems.conversion import as_system

INTEGRATOR = control.tf([1.0], [1.0, 0.0]), 10.0, 0.1
"""L = 1 / (z - 1)."""
UNSTABLE = control.tf([math.log(1.5)], [1.0, -math.log(1.5)]), 2.0, 1.0
"""L = 1 / (z - 1.5)."""


def loop(plant, gain, period):
    K = control.ss([], [], [], [[gain]], period)
    return HeldPlantLoop(as_system(plant, "plant"), K, period, 0.0, -1)


@pytest.mark.parametrize(
    ("case", "gain", "phase"),
    [(INTEGRATOR, (0.0, 2.0), 60.0), (UNSTABLE, (0.5, 2.5), math.degrees(math.acos(0.875)))],
)
def test_gains_and_phase(monkeypatch, case, gain, phase):
    """|e^(j a) - p| = 1 where cos a = p / 2; there -L has the angle that is kept."""
    monkeypatch.setattr(sampled_loop, "_delay_margin", lambda *given: 1.0)
    found = _margins(loop(*case), 0)
    assert found.gain == (pytest.approx(gain[0]), pytest.approx(gain[1]))
    pole = 1.0 if case is INTEGRATOR else 1.5
    crossing = np.exp(1j * math.acos(pole / 2))
    assert found.phase_deg == pytest.approx(
        abs(np.angle(-1 / (crossing - pole), deg=True)), rel=1e-6
    )
    assert case is not INTEGRATOR or found.phase_deg == pytest.approx(phase)


@pytest.mark.parametrize(("earlier", "delay"), [(None, 1.0), (0.3, 0.3)])
def test_a_delay_that_loses_the_loop_earlier_counts(monkeypatch, earlier, delay):
    monkeypatch.setattr(sampled_loop, "_unstable_from", lambda *given: earlier)
    monkeypatch.setattr(sampled_loop, "STARTING_DELAYS", (0.0, 1.0))
    held = loop(*INTEGRATOR)
    assert _delay_margin(held, 0, held.angles()) == pytest.approx(delay)


def test_a_change_of_sign_that_rounding_hides_is_a_crossing_at_an_end():
    """Values of many frequencies at once and of one differ in their last bits."""
    x = np.array([1.0, 2.0, 3.0])
    values = np.array([2e-18, -1e-18, -1.0])
    assert _crossings(x, values, lambda at: -1e-18 if at < 1.5 else -3e-18) == [1.0]
    assert _crossings(x, values, lambda at: 1.25 - at) == [pytest.approx(1.25, abs=1e-12)]
