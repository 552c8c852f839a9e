"""Open loops of the drives: their margins and bandwidths are those printed, and a delay's."""

import pytest
from workbench.plants.cd_drive.control.loops import open_loop, plants
from workbench.plants.cd_drive.drive.margins import nearest_margins
from workbench.plants.cd_drive.drive.plants import crossover, phase_margin
from workbench.plants.cd_drive.laboratory.bench_setup import PERIOD

from workbench.systems import bandwidths


@pytest.mark.parametrize("axis", ["focus", "radial"])
def test_the_nominal_loop_is_the_drives_own(axis):
    loop = open_loop(axis, plants(axis, "own", "printed")["nominal"])
    found = nearest_margins(loop)
    assert bandwidths(loop)["crossover"] == pytest.approx(crossover(axis), rel=1e-8)
    assert found.phase == pytest.approx(phase_margin(axis), rel=1e-8)


def test_delay_costs_phase():
    plant = plants("focus", "agc", "printed")["CD3"]
    none, half = (nearest_margins(open_loop("focus", plant, delay)) for delay in (0.0, 0.5))
    lost = 0.5 * PERIOD * none.crossover_hz * 360
    assert none.phase - half.phase == pytest.approx(lost, rel=2e-3)
    assert half.increase < none.increase
