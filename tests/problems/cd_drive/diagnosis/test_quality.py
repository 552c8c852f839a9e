"""The diodes' quality signal and binary detector on the virtual laboratory's records."""

import numpy as np
import pytest
from workbench.plants.cd_drive.diagnosis.quality import DARK, dimming_detector, diode_quality
from workbench.plants.cd_drive.drive.disc import Defect
from workbench.plants.cd_drive.laboratory.experiment import Laboratory, measurements

from workbench.diagnosis import clean_level
from workbench.simulation import play


@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_the_clean_level_is_the_drives_optical_gains(axis):
    bench = Laboratory(axis, "CD7")
    still = [Defect(length=1e-3, depth=0.9)]
    found = clean_level(bench.open_loop(np.zeros(3500), defects=still).sum)
    assert found == pytest.approx(bench.parameters.K_opt / bench.parameters.K_optn, rel=0.01)


def test_the_diodes_and_their_sum_are_what_is_read():
    record = Laboratory("focus", "CD7").open_loop(
        np.zeros(3500), defects=[Defect(length=1e-3, depth=0.9)]
    )
    level = clean_level(record.sum)
    found = play(diode_quality(level, 0.1, 0.5), measurements(record))
    total = record.d1 + record.d2
    assert found[:, 1] == pytest.approx(abs(1.0 - total / level) / np.sqrt(2.0), abs=1e-12)
    bright = total > DARK * level
    ratio = ((record.d1 - record.d2) / total)[bright]
    assert found[bright, 2] == pytest.approx(ratio, abs=1e-12)
    for brighter, alarm in ((1.0, 0.0), (2.0, 1.0)):  # a level above the record: it is dimmed
        assert (play(dimming_detector(brighter * level), measurements(record)) == alarm).all()
