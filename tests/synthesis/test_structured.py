"""Families with a name: their slopes, their members back, their place in mu synthesis."""

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from workbench.plants.textbook.distillation import distillation_column
from workbench.plants.textbook.first_order import unstable_first_order

import workbench as wb
from workbench.errors import InputError
from workbench.synthesis import PID, Decentralised, LeadLag, MuSynthesis

OMEGA = np.geomspace(1e-3, 1e3, 30)
number = st.floats(-2, 2).map(lambda x: round(x, 3))


def members(seed):
    rng = np.random.default_rng(seed)
    lead = LeadLag(leak=1e-4, sign=-1.0), rng.normal(size=5)
    pid = PID.of(*rng.normal(size=3), float(np.exp(rng.normal())), leak=1e-5)
    return [lead, pid, Decentralised.of([lead, pid])]


@given(st.integers(0, 1000))
@settings(max_examples=20)
def test_responses_are_those_of_the_systems_and_slopes_those_of_differences(seed):
    for family, x in members(seed):
        K, slopes = family.response(x, OMEGA)
        system = np.moveaxis(family.system(x)(1j * OMEGA, squeeze=False), -1, 0)
        np.testing.assert_allclose(K, system, rtol=1e-8, atol=1e-10)
        for k, step in enumerate(1e-6 * np.eye(len(x))):
            above, below = (family.response(x + sign * step, OMEGA)[0] for sign in (1, -1))
            scale = np.abs(K).max(axis=(1, 2), keepdims=True) + 1.0
            assert np.abs((above - below) / 2e-6 - slopes[:, k]).max() <= 1e-6 * scale.max()


@given(st.integers(0, 1000))
@settings(max_examples=20)
def test_members_are_recognised(seed):
    for family, x in members(seed):
        again = family.parameters(family.system(x))
        expected, _ = family.response(x, OMEGA)
        np.testing.assert_allclose(family.response(again, OMEGA)[0], expected, rtol=1e-5)


def test_the_thesis_controller_is_a_lead_lag_one():
    from workbench.plants.cd_drive.drive.plants import controller

    family, x = LeadLag.of(controller("focus"))
    assert (family.zeros, family.poles, family.sign) == (2, 2, 1.0)
    assert family.leak == pytest.approx(2 * np.pi * 1.6e-4)
    corners = np.exp(x[1:]) / (2 * np.pi)
    np.testing.assert_allclose(corners, [31, 230, 9820, 14130], rtol=1e-6)
    assert np.exp(x[0]) == pytest.approx(12.9e6, rel=1e-6)


@pytest.mark.parametrize(
    ("K", "words"),
    [
        (control.tf([1.0, 0.1, 1.0], [1.0, 1.0, 0.0]), "must be real"),
        (control.tf([1.0, -1.0], [1.0, 1.0]), "not right of"),
        (control.ss(np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), [[1.0]]), "one pole"),
        (control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2))), "one input"),
    ],
)
def test_controllers_that_are_no_lead_lag_are_named(K, words):
    with pytest.raises(InputError, match=words):
        LeadLag.of(K)


def test_families_that_cannot_be_are_named():
    with pytest.raises(InputError, match="proper"):
        LeadLag(zeros=4, poles=2)
    with pytest.raises(InputError, match="T positive"):
        PID.of(1.0, 1.0, 0.0, -1.0)
    with pytest.raises(InputError, match="belongs to"):
        LeadLag(leak=0.5).parameters(control.zpk([-1.0, -2.0], [-0.1, -5.0, -7.0], 1.0).to_ss())
    with pytest.raises(InputError, match="where D is zero give it a small gain"):
        PID.of(1.0, 1.0, 1.0, 1.0)[0].parameters(control.ss([], [], [], [[2.0]]))
    coupled = control.ss([], [], [], [[1.0, 0.5], [0.0, 1.0]])
    family, _ = Decentralised.of([PID.of(1.0, 1.0, 1.0, 1.0)] * 2)
    with pytest.raises(InputError, match="not diagonal"):
        family.parameters(coupled)


@pytest.mark.slow
def test_a_pid_for_an_unstable_plant_gets_near_the_best_of_full_order():
    plant = unstable_first_order()
    family, x = PID.of(10.0, 10.0, 0.1, 0.01, leak=0.006)
    start = family.system(x)
    before = MuSynthesis(plant).certified_peak(start)
    solution = wb.solve(MuSynthesis(plant, start=start, family=family, random=1), method="fixed")
    assert solution.certificate.holds, solution.certificate
    assert solution.answer.K.nstates == 2
    assert solution.answer.upper < 0.9 * before.lower
    assert solution.answer.upper < 0.8  # full order: 0.676


@pytest.mark.cases(0)
def test_a_decentralised_controller_of_the_column_stays_decentralised():
    plant = distillation_column()
    members = [PID.of(gain, gain / 10, gain / 100, 0.05, leak=1e-6) for gain in (0.2, -0.2)]
    family, x = Decentralised.of(members)
    start = family.system(x)
    program = MuSynthesis(plant, start=start, family=family)
    before = program.certified_peak(start)
    solution = wb.solve(program, method="fixed", options=wb.Options(time_limit=15.0))
    K = solution.answer.K
    response = K(1j, squeeze=False)
    assert abs(response[0, 1]) == abs(response[1, 0]) == 0.0
    assert solution.answer.upper < before.upper
