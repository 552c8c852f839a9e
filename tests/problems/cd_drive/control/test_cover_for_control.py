"""Covers for control: where their search ends does not hang on the last bits of its start."""

from dataclasses import replace

import numpy as np
import pytest
from workbench.plants.cd_drive.control.cover_for_control.problem import CoverForControl
from workbench.plants.cd_drive.uncertainty.measured_drives import measured_drives

from workbench.executor import Context

SPREAD = 0.05
"""Largest relative difference of the peaks that perturbed data lead to."""
PERTURBATION, SEEDS = 1e-13, range(1, 4)
"""Relative size of the perturbations of roots and gains, and their seeds."""


def perturbed(part, random):
    """A rational function with other last bits; conjugate roots stay so."""

    def moved(values):
        phase = random.uniform(1e3, 1e4) * np.log(np.abs(values))
        return values * (1 + PERTURBATION * np.sin(phase))

    gain = float(moved(np.array(part.gain)))
    return replace(part, zeros=moved(part.zeros), poles=moved(part.poles), gain=gain)


@pytest.mark.slow
@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_the_peak_does_not_hang_on_last_bits(axis, reference):
    """The stored run is one more of them, made on another day and maybe on another processor."""
    narrowest = reference(f"cd/{axis}/stadium-cover", "steps")
    responses = measured_drives(axis, 400, 5.0, 5000.0, "own")
    peaks = [reference(f"cd/{axis}/cover-for-control").metrics["peak"]]
    for seed in SEEDS:
        study, random = (
            CoverForControl(axis, narrowest, responses, 6, 4),
            np.random.default_rng(seed),
        )
        model = study.given
        parts = {
            name: perturbed(getattr(model, name), random) for name in ("nominal", "W_c", "W_r")
        }
        object.__setattr__(study, "given", replace(model, **parts))
        answer = study.compute(Context())
        peaks.append(float(answer["peak"].sel(stage="together", bound="upper")))
    assert max(peaks) <= (1 + SPREAD) * min(peaks), peaks
