"""The plants, covers and controllers of the design problems."""

import control
import pytest
from lanes import thinned
from workbench.plants.cd_drive.control.control_problem import generalised
from workbench.plants.cd_drive.control.controller import controller as controller_problem
from workbench.plants.cd_drive.control.design import MEASUREMENT_NOISE, synthesis_plant, uncertainty
from workbench.plants.cd_drive.control.loop_weights import control_cover
from workbench.plants.cd_drive.drive.plants import controller as reference
from workbench.plants.cd_drive.uncertainty.measured_drives import measured_drives
from workbench.plants.cd_drive.uncertainty.parametric_model import parametric_plant

import workbench as wb
from workbench.errors import InputError
from workbench.executor import Context
from workbench.fitting.rational import rational_of_system
from workbench.mu import conditions
from workbench.synthesis import MuSynthesis
from workbench.uncertainty import contains

AXES = ["focus", "radial"]


@pytest.mark.cases(0)
@pytest.mark.parametrize("axis", thinned(AXES, 2))
def test_the_synthesis_plant_adds_only_noise_to_one_disturbance_and_both_outputs(axis):
    plant = synthesis_plant(axis, parametric_plant(axis))
    assert (plant.exogenous, plant.performance) == (2, 2)
    K = control.ss(reference(axis))
    whole = generalised(axis, parametric_plant(axis))
    alone = whole.channel(performance=("z_p", "z_u"), exogenous="w_p")
    without = conditions(alone, K).robust_performance
    found = MuSynthesis(plant).certified_peak(K)
    assert without.lower <= found.upper
    assert found.upper == pytest.approx(without.upper, rel=0.01 * MEASUREMENT_NOISE + 2e-3)


@pytest.mark.slow
@pytest.mark.parametrize("axis", AXES)
def test_a_third_order_controller_holds_parametric_uncertainty(axis):
    program = controller_problem(axis)
    before = program.certified_peak(program.start)
    solution = wb.solve(program, method="fixed")
    assert solution.certificate.holds, solution.certificate
    assert solution.answer.K.nstates == 3
    assert solution.answer.upper < 0.95 * before.lower
    assert solution.answer.upper < 1.0


def test_an_order_without_a_controller_to_reduce_is_named():
    with pytest.raises(
        InputError, match="order = 3 reduces the controller of an earlier method: name it by after"
    ):
        controller_problem("focus", after="", order=3)


@pytest.fixture(scope="module")
def measured():
    return measured_drives("focus", 60, 5.0, 5000.0)


@pytest.mark.slow
def test_stadiums_for_a_controller_contain_the_drives_and_hurt_its_loop_less(measured):
    K = control.ss(reference("focus"))
    run = wb.run("cd/focus/stadium-cover", method="steps", frequencies=60)
    given = uncertainty("focus", run)
    cover = control_cover("focus", 1.0, measured, 6)
    parts = {"nominal": given.nominal, "real": given.W_r, "controller": rational_of_system(K)}
    last = cover.optimised_parts(parts, ["real"], Context())
    model = cover.model(last, Context())
    assert contains(model, measured)
    peaks = [
        MuSynthesis(synthesis_plant("focus", each)).certified_peak(K) for each in (given, model)
    ]
    assert peaks[1].upper < 0.9 * peaks[0].lower
