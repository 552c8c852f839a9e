"""Whether the words came true: by signals whose quality is known, and in a loop."""

from functools import cache

import control
import numpy as np
import pytest

import workbench as wb
from workbench.errors import InputError
from workbench.fitting import Rational
from workbench.synthesis import Demands, Implementation, KeptDemands, WorkingPoint
from workbench.synthesis.demands.reached import (
    reached_by_responses,
    recovery_time,
    step_quality,
)
from workbench.uncertainty import Responses, UncertaintyModel

OMEGA = np.geomspace(0.01, 10, 40)
PLANTS = Responses(omega=OMEGA, values=np.array([gain / (1j * OMEGA + 1) for gain in (0.9, 1.1)]).T)
MODEL = UncertaintyModel(control.tf([1.0], [1.0, 1.0]), control.tf([0.12], [1.0]))
TIME = np.arange(4000) * 0.01


def test_two_poles_have_the_overshoot_of_the_book():
    z = 0.5
    y = control.step_response(control.tf([1.0], [1.0, 2 * z, 1.0]), TIME).outputs
    overshoot, settling = step_quality(y, 0.01)
    assert overshoot == pytest.approx(np.exp(-np.pi * z / np.sqrt(1 - z * z)), rel=1e-3)
    assert settling == pytest.approx(8.08, abs=0.02)  # of damping 0.5, to 2 %


def test_the_double_pole_recovers_when_it_should():
    assert recovery_time(TIME * np.exp(-TIME), 0.01) == pytest.approx(4.89, abs=0.02)


def test_an_integrating_loop_reaches_its_own_bandwidth():
    """L = a / s: |S| keeps the weight of the bandwidth a, and of no larger one."""
    plant = control.ss([[1.0]], [[0.001]], [[1.0]], [[0.0]], 0.001)  # 1 / s, held
    K = control.ss([], [], [], [[2.0]], 0.001)
    nominal = Rational([], [-1e-9], 1.0)
    found = reached_by_responses(plant, K, -1, Demands(bandwidth=1.0), nominal)
    assert found["bandwidth"] == pytest.approx(2.0, rel=1e-2)


@cache
def board():
    K = control.tf([2.0, 2.0], [1.0, 0.0])
    point = WorkingPoint(50.0, 20.0, u_unit="%", y_unit="K")
    given = {"limits": (0.0, 100.0), "working_point": point}
    return wb.solve(Implementation(MODEL, K, dt=0.05, **given))


@pytest.mark.slow
def test_each_demand_is_judged_on_each_plant():
    demands = Demands(
        bandwidth=1.5, overshoot=0.05, settling_time=2.5, recovery_time=9.0, effort=0.1,
        control_rms=0.1, noise=0.1, control_range=20.0, setpoint_step=5.0,
    )  # fmt: skip
    study = KeptDemands(PLANTS, board(), demands, peak=0.9)
    done = wb.solve(study)
    assert done.certificate.holds, done.certificate
    missed = {name: done.metrics[f"missed_{name}"] for name in study.asked}
    # K = 2 (s + 1) / s: S is that of a lag of gain * 2, which settles within log(50) / 1.8.
    assert missed["settling_time"] == missed["overshoot"] == missed["bandwidth"] == 0
    assert missed["control_rms"] == 2  # noise of 0.1 times a gain of 2
    assert missed["control_range"] == 0 and missed["limits"] == 0
    tables = study.tables(done.answer)
    assert "missed by 2 of 2" in tables["demands"] and "keeps" in tables["certificate-for-the-set"]
    assert {"demands", "working-point"} <= study.figures(done.answer).keys()


def test_misuse_is_named():
    with pytest.raises(InputError, match="nothing is demanded"):
        KeptDemands(PLANTS, board(), Demands())
    with pytest.raises(InputError, match="demands"):
        KeptDemands(PLANTS, board(), None)
