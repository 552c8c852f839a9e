"""Frequencies and sampling times a hundred times beyond a plant's own are told; all others not."""

import contextlib
import warnings

import control
import numpy as np
import pytest

import workbench as wb
from workbench.diagnosis import FaultModel, detectability, performance_index, residual_response
from workbench.errors import RangeWarning
from workbench.mu import Complex, Full, Structure, frequency_sweep, peak, performance_sweep
from workbench.simulation import sampled_model
from workbench.synthesis import Implementation, discretise, sampled_conditions
from workbench.systems import bandwidths
from workbench.systems.range_hints import warn_far_frequencies, warn_far_period
from workbench.uncertainty import (
    CircleCover,
    MatrixCover,
    MatrixResponses,
    Responses,
    generalised_plant,
    real,
    tf,
)

LAG = control.ss(control.tf([12.0], [1.0, 12.0]))
ONE = Structure([Full(1, 1)])
ABOVE = "^all frequencies lie above 100 times the fastest pole: are they in Hz\\?"


def in_other_time(system, unit):
    """The system with its time in this unit [s]: its poles are as many times as large."""
    return control.ss(system.A * unit, system.B * unit, system.C, system.D)


def chain(count, gain=1.0):
    """Integrators in coordinates of no meaning."""
    T = np.random.default_rng(count).standard_normal((count, count))
    A = T @ np.diag(np.full(count - 1, gain), 1) @ np.linalg.inv(T)
    return control.ss(A, np.ones((count, 1)), np.ones((1, count)), 0.0)


def test_the_hint_says_the_numbers():
    with pytest.warns(RangeWarning) as caught:
        warn_far_frequencies(np.geomspace(6.3e4, 6.3e6, 50), LAG)
    assert str(caught[0].message) == (
        "all frequencies lie above 100 times the fastest pole: are they in Hz? (50 given, 6.3e+04 "
        "to 6.3e+06 rad/s; the pole is at 12 rad/s, or is the system in other units of time?)"
    )
    assert caught[0].filename == __file__


@pytest.mark.parametrize(
    ("unit", "told"),
    [
        (1e-6, "above 100 times the fastest pole"),
        (1e-3, ""),
        (1.0, ""),
        (1e3, ""),
        (1e6, "below 1/100 of the slowest zero"),
    ],
)
def test_a_plant_in_other_units_of_time(unit, told):
    G = control.ss(control.tf([3.0, 1.0], [1.0, 2.0, 10.0]))  # zero 1/3, poles of size 3.2 rad/s
    assert told in hint(np.geomspace(0.1, 100, 20), in_other_time(G, unit))
    assert bool(told) == bool(hint(np.geomspace(0.1, 100, 20), in_other_time(G, unit)))


def hint(omega, system):
    """What is said of frequencies; empty if nothing."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        warn_far_frequencies(omega, system)
    return " ".join(str(one.message) for one in caught)


def test_the_limit_is_a_hundred_and_a_zero_counts():
    assert not hint([1199.0, 1e6], LAG) and hint([1201.0, 1e6], LAG)
    assert not hint([1e-6, 0.1201], LAG) and hint([1e-6, 0.1199], LAG)
    lead = control.ss(control.tf([1.0, 1e4], [1.0, 12.0]))
    assert not hint([2e3], lead) and "fastest zero" in hint([2e6], lead)


def test_ends_of_the_axis_count_for_nothing():
    assert not hint([0.0], LAG) and not hint([np.inf], LAG) and not hint([], LAG)
    assert not hint((0.0, np.inf), LAG)
    assert hint((1e5, np.inf), LAG) and hint((0.0, 1e-3), LAG)


def test_gains_and_integrators_say_nothing():
    gain = control.ss([], [], [], [[2.0]])
    for system in (gain, chain(1), chain(2), chain(3), chain(4, 1e3), control.tf([1], [1, 0, 0])):
        for omega in (1e-9, 1e-3, 1.0, 1e9):
            assert not hint([omega], system)
    beside = control.append(chain(2), LAG)  # the pole at 12 rad/s is still seen
    assert not hint([100.0], beside) and hint([1e6], beside)
    assert not hint([1.0], control.ss(control.tf([5.0], [1.0, 5.0, 0.0])))


def test_a_sampled_system_is_judged_by_its_poles_in_continuous_time():
    slow = LAG.sample(1e-5)  # half the sampling rate at 3e5 rad/s, the pole at 12
    assert not hint([1.0, 3e5], slow) and hint([2e3, 3e5], slow)
    assert not hint([0.2, 0.3], slow) and hint([0.1], slow)
    fast = LAG.sample(10.0)  # its pole has gone to 1e-52
    assert not hint([1e-3, 0.3], fast)
    assert not hint([0.1], control.ss([[1.0]], [[1.0]], [[1.0]], [[0.0]], 0.1))  # an integrator
    delay = control.ss([[0.0]], [[1.0]], [[1.0]], [[0.0]], 0.1)
    assert not hint([1e-6], control.tf([1.0], [1.0, -1.0], 0.1)) and not hint([31.0], delay)


def test_what_takes_frequencies_and_a_system_tells():
    omega = np.geomspace(1e4, 1e6, 20)
    model = FaultModel(
        control.ss(-12.0, [[1.0, 0.0]], 1.0, [[0.0, 0.1]], inputs=["f", "n"]),
        faults=("f",),
        noise=("n",),
    )
    Q = control.ss([], [], [], [[1.0]])
    plant = generalised_plant(
        [(LAG, "v", "y"), (control.ss([], [], [], [[0.2]]), "u", "z")],
        {"v": "u + d", "e": "r - y"},
        perturbation=[(Complex(1), "z", "d")],
        exogenous="r",
        performance="e",
        control="u",
        measurement="e",
    )
    far = LAG(1j * omega)[:, None] * np.array([0.9, 1.1])
    asked = (
        lambda: frequency_sweep(LAG, ONE, omega=omega),
        lambda: performance_sweep(plant, control.ss([], [], [], [[1.0]]), omega),
        lambda: peak(LAG, ONE, band=(1e4, np.inf)),
        lambda: plant.response(omega),
        lambda: (tf([12], [1, 12]) * real("k", 1, percent=10)).response(omega),
        lambda: MatrixResponses.of_systems([LAG, 1.1 * LAG], omega),
        lambda: MatrixCover(MatrixResponses(omega, far[..., None, None]), LAG),
        lambda: CircleCover(Responses(omega=omega, values=far), order=1, nominal=LAG),
        lambda: detectability(model, omega=omega),
        lambda: residual_response(Q, model, ["f"], omega),
        lambda: performance_index(Q, model, (1e4, 1e6)),
        lambda: bandwidths(LAG, frequency_hz=omega),
    )
    for ask in asked:
        with pytest.warns(RangeWarning, match=ABOVE) as caught:
            ask()
        assert {one.filename for one in caught} == {__file__}


LONG = "^the sampling time, 10 s, is above 100 times the plant's longest time constant, 0.083"
SHORT = "^the sampling time, .*, is below 1/1000 of the loop's shortest time constant"


@pytest.mark.parametrize(
    ("plant", "gain", "dt", "told"),
    [
        (LAG, 2.0, 1e-2, ""),
        (LAG, 2.0, 3e-5, ""),  # the loop has a pole of 36 rad/s
        (LAG, 2.0, 10.0, LONG),
        (LAG, 2.0, 1e-5, SHORT),
        (in_other_time(LAG, 1e-3), 2.0, 1e-2, SHORT),  # its time is in milliseconds
        (control.tf([1.0], [1.0, 0.01]), 20.0, 1e-3, ""),  # a fast loop around a slow plant
        (control.tf([1.0], [1.0, 0.0, 0.0]), 0.1, 10.0, ""),  # two integrators
    ],
)
def test_a_sampling_time_far_from_the_loop_is_told(plant, gain, dt, told):
    plant = control.ss(plant)
    loop = control.feedback(plant.sample(dt) * gain)
    with pytest.warns(RangeWarning, match=told) if told else contextlib.nullcontext():
        warn_far_period(dt, plant, loop)


def test_what_samples_one_system_tells():
    with pytest.warns(RangeWarning, match=LONG) as caught:
        sampled_model(LAG, 10.0)
    with pytest.warns(RangeWarning, match=LONG.replace("plant", "controller")):
        discretise(LAG, 10.0)
    assert caught[0].filename == __file__
    sampled_model(LAG, 1e-6), discretise(LAG, 1e-6)  # alone, nothing says that it is too short


def test_what_takes_a_sampling_time_and_a_plant_tells():
    K = control.ss([], [], [], [[2.0]], 10.0)
    with pytest.warns(RangeWarning, match=LONG):
        assert not sampled_conditions(LAG, K, 10.0).stable
    with pytest.warns(RangeWarning, match=LONG):
        wb.solve(Implementation(LAG, K, dt=10.0))
