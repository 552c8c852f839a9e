"""Loop shaping of transfer functions that are sampled fast, against closed forms and continuity."""

import math

import control
import pytest

import workbench as wb
from workbench.synthesis import LoopShaping


@pytest.mark.parametrize("dt", [0.01, 1e-3])
@pytest.mark.parametrize("den", [[1, 0.2, 1], [1, 0, 0], [1, 1, 0], [1, 0, -1]])
def test_a_fast_sampled_plant_has_nearly_the_margin_of_the_continuous_one(den, dt):
    """The states are nearly parallel: most of these had no Riccati solution or no proven margin."""
    G = control.tf([1], den)
    sampled = wb.solve(LoopShaping(control.sample_system(G, dt)))
    assert sampled.holds
    norm = sampled.answer.norm
    assert norm == pytest.approx(wb.solve(LoopShaping(G)).answer.norm, rel=2 * dt)
    if den == [1, 0, 0]:  # in continuous time
        assert norm == pytest.approx(math.sqrt(4 + 2 * math.sqrt(2)), rel=2 * dt)
