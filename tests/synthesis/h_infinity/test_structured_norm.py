"""H-infinity controllers of an order or a family; their distance from the best of any order."""

import math

import control
import numpy as np
import pytest
from scipy.optimize import minimize, minimize_scalar

import workbench as wb
from workbench.errors import InputError
from workbench.solvers import Outcome
from workbench.synthesis import PI, PID, Decentralised, HinfSynthesis, MixedSensitivity, hinf
from workbench.systems.generalised_plant import GeneralisedPlant
from workbench.uncertainty import generalised_plant

G = control.tf([1.0], [1.0, 0.4, 1.0])
W_S, W_KS = control.tf([0.5, 0.5], [1.0, 0.005]), control.tf([0.1], [1.0])


def loop_norm(K):
    """Norm of weighted S and K S, by another library."""
    S = control.feedback(1, G * K)
    both = control.append(W_S * S, W_KS * K * S) * control.ss([], [], [], [[1], [1]])
    stable = np.all(control.feedback(G * K, 1).poles().real < 0)
    return min(control.linfnorm(control.ss(both), tol=1e-7)[0], 1e6) if stable else 1e6


@pytest.mark.cases(0)
def test_a_gain_is_as_good_as_the_best_of_a_search_along_the_line():
    found = minimize_scalar(
        lambda k: loop_norm(control.tf([k], [1.0])), bounds=(0.01, 30.0), method="bounded"
    )
    solution = wb.solve(MixedSensitivity(G, W_S=W_S, W_KS=W_KS, order=0))
    assert solution.holds
    assert solution.answer.norm == pytest.approx(found.fun, rel=2e-3)


@pytest.mark.cases(0)
def test_a_pid_is_as_good_as_the_best_of_searches_without_slopes():
    def size(x):
        P, integral, D, log = x
        T = math.exp(min(max(log, -9.0), 9.0))
        return loop_norm(control.tf([P * T + D, P + integral * T, integral], [T, 1.0, 0.0]))

    best = min(
        minimize(size, start, method="Nelder-Mead", options={"maxfev": 600, "fatol": 1e-5}).fun
        for start in ([1.0, 0.5, 1.0, -3.0], [2.0, 2.0, 2.0, -4.0])
    )
    solution = wb.solve(MixedSensitivity(G, W_S=W_S, W_KS=W_KS, family=PID()))
    assert solution.holds
    assert solution.answer.norm <= 1.005 * best
    assert 0 < solution.answer.least <= solution.answer.norm


@pytest.mark.cases(0)
def test_the_distance_from_the_best_of_any_order_is_told():
    program = MixedSensitivity(G, W_S=W_S, W_KS=W_KS, order=1)
    solution = wb.solve(program)
    every = wb.solve(MixedSensitivity(G, W_S=W_S, W_KS=W_KS)).answer
    answer = solution.answer
    assert answer.K.nstates <= 1
    assert answer.least == pytest.approx(every.least, rel=1e-3)
    assert answer.norm >= every.least
    assert any(
        f"distance {answer.norm / answer.least - 1:.1%}" in said
        for said in solution.certificate.facts
    )


@pytest.mark.slow
@pytest.mark.cases(0)
def test_an_order_that_is_no_hindrance_gives_the_least_norm():
    every = hinf(MixedSensitivity(G, W_S=W_S, W_KS=W_KS).plant)
    few = hinf(MixedSensitivity(G, W_S=W_S, W_KS=W_KS).plant, order=every.K.nstates)
    assert few.norm <= 1.02 * every.norm


def test_no_stable_controller_exists_where_poles_and_zeros_interlace_wrongly():
    unstable = control.tf([1.0, -1.0], [1.0, -1.0, -2.0])  # a pole at 2 between zeros at 1 and inf
    plant = generalised_plant(
        [(unstable, "v", "x")],
        {"v": "u + d", "y": "x + n"},
        exogenous=["d", "n"],
        performance=["x", "u"],
        control="u",
        measurement="y",
    )
    assert wb.solve(HinfSynthesis(plant)).holds
    asked = wb.solve(HinfSynthesis(plant, stable=True))
    assert asked.outcome is Outcome.INFEASIBLE and asked.certificate.holds


@pytest.mark.cases(0)
@pytest.mark.slow
@pytest.mark.cases(0)
def test_a_stable_controller_is_found_where_the_best_one_is_unstable():
    # M. Zeren, H. Ozbay, On the synthesis of stable H-infinity controllers, IEEE Trans. Automatic
    # Control 44 (1999) 431-435: the least norm of all controllers is 34.24
    s = control.tf("s")
    plant = (s + 5) * (s - 1) * (s - 5) / ((s**2 + 4 * s + 5) * (s - 20) * (s - 30))
    weights = {"W_S": control.tf([1.0], [1.0, 1.0]), "W_KS": 0.2}
    best = wb.solve(MixedSensitivity(plant, **weights)).answer
    assert best.least == pytest.approx(34.24, abs=0.01)
    assert best.K.poles().real.max() > 0
    program = MixedSensitivity(plant, **weights, order=3, stable=True)
    found = wb.solve(program, options=wb.Options(time_limit=20))
    assert found.holds
    assert found.answer.K.poles().real.max() < 0
    assert best.least < found.answer.norm < 2 * best.least


def test_a_level_above_the_reachable_norm_is_met_and_one_below_is_not_claimed():
    program = MixedSensitivity(G, W_S=W_S, W_KS=W_KS, order=0)
    norm = wb.solve(program).answer.norm
    met = wb.solve(MixedSensitivity(G, W_S=W_S, W_KS=W_KS, gamma=1.1 * norm, order=0))
    assert met.holds and met.answer.norm <= 1.1 * norm
    assert not wb.solve(MixedSensitivity(G, W_S=W_S, W_KS=W_KS, gamma=0.9 * norm, order=0)).holds


@pytest.mark.slow
@pytest.mark.cases(0)
def test_a_controller_that_is_asked_to_be_slow_is_slow():
    fast = wb.solve(MixedSensitivity(G, W_S=W_S, W_KS=W_KS)).answer
    assert np.abs(fast.K.poles()).max() > 5.0
    slow = wb.solve(MixedSensitivity(G, W_S=W_S, W_KS=W_KS, fastest_pole=5.0, order=3))
    assert slow.holds and np.abs(slow.answer.K.poles()).max() <= 5.0 * (1 + 1e-6)


def two_channels(coupling):
    """Two lags, each driven by its own control and a share of the other one."""
    A, B = -np.diag([1.0, 2.0]), np.array([[1.0, coupling], [coupling, 1.0]])
    parts = [(control.ss(A, B, np.eye(2), 0), ["u0", "u1"], ["x0", "x1"])]
    parts += [(control.tf([0.5], [1.0, 0.05]), f"e{i}", f"z{i}") for i in range(2)]
    return generalised_plant(
        parts,
        {"e0": "r0 - x0", "e1": "r1 - x1"},
        exogenous=["r0", "r1"],
        performance=["z0", "z1", "u0", "u1"],
        control=["u0", "u1"],
        measurement=["e0", "e1"],
    )


@pytest.mark.cases(0)
def test_a_decentralised_controller_has_nothing_off_its_diagonal():
    solution = wb.solve(HinfSynthesis(two_channels(0.3), family=Decentralised(PI(), PI())))
    assert solution.holds
    K = solution.answer.K
    assert np.abs(K(1j)).min(axis=None) == 0.0 and np.abs(np.diag(K(1j))).min() > 0.0
    assert solution.answer.norm >= solution.answer.least > 0


@pytest.mark.cases(0)
def test_a_sampled_plant_has_controllers_of_an_order():
    plant = two_channels(0.2)
    sampled = control.sample_system(plant.system, 0.1, "tustin")
    plant = GeneralisedPlant(sampled, None, plant.controls, plant.measurements)
    solution = wb.solve(HinfSynthesis(plant, order=0))
    assert solution.holds and solution.answer.K.dt == 0.1 and solution.answer.K.nstates == 0
    assert np.abs(plant.close(solution.answer.K).poles()).max() < 1


def test_a_gain_that_does_not_exist_is_said_to_be_infeasible():
    plant = generalised_plant(
        [(control.tf([1.0], [1.0, 0.0, 0.0]), "v", "x")],
        {"v": "u + d", "y": "x + n"},
        exogenous=["d", "n"],
        performance=["x", "u"],
        control="u",
        measurement="y",
    )
    solution = wb.solve(HinfSynthesis(plant, order=0))
    assert solution.outcome is Outcome.INFEASIBLE and solution.certificate.holds


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"order": -1}, "order is -1; it must be 0 or more"),
        ({"order": 1.5}, "order"),
        ({"order": "two"}, "order"),
        ({"family": PI}, "write PI()"),
        ({"family": "pid"}, "must be a Family, not str"),
        ({"family": Decentralised(PI(), PI())}, "measurements"),
        ({"stable": 1}, "stable must be"),
        ({"fastest_pole": 0.0}, "fastest_pole"),
        ({"fastest_pole": math.nan}, "fastest_pole"),
        ({"random": -1}, "random is -1"),
        ({"start": control.tf([-50.0], [1.0])}, "does not stabilise"),
        ({"start": [1.0, 2.0, 3.0], "family": PI()}, "has 2 parameters"),
        ({"start": control.rss(2, 2, 2)}, "2"),
    ],
)
def test_what_cannot_be_asked_of_a_controller_is_named(asked, words):
    with pytest.raises(InputError, match=words.replace("(", r"\(").replace(")", r"\)")):
        MixedSensitivity(G, W_S=W_S, W_KS=W_KS, **asked)


def test_poles_of_weights_leave_no_room_for_an_order():
    with pytest.raises(InputError, match="order cannot be given: move these poles"):
        MixedSensitivity(G, W_S=control.tf([1.0], [1.0, 0.0]), W_KS=W_KS, order=1)


def test_the_search_is_asked_for_something():
    with pytest.raises(InputError, match="no demand on the controller"):
        wb.solve(MixedSensitivity(G, W_S=W_S, W_KS=W_KS), method="fixed")
