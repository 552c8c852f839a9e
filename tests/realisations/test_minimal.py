"""Minimal realisations, against the systems that they were made from."""

import dataclasses

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.errors import InputError
from workbench.realisations import hankel_values, minimal_realisation

tf = control.tf
RNG = np.random.default_rng(5)
LAG = tf([1.0], [1.0, 5.0])


def hidden(poles, unit=1.0):
    """Three states of two inputs and outputs, and others that nobody sees, in random states."""
    A, B, C = RNG.standard_normal((3, 3)) - 4.0 * np.eye(3), *RNG.standard_normal((2, 3, 2))
    n = len(poles)
    whole = np.block([[A, np.zeros((3, n))], [RNG.standard_normal((n, 3)), np.diag(poles)]])
    T = RNG.standard_normal((3 + n, 3 + n))
    back = np.linalg.inv(T)
    B, C = np.vstack([B, RNG.standard_normal((n, 2))]), np.hstack([C.T, np.zeros((2, n))])
    return control.ss(unit * T @ whole @ back, unit * T @ B, C @ back, 0.0)


CASES = {
    "lag": (LAG, 1, []),
    "static": (tf([2.0], [1.0]), 0, []),
    "nothing": (control.ss(-np.eye(2), np.zeros((2, 1)), [[1.0, 2.0]], 3.0), 0, [-1, -1]),
    "cancelled pole": (tf([1.0, 2.0], [1.0, 3.0, 2.0]), 1, [-2]),
    "cancelled integrator": (tf([1.0, 0.0], [1.0, 1.0, 0.0]), 1, [0]),
    "one of two integrators": (tf([1.0, 0.0], [1.0, 1.0, 0.0, 0.0]), 2, [0]),
    "PI times a lag that it cancels": (tf([1.0, 2.0], [1.0, 2.0, 0.0]) * LAG, 2, [-2]),
    "an integrator alone": (tf([1.0, 1.0], [1.0, 1.0, 0.0]), 1, [-1]),
    "unstable pole": (tf([1.0, -2.0], [1.0, -1.0, -2.0]), 1, [2]),
    "undamped pair": (tf([1.0, 0.0, 4.0], [1.0, 1.0, 4.0, 4.0]), 1, [2j, -2j]),
    "slow unit": (tf([1.0, 2e-6], [1.0, 3e-6, 2e-12]), 1, [-2e-6]),
    "fast unit": (tf([1.0, 2e6], [1.0, 3e6, 2e12]), 1, [-2e6]),
    "two copies": (control.ss(LAG) + control.ss(LAG), 1, [-5]),
    "equal integrators": (control.ss(np.zeros((2, 2)), np.ones((2, 2)), np.eye(2), 0.0), 1, [0]),
    "integrators of two inputs": (control.ss(np.zeros((2, 2)), np.eye(2), np.eye(2), 0.0), 2, []),
    "sampled": (tf([1.0, -0.5], [1.0, -0.9, 0.2], 0.1), 1, [0.5]),
    "sampled integrator": (tf([1.0, -0.5], [1.0, -1.5, 0.5], 0.1), 1, [0.5]),
    "sampled, one of two integrators": (tf([1, -1], [1, -2.5, 2, -0.5], 0.1), 2, [1]),
    "hidden states": (hidden([-1.0, -2.0]), 3, [-1, -2]),
    "hidden states, slow": (hidden([-1.0, -2.0], 1e-6), 3, [-1e-6, -2e-6]),
    "hidden unstable state": (hidden([1.0]), 3, [1]),
}


@pytest.mark.parametrize("name", CASES)
def test_what_counts_for_nothing_goes(name):
    system, states, removed = CASES[name]
    found = minimal_realisation(system)
    assert found.system.nstates == states
    key = lambda pole: (np.round(pole.real, 6), pole.imag)  # noqa: E731
    assert sorted(found.removed_poles, key=key) == pytest.approx(
        sorted(np.array(removed, complex), key=key), rel=1e-5, abs=1e-12
    )
    assert found.holds, found.certificate
    assert found.boundary_error < 1e-13
    size = 1.0 if system.dt or not system.poles().size else max(abs(system.poles()).max(), 1e-9)
    for s in 2.0 * size * np.exp(1j * np.array([0.4, 1.4])):
        assert np.atleast_2d(found.system(s)) == pytest.approx(
            np.atleast_2d(system(s)), rel=1e-9, abs=1e-11
        )


def test_what_is_minimal_stays_as_it_is():
    system = control.ss(
        RNG.standard_normal((4, 4)) - 3 * np.eye(4), np.ones((4, 1)), [1, 0, 0, 0], 0
    )
    found = minimal_realisation(system)
    assert (
        (found.system.A == system.A).all() and found.error == 0.0 and not found.removed_poles.size
    )


def test_exact_integrators_stay_exact():
    found = minimal_realisation(tf([1.0, 0.0], [1.0, 1.0, 0.0, 0.0])).system
    assert 0.0 in found.poles().tolist()
    assert (
        1.0
        in minimal_realisation(CASES["sampled, one of two integrators"][0]).system.poles().tolist()
    )


def test_a_tolerance_asks_for_less():
    near = tf([1.0, 1.001], [1.0, 3.0, 2.0])
    assert minimal_realisation(near).system.nstates == 2
    found = minimal_realisation(near, tolerance=1e-2)
    omega = 1j * np.geomspace(1e-3, 1e3, 200)
    true = max(abs(near(s) - found.system(s)) for s in omega)
    assert found.system.nstates == 1 and true <= found.error < 5.0 * true and found.holds


@pytest.mark.cases(0)
@settings(max_examples=25, deadline=None)
@given(st.floats(0.01, 50.0), st.floats(0.01, 50.0), st.floats(-3.0, 3.0), st.integers(0, 2))
def test_cancelling_pairs_of_random_loops(pole, gain, decade, integrators):
    """(s + a) (s + b) / ((s + a) (s + c) s^k): coefficients are rounded, and cancel to rounding."""
    unit = 10.0**decade
    other = 3.7 * pole + 1.0
    numerator = gain * np.poly([-pole * unit])
    denominator = np.poly([-pole * unit, -other * unit, *[0.0] * integrators])
    found = minimal_realisation(tf(numerator, denominator), tolerance=1e-8)
    assert found.system.nstates == 1 + integrators and found.holds
    assert found.removed_poles.real == pytest.approx([-pole * unit], rel=1e-6)
    assert found.system.poles().tolist().count(0.0) == integrators


def test_a_unit_of_time_far_from_one():
    found = minimal_realisation(
        tf([1.0, 1e-100], [1.0, 3e-100, 2e-200])
    )  # poles -1e-100 and -2e-100
    assert found.removed_poles.real == pytest.approx([-1e-100]) and found.holds
    assert found.error < 1e-12 / 2e-100


def test_it_stands_where_a_system_is_wanted():
    assert hankel_values(
        minimal_realisation(tf([1.0, 2.0], [1.0, 3.0, 2.0]))
    ).upper == pytest.approx([0.5])


def test_bad_input_is_named():
    with pytest.raises(InputError, match="tolerance is -1"):
        minimal_realisation(LAG, tolerance=-1)
    with pytest.raises(InputError, match="improper"):
        minimal_realisation(tf([1.0, 0.0, 0.0], [1.0, 1.0]))


def test_wrong_claims_fail():
    found = minimal_realisation(tf([1.0, 1.001], [1.0, 3.0, 2.0, 0.0]), tolerance=1e-2)
    checker = found._checked_by[0]
    A, B, C, D = (getattr(found.system, part) for part in "ABCD")
    coupled = A.copy()
    coupled[0, -1] = 1e-9
    spoilt = {
        "error": {"error": found.error * 0.4},
        "gain": {"system": control.ss(A, B * 1.01, C, D)},
        "direct": {"system": control.ss(A, B, C, D + 0.1)},
        "coupling": {"system": control.ss(coupled, B, C, D)},
        "sizes": {"sizes": (0, 1, 1)},
    }
    for name, fields in spoilt.items():
        wrong = dataclasses.replace(found, **fields).with_checker(checker)
        assert not wrong.holds, name
    same = minimal_realisation(LAG)
    other = dataclasses.replace(same, system=control.ss(control.tf([1.0], [1.0, 5.1])))
    assert not other.with_checker(same._checked_by[0]).holds


@pytest.mark.parametrize("unit", [1e-9, 1e-14, 1e12])
def test_an_output_in_another_unit_keeps_its_states(unit):
    """An output in metres beside one in volts lost both states of its resonance."""
    A = np.array([[-1.0, 0, 0, 0], [0, -3.0, 0, 0], [0, 0, 0, 1.0], [0, 0, -1.0, -0.02]])
    B = np.array([[1.0, 0.0], [0.0, 0.0], [0.0, 0.0], [0.0, 1.0]])
    C = np.array([[1.0, 1.0, 0.0, 0.0], [0.0, 0.0, unit, 0.0]])
    found = minimal_realisation(control.ss(A, B, C, 0.0, remove_useless_states=False))
    assert found.system.nstates == 3 and found.holds
    assert found.removed_poles.real == pytest.approx([-3.0])
    for s in (0.3j, 1j, 5j):
        assert found.system(s)[1, 1] == pytest.approx(unit / (s**2 + 0.02 * s + 1.0), rel=1e-9)


def test_what_rounding_leaves_of_an_output_is_no_unit():
    """Two equal lags that cancel in the second output but for 5e-17 are not shown by it."""
    A, C = np.diag([-1.0, -2.0, -2.0]), np.array([[1.0, 0.0, 0.0], [0.0, 1.0, -1.0]])
    G = control.ss(A, [[1.0], [0.1 + 0.2], [0.3]], C, 0, remove_useless_states=False)
    assert abs(G(0.0)[1]) > 0.0
    assert minimal_realisation(G).system.nstates == 1


@pytest.mark.parametrize("far", [1e4, 1e6])
def test_a_fast_mode_that_matters_about_its_own_frequency_stays(far):
    """Poles at 1/far and far with equal residues: about far both have the same gain."""
    G = control.ss(np.diag([-1 / far, -far]), np.ones((2, 1)), np.ones((1, 2)), 0)
    found = minimal_realisation(G).system
    assert found.nstates == 2
    s = 1j * far
    np.testing.assert_allclose(found(s), 1 / (s + 1 / far) + 1 / (s + far), rtol=1e-8)
