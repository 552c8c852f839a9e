"""K' by mu synthesis: robust, slower than K, and stored with its sampled form."""

import numpy as np
import pytest
from workbench.plants.cd_drive.laboratory.bench_setup import PERIOD
from workbench.plants.cd_drive.tolerance.lower_bandwidth import ROLL_OFF, lower_bandwidth, roll_off

import workbench as wb
from workbench.errors import InputError
from workbench.systems.storage import restored_system


@pytest.fixture(scope="module")
def solved():
    program = lower_bandwidth("focus")
    return program, wb.solve(program, method="fixed")


@pytest.mark.cases(0)
def test_its_certificate_holds(solved):
    _, solution = solved
    assert solution.certificate.failures == ()
    assert solution.answer.upper < 1.0  # robust performance: all three channels, all plants
    assert solution.answer.K.nstates == 3


@pytest.mark.cases(0)
def test_defects_move_the_lens_less(solved):
    program, solution = solved
    slow, fast = (program.defect_gain(K) for K in (solution.answer.K, program.reference))
    assert slow < 0.45 * fast
    found = program.metrics(solution.answer)
    assert found["T_defects"] == slow
    robust = [c for c in solution.certificate.checks if c.name == "robust stability"]
    assert robust[0].value < 1.0


def test_others_can_restore_both_forms(solved):
    program, solution = solved
    data = program.to_dataset(solution.answer)
    K, sampled = (restored_system(data, name) for name in ("controller", "sampled"))
    assert sampled.dt == pytest.approx(PERIOD)
    omega = 2 * np.pi * 300.0
    ratio = complex(sampled(np.exp(1j * omega * PERIOD))) / complex(K(1j * omega))
    assert abs(ratio - 1) < 1e-2


def test_the_reference_controller_fails_the_check_of_immunity(solved):
    program, solution = solved
    other = type(solution.answer)(program.reference, 0.0, 10.0, 1.0)
    failed = {each.name for each in program.checks(other, 1e-6) if not each.holds}
    assert "immunity" in failed


def test_roll_off():
    s = 2j * np.pi * ROLL_OFF
    assert abs(complex(roll_off()(1e-3 * s))) == pytest.approx(1.0, abs=1e-3)
    assert abs(complex(roll_off()(s))) == pytest.approx(2**0.5, rel=1e-3)
    assert abs(complex(roll_off()(10 * s))) == pytest.approx(10.0, rel=0.05)


def test_wrong_input_is_named():
    for wrong in ({"share": 0.0}, {"defect_mm": -1.0}, {"start": 11.0}):
        with pytest.raises(InputError):
            wb.run("cd/focus/lower-bandwidth", **wrong)
