"""Method "fixed" finds its own starts for families that are given no gains."""

import control
import numpy as np
import pytest
from loop_plants import S, dead_time, tracking
from workbench.plants.textbook.distillation import distillation_column
from workbench.plants.textbook.first_order import unstable_first_order

import workbench as wb
from workbench.executor import Context
from workbench.solvers import Outcome
from workbench.synthesis import PD, PI, PID, Decentralised, LeadLag, Modal, MuSynthesis, Static
from workbench.synthesis.mu.structured.starts import lag_rules
from workbench.synthesis.mu.structured.starts.quiet import quiet
from workbench.synthesis.mu.structured.starts.rightmost import rightmost
from workbench.synthesis.mu.structured.starts.search import Search

LAG = 2.0 / (5.0 * S + 1.0) * dead_time(1.0)


def searched(plant, family):
    program = MuSynthesis(plant, family=family)
    return Search(program, program.family, Context())


def least(plant, **asked):
    found = wb.solve(MuSynthesis(plant, **asked))
    assert found.outcome is Outcome.SOLVED and found.certificate.valid, found.message
    assert "started from" in found.message
    return found.answer.upper


@pytest.mark.cases(0)
@pytest.mark.parametrize(
    ("G", "speed", "family", "limit"),
    [
        (1 / S, 1.0, PI(), 0.52),
        (1 / S**2, 0.2, PD(), 0.53),
        (1 / S**2, 0.2, PID(filter=0.03), 0.53),
        (1 / (S - 1), 3.0, PI(), 1.0),
        (1 / ((S - 1) * (S - 2)), 1.0, PID(), 1.06),
        (LAG, 0.1, PID(), 0.5535),  # D-K of full order: 0.545
        (LAG, 0.1, LeadLag(), 0.5535),
        (100 / (S**2 + 0.2 * S + 100), 0.5, PID(), 0.53),
        pytest.param(LAG, 0.1, Modal(2), 0.575, marks=pytest.mark.slow),
    ],
)
def test_a_family_finds_its_own_start(G, speed, family, limit):
    assert least(tracking(G, speed), family=family) <= limit


@pytest.mark.cases(0)
@pytest.mark.parametrize("unit", [1e-6, 1e6])
@pytest.mark.parametrize("gain", [1.0, 1e9])
def test_units_of_time_and_of_the_output_do_not_matter(unit, gain):
    G = gain * 2.0 / (5.0 * unit * S + 1.0) * dead_time(unit)
    plain, other = tracking(LAG, 0.1), tracking(G, 0.1 / unit, gain)
    assert least(other, family=PI()) == pytest.approx(least(plain, family=PI()), rel=1e-6)


@pytest.mark.cases(0)
def test_a_pid_gets_as_low_as_full_order():
    assert least(unstable_first_order(), family=PID()) < 0.678  # full order: 0.676


@pytest.mark.cases(0)
def test_a_decentralised_family_of_the_column():
    plant = distillation_column()
    found = wb.solve(MuSynthesis(plant, family=Decentralised(PI(), PI())))
    assert found.certificate.valid and found.answer.upper < 1.51
    response = found.answer.K(1j, squeeze=False)
    assert abs(response[0, 1]) == abs(response[1, 0]) == 0.0
    facts = "\n".join(found.certificate.facts)
    assert "with 2 integrators" in facts and "UNSTABLE" not in facts
    assert "channel 1 P = " in facts


@pytest.mark.cases(0)
def test_the_least_gain_is_that_of_a_scan():
    plant = unstable_first_order()
    program = MuSynthesis(plant, family=Static())
    scanned = [
        found.upper
        for gain in np.linspace(30.0, 60.0, 31)
        if (found := program.certified_peak(control.ss([], [], [], [[gain]]))) is not None
    ]
    assert least(plant, family=Static()) <= min(scanned) * 1.001
    assert least(plant, order=0) == pytest.approx(least(plant, family=Static()))


@pytest.mark.cases(0)
def test_weights_of_the_set_point_help():
    """With r and y apart the set-point acts less hard than the disturbance asks for."""
    G = 1 / (S * (S + 1))
    program = MuSynthesis(tracking(G, 0.3, apart=True), family=PID(setpoint_weights=True))
    found = wb.solve(program)
    assert found.certificate.valid
    settings = program.family.settings(found.answer.K)
    assert settings["b"] < 0.9
    bound = wb.solve(
        MuSynthesis(program.plant, start=one_degree(found.answer.K), family=program.family)
    )
    assert bound.answer.upper >= found.answer.upper * (1 - 1e-3)


def one_degree(K):
    """The controller of the same feedback with b = c = 1."""
    return control.ss(K[0, 1]) * control.ss([], [], [], [[-1.0, 1.0]])


@pytest.mark.cases(0)
def test_demands_on_poles_reach_a_family():
    found = wb.solve(MuSynthesis(tracking(1 / (S + 1), 1.0), family=PID(), fastest_pole=20.0))
    assert found.certificate.valid and found.answer.K.poles().real.min() >= -20.0 * (1 + 1e-9)


@pytest.mark.cases(0)
def test_progress_and_message_say_which_start():
    told = []
    context = Context(progress=lambda what, done, total: told.append(what))
    program = MuSynthesis(tracking(LAG, 0.1), family=PI())
    found = wb.solve(program, context=context)
    for words in ("SIMC", "full-order", "little integration"):
        assert any("start" in what and words in what for what in told), told
    assert "started from" in found.message and "best from" in found.message


def test_a_limit_of_time_ends_the_search():
    """A start that was found is an answer."""
    program = MuSynthesis(tracking(LAG, 0.1), family=PID())
    found = wb.solve(program, options=wb.Options(time_limit=0.3))
    assert found.answer is None or found.answer.upper < 10.0


# --- rules ---------------------------------------------------------------------------------------


def model(G):
    return lag_rules.lag_model(control.ss(G))


def test_the_half_rule_of_skogestad():
    """Example 1 of the source: k (-0.3 s + 1)(0.08 s + 1) / ((2 s + 1)(s + 1)(0.4 s + 1)
    (0.2 s + 1)(0.05 s + 1)^3); without the zero left of the axis, which is treated otherwise."""
    G = (1 - 0.3 * S) / (
        (2 * S + 1) * (S + 1) * (0.4 * S + 1) * (0.2 * S + 1) * (0.05 * S + 1) ** 3
    )
    found = model(G)
    first, second = found.shortened(1), found.shortened(2)
    assert first.lags == pytest.approx((2.5,)) and second.lags == pytest.approx((2.0, 1.2))
    assert first.delay == pytest.approx(0.3 + 0.5 + 0.4 + 0.2 + 0.15, rel=1e-3)
    assert second.delay == pytest.approx(0.3 + 0.2 + 0.2 + 0.15, rel=1e-3)
    assert found.gain == pytest.approx(1.0, rel=1e-3)


def test_the_settings_of_skogestad():
    """Table 1 of the source, with tau_c = theta: a lag, an integrator, two integrators."""
    lag = lag_rules.LagModel(2.0, 0, (8.0,), 1.0, False)
    assert lag_rules.pi_terms(lag, 1.0)[:2] == pytest.approx((2.0, 0.25))  # tau_I = 8 theta
    fast = lag_rules.LagModel(2.0, 0, (20.0,), 1.0, False)
    assert lag_rules.pi_terms(fast, 1.0)[:2] == pytest.approx((5.0, 5.0 / 8.0))
    ramp = lag_rules.LagModel(0.5, 1, (), 1.0, False)
    assert lag_rules.pi_terms(ramp, 1.0)[:2] == pytest.approx((1.0, 1.0 / 8.0))
    double = lag_rules.LagModel(1.0, 2, (), 1.0, False)
    P, integral, D, _ = lag_rules.pid_terms(double, 1.0)
    Kc = 0.0625 / 1.0  # 1 / (16 k theta^2); tau_I = tau_D = 8 theta
    assert pytest.approx((2 * Kc, Kc / 8.0, 8.0 * Kc)) == (P, integral, D)


def test_an_unstable_lag_gets_two_equal_poles():
    P, integral, *_ = lag_rules.pi_terms(model(3.0 / (2.0 * S - 1.0)), 0.5)
    loop = control.feedback(control.tf([P, integral], [1.0, 0.0]) * 3.0 / (2.0 * S - 1.0), 1)
    np.testing.assert_allclose(loop.poles(), -2.0, rtol=2e-3)


@pytest.mark.parametrize("G", [S / (S + 1), 1 / S**3, 1 / ((S - 1) * (S - 2)), 1 / (S * (S - 1))])
def test_plants_without_a_rule_have_no_model(G):
    assert model(G) is None


@pytest.mark.parametrize("G", [LAG, -3.0 / (S + 1), 1e-6 / (1e6 * S + 1)])
def test_a_little_integration_stabilises_a_stable_plant(G):
    search = searched(tracking(G, 0.1), PI())
    stabilising = [K for K in quiet(search) if search.stabilises(K)]
    assert len(stabilising) >= 2
    still = complex(control.ss(G)(0.0)).real
    for K in stabilising:  # u = K (r - y)
        assert np.sign(PI().settings(K)["I"]) == np.sign(still)


def test_signs_of_two_channels_are_tried():
    """With pairs the wrong way round, one channel needs the other sign."""
    from workbench.structure import Complex
    from workbench.uncertainty import generalised_plant

    G = control.ss(control.tf([[[1.0], [2.0]], [[2.0], [1.0]]], [[[1.0, 1.0]] * 2] * 2))
    plant = generalised_plant(
        [(G, ["v1", "v2"], ["g1", "g2"]), (0.1, "u1", "y_d")],
        {"v1": "u1 + d", "v2": "u2", "e1": "r1 - g1", "e2": "r2 - g2"},
        perturbation=[(Complex(1), "y_d", "d")],
        exogenous=["r1", "r2"],
        control=["u1", "u2"],
        performance=["e1", "e2"],
        measurement=["e1", "e2"],
    )
    search = searched(plant, Decentralised(PI(), PI()))
    found = [K for K in quiet(search) if search.stabilises(K)]
    assert found
    gains = [search.family.settings(K) for K in found]
    assert all(one["channel 1 I"] * one["channel 2 I"] < 0 for one in gains)


def test_the_rightmost_pole_moves_left():
    search = searched(tracking(1 / ((S - 1) * (S - 2)), 1.0), PD())
    assert any(search.stabilises(K) for K in rightmost(search))


# --- nothing stabilises ---------------------------------------------------------------------------


@pytest.mark.cases(0)
def test_what_was_tried_in_vain_is_said_with_the_least_abscissa():
    plant = tracking(1 / ((S - 1) * (S - 2) * (S - 3)), 1.0)
    found = wb.solve(MuSynthesis(plant, family=PI()))
    assert found.outcome is Outcome.FAILED
    for words in ("SIMC", "full-order", "rightmost pole", "least real part", "rad/s"):
        assert words in found.message
    least_seen = float(found.message.split("pole was ")[1].split()[0])
    assert 2.0 <= least_seen < 3.0  # the trace of the loop's matrix is 6, of three poles


@pytest.mark.parametrize(
    "asked", [{"family": Static()}, {"order": 0}, {"family": Decentralised(Static())}]
)
@pytest.mark.parametrize("G", [1 / S**2, 1 / ((S - 1) * (S - 3)), (S - 1) / ((S - 2) * (S + 1))])
def test_that_no_gain_stabilises_is_proven(G, asked):
    found = wb.solve(MuSynthesis(tracking(G, 1.0), **asked), method="fixed")
    assert found.outcome is Outcome.INFEASIBLE and found.certificate.holds, found.message
    assert "no constant gain stabilises" in found.message
    assert all(
        "for every real gain" in c.over for c in found.certificate.checks if "proven" in str(c)
    )


def test_what_a_descent_returns_goes_back_from_another_process():
    """Systems do not go through a pickle; arrays do."""
    import pickle

    from workbench.synthesis.mu.structured.fixed import _minimise_peak_until, _problem

    program = MuSynthesis(tracking(1 / (S + 1), 1.0), family=PI(), start=[1.0, 1.0])
    found = _minimise_peak_until(None, 0.0, 3, _problem(program, program.start))
    rounds, _ = pickle.loads(pickle.dumps(found))
    assert rounds["peak"][-1] < rounds["peak"][0]
