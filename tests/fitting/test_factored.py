"""FactoredRational: the function it stands for, its derivatives, and the signs that it keeps."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from workbench.fitting.factored import FactoredRational
from workbench.fitting.rational import Rational

OMEGA = np.geomspace(0.1, 1e4, 40)
BAND = float(OMEGA[0]), float(OMEGA[-1])
POLES = [-1.0, -20.0, -300 + 4000j, -300 - 4000j, -2e3]


def factored(start, zeros, stable=True, minimum_phase=False):
    return FactoredRational.of(start, zeros, BAND, stable, minimum_phase)


roots = st.lists(
    st.one_of(
        st.floats(-1e4, -1e-1).map(lambda x: [complex(x)]),
        st.builds(
            lambda x, y: [complex(x, y), complex(x, -y)], st.floats(-1e4, -1e-2), st.floats(1, 1e4)
        ),
    ),
    max_size=4,
).map(lambda groups: [root for group in groups for root in group])


@settings(derandomize=True, deadline=None)
@given(roots, roots, st.floats(-1e3, 1e3), st.booleans(), st.integers(0, 3))
def test_factored_function_equals_its_start(zeros, poles, gain, minimum_phase, spare):
    zeros = zeros if len(zeros) <= len(poles) else []
    start = Rational(zeros, poles, gain)
    allowed = min(len(zeros) + (0 if minimum_phase else spare), len(poles))
    made = factored(start, allowed, minimum_phase=minimum_phase)
    assert made.start.size == len(poles) + allowed + 1
    expected = start.response(OMEGA)
    assert np.allclose(made.response(made.start, OMEGA), expected, rtol=1e-6, atol=1e-300)
    back = made.rational(made.start)
    assert back.poles.size == len(poles)
    assert np.allclose(back.response(OMEGA), expected, rtol=1e-6, atol=1e-300)


@pytest.mark.parametrize("minimum_phase", [False, True])
@pytest.mark.parametrize("stable", [False, True])
@pytest.mark.parametrize("zeros", [[], [-3.0], [-50 + 900j, -50 - 900j, -7.0]])
def test_slopes_are_derivatives(zeros, stable, minimum_phase):
    made = factored(Rational(zeros, POLES, 2.0), 4, stable, minimum_phase)
    at = made.start
    slopes = made.slopes(at, OMEGA)
    size = np.abs(made.response(at, OMEGA))
    for i in range(at.size):
        step = np.zeros(at.size)
        step[i] = 1e-6 * max(abs(at[i]), 1e-3)
        ahead, behind = (made.response(at + sign * step, OMEGA) for sign in (1, -1))
        numeric = (ahead - behind) / (2 * step[i])
        assert np.allclose(slopes[:, i] / size, numeric / size, rtol=1e-4, atol=1e-4)


def test_slopes_at_a_zero_on_the_axis():
    on_axis = Rational([1j * OMEGA[9], -1j * OMEGA[9]], POLES, 2.0)
    made = factored(on_axis, 2)
    assert abs(made.response(made.start, OMEGA)[9]) < 1e-12
    slopes = made.slopes(made.start, OMEGA)
    assert np.isfinite(slopes).all()
    assert np.abs(slopes[9, :2]).min() > 0


@settings(derandomize=True, deadline=None)
@given(st.integers(0, 10**6), st.floats(0.1, 30))
def test_roots_stay_on_the_left(seed, step):
    made = factored(Rational([5.0], POLES, 1.0), 3, minimum_phase=True)
    moved = made.start + step * np.random.default_rng(seed).normal(size=made.start.size)
    found = made.rational(moved)
    assert found.is_stable
    assert found.is_minimum_phase


def test_zeros_pass_through_infinity():
    made = factored(Rational([-1e6], POLES, 1.0), 1)
    signs = []
    for leading in (0.1, 0.0, -0.1):
        vector = made.start.copy()
        vector[0] = leading
        signs.append(np.sign(made.rational(vector).zeros.real).tolist())
    assert signs == [[-1], [], [1]]


@pytest.mark.parametrize("monic", [False, True])
@pytest.mark.parametrize("zeros", [[], [-3.0], [-50 + 900j, -50 - 900j, -7.0]])
def test_log_magnitudes_are_those_of_the_values(zeros, monic):
    start = Rational(zeros, POLES, -2.0)
    made = FactoredRational.of(start, len(zeros), BAND, True, True, monic=monic)
    values, slopes = made.values(made.start, OMEGA)
    logs, by_parameter = made.log_magnitude(made.start, OMEGA)
    np.testing.assert_allclose(logs, np.log(np.abs(values)), rtol=1e-10)
    relative = (slopes / values[:, None]).real
    np.testing.assert_allclose(by_parameter, relative, rtol=1e-9, atol=1e-12)


@pytest.mark.parametrize("monic", [False, True])
def test_a_monic_function_has_its_gain_at_infinite_frequency(monic):
    start = Rational([-3.0, -700.0], [-1.0, -20.0], 5.0)
    made = FactoredRational.of(start, 2, BAND, True, True, monic=monic)
    moved = made.start.copy()
    moved[:-1] += 1.0
    assert (made.rational(moved).gain == pytest.approx(5.0)) == monic


def test_products_are_the_values_at_any_points():
    start = Rational([-50 + 900j, -50 - 900j, -7.0], POLES, 2.0)
    made = factored(start, 3)
    s = np.random.default_rng(4).normal(size=(2, 20)) * 1e3
    real, imaginary = made.products(made.start, (s[0], s[1]))
    np.testing.assert_allclose(real + 1j * imaginary, start(s[0] + 1j * s[1]), rtol=1e-8)
