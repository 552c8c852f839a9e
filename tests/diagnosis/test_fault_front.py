"""Fronts of fault filters on a heater's loop: members of the set, closed forms, a lower bound."""

import control
import numpy as np
import pytest

from workbench.diagnosis import (
    EstimationDemands,
    FaultFront,
    FaultLoop,
    LaguerreBasis,
    full_order_filter,
    least_total_error,
    low_order_filter,
)
from workbench.diagnosis.estimation.front import near_poles
from workbench.diagnosis.estimation.front_bound import _outer
from workbench.diagnosis.estimation.front_filters import removal_conditions
from workbench.errors import InputError, SolverError
from workbench.fitting.rational import Rational
from workbench.systems.generalised_plant import response
from workbench.uncertainty import UncertaintyModel

HZ = 2 * np.pi
GRID = np.unique(np.concatenate([np.geomspace(1e-4, 20.0, 120), [0.05, 0.5, 1.0]]))
CORNER = HZ * 0.2
NOTHING = np.zeros(0, complex)


def rational(pole, gain):
    return Rational(NOTHING, np.array([-pole], complex), gain)


DEMANDS = EstimationDemands(
    error_above_hz=0.5,
    leakage_below_hz=0.05,
    gain=2.0,
    disturbance=control.ss(-0.1, 0.1, 3e-3, 0.0),
    noise=1e-4,
    noise_band_hz=1.0,
    unit=1e-3,
)
"""Of a thermometer's fault; leakage of a room's temperature up to 0.05 Hz [K]."""


@pytest.fixture(scope="module", params=["continuous", "sampled"])
def loop(request):
    model = UncertaintyModel(rational(0.2, 0.2), rational(2.0, 0.2), rational(1.0, 0.15))
    K = control.ss(0.0, 0.1, 1.0, 0.8)
    H = control.ss(-30.0, 30.0, 1.0, 0.0)
    if request.param == "continuous":
        return FaultLoop(model, K, H, DEMANDS)
    return FaultLoop(model, K, H, DEMANDS, dt=0.02, delay_samples=1.0)


def test_the_boundary_holds_every_member(loop):
    """S_nominal / S of members by formula: between the extremes of the boundary."""
    omega = loop.warped_omega(GRID)
    L, S = loop.open_loop(omega), 1 / (1 + loop.open_loop(omega))
    most, least = loop.amplification(omega), abs(loop.differences(omega, sides=400)).min(axis=1)
    assert 1 / least == pytest.approx(most, rel=1e-2)
    rng = np.random.default_rng(1)
    W_c, W_r = (each.response(omega) for each in (loop.model.W_c, loop.model.W_r))
    for _ in range(30):
        delta = np.sqrt(rng.uniform()) * np.exp(2j * np.pi * rng.uniform())
        member = L * (1 + W_c * delta + W_r * rng.uniform(-1, 1))
        assert (abs(1 / (1 + member) / S) <= most * (1 + 1e-9)).all()


def test_the_closed_plant_has_the_nominal_sensitivity(loop):
    omega = loop.warped_omega(np.geomspace(0.01, 5.0, 9))
    closed = response(loop.plant.channel(exogenous=["d", "f"]).system, omega)
    S = 1 / (1 + loop.open_loop(omega))
    assert closed[:, -1, -2] == pytest.approx(S)
    assert closed[:, -1, -1] == pytest.approx(S)


def test_a_filter_of_the_basis_has_the_response_of_its_coefficients(loop):
    x = np.random.default_rng(2).standard_normal(5)
    front, basis = FaultFront(loop, GRID), LaguerreBasis(loop, CORNER)
    F = basis.filter(x)
    assert (F.poles().real < 0).all()
    expected = basis.response(front.omega, 5) @ x
    np.testing.assert_allclose(front.estimate(F), expected, atol=1e-9)


def test_judged_of_a_constant_estimate_by_hand(loop):
    """T = 1 on the nominal plant: no error, all of the disturbance, all of the noise."""
    error, leakage, noise = FaultFront(loop, GRID, nominal=True).error_leakage_noise(
        np.ones(len(GRID), complex)
    )
    assert error == 0.0
    assert leakage == pytest.approx(3e-3, rel=1e-3)
    assert noise == pytest.approx(1e-4, rel=1e-6)


@pytest.mark.cases(0)
def test_the_front_is_met_falls_and_is_above_its_bound(loop):
    basis = LaguerreBasis(loop, CORNER)
    totals = {}
    for nominal in (True, False):
        front = FaultFront(loop, GRID, nominal=nominal)
        for error in (0.3, 0.5):
            point = front.least(basis.response(front.omega, 8), error)
            assert point.error <= error
            again = front.error_leakage_noise(front.estimate(basis.filter(point.coefficients)))
            assert again == pytest.approx((point.error, point.leakage, point.noise), rel=1e-6)
            totals[nominal, error] = point.total_error
    assert totals[True, 0.5] < totals[True, 0.3] < totals[False, 0.3]
    if loop.dt is None:
        bounds = [least_total_error(DEMANDS, 0.3, HZ * 0.15, coefficients=n) for n in (8, 24)]
        assert 0.0 < bounds[0] <= bounds[1] * (1 + 1e-3)
        assert 0.2 * totals[True, 0.3] < bounds[1] < totals[True, 0.3]


@pytest.mark.parametrize("loop", ["continuous", "sampled"], indirect=True)
@pytest.mark.slow
def test_a_filter_of_few_states_is_certified(loop):
    basis = LaguerreBasis(loop, CORNER)
    fine = full_order_filter(loop, GRID, basis, 8, 0.5, 2e-3)
    few = low_order_filter(loop, GRID, fine.F, 4, 0.5, 2e-3)
    assert few.F.nstates <= 4 < fine.F.nstates
    assert few.answer.upper <= 1.0
    assert few.point.error <= 0.5


def test_the_plant_of_a_removal_has_the_loop_of_what_is_left(loop):
    """By the formula 1 / (1 + L (1 - F)), for a filter of one state."""
    frequency = np.geomspace(0.01, 5.0, 9)
    omega = loop.warped_omega(frequency)
    F = control.ss(-3.0, 1.0, 1.5, 0.2)
    closed = loop.removal.nominal().close(F)
    left = 1 - response(F, omega)[:, 0, 0]
    expected = 1 / (1 + loop.open_loop(omega) * left)
    assert response(closed, omega)[:, 0, 0] == pytest.approx(expected)


@pytest.mark.cases(1)
def test_a_bounded_sensitivity_holds_on_members_and_costs_leakage(loop):
    """On members of the set by formula, and against the least filter without the bound."""
    front, basis = FaultFront(loop, GRID), LaguerreBasis(loop, CORNER)
    functions = basis.response(front.omega, 8)
    free = front.least(functions, 0.5)
    peak = 0.99 * front.removed_peak(functions @ free.coefficients)
    bounded = front.least(functions, 0.5, peak=peak)
    T = functions @ bounded.coefficients
    assert front.removed_peak(T) <= peak
    assert bounded.error <= 0.5
    assert bounded.total_error > free.total_error
    rng = np.random.default_rng(3)
    L, F = loop.open_loop(front.omega), T * front.back
    W_c, W_r = (each.response(front.omega) for each in (loop.model.W_c, loop.model.W_r))
    for _ in range(20):
        delta = np.exp(2j * np.pi * rng.uniform())
        member = L * (1 + W_c * delta + W_r * rng.uniform(-1, 1))
        assert abs(1 / (1 + member * (1 - F))).max() <= peak * 1.01


@pytest.mark.parametrize("loop", ["continuous"], indirect=True)
def test_conditions_of_a_removal_hold_and_fail(loop):
    nothing = control.ss(-1.0, 0.0, 0.0, 0.0)
    plain = removal_conditions(loop, nothing, 10.0, 1e-2)
    assert plain.met
    assert plain.nominal_stability
    strict = removal_conditions(loop, nothing, 1.0, 1e-2)
    assert not strict.met
    positive = control.ss(-1.0, 1.0, 400.0, 0.0)
    assert not removal_conditions(loop, positive, 10.0, 1e-2).nominal_stability
    with pytest.raises(InputError, match="peak"):
        removal_conditions(loop, nothing, 0.0)


def test_outer_functions_have_their_modulus():
    theta = 2 * np.pi * (np.arange(2**12) + 0.5) / 2**12
    modulus = 1 / abs(1 - 0.8 * np.exp(1j * theta))
    np.testing.assert_allclose(_outer(modulus, 60), 0.8 ** np.arange(60), atol=1e-10)


def test_grids_are_finer_about_lightly_damped_poles(loop):
    omega = float(loop.warped_omega(1.0))
    found = near_poles(loop, GRID, np.array([-0.01 + 1j * omega, -0.01 - 1j * omega]))
    assert set(GRID) <= set(found)
    assert np.sum(abs(found - 1.0) < 0.01) > 10


def test_wrong_input_is_named(loop):
    front = FaultFront(loop, GRID)
    with pytest.raises(SolverError, match="no filter of this basis has a relative error of 0"):
        front.least(LaguerreBasis(loop, CORNER).response(front.omega, 3), 0.01)
    functions = LaguerreBasis(loop, CORNER).response(front.omega, 8)
    with pytest.raises(InputError, match="peak"):
        front.least(functions, 0.5, peak=-1.0)
    with pytest.raises(SolverError, match="no filter of this basis"):
        front.least(functions, 0.5, peak=0.9)
    with pytest.raises(InputError, match="rising"):
        FaultFront(loop, GRID[::-1])
    with pytest.raises(InputError, match="must have frequencies"):
        FaultFront(loop, GRID[GRID < 0.4])
    with pytest.raises(InputError, match="corner"):
        LaguerreBasis(loop, 0.0)
    with pytest.raises(InputError, match="noise_band"):
        EstimationDemands(
            error_above_hz=1.0,
            leakage_below_hz=0.1,
            gain=2.0,
            disturbance=control.ss(-1.0, 1.0, 1.0, 0.0),
            noise=0.1,
            noise_band_hz=0.0,
        )


def test_a_measurement_filter_that_is_not_stable_is_refused():
    model = UncertaintyModel(rational(0.2, 0.2), rational(2.0, 0.2), rational(1.0, 0.15))
    K, H = control.ss(0.0, 0.1, 1.0, 0.8), control.ss(30.0, 30.0, 1.0, 0.0)
    with pytest.raises(InputError, match=r"filter of a fault loop: .*pole"):
        FaultLoop(model, K, H, DEMANDS)
