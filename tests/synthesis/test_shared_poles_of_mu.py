"""Weights with poles on the axis in mu synthesis: the controller has these poles besides."""

import control
import numpy as np
import pytest

import workbench as wb
from workbench.errors import InputError
from workbench.structure import Complex
from workbench.synthesis import MuSynthesis
from workbench.uncertainty import generalised_plant


def servo(leak, effort=0.1, G=None):
    """A lag with uncertain input, and a weight of the error with its pole at -leak."""
    lag = control.tf([1.0], [1.0, 1.0]) if G is None else G
    W = control.tf([0.4, 0.2], [1.0, leak])
    parts = [(lag, "v", "y"), (control.ss([], [], [], [[0.2]]), "u", "z"), (W, "e", "z_e")]
    parts += [(control.tf([effort], [1.0]), "u", "z_u")] if effort else []
    return generalised_plant(
        parts,
        {"v": "u + d", "e": "r - y"},
        perturbation=[(Complex(1), "z", "d")],
        exogenous=["r"],
        performance=["z_e", "z_u"] if effort else ["z_e"],
        control=["u"],
        measurement="e",
    )


@pytest.mark.cases(0)
@pytest.mark.parametrize(("method", "effort"), [("dk", 0.1), ("mu-dk", 0.1), ("dk", 0.0)])
def test_an_integrator_in_a_weight_is_the_limit_of_slow_poles(method, effort):
    near = wb.solve(MuSynthesis(servo(1e-6, effort)), method=method)
    exact = wb.solve(MuSynthesis(servo(0.0, effort)), method=method)
    assert exact.certificate.holds, exact
    assert exact.answer.upper == pytest.approx(near.answer.upper, rel=5e-3)
    K = exact.answer.lti
    assert np.abs(K.poles()).min() < 1e-12  # the integrator is the controller's
    assert K.nstates == exact.metrics["order"]
    assert any("shared with the controller" in one for one in exact.task.facts(exact.answer))


def test_the_loop_of_the_whole_controller_follows_without_error():
    whole = wb.solve(MuSynthesis(servo(0.0))).answer.lti
    G = control.tf([1.0], [1.0, 1.0])
    S = control.feedback(control.ss([], [], [], [[1.0]]), control.ss(G) * whole)
    assert (S.poles().real < 0).all()
    assert abs(S(1e-9j)) < 1e-6


@pytest.mark.cases(0)
def test_an_integrator_in_weight_and_plant_too():
    solution = wb.solve(MuSynthesis(servo(0.0, G=control.tf([1.0], [1.0, 0.0]))))
    assert solution.certificate.holds, solution


def test_it_comes_back_from_its_dataset():
    program = MuSynthesis(servo(0.0))
    answer = wb.solve(program).answer
    again = program.from_dataset(program.to_dataset(answer))
    np.testing.assert_array_equal(again.lti.A, answer.lti.A)


@pytest.mark.parametrize("asked", [{"order": 3}, {"stable": True}, {"fastest_pole": 1e3}])
def test_demands_on_a_controller_that_has_more_poles_are_refused_by_name(asked):
    with pytest.raises(InputError, match=f"0.*{next(iter(asked))} cannot be given"):
        MuSynthesis(servo(0.0), **asked)


def test_a_start_is_refused_where_the_controller_shares_poles():
    K = control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]])
    with pytest.raises(InputError, match="start cannot be given"):
        MuSynthesis(servo(0.0), start=K)


def test_a_weight_with_an_unstable_pole_is_refused():
    with pytest.raises(InputError, match="not detectable"):
        MuSynthesis(servo(-0.1))
