"""Method "fixed" finds its own start and leaves any; controllers that one would ship."""

import re
from dataclasses import replace

import control
import numpy as np
import pytest
from lanes import thinned
from workbench.plants.textbook.first_order import unstable_first_order

from workbench.certificate import Certificate
from workbench.certify.interlacing import interlacing as certify_interlacing
from workbench.errors import InputError, UnknownNameError
from workbench.executor import Context
from workbench.solution import solve
from workbench.solvers import Outcome
from workbench.structure import Complex
from workbench.synthesis import Modal, MuSynthesis
from workbench.synthesis.families.demands import Shippable
from workbench.synthesis.no_controller import interlacing
from workbench.synthesis.no_controller.interlacing import NoStableController
from workbench.systems.bilinear import bilinear_sampled
from workbench.uncertainty import GeneralisedPlant, UncertaintyModel, generalised_plant

s = control.tf("s")


def plant(G=100 / (s**2 + 3 * s + 100)):
    model = UncertaintyModel(G, 0.1 * (s + 10) / (s + 100), 0.1 * (s + 5) / (s + 50))
    error = control.tf([0.4, 8.0], [1.0, 0.01], inputs="e", outputs="z_e")
    return generalised_plant(
        [model, error, (0.01, "u", "z_u")],
        {"e": "r - f"},
        exogenous="r",
        control="u",
        performance=["z_e", "z_u"],
        measurement="e",
    )


PLANT = plant()


@pytest.fixture(scope="module")
def full():
    return solve(MuSynthesis(PLANT), method="dk")


@pytest.fixture(scope="module")
def small():
    return solve(MuSynthesis(PLANT, order=2), method="fixed")


@pytest.mark.slow
def test_it_finds_its_own_start_and_is_as_good_as_the_iteration(full, small):
    assert small.outcome is Outcome.SOLVED, small.message
    assert small.answer.K.nstates == 2 < full.answer.K.nstates
    assert small.answer.upper <= 1.02 * full.answer.upper
    assert "started from" in small.message


@pytest.mark.slow
@pytest.mark.parametrize("order", [0, 2])
def test_it_leaves_the_zero_controller(small, order):
    """K = 0, the natural start of a stable plant, in one round only before.

    Where the descent ends from there depends on the last bits of a processor: 0.50 or 3.1 for two
    states, of 801 at the start. The method's own starts are better.
    """
    A = -np.diag(np.arange(1.0, order + 1)) * 5
    zero = control.StateSpace(
        A, np.zeros((order, 1)), np.zeros((1, order)), np.zeros((1, 1)),
        remove_useless_states=False,
    )  # fmt: skip
    task = MuSynthesis(PLANT, start=zero)
    found = solve(task, method="fixed")
    begun = task.certified_peak(zero).upper
    assert found.answer.upper < 0.1 * begun
    assert small.answer.upper < 0.02 * begun


def test_open_loop_poles_on_the_axis_are_no_obstacle():
    """A weight that integrates, and a plant that does: the open loop is infinite at 0."""
    G = 20 / (s * (s + 10))
    model = (control.ss(G), "v", "g")
    loop = generalised_plant(
        [model, (0.2 * (s + 2) / (s + 50), "u", "y_d"), ((0.3 * s + 1) / (s + 1e-4), "e", "z")],
        {"v": "u + u_d", "e": "r - g"},
        perturbation=[(Complex(1), "y_d", "u_d")],
        exogenous="r",
        control="u",
        performance="z",
        measurement="e",
    )
    found = solve(MuSynthesis(loop, start=control.ss([], [], [], [[2.0]])), method="fixed")
    assert found.outcome is Outcome.SOLVED, found.message
    assert (
        found.answer.upper < MuSynthesis(loop).certified_peak(control.ss([], [], [], [[2.0]])).upper
    )


@pytest.mark.slow
def test_stable_and_slow_is_carried_and_certified(small):
    fastest = 60.0
    task = MuSynthesis(PLANT, order=2, stable=True, fastest_pole=fastest)
    found = solve(task, method="fixed")
    assert found.outcome is Outcome.SOLVED, found.message
    poles = found.answer.K.poles()
    assert poles.real.max() < 0 and np.abs(poles).max() <= fastest * (1 + 1e-9)
    assert found.answer.upper >= small.answer.upper * (1 - 1e-3)
    names = {check.name for check in found.certificate.checks}
    assert {"order", "controller stable", "fastest pole"} <= names
    metrics = task.metrics(found.answer)
    assert metrics["stable_controller"] == 1.0 and metrics["fastest_pole_rad_s"] <= fastest * (
        1 + 1e-9
    )
    # The same controller, asked for more, is refused.
    tighter = MuSynthesis(PLANT, order=1, fastest_pole=fastest / 100)
    failures = tighter.certify(found.answer, 1e-6, optimal=False).failures
    assert any(text.startswith("order") for text in failures)
    assert any(text.startswith("fastest pole") for text in failures)


@pytest.mark.slow
def test_iterations_hand_over_what_they_do_not_meet(full):
    found = solve(MuSynthesis(PLANT, order=2, fastest_pole=1e3), method="dk")
    assert full.answer.K.nstates > 2
    assert "not met: order" in found.message and "handed over to fixed" in found.message
    assert found.answer.K.nstates == 2 and found.certificate.valid


@pytest.mark.parametrize("seed", range(20))
def test_halfspaces_are_the_stable_and_the_slow_controllers(seed):
    rng = np.random.default_rng(seed)
    order = int(rng.integers(1, 6))
    family = Modal(order, corners=tuple(rng.uniform(0.5, 5, (order + 1) // 2)))
    fastest = float(rng.uniform(1, 6))
    rows, sides = family.halfspaces(True, fastest)
    for _ in range(50):
        x = rng.normal(size=3 * order + 1)
        poles = np.linalg.eigvals(family.matrices(x)[0])
        met = poles.real.max() < -1e-5 and np.abs(poles).max() < fastest * (1 - 1e-4)
        missed = poles.real.max() > 1e-5 or np.abs(poles).max() > fastest * (1 + 1e-4)
        inside = bool((rows @ x <= sides).all())
        assert not (inside and missed)
        assert inside or not met


@pytest.mark.parametrize(
    ("G", "violated"),
    [
        (1 / (s - 1), False),  # zero at infinity only
        ((s - 1) / ((s - 2) * (s + 1)), True),  # 2 between 1 and infinity
        ((s - 2) / ((s - 1) * (s + 1)), False),
        ((s - 1) / ((s - 2) * (s - 3)), False),  # two between
        ((s - 1) * (s - 4) / ((s - 2) * (s + 1) * (s + 3)), True),
        (s / (s - 1), False),  # not strictly proper: no zero at infinity
        (s / ((s - 1) * (s + 2)), True),  # 1 between 0 and infinity
        (1 / (s + 1), False),
    ],
)  # fmt: skip
def test_parity_interlacing(G, violated):
    plant = control.ss(G)
    assert (interlacing.violated(plant) is not None) == violated
    claim = NoStableController(plant)
    evidence, _, _ = claim.respond(None, Context())
    assert (evidence is not None) == violated
    if violated:
        assert claim.certify(evidence, 1e-6).holds
        again = claim.from_dataset(claim.to_dataset(evidence))
        assert claim.metrics(again)["poles_between"] % 2 == 1


def with_blocking_zero(zero, poles):
    """Two inputs through the same factor with a zero, then a full matrix."""
    factor = control.ss((s - zero) / (s + 1))
    mixed = control.append(*(control.ss(1 / (s - pole)) for pole in poles))
    return np.array([[1.0, 2.0], [1.0, -1.0]]) * mixed * control.append(factor, factor)


@pytest.mark.parametrize(
    ("zero", "poles", "violated"),
    [
        (1.0, (2.0, -3.0), True),  # 2 between 1 and infinity
        (1.0, (0.5, -3.0), False),
        (1.0, (2.0, 3.0), False),  # two between
        (0.0, (2.0, -3.0), True),  # a washout
        (0.3, (2.0, -3.0), True),
    ],
)
def test_blocking_zeros_of_a_matrix(zero, poles, violated):
    plant = with_blocking_zero(zero, poles)
    claim = NoStableController(plant)
    evidence, outcome, said = claim.respond(None, Context())
    assert (outcome is Outcome.SOLVED) == violated
    if violated:
        assert claim.certify(evidence, 1e-6).holds
        assert f"between its zeros {zero:.6g} and infinity" in said
        moved = evidence.copy(deep=True)
        moved["zeros"][0] = moved["zeros"][0] * (1 + 1e-3) + 1e-3
        assert not claim.certify(moved, 1e-6).holds


@pytest.mark.parametrize("seed", range(20))
def test_a_zero_at_0_is_there_in_whatever_units_and_order_the_states_are(seed):
    """Eigenvalues round it to one side or the other."""
    rng, plant = np.random.default_rng(seed), with_blocking_zero(0.0, (2.0, -3.0))
    order, units = rng.permutation(plant.nstates), 2.0 ** rng.integers(-3, 4, plant.nstates)
    A, B, C = plant.A[order][:, order], plant.B[order], plant.C[:, order]
    A, B, C = A * units[:, None] / units, B * units[:, None], C / units
    claim = NoStableController(control.ss(A, B, C, plant.D))
    evidence, outcome, said = claim.respond(None, Context())
    assert outcome is Outcome.SOLVED and "between its zeros 0 and infinity" in said
    assert claim.certify(evidence, 1e-6).holds


def test_a_double_zero_is_a_zero_too():
    """p is negative at 1, where the two are, and positive at infinity."""
    plant = control.ss((s - 1) ** 2 / ((s - 2) * (s + 1) * (s + 3)))
    claim = NoStableController(plant)
    evidence, outcome, _ = claim.respond(None, Context())
    assert outcome is Outcome.SOLVED and claim.certify(evidence, 1e-6).holds


def test_zeros_of_the_entries_at_different_places_block_nothing():
    plant = control.ss([[-1.0, 0], [0, 2.0]], np.eye(2), [[1.0, 1.0], [1.0, 2.0]], np.zeros((2, 2)))
    assert interlacing.violated(plant) is None
    assert not certify_interlacing(plant, (0.5, 0.5), (np.inf, np.inf)).low_zero
    assert not certify_interlacing(plant, (2.0, 2.0), (np.inf, np.inf)).low_zero  # a pole


def unstable_loop(G):
    return generalised_plant(
        [(control.ss(G), "u", "g"), (0.1, "u", "y_d")],
        {"e": "r - g - u_d"},
        perturbation=[(Complex(1), "y_d", "u_d")],
        exogenous="r",
        control="u",
        performance="e",
        measurement="e",
    )


@pytest.mark.parametrize("method", ["dk", "fixed"])
def test_what_no_stable_controller_can_do_is_proven(method):
    program = MuSynthesis(unstable_loop((s - 1) / ((s - 2) * (s + 1))), stable=True, order=2)
    found = solve(program, method=method)
    assert found.outcome is Outcome.INFEASIBLE and found.certificate.holds
    assert re.search(r"between its zeros 1 and infinity.*odd.*2 rad/s", found.message)
    assert "every stable controller of any order" in found.certificate.checks[0].over
    with pytest.raises(InputError, match="no certified answer"):
        _ = found.lti
    with pytest.raises(UnknownNameError):
        solve(program, method="dkk")


def test_a_controller_that_is_not_stable_may_do_it():
    found = solve(MuSynthesis(unstable_loop((s - 1) / ((s - 2) * (s + 1)))))
    assert found.certificate.valid
    assert found.answer.K.poles().real.max() > 0


@pytest.mark.parametrize("seed", range(30))
def test_the_proof_of_interlacing_knows_the_number_of_poles(seed):
    """Random zeros and poles: the proof holds if, and only if, an odd number lies between."""
    rng = np.random.default_rng(seed)
    poles, zeros = rng.uniform(0.01, 10, int(rng.integers(1, 6))), rng.uniform(0.01, 10, 2)
    stable = -rng.uniform(0.1, 1e3, 4)
    plant = control.ss(control.zpk(zeros, [*poles, *stable], 1.0))
    turn = rng.normal(size=(plant.nstates, plant.nstates))  # of no consequence, but full
    plant = control.ss(*(np.linalg.solve(turn, plant.A @ turn), np.linalg.solve(turn, plant.B)),
                       plant.C @ turn, plant.D)  # fmt: skip
    low, high = np.sort(zeros)
    odd = ((poles > low) & (poles < high)).sum() % 2 == 1
    narrow = [(zero * (1 - 1e-6), zero * (1 + 1e-6)) for zero in (low, high)]
    found = certify_interlacing(plant, *narrow)
    assert found.low_zero and found.high_zero
    assert found.opposite == odd
    assert not certify_interlacing(plant, *reversed(narrow)).holds
    beside = (low * 1.001, low * 1.002)
    assert not certify_interlacing(plant, beside, narrow[1]).low_zero or high < low * 1.01


def test_what_the_proof_of_interlacing_does_not_take():
    plant = control.ss((s - 1) / ((s - 2) * (s + 1)))
    infinity = (np.inf, np.inf)
    zero = (1.0 - 1e-9, 1.0 + 1e-9)
    assert certify_interlacing(plant, zero, infinity).holds
    assert not certify_interlacing(plant, (-1.0, 1.0), infinity).holds  # begins left of 0
    assert not certify_interlacing(plant, (0.5, 3.0), infinity).holds  # holds a pole
    assert not certify_interlacing(control.ss((s - 1) / (s - 2)), zero, infinity).holds
    assert not certify_interlacing(plant.sample(0.1), zero, infinity).holds
    assert not certify_interlacing(control.append(plant, plant), zero, infinity).holds
    left = control.ss((s + 1e-9) / ((s - 2) * (s + 1)))
    assert not NoStableController(left).respond(None, Context())[0]  # its zero is left of 0


@pytest.mark.slow
def test_a_slow_state_and_a_gain_are_found_for_order_one():
    """What fast states of the D-K controller do is left as a gain, else descent ends at 2.5."""
    plant = unstable_first_order()
    peaks = [
        solve(MuSynthesis(plant, order=order), method="fixed").answer.upper for order in (1, 2)
    ]
    assert peaks[0] < 0.73 and peaks[1] < 1.001 * peaks[0]


@pytest.mark.cases(0)
def test_certificates_tell_what_a_controller_is():
    found = solve(MuSynthesis(unstable_first_order(), order=1), method="fixed").certificate
    (told,) = found.facts
    assert re.fullmatch(
        r"controller: order 1, stable itself, fastest pole [\d.]+ rad/s, crossover [\d.]+ Hz", told
    )
    assert told in repr(found)
    assert Certificate.from_json(found.to_json()) == found
    assert "order 1, stable" not in repr(replace(found, facts=()))


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"order": 1.5}, "order is 1.5; it must be a whole number"),
        ({"order": -1}, "order is -1; it must be 0 or more"),
        ({"stable": "yes"}, "stable must be a bool, not str"),
        ({"fastest_pole": 0.0}, "fastest_pole is 0.0"),
    ],
)
def test_bad_demands(asked, words):
    with pytest.raises(InputError, match=words):
        MuSynthesis(PLANT, **asked)


def test_fixed_without_start_and_order_says_what_it_needs():
    found = solve(MuSynthesis(PLANT), method="fixed")
    assert found.outcome is Outcome.FAILED and "give start, or order" in found.message
    fast = control.ss([[-100.0]], [[1.0]], [[1.0]], [[0.0]])
    found = solve(MuSynthesis(PLANT, start=fast, fastest_pole=10.0), method="fixed")
    assert "the start does not meet the demands on the controller: fastest pole" in found.message


def test_nothing_asked_is_nothing_checked():
    K = control.ss([[5.0]], [[1.0]], [[1.0]], [[0.0]])
    assert not Shippable().asked and Shippable().checks(K) == [] and Shippable().admits(K)
    assert not Shippable(stable=True).admits(K)


@pytest.mark.slow
@pytest.mark.parametrize("method", thinned(["dgk", "dk", "mu-dk", "fixed"], 4))
def test_sampled_plants_as_they_are(method):
    """The plant by the bilinear transformation: the least peaks of both are the same."""
    plant = unstable_first_order()
    sampled = GeneralisedPlant(
        bilinear_sampled(plant.system, 0.01), plant.structure, plant.controls, plant.measurements
    )
    order = 2 if method == "fixed" else None
    program = MuSynthesis(sampled, order=order)
    found = solve(program, method=method)
    assert found.certificate.holds, found.certificate
    assert found.answer.K.dt == 0.01
    limit = 0.73 if method == "fixed" else 0.685
    assert found.answer.upper < limit
    back = program.from_dataset(program.to_dataset(found.answer))
    assert program.certify(back, 1e-6).holds
    worse = replace(found.answer, upper=found.answer.upper / 1.01)
    assert not program.certify(worse, 1e-6).holds
    again = MuSynthesis(sampled, start=found.answer.K, stable=True)
    assert solve(again, method="fixed").answer.upper <= found.answer.upper * (1 + 1e-6)


@pytest.mark.parametrize("demand", [{"fastest_pole": 10.0}])
def test_what_sampled_plants_do_not_take(demand):
    plant = unstable_first_order()
    sampled = GeneralisedPlant(
        bilinear_sampled(plant.system, 0.01), plant.structure, plant.controls, plant.measurements
    )
    with pytest.raises(InputError, match="for continuous controllers"):
        MuSynthesis(sampled, **demand)
