"""The order of the searches of covers for control; what they find is checked by its own study."""

import pytest
from workbench.plants.cd_drive.control.cover_for_control.problem import CoverForControl, DesignStage

from workbench.executor import Context


class Searches(CoverForControl):
    """Searches that give the next of given peaks, each from the stage before."""

    def given_peaks(self, designed, together):
        object.__setattr__(self, "designs", iter(designed))
        object.__setattr__(self, "ends", iter(together))
        return self

    def _designed(self, stage):
        return DesignStage(stage.model, stage.K, next(self.designs))

    def _together(self, cover, best, steps, context):
        return min(best, DesignStage(best.model, best.K, next(self.ends)), key=lambda one: one.peak)


@pytest.mark.parametrize(
    ("designed", "together", "reached"),
    [
        ([0.9, 0.8, 0.8], [0.85, 0.9, 0.9], 0.8),  # the third round no longer falls
        ([1.2], [1.1], 1.0),  # no round falls
        ([0.9, 0.8, 0.7, 0.6, 0.5], [1.0] * 5, 0.6),  # four rounds at most
    ],
)
def test_controllers_lead_on_as_long_as_the_peak_falls(designed, together, reached):
    study = Searches("focus", None, None, 6, rounds=4).given_peaks(designed, together)
    steps = []
    found = study._led_on(None, DesignStage(None, None, 1.0), steps, Context())
    assert found.peak == reached
    assert [peak for _, peak in steps] == designed[: len(steps)]
