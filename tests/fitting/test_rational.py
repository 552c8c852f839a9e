"""Rational functions by their roots, against exact arithmetic, NumPy and python-control."""

from fractions import Fraction

import control
import flint
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.errors import InputError, SolverError
from workbench.fitting.rational import Rational, conjugate_pairs, rational_of_system
from workbench.fitting.slicot import sb10yd


def roots(rng, count, left=True, decades=3.0):
    """Random roots in conjugate pairs."""
    pairs = rng.integers(0, count // 2 + 1)
    size = 10 ** rng.uniform(-decades / 2, decades / 2, count)
    turn = rng.uniform(np.pi / 2 + 0.01 if left else 0.01, np.pi - 0.01, pairs)
    upper = size[:pairs] * np.exp(1j * turn)
    real = -size[2 * pairs :]
    return np.concatenate([upper, upper.conj(), real])


def random_rational(seed, order):
    rng = np.random.default_rng(seed)
    zeros = roots(rng, int(rng.integers(0, order + 1)), left=False)
    return Rational(zeros, roots(rng, order), float(rng.normal()) + 0.1)


def exact(function, omega):
    """Its value at j omega in rational arithmetic: no rounding at all."""

    def times(a, b):
        return a[0] * b[0] - a[1] * b[1], a[0] * b[1] + a[1] * b[0]

    def product(all_roots):
        value = Fraction(1), Fraction(0)
        for root in all_roots:
            away = Fraction(-float(root.real)), Fraction(float(omega)) - Fraction(float(root.imag))
            value = times(value, away)
        return value

    top, bottom = product(function.zeros), product(function.poles)
    size = bottom[0] ** 2 + bottom[1] ** 2
    value = times(top, (bottom[0] / size, -bottom[1] / size))
    gain = Fraction(function.gain)
    return complex(float(gain * value[0]), float(gain * value[1]))


@pytest.mark.parametrize("order", [0, 1, 2, 5, 8])
@pytest.mark.parametrize("seed", range(4))
def test_responses_are_exact(seed, order):
    function = random_rational(seed, order)
    omega = np.geomspace(1e-3, 1e3, 9)
    truth = np.array([exact(function, w) for w in omega])
    np.testing.assert_allclose(function.response(omega), truth, rtol=1e-11)


def test_values_off_the_axis_are_those_of_polynomials():
    function = random_rational(3, 4)
    s = np.array([[1 + 2j, -3j], [0.5, 10]])
    top, bottom = np.poly(function.zeros), np.poly(function.poles)
    truth = function.gain * np.polyval(top, s) / np.polyval(bottom, s)
    np.testing.assert_allclose(function(s), truth, rtol=1e-10)
    assert function(1.0).shape == ()


def test_high_orders_do_not_overflow():
    far = -np.geomspace(1e20, 1e25, 40)
    function = Rational(far * 1.5, far, 3.0)
    np.testing.assert_allclose(function.response([0.0, 1.0]), 3 * 1.5**40, rtol=1e-12)
    np.testing.assert_allclose(function.response(1e40), 3, rtol=1e-12)


@settings(derandomize=True, deadline=None, max_examples=60)
@given(st.integers(0, 10_000), st.integers(0, 10))
def test_state_space_is_the_same_function(seed, order):
    function = random_rational(seed, order)
    system = function.state_space()
    assert system.nstates == order
    omega = np.geomspace(1e-3, 1e3, 12)
    response = function.response(omega)
    other = np.array([
        (system.C @ np.linalg.solve(1j * w * np.eye(order) - system.A, system.B) + system.D)[0, 0]
        for w in omega
    ])  # fmt: skip
    # a nearly undamped root makes the response as ill-conditioned as the root itself
    np.testing.assert_allclose(other, response, rtol=1e-7, atol=1e-9 * np.abs(response).max())


@settings(derandomize=True, deadline=None, max_examples=40)
@given(st.integers(0, 10_000), st.integers(0, 6))
def test_systems_come_back(seed, order):
    function = random_rational(seed, order)
    back = rational_of_system(function.state_space())
    assert back.order == order
    assert back.zeros.size == function.zeros.size
    omega = np.geomspace(1e-2, 1e2, 12)
    scale = np.abs(function.response(omega)).max()
    np.testing.assert_allclose(
        back.response(omega), function.response(omega), rtol=1e-4, atol=1e-6 * scale
    )


def test_transfer_functions_are_taken():
    back = rational_of_system(control.tf([2.0, 4.0], [1.0, 3.0, 100.0]))
    np.testing.assert_allclose(back.zeros, [-2])
    np.testing.assert_allclose(back.gain, 2)
    np.testing.assert_allclose(np.poly(back.poles).real, [1, 3, 100])
    assert rational_of_system(control.tf([0.0], [1.0, 1.0])).gain == 0
    assert rational_of_system(control.ss([], [], [], [[5.0]])).response(3.0) == 5


def test_properties():
    function = Rational([-1.0], [-3.0, -2 + 1j, -2 - 1j], 4)
    assert (function.order, function.is_stable, function.is_minimum_phase) == (3, True, True)
    assert not Rational([0.0], [-1.0], 1.0).is_minimum_phase
    assert not Rational([], [0.0], 1.0).is_stable
    assert Rational([], [], 1.0).is_stable
    omega = np.geomspace(0.1, 10, 5)
    np.testing.assert_allclose(function.scaled(-3).response(omega), -3 * function.response(omega))
    biproper = Rational([-1.0], [-3.0], 4.0)
    np.testing.assert_allclose(biproper.inverse().response(omega), 1 / biproper.response(omega))
    with pytest.raises(InputError, match="3 zeros, but only 1 poles"):
        function.inverse()


@pytest.mark.parametrize("time", [1e-5, 1.0, 1e6])
@pytest.mark.parametrize("size", [1e-12, 1.0, 1e9])
def test_systems_come_back_in_any_unit(time, size):
    system = control.ss([[0, -100.0], [1, -3]], [[1], [2]], [[0, 1]], [[0.5]])
    scaled = control.ss(system.A * time, system.B * time * size, system.C, system.D * size)
    one, other = rational_of_system(system), rational_of_system(scaled)
    np.testing.assert_allclose(other.zeros, one.zeros * time, rtol=1e-6)
    np.testing.assert_allclose(other.poles, one.poles * time, rtol=1e-9)
    assert other.gain == pytest.approx(one.gain * size)


@pytest.mark.parametrize(
    ("zeros", "poles", "gain", "words"),
    [
        ([1j], [-1.0], 1.0, "zeros must come in conjugate pairs"),
        ([], [-1 + 1j, -1 - 1.0000001j], 1.0, "poles must come in conjugate pairs"),
        ([], [-1 + 1j, -1 + 1j], 1.0, "poles must come in conjugate pairs"),
        ([], [np.nan], 1.0, "poles must be finite"),
        ([np.inf], [-1.0], 1.0, "zeros must be finite"),
        ([], [-1.0], np.inf, "gain must be finite, it is inf"),
        ([-1.0, -2.0], [-1.0], 1.0, "2 zeros, but only 1 poles"),
    ],
)
def test_refused_functions(zeros, poles, gain, words):
    with pytest.raises(InputError, match=words):
        Rational(zeros, poles, gain)


@pytest.mark.parametrize(
    ("system", "words"),
    [
        (control.ss([], [], [], np.eye(2)), "SISO system is needed, not 2 x 2"),
        (control.tf([1.0], [1.0, 0.5], 0.1), "continuous-time system is needed, dt is 0.1"),
        (control.tf([1.0, 0.0, 0.0], [1.0, 0.5]), "2 zeros, but only 1 poles"),
        ("G", "state space is needed, not 'G'"),
        (3.0, "state space is needed, not 3.0"),
        (control.frd([1.0, 2.0], [1.0, 2.0]), "state space is needed"),
    ],
)
def test_refused_systems(system, words):
    with pytest.raises(InputError, match=words):
        rational_of_system(system)


def test_pairs_are_repaired():
    noise = 1e-9 * np.array([1, 1j, -1, 2j, 1 - 1j])
    given_roots = np.array([-1 + 2j, -1 - 2j, -3 + 0.5j, -3 - 0.5j, -7]) + noise
    repaired = conjugate_pairs(given_roots)
    assert sorted(repaired.imag) == sorted(-repaired.imag)
    assert repaired[repaired.imag == 0].size == 1
    far = np.abs(given_roots[:, None] - repaired[None, :]).min(axis=1)
    assert far.max() < 1e-8
    Rational([], repaired, 1.0)
    assert conjugate_pairs([2 + 1e-12j]).tolist() == [2]
    assert conjugate_pairs([]).size == 0


def test_exact_pairs_stay_as_they_are():
    given_roots = np.array([-1 + 2j, -4, -1 - 2j, 3, -4])
    assert sorted(conjugate_pairs(given_roots), key=str) == sorted(given_roots, key=str)


# --- SLICOT ---------------------------------------------------------------------------------------

OMEGA = np.geomspace(0.1, 100, 60)
PLANT = Rational([-1.0], [-2 + 9j, -2 - 9j, -30.0], 5.0)


def test_sb10yd_finds_a_function_of_its_order():
    response = PLANT.response(OMEGA)
    fit = sb10yd(OMEGA, response, 3, False)
    assert fit.order <= 3
    away = np.abs(fit.response(OMEGA) - response)  # it resamples the response: not exact
    assert away.max() < 0.2 * np.abs(response).max()


@pytest.mark.parametrize("time", [1e-6, 1e6])
@pytest.mark.parametrize("size", [1e-9, 1e9])
def test_sb10yd_knows_no_units(time, size):
    response = PLANT.response(OMEGA) * (1 + 0.1 * np.sin(np.arange(60)))
    one = sb10yd(OMEGA, response, 2, True)
    other = sb10yd(OMEGA * time, response * size, 2, True)
    assert one.is_stable
    assert one.is_minimum_phase
    np.testing.assert_allclose(other.response(OMEGA * time), size * one.response(OMEGA), rtol=1e-5)


def test_sb10yd_mirrors_what_is_unstable():
    response = Rational([3.0], [2.0], 1.0).response(OMEGA)
    fit = sb10yd(OMEGA, response, 1, True)
    assert fit.is_stable
    assert fit.is_minimum_phase


def test_sb10yd_speaks_for_itself():
    with pytest.raises(SolverError, match=r"^SB10YD: \S"):
        sb10yd(OMEGA[:2], PLANT.response(OMEGA[:2]), 40, False)


def test_a_direct_path_that_is_small_beside_the_states_keeps_its_zeros():
    """A controller that almost integrates, in bad units: SLICOT alone finds zeros at 80, 15373.

    Truth: eigenvalues of A - B C / D in 60 digits.
    """
    system = control.ss(
        [
            [0.0, 6.1448200917874516, 0.0],
            [6.4351472527348825, -57426.703675800127, 0.0],
            [0.0, 0.0, -73578.173781094738],
        ],
        [[2629.1905473699576], [-24571223.586227618], [-6878.2140020140141]],
        [[-1572559421.2196736, -168266.73780401115, -6878.2140020204397]],
        35.23059738498149,
        remove_useless_states=False,
    )
    zeros = rational_of_system(system).zeros
    truth = [-617.12479 - 647.95134j, -617.12479 + 647.95134j, -373339.78804]
    np.testing.assert_allclose(zeros, truth, rtol=1e-5)


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**31), st.integers(1, 6), st.booleans())
def test_badly_scaled_systems_are_converted_exactly(seed, order, direct):
    """States that nearly cancel, in units that lie far apart: against 400 bits."""
    rng = np.random.default_rng(seed)
    units = np.diag(10 ** rng.uniform(-6, 6, order))
    A = units @ rng.normal(size=(order, order)) @ np.linalg.inv(units)
    b = units @ rng.normal(size=(order, 1)) * 10 ** rng.uniform(-8, 0, (order, 1))
    c = rng.normal(size=(1, order)) * 10 ** rng.uniform(0, 8, (1, order))
    d = [[float(direct) * 10 ** rng.uniform(-6, 6)]]
    system = control.ss(A, b, c, d, remove_useless_states=False)
    function = rational_of_system(system)
    s = complex(rng.normal(), rng.normal())
    with flint.ctx.workprec(400):
        parts = (system.A, system.B, system.C, system.D)
        A, b, c, d = (flint.acb_mat(part.tolist()) for part in parts)
        resolvent = (s * flint.acb_mat(np.eye(order).tolist()) - A).solve(b)
        truth = complex((c * resolvent + d)[0, 0])
    # rounded roots alone move a response that nearly cancels
    assert abs(function(s) - truth) <= 1e-7 * abs(truth)
