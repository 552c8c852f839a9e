"""The loop about its working point: what it stores, draws and says, and what it refuses."""

import re
from functools import cache

import control
import numpy as np
import pytest

import workbench as wb
from workbench.errors import InputError
from workbench.synthesis import Implementation, WorkingLoop, WorkingPoint
from workbench.uncertainty import CircleCover, Responses

OMEGA = np.geomspace(0.01, 10, 60)
PLANTS = Responses(
    omega=OMEGA, values=np.array([gain / (1j * OMEGA + 1) for gain in (0.9, 1.0, 1.1)]).T
)
POINT = WorkingPoint(50.0, 20.0, u_unit="%", y_unit="K")


@cache
def board(leak=0.0, K=None, **more):
    cover = wb.solve(CircleCover(PLANTS, order=1))
    K = control.tf([2.0, 1.0], [1.0, leak]) if K is None else K
    given = {"limits": (0.0, 100.0), "working_point": POINT} | more
    return wb.solve(Implementation(cover, K, dt=0.1, **given))


@pytest.mark.cases(0)
def test_it_rests_steps_and_settles_within_its_limits():
    done = wb.solve(WorkingLoop(PLANTS, board(rate_limit=50.0)))
    assert done.certificate.holds, done.certificate
    y, u = (done.answer["signals"].sel(signal=name).values for name in "yu")
    assert (y[:, 0] == 20.0).all() and (u[:, 0] == 50.0).all()
    assert u.max() <= 100.0
    assert done.metrics["static_error"] < 1e-3
    told = done.task.tables(done.answer)["constant-signals"]
    assert "extrapolated" in told and "at 0.001592 Hz, the lowest measured frequency" in told
    assert float(done.answer["step_size"]) == pytest.approx(0.3 * 50 * 0.9, rel=1e-3)
    assert list(done.task.figures(done.answer)) == ["working-point"]


def test_the_step_for_slow_plants_is_one_that_the_records_show():
    """A fit to records of a slow plant has any static gain, here 1e5."""
    slow = Responses(
        omega=OMEGA, values=np.array([gain / (1j * OMEGA + 1e-5) for gain in (0.9, 1.0, 1.1)]).T
    )
    cover = wb.solve(CircleCover(slow, order=1, zeros=0), method="steps")
    K = control.tf([2.0, 0.2], [1.0, 0.0])
    given = {"limits": (0.0, 100.0), "working_point": POINT}
    made = wb.solve(Implementation(cover, K, dt=0.1, **given))
    (told,) = (one for one in made.task.facts(made.answer) if one.startswith("constant signals"))
    assert "static gains are extrapolated" in told
    numbers = [float(one) for one in re.findall(r"up to (\S+) K below", told)]
    assert 0 < numbers[0] <= 50 * 0.9 / OMEGA[0]
    step = float(wb.solve(WorkingLoop(slow, made)).answer["step_size"])
    assert step == pytest.approx(0.3 * 50 * 0.9 / OMEGA[0], rel=1e-3)


@pytest.mark.cases(0)
def test_an_offset_without_an_integrator_is_that_of_the_certificate():
    made = board(leak=0.1)
    done = wb.solve(WorkingLoop(PLANTS, made, step=1.0))
    assert done.certificate.holds, done.certificate
    static = float(np.real(made.answer.K(1.0)))
    assert done.metrics["static_error"] == pytest.approx(1 / (1 + 0.9 * static), rel=1e-2)
    assert done.metrics["static_error"] < made.metrics["static_error"]


@pytest.mark.cases(0)
def test_the_simulation_filters_the_set_point_as_the_code_does():
    made = board(K=control.tf([2.0, 6.0], [1.0, 0.0]), setpoint_filter=0.6)
    done = wb.solve(WorkingLoop(PLANTS, made, step=1.0))
    assert done.certificate.holds, done.certificate  # also by the difference equation of the filter
    bare = wb.solve(WorkingLoop(PLANTS, board(K=control.tf([2.0, 6.0], [1.0, 0.0])), step=1.0))
    assert done.metrics["overshoot"] < 0.05 < 0.12 < bare.metrics["overshoot"]
    assert "filter of first order with 0.6 s" in " ".join(made.task.facts(made.answer))
    (drawn,) = done.task.figures(done.answer).values()
    assert "filtered set-point" in [line.get_label() for line in drawn.axes[0].lines]


@pytest.mark.cases(0)
def test_a_control_that_is_another_is_found():
    done = wb.solve(WorkingLoop(PLANTS, board(), step=1.0))
    signals = done.answer["signals"].copy()
    signals.loc[{"signal": "u"}] += 0.01 * (np.arange(signals.sizes["time"]) > 50)
    moved = done.task.second_opinion(done.answer.assign(signals=signals))
    assert not moved[-1].holds


def test_misuse_is_named():
    with pytest.raises(InputError, match="an Implementation with an answer is needed"):
        WorkingLoop(PLANTS, None)
    with pytest.raises(InputError, match="needs a working point"):
        WorkingLoop(PLANTS, board(working_point=None, limits=None))
    with pytest.raises(InputError, match=r"step is 0\.0"):
        WorkingLoop(PLANTS, board(), step=0.0)
