"""Poles of weights on the stability boundary, which the controller shares."""

import control
import numpy as np
import pytest

from workbench import solve
from workbench.certify.norms import certified_norm
from workbench.certify.stability import stability_check
from workbench.errors import InputError
from workbench.synthesis import HinfSynthesis, MixedSensitivity
from workbench.synthesis.h_infinity.singular_plants.absorbed import absorbed
from workbench.systems.generalised_plant import response
from workbench.systems.realisation import realisation
from workbench.uncertainty import GeneralisedPlant, generalised_plant

S = control.tf("s")
G = 1 / (S + 1)
TWO = control.ss([[-1.0, 0.3], [0.0, -2.0]], np.eye(2), [[1.0, 1.0], [0.0, 1.0]], np.zeros((2, 2)))


def sampled(numerator, denominator):
    return control.tf(numerator, denominator, 0.1)


NEAR = 1e-6
"""Distance from the axis at which a weight's pole costs less than the tolerance of synthesis."""

WEIGHTS = {
    "integrator": (G, (S + 1) / S, (S + 1) / (S + NEAR)),
    "integrator, strictly proper": (G, 1 / S, 1 / (S + NEAR)),
    "double integrator": (G, (S + 1) ** 2 / S**2, (S + 1) ** 2 / (S + 1e-4) ** 2),
    "resonator": (G, (S**2 + S + 4) / (S**2 + 4), (S**2 + S + 4) / (S**2 + 2 * NEAR * S + 4)),
    "unstable plant": (1 / (S - 1), (S + 1) / S, (S + 1) / (S + NEAR)),
    "several channels": (TWO, (S + 1) / S, (S + 1) / (S + NEAR)),
    "other units": (1e6 / (S / 1e4 + 1), (S + 1e4) / S, (S + 1e4) / (S + 1e4 * NEAR)),
    "sampled": (
        sampled([0.1], [1, -0.9]),
        sampled([1, -0.9], [1, -1]),
        sampled([1, -0.9], [1, -1 + 0.1 * NEAR]),
    ),
}


@pytest.mark.parametrize("name", WEIGHTS)
def test_a_weight_on_the_axis_is_the_limit_of_weights_near_it(name):
    plant, exact, near = WEIGHTS[name]
    W_KS = 1e5 if name == "other units" else 0.1
    solution = solve(MixedSensitivity(plant, W_S=exact, W_KS=W_KS))
    assert solution.certificate.holds, solution.certificate.failures
    beside = solve(MixedSensitivity(plant, W_S=near, W_KS=W_KS)).answer
    assert solution.answer.norm == pytest.approx(beside.norm, rel=2e-3)
    assert solution.answer.least == pytest.approx(beside.least, rel=2e-3)


@pytest.mark.parametrize("name", WEIGHTS)
def test_the_controller_has_the_poles_of_the_weight(name):
    plant, weight, _ = WEIGHTS[name]
    program = MixedSensitivity(plant, W_S=weight, W_KS=1e5 if name == "other units" else 0.1)
    answer = solve(program).answer
    K = answer.lti
    assert K is answer.whole
    scale = 1e-12 * np.abs(K.poles()).max()
    for pole in control.ss(weight).poles():  # a double one is known to the root of rounding
        assert np.abs(K.poles() - pole).min() <= max(scale, 1e-7 * abs(pole), 1e-7)
    assert stability_check(control.ss(control.feedback(plant, K, sign=-1))).holds


def test_an_error_that_is_integrated_vanishes():
    K = solve(MixedSensitivity(G, W_S=(S + 1) / S, W_KS=0.1)).answer.lti
    omega = np.array([1e-3, 1e-6, 1e-9])
    loop = response(control.ss(G), omega) @ response(K, omega)
    np.testing.assert_allclose(np.abs(1 / (1 + loop)).ravel() / omega, 1.0, rtol=0.2)


def test_an_integrator_of_the_plant_beside_that_of_the_weight():
    solution = solve(MixedSensitivity(1 / S, W_S=(S + 1) / S, W_KS=0.1))
    assert solution.certificate.holds
    near = solve(MixedSensitivity(1 / (S + 1e-7), W_S=(S + 1) / (S + NEAR), W_KS=0.1)).answer
    assert solution.answer.norm == pytest.approx(near.norm, rel=2e-3)


def test_without_a_weight_of_u_too():
    solution = solve(MixedSensitivity((1 - S) / (S + 1) ** 2, W_S=(0.5 * S + 1) / S))
    assert solution.certificate.holds
    assert solution.answer.norm == pytest.approx(1.5, rel=3e-3)  # |W_S(1)|, as S(1) = 1


def test_a_pole_that_the_plant_repeats_needs_none_in_the_controller():
    """W_KS integrates u as the plant does, so what it shows is an output of the plant."""
    program = MixedSensitivity(1 / S, W_S=(S + 1) / (S + 0.1), W_KS=(S + 1) / S)
    solution = solve(program)
    assert solution.certificate.holds
    assert not program.absorbed.copies
    assert np.abs(solution.answer.lti.poles()).min() > 1e-3


def input_disturbance(model):
    """x' = -x + u + d, z = (x, 0.1 (u + d)), y = x + 0.1 n, with d = model w."""
    return generalised_plant(
        [(G, "v", "x"), (model, "w", "d"), (control.ss([], [], [], [[0.1]]), "v2", "z_v")],
        {"v": "u + d", "v2": "u + d", "y": "x + n"},
        exogenous=["w", "n"],
        performance=["x", "z_v"],
        control="u",
        measurement="y",
    )


def output_disturbance(model):
    """y = x + d + n with d = model w and z = (x + d, u at high frequencies): tracking."""
    return generalised_plant(
        [(G, "u", "x"), (model, "w", "d"), (0.1 * S**2 / (S + 10) ** 2, "u", "z_u")],
        {"y": "x + d + n", "z": "x + d"},
        exogenous=["w", "n"],
        performance=["z", "z_u"],
        control="u",
        measurement="y",
    )


@pytest.mark.parametrize("plant", [input_disturbance, output_disturbance])
@pytest.mark.parametrize("order", [1, 2])
def test_a_disturbance_that_is_integrated_noise(plant, order):
    solution = solve(HinfSynthesis(plant((1 + 1 / S) ** order)))
    assert solution.certificate.holds, solution.certificate.failures
    beside = solve(HinfSynthesis(plant((1 + 1 / (S + 1e-3)) ** order))).answer
    assert solution.answer.norm == pytest.approx(beside.norm, rel=5e-3)
    assert (np.abs(solution.answer.lti.poles()) < 1e-5).sum() == order


def test_any_coordinates_of_the_states():
    plain = MixedSensitivity(TWO, W_S=(S + 1) / S, W_KS=0.1).plant
    T = np.random.default_rng(0).normal(size=(plain.system.nstates,) * 2)
    A, B, C, D = (np.asarray(getattr(plain.system, name)) for name in "ABCD")
    turned = realisation((np.linalg.solve(T, A @ T), np.linalg.solve(T, B), C @ T, D), 0.0)
    other = solve(HinfSynthesis(GeneralisedPlant(turned, None, 2, 2)))
    assert other.certificate.holds
    assert other.answer.norm == pytest.approx(solve(HinfSynthesis(plain)).answer.norm, rel=1e-6)


def test_the_loop_is_that_of_the_plant_with_the_whole_controller():
    """Closing the plant that is left equals closing the given one, whose shared poles cancel."""
    for plant in (
        MixedSensitivity(TWO, W_S=(S + 1) / S, W_KS=0.1).plant,
        input_disturbance(1 + 1 / S),
    ):
        left = absorbed(plant)
        m, p = plant.controls, plant.measurements
        rng = np.random.default_rng(0)
        sizes = (2, p), (m, 2), (m, p)
        K = control.ss(-np.eye(2), *(rng.normal(size=size) for size in sizes))
        omega = np.array([0.1, 1.0, 10.0])
        whole = plant.close(left.whole(K))
        np.testing.assert_allclose(
            response(left.plant.close(K), omega), response(whole, omega), rtol=1e-9
        )
        assert np.abs(whole.poles()).min() < 1e-7  # of which the loop that is certified has none
        assert np.abs(left.plant.close(K).poles()).min() > 1e-7


def test_a_wrong_claim_is_rejected():
    program = MixedSensitivity(G, W_S=(S + 1) / S, W_KS=0.1)
    answer = solve(program).answer
    low = program.witnessed(type(answer)(answer.K, 0.9 * answer.norm, answer.gamma))
    assert not program.certify(low, 1e-6).holds
    other = program.witnessed(type(answer)(0 * answer.K, answer.norm, answer.gamma))
    assert not program.certify(other, 1e-6).holds


def test_what_is_certified_is_said():
    program = MixedSensitivity(G, W_S=(S + 1) / S, W_KS=0.1)
    solution = solve(program)
    assert "shared with the controller: 0" in program.facts(solution.answer)[1]
    names = [check.name for check in solution.certificate.checks]
    assert "stability without weights" in names and "whole" in names


@pytest.mark.parametrize(
    ("weights", "said"),
    [
        ({"W_S": 1.0, "W_T": 1 / S, "W_KS": 1.0}, "mode 0.* no measurement drives it alone"),
        ({"W_S": 1.0, "W_KS": 1 / S}, "mode 0.* no measurement drives it alone"),
        ({"W_S": 1 / (S - 1), "W_KS": 1.0}, "mode 1.*weights must be stable"),
    ],
)
def test_poles_that_no_controller_can_share(weights, said):
    with pytest.raises(InputError, match=said):
        MixedSensitivity(G, **weights)


@pytest.mark.parametrize("W_KS", [None, 0.1])
@pytest.mark.parametrize(
    ("zeros", "weight"),
    [
        (S / (S + 1), (S + 1) / S),
        ((S**2 + 4) / (S + 1) ** 2, (S**2 + S + 4) / (S**2 + 4)),
        (control.ss([[-1.0]], [[1.0, 1.0]], [[1.0], [2.0]], np.zeros((2, 2))), (S + 1) / S),
        (control.ss(-np.eye(2), [[1.0], [1.0]], np.eye(2), np.zeros((2, 1))), (S + 1) / S),
    ],
)
def test_zeros_of_the_plant_at_poles_of_the_weight(zeros, weight, W_KS):
    """No control moves the error there: the zero would cancel the controller's own pole."""
    with pytest.raises(InputError, match=r"not stabilisable.*zero of the plant"):
        MixedSensitivity(zeros, W_S=weight, W_KS=W_KS)


def test_a_norm_of_its_own():
    answer = solve(program := MixedSensitivity(G, W_S=(S + 1) / S, W_KS=0.1)).answer
    loop = program.absorbed.plant.close(answer.K)
    assert stability_check(loop).holds
    assert certified_norm(loop) <= answer.norm * (1 + 2e-4)
