"""What families, starts and fixed structures say to what they cannot take: what was given, what is
needed."""

import re

import control
import numpy as np
import pytest
from loop_plants import S, tracking
from tables import each
from workbench.plants.textbook.distillation import distillation_column

from workbench import Outcome, solve
from workbench.errors import InputError
from workbench.structure import Full, Real, Structure
from workbench.synthesis import (
    PD,
    PI,
    PID,
    Decentralised,
    H2HinfSynthesis,
    H2Synthesis,
    HinfSynthesis,
    LeadLag,
    Modal,
    MuSynthesis,
    Static,
)
from workbench.uncertainty import GeneralisedPlant

PLANT = tracking(1 / (S + 1), 1.0)
APART = tracking(1 / (S + 1), 1.0, apart=True)
COLUMN = distillation_column()
GAIN = control.ss([], [], [], [[2.0]])
TWO = control.ss([], [], [], 0.1 * np.eye(2))
NAN, INF = float("nan"), float("inf")
NO_NUMBERS = [NAN, INF, -1.0, 0.0, "1", 1j, True, [1.0]]
NO_LEAKS = [NAN, INF, -1.0, "1", None, 1j, True, [0.0]]
NO_COUNTS = [-1, 1.5, "2", None, True, NAN]

CONSTRUCTED = [
    *((lambda w=w: PID(filter=w), "filter is .*positive") for w in NO_NUMBERS),
    *((lambda w=w: PD(filter=w), "filter is .*positive") for w in NO_NUMBERS),
    *((lambda w=w: PID(leak=w), "leak is .*0 or more") for w in NO_LEAKS),
    *((lambda w=w: PI(leak=w), "leak is .*0 or more") for w in NO_LEAKS),
    *((lambda w=w: LeadLag(leak=w), "leak is .*0 or more") for w in NO_LEAKS),
    *((lambda w=w: LeadLag(zeros=w), "zeros|proper") for w in NO_COUNTS),
    *((lambda w=w: LeadLag(poles=w), "poles|proper") for w in NO_COUNTS),
    *((lambda w=w: LeadLag(sign=w), "sign is .*1, -1 or None") for w in (0.0, 2, "+", NAN)),
    *((lambda w=w: Modal(w), "order is .*(whole|0 or more)") for w in NO_COUNTS),
    *((lambda w=w: PID(setpoint_weights=w), "setpoint_weights") for w in (1, None, "yes", (1, 0))),
    (lambda: LeadLag(zeros=4, poles=2), "4 zeros and 2 poles.*proper"),
    (lambda: Modal(2, corners=(1.0, 2.0)), "2 corners for order 2; there must be 1"),
    (lambda: Decentralised(), "no channels are given; Decentralised"),
    (lambda: Decentralised(PID), "channel 1 is the class PID: write PID()"),
    (lambda: Decentralised(PI(), "PI"), "channel 2 must be a Family, not str"),
    (lambda: Decentralised(PI(), PI(setpoint_weights=True)), "2 inputs"),
    (lambda: Decentralised(Decentralised(PI(), PI())), "2 inputs and 2 outputs"),
    (lambda: Decentralised([PI(), PI()]), "channel 1 must be a Family, not list"),
    (lambda: PID.of(0.0, 0.0, 0.0, 1.0), "not all zero"),
    (lambda: PID.of(1.0, 1.0, 1.0, 0.0), "T positive"),
    (lambda: PID.of(NAN, 1.0, 1.0, 1.0), "finite"),
    (lambda: PID.of(1.0, 1.0, 1.0, INF), "T positive"),
    (lambda: PID.of(1.0, 1.0, 1.0, 1.0, leak=-1.0), "leak is -1.0"),
]  # fmt: skip


@each(("call", "said"), CONSTRUCTED)
def test_families_that_cannot_be(call, said):
    with pytest.raises(InputError, match=said):
        call()


NO_FAMILIES = [
    (PID, r"family is the class PID: write PID\(\)"),
    (Decentralised, r"family is the class Decentralised: write"),
    ("PID", r"family must be a Family, not str: PID\(\)"),
    (1, "family must be a Family, not int"),
    ([PID()], "not list"),
    (GAIN, "not StateSpace"),
    (lambda: PID(), "not function"),
    (PID.of(1.0, 1.0, 1.0, 1.0), "tuple of a family and parameters.*second as start"),
    (Decentralised(PI(), PI()), "2 inputs and 2 outputs, the plant 1 measurements"),
    (PID(setpoint_weights=True), "2 inputs and 1 outputs.*leave out setpoint_weights"),
    (PI(setpoint_weights=True), "leave out setpoint_weights"),
    (Modal(1, inputs=2, outputs=1), "2 inputs and 1 outputs.*leave both numbers out"),
]


QUIET = control.ss(
    [[-1.0]], [[1.0, 0, 1]], [[1.0], [0], [1]], [[0, 0, 0], [0, 0, 1.0], [0, 1.0, 0]]
)  # no direct term from the disturbances to the performance
PROGRAMS = {
    "mu": lambda **asked: MuSynthesis(PLANT, **asked),
    "hinf": lambda **asked: HinfSynthesis(PLANT.nominal(), **asked),
    "h2": lambda **asked: H2Synthesis(GeneralisedPlant(QUIET, None, 1, 1), **asked),
    "mixed": lambda **asked: H2HinfSynthesis(PLANT, 10.0, **asked),
}
NO_DEMANDS = [
    *(("order", value) for value in (-1, 1.5, "2", True, NAN, [2])),
    *(("fastest_pole", value) for value in NO_NUMBERS),
    *(("largest_gain", value) for value in NO_NUMBERS),
    *(("stable", value) for value in (1, "yes", None, [True])),
    *(("random", value) for value in (-1, 1.5, "2", None, NAN)),
]


@pytest.mark.parametrize("program", PROGRAMS)
@pytest.mark.parametrize(("family", "said"), NO_FAMILIES)
def test_families_that_are_none_or_do_not_fit(program, family, said):
    with pytest.raises(InputError, match=said):
        PROGRAMS[program](family=family)


@pytest.mark.parametrize("program", PROGRAMS)
@each(("name", "value"), NO_DEMANDS)
def test_demands_that_are_none(program, name, value):
    with pytest.raises(InputError, match=name):
        PROGRAMS[program](**{"order": 1, name: value})


@pytest.mark.parametrize("family", [PID(), PI(), PD(), LeadLag(), Decentralised(PI())])
def test_one_channel_for_a_plant_of_two(family):
    with pytest.raises(InputError, match=r"the plant 2 measurements and 2 controls: .*channel"):
        MuSynthesis(COLUMN, family=family)


@pytest.mark.parametrize("family", [PID(), PI(), PD()])
def test_a_set_point_measured_apart(family):
    with pytest.raises(InputError, match=r"setpoint_weights=True\) takes the set-point r"):
        MuSynthesis(APART, family=family)


STARTS = [
    (PID(), [1.0, 1.0], "start has 2 numbers; a member of PID.* has 4 parameters"),
    (PID(filter=1.0), [1.0, 1.0, 0.1, 0.0], "start has 4 numbers.* has 3 parameters"),
    (PI(), [1.0], "start has 1 numbers"),
    (PI(), [], "start has 0 numbers"),
    (PI(), [NAN, 1.0], "start"),
    (PI(), ["a", "b"], "start"),
    (PI(), [1j, 1.0], "start"),
    (PI(), "PI", "not str"),
    (PI(), {"P": 1.0}, "dict"),
    (PI(), [-3.0, -1.0], "does not stabilise"),
    (PID(), GAIN, "where D is zero give it a small gain"),
    (PI(), control.tf([1.0, 1.0], [1.0, 0.5]), "slow pole is -0.5"),
    (PI(), control.tf([1.0, 2.0], [1.0, 1.0, 0.0]), "no member"),
    (PI(), control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]]), "slow pole"),
    (PID(), control.tf([1.0], [1.0, 2.0, 1.0, 0.0]), "3 states"),
    (PID(), TWO, "2 inputs, 2 outputs"),
    (PI(), control.ss([[1.0]], [[1.0]], [[1.0]], [[1.0]], 0.1), "continuous time"),
    (PD(), control.tf([1.0, 1.0], [1.0, 0.0]), "no member|filter"),
    (PID(filter=0.5), control.tf([2.0, 1.0, 1.0], [1.0, 1.0, 0.0]), "no member"),
    (LeadLag(), control.tf([1.0, 0.1, 1.0], [1.0, 1.0, 0.0]), "must be real"),
    (LeadLag(), control.tf([1.0, 1.0], [1.0, 0.5]), "belongs to"),
    (LeadLag(), GAIN, "at least one pole"),
    (LeadLag(), [0.0], "start has 1 numbers.* has 5 parameters"),
    (Static(), control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]]), "1 states, a member .* 0"),
    (Static(), [1.0, 2.0], "start has 2 numbers"),
    (Modal(2), GAIN, "0 states, a member .* 2"),
    (Modal(2), control.tf([1.0], [1.0, 2.0, 1.0]), "defective|equal"),
    (None, [1.0, 2.0, 3.0, 4.0], "controller has 4 inputs and 1 outputs"),
    (None, "K", "start|str"),
    (None, control.tf([1, 1, 1], [1, 1]), "improper"),
]  # fmt: skip


@each(("family", "start", "said"), STARTS)
def test_starts_that_are_none(family, start, said):
    with pytest.raises(InputError, match=said):
        MuSynthesis(PLANT, start=start, family=family)


def test_starts_of_two_channels():
    family = Decentralised(PI(), PI())
    with pytest.raises(InputError, match=r"start has 3 numbers.* has 4 parameters"):
        MuSynthesis(COLUMN, start=[1.0, 1.0, 1.0], family=family)
    coupled = control.ss([], [], [], [[1.0, 0.5], [0.0, 1.0]])
    with pytest.raises(InputError, match="not diagonal"):
        MuSynthesis(COLUMN, start=coupled, family=family)


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"family": PID(), "stable": True}, "controller stable. An integrator is not stable"),
        ({"family": LeadLag(), "stable": True}, "An integrator is not stable: give it a leak"),
        ({"family": PID(filter=0.01), "fastest_pole": 10.0}, "a fixed filter is a pole"),
        ({"family": PID(), "order": 1}, "demands on the controller: order"),
        ({}, r"give start, or order, or a family such as PID\(\)"),
    ],
)
def test_what_no_member_can_meet(asked, said):
    found = solve(MuSynthesis(PLANT, **asked), method="fixed")
    assert found.outcome is Outcome.FAILED
    assert re.search(said, found.message), found.message


def test_a_family_without_examples_needs_a_start():
    class Bare(PI):
        def examples(self, corner, gain):
            return ()

        def nearest(self, K, omega, weight):
            return None

    found = solve(MuSynthesis(PLANT, family=Bare()))
    assert found.outcome is Outcome.FAILED and "give a start" in found.message
    found = solve(MuSynthesis(PLANT, family=Bare(), start=[1.0, 1.0]))
    assert found.certificate.valid


def test_plants_and_structures_that_do_not_fit():
    with pytest.raises(InputError, match=r"no perturbation.*a family or an order"):
        MuSynthesis(PLANT.nominal())
    with pytest.raises(InputError, match="for continuous controllers"):
        MuSynthesis(sampled(PLANT), family=PI(), fastest_pole=10.0)
    with pytest.raises(InputError):
        MuSynthesis(PLANT, Structure([Full(4, 4)]), family=PI())
    with pytest.raises(InputError):
        MuSynthesis(PLANT, Structure([Real(1), Real(1), Real(1)]), family=PI())


def sampled(plant):
    from workbench.systems.bilinear import bilinear_sampled

    system = bilinear_sampled(plant.system, 0.01)
    return GeneralisedPlant(system, plant.structure, plant.controls, plant.measurements)
