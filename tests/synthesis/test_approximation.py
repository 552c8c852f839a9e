"""Approximations of plants, sampled ones too, with weights and a wanted error; their errors."""

import copy

import control
import numpy as np
import pytest

from workbench.errors import InputError
from workbench.realisations import hankel_values
from workbench.synthesis import ApproximatedSystem, approximate

tf = control.tf
G = tf([1.0], [1.0, 0.2, 1.0]) * tf([1.0], [1.0, 3.0]) + tf([0.1], [1.0, 10.0])
LEAVING, ENTERING = tf([10.0], [1.0, 0.1]), tf([1.0, 1.0], [1.0, 100.0])
RNG = np.random.default_rng(2)
MIMO = control.ss(
    RNG.standard_normal((6, 6)) - 4.0 * np.eye(6),
    RNG.standard_normal((6, 2)),
    RNG.standard_normal((2, 6)),
    np.ones((2, 2)),
)
SAMPLED = control.ss(G).sample(0.1)


def seen(system, small, leaving=None, entering=None, unit=1.0):
    """The largest weighted gain of the difference at many frequencies."""
    if system.dt:
        points = np.exp(1j * np.linspace(1e-3, np.pi, 800))
    else:
        points = 1j * unit * np.geomspace(1e-4, 1e4, 1500)
    worst = 0.0
    for s in points:
        apart = np.atleast_2d(system(s)) - np.atleast_2d(small(s))
        apart = np.atleast_2d(leaving(s)) * apart if leaving is not None else apart
        apart = apart * np.atleast_2d(entering(s)) if entering is not None else apart
        worst = max(worst, np.linalg.norm(apart, 2))
    return worst


CASES = {
    "plant": (G, 2, {}),
    "two inputs": (MIMO, 3, {}),
    "sampled": (SAMPLED, 2, {}),
    "integrator": (G * tf([1.0], [1.0, 0.0]), 3, {}),
    "unstable": (G * tf([1.0], [1.0, -1.0]), 3, {}),
    "sampled, unstable": (control.ss(G * tf([1.0], [1.0, -1.0])).sample(0.1), 3, {}),
    "sampled integrator": (
        tf([1.0], [1.0, -1.0], 0.1) * tf([1.0], [1.0, -0.75, 0.125], 0.1),
        2,
        {},
    ),
    "weight of the output": (G, 2, {"output_weight": LEAVING}),
    "weights of both": (G, 2, {"output_weight": LEAVING, "input_weight": ENTERING}),
    "weights of two channels": (MIMO, 3, {"output_weight": LEAVING, "input_weight": ENTERING}),
    "sampled, weighted": (SAMPLED, 2, {"output_weight": control.ss(LEAVING).sample(0.1)}),
}


@pytest.mark.parametrize("method", ["balanced", "matchdc", "hankel"])
@pytest.mark.parametrize("name", CASES)
def test_the_error_is_proven_and_close(name, method):
    system, order, weights = CASES[name]
    if weights and method == "hankel":
        return
    small = approximate(system, order, method=method, **weights)
    assert small.nstates == order and small.dt == system.dt
    true = seen(system, small, *(weights.get(f"{side}_weight") for side in ("output", "input")))
    assert true * (1 - 1e-6) <= small.error <= 1.05 * true, name
    assert small.holds and small.value == small.error


@pytest.mark.parametrize("unit", [1e-6, 1e6])
def test_a_unit_of_time_changes_nothing(unit):
    scaled = tf([unit**2], [1.0, 0.2 * unit, unit**2]) * tf([unit], [1.0, 3.0 * unit])
    plain = tf([1.0], [1.0, 0.2, 1.0]) * tf([1.0], [1.0, 3.0])
    weight = tf([10.0 * unit], [1.0, 0.1 * unit])
    found = approximate(scaled, 2, method="balanced", output_weight=weight)
    other = approximate(plain, 2, method="balanced", output_weight=LEAVING)
    assert found.error == pytest.approx(other.error, rel=1e-3)


def test_a_weight_brings_the_error_down_where_it_is_high():
    plain = approximate(MIMO, 3, method="balanced")
    shaped = approximate(MIMO, 3, method="balanced", output_weight=LEAVING)
    assert seen(MIMO, shaped, LEAVING) < seen(MIMO, plain, LEAVING)
    assert seen(MIMO, shaped) > seen(MIMO, plain)


@pytest.mark.cases(2)
@pytest.mark.parametrize("system", [G, SAMPLED, MIMO, G * tf([1.0], [1.0, 0.0])])
@pytest.mark.parametrize("error", [0.5, 3e-2, 1e-3])
def test_a_wanted_error_is_reached_by_the_least_order(system, error):
    found = approximate(system, None, method="balanced", error=error)
    assert found.error <= error and seen(system, found) <= error
    least = 0 if abs(system.poles()).min() > 0.0 else 1
    if found.nstates > least:
        assert seen(system, approximate(system, found.nstates - 1, method="balanced")) > error


def test_no_approximation_is_better_than_the_next_hankel_value():
    values = hankel_values(MIMO)
    for order in range(6):
        error = approximate(MIMO, order, method="hankel").error
        assert error >= values.lower[order]
        assert (
            approximate(MIMO, order, method="balanced").error <= values.error_bounds[order] * 1.001
        )


def test_an_error_below_rounding_has_the_system_itself_alone():
    found = approximate(G, None, method="balanced", error=1e-30)
    assert found.nstates == 4 and found.error == 0.0 and found.holds
    assert approximate(G, None, method="balanced", error=1e-11).nstates == 4


def test_it_is_a_state_space_with_a_certificate():
    named = control.ss(control.ss(G), inputs="u", outputs="y")
    small = approximate(named, 2, method="balanced")
    assert isinstance(small, ApproximatedSystem) and isinstance(small, control.StateSpace)
    assert small.input_labels == ["u"] and type(2 * small).__name__ == "StateSpace"
    assert "error" not in vars(small)  # nobody asked
    assert copy.deepcopy(small).holds
    assert np.isnan(ApproximatedSystem(small).error)


def test_a_wrong_error_fails():
    small = approximate(G, 2, method="balanced", output_weight=LEAVING)
    vars(small)["error"] = small.error * 0.99
    assert not small.holds
    moved = approximate(G, 2, method="balanced")
    bound = moved.error
    moved.B = moved.B * 1.1
    vars(moved)["error"] = bound
    assert not moved.holds


def test_what_is_on_the_boundary_must_agree():
    """An integrator of another gain: the difference has no bound."""
    integrating = G * tf([1.0], [1.0, 0.0])
    small = approximate(integrating, 3, method="balanced")
    checker = small._checked_by[0]
    place = int(np.argmin(abs(np.diagonal(small.A))))
    B = np.array(small.B)
    B[place] *= 1.001
    other = ApproximatedSystem.of(control.ss(small.A, B, small.C, small.D), checker)
    assert other.error == np.inf


@pytest.mark.parametrize(
    ("given", "message"),
    [
        ({}, "order is None and error is None; give one of them"),
        ({"order": 2, "error": 0.1}, "order is 2 and error is 0.1; give one of them"),
        ({"error": -1.0}, "error is -1"),
        ({"order": 2, "output_weight": tf([1], [1, 0])}, "output_weight is not stable"),
        ({"order": 2, "output_weight": tf([1], [1, 0.5], 0.1)}, "output_weight has dt = 0.1"),
        ({"order": 2, "input_weight": MIMO}, "input_weight has 2 inputs"),
        ({"order": 2, "input_weight": 2.0, "method": "hankel"}, "belongs to the methods"),
        ({"order": 2, "input_weight": tf([1, 0, 0], [1, 1])}, "input_weight has no realisation"),
    ],
)
def test_bad_input_is_told(given, message):
    with pytest.raises(InputError, match=message):
        approximate(G, **{"order": None, "method": "balanced"} | given)


def test_a_sampling_time_that_is_not_given_stays_so():
    small = approximate(tf([1.0, 0.1], [1.0, -0.5, 0.06], True), 1, method="balanced")
    assert small.dt is True and small.holds


@pytest.mark.cases(1)
@pytest.mark.parametrize("unit", [1.0, 1.0588, 1e6])
@pytest.mark.parametrize("damping", [1e-9, 1e-11])
@pytest.mark.parametrize("method", ["balanced", "matchdc", "hankel"])
def test_a_pair_of_hardly_any_damping_has_a_finite_error(method, damping, unit):
    """Rounding of its real part moves its peak by the share eps / damping, and more by the change
    of coordinates; the bound is no smaller, and far below the peak."""
    pair = tf([1.0], [1.0 / unit**2, 2.0 * damping / unit, 1.0])
    small = approximate(
        control.ss(pair) + control.ss(tf([1.0], [1.0 / unit, 1.0])), 2, method=method
    )
    assert 1.0 <= small.error <= 0.1 / damping
    assert small.holds, small.certificate.failures
