"""The gain raised and lowered until the loop fails."""

import numpy as np
import pytest
from workbench.plants.cd_drive.drive.margins import nearest_margins
from workbench.plants.cd_drive.laboratory.bench_setup import RATE
from workbench.plants.cd_drive.laboratory.gain_ramp import (
    DIRECTIONS,
    FARTHEST,
    gain_ramp,
    oscillation,
)

import workbench as wb
from workbench.solvers import Options


@pytest.mark.parametrize("frequency", [84.0, 1700.0])
def test_the_frequency_of_a_growing_oscillation(frequency):
    time = np.arange(round(0.2 * RATE)) / RATE
    wobble = 5.0 * np.sin(2 * np.pi * 6.0 * time)
    signal = np.exp(10.0 * time) * np.sin(2 * np.pi * frequency * time) + wobble
    assert oscillation(signal) == pytest.approx(frequency, abs=4.0)


@pytest.mark.cases(1)
@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_the_models_limits_lie_within_the_ramps(axis):
    limits = [nearest_margins(gain_ramp(axis).loop(f"CD{n}")) for n in range(1, 13)]
    assert max(20 * np.log10(one.increase) for one in limits) < FARTHEST["up"]
    assert max(-20 * np.log10(one.decrease) for one in limits) < FARTHEST["down"]


@pytest.mark.slow
def test_a_ramp_ends_by_a_full_control_signal_or_a_lost_focus():
    task = gain_ramp("focus")
    up, down = (task.ending(way, task.record("CD8", way, 1)) for way in DIRECTIONS)
    assert up.full and not down.full
    assert 5.0 < up.change < 12.0 and -31.0 < down.change < -25.0
    assert down.frequency == pytest.approx(85.0, abs=8.0)


@pytest.mark.slow
@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_another_seed_changes_no_verdict(axis):
    task = gain_ramp(axis, draws=1)
    for seed in (0, 1):
        solution = wb.solve(task, options=Options(seed=seed))
        assert solution.certificate.holds, solution.certificate
        assert set(task.figures(solution.answer)) == {"gain-ramp"}
