"""Sampling times that are unknown (python-control's dt=True), or that meet in one call."""

import control
import numpy as np
import pytest

from workbench.errors import InputError
from workbench.input_checks import common_time_base
from workbench.mu import loop_margins, nu_gap, peak, robust_stability
from workbench.structure import Full, Structure
from workbench.synthesis import HinfSynthesis, LoopShaping, continuous_controller, lqg
from workbench.systems import bilinear_continuous
from workbench.uncertainty import (
    GeneralisedPlant,
    MatrixResponses,
    Responses,
    dynamics,
    feedback,
)

OMEGA = np.geomspace(0.1, 30.0, 6)  # rad/s


def plant(dt):
    return control.tf([0.5], [1.0, -0.8], dt)


def uncertain(dt):
    return plant(dt) * (1 + 0.3 * dynamics("d", 1, 1))


def data(dt, *gains):
    return [control.frd(gain * plant(0.1)(np.exp(0.1j * OMEGA)), OMEGA, dt=dt) for gain in gains]


@pytest.mark.parametrize(
    ("times", "common"),
    [
        ([], None),
        ([None, None], None),
        ([None, True], True),
        ([True, 1.0], 1.0),
        ([1.0, True], 1.0),
        ([0, None, 0.0], 0.0),
        ([0.1, 0.1, None], 0.1),
    ],
)
def test_the_common_time_is_that_of_python_control(times, common):
    found = common_time_base(times)
    assert found == common and (found is True) == (common is True)


@pytest.mark.parametrize("times", [[0.0, True], [0.1, 0.2], [0.0, 0.1], [True, 0.1, 0.2]])
def test_times_that_do_not_fit_are_named(times):
    with pytest.raises(InputError, match="cannot be combined"):
        common_time_base(times)


def test_an_unknown_time_takes_that_of_its_neighbour():
    assert (uncertain(True) * plant(0.1)).dt == 0.1
    assert feedback(uncertain(1.0), plant(True)).dt == 1.0


@pytest.mark.parametrize(
    "call",
    [
        lambda: loop_margins(plant(True)),
        lambda: loop_margins(data(True, 1.0)[0]),
        lambda: robust_stability(feedback(uncertain(True), 1)),
        lambda: nu_gap(plant(True), plant(True)),
        lambda: peak(plant(True), Structure([Full(1, 1)])),
        lambda: bilinear_continuous(plant(True)),
        lambda: continuous_controller(plant(True)),
        lambda: lqg(control.ss(plant(True)), 1.0, 1.0, 1.0, 1.0),
        lambda: LoopShaping(plant(True)),
        lambda: HinfSynthesis(
            GeneralisedPlant(control.ss(0.5, [[1, 1]], [[1], [1]], 0, True), None, 1, 1)
        ),
        lambda: MatrixResponses.of_systems([plant(True)], OMEGA),
        lambda: MatrixResponses.from_frd(data(True, 1.0, 1.1)),
        lambda: Responses.from_frd(data(True, 1.0, 1.1)),
    ],
)
def test_no_second_stands_for_an_unknown_time(call):
    with pytest.raises(InputError, match="sampling time is not given"):
        call()


def test_measured_responses_keep_their_sampling_time():
    sampled, plain = data(0.1, 1.0, 1.1), data(0, 1.0, 1.1)
    assert Responses.from_frd(sampled).dt == Responses.from_frd(plain, dt=0.1).dt == 0.1
    assert Responses.from_frd(plain).dt == 0.0
    assert MatrixResponses.from_frd(sampled).dt == 0.1
    for both in (lambda: Responses.from_frd(sampled, dt=0.2), lambda: nu_gap(plant(0.1), plant(0))):
        with pytest.raises(InputError, match="cannot be combined"):
            both()
