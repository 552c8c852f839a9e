"""Crossings and bandwidths against loops whose numbers are known by hand."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from workbench.systems import bandwidths, crossings, modulus_margin, positive_bands
from workbench.systems.margins import highest_crossover, search_grid

HZ = 2 * np.pi


def triple_lag(gain, corner_hz=100.0):
    """gain / (1 + s/w)^3: unstable from a gain of 8, at sqrt(3) w."""
    w = HZ * corner_hz
    return gain * control.ss(control.zpk([], [-w] * 3, w**3))


def test_a_loop_below_one_has_no_crossover():
    assert np.isnan(list(bandwidths(triple_lag(0.2)).values())).all()


def test_bandwidths_of_an_integrator():
    w = HZ * 50
    found = bandwidths(control.ss(control.zpk([], [0], w)))
    # |S| = f / sqrt(f^2 + 50^2), |T| = 50 / sqrt(f^2 + 50^2).
    assert found == pytest.approx({"S": 50.0, "crossover": 50.0, "T": 50.0}, rel=1e-9)


def test_crossings_and_bands_of_a_sine():
    grid = np.geomspace(1.0, 10.0, 50)
    found = crossings(lambda f: np.sin(f), grid)
    assert found == pytest.approx(np.pi * np.arange(1, 4), rel=1e-12)
    positive = positive_bands(lambda f: np.sin(f), grid)
    assert np.array(positive) == pytest.approx(
        np.array([[1.0, np.pi], [2 * np.pi, 3 * np.pi]]), rel=1e-12
    )


def test_modulus_margin_of_a_triple_lag():
    """At a gain of 8 the loop meets -1; at 4 its nearest point is known from a fine grid."""
    f = np.geomspace(1.0, 1e5, 200_001)
    critical = modulus_margin(8.0 / (1 + 1j * f / 100.0) ** 3)
    assert critical == pytest.approx(0.0, abs=1e-4)
    f = f[::10]
    exact = abs(1 + 4.0 / (1 + 1j * f / 100.0) ** 3).min()
    assert modulus_margin(triple_lag(4.0)(HZ * 1j * f)) == pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize("unit", [1e-6, 1e-3, 1.0, 1e3, 1e6])
def test_bandwidths_in_any_unit_of_time(unit):
    for corner in (50.0 * unit, 50.0):
        w = HZ * corner
        found = bandwidths(control.ss(control.zpk([], [0], w)))
        assert found == pytest.approx(dict.fromkeys(found, corner), rel=1e-9)
    loop = control.ss([[1.0]], [[0.5]], [[1.0]], [[0.0]], unit)  # 0.5 / (z - 1)
    assert search_grid(loop)[-1] == pytest.approx(0.4995 / unit)
    at = 2 * np.arcsin(0.25)  # |exp(j w) - 1| = 2 sin(w / 2)
    assert bandwidths(loop)["crossover"] == pytest.approx(at / unit / HZ, rel=1e-9)


# --- the highest crossover of a loop with any number of channels ------------------------------


def gain(value, dt=0):
    return control.ss([], [], [], np.atleast_2d(value), dt)


@pytest.mark.cases(0)
@given(factor=st.floats(1.5, 1e6), corner=st.floats(0.01, 1000.0))
def test_the_highest_crossover_of_a_triple_lag(factor, corner):
    at = np.sqrt(factor ** (2 / 3) - 1)
    unit = gain(1.0)
    assert highest_crossover(triple_lag(factor, corner), unit) == pytest.approx(
        at * corner, rel=1e-8
    )
    assert highest_crossover(unit, triple_lag(factor, corner)) == pytest.approx(
        at * corner, rel=1e-8
    )


def test_the_highest_crossover_is_that_of_the_fastest_channel():
    slow, fast = triple_lag(2.0, 1.0), triple_lag(2.0, 50.0)
    found = highest_crossover(control.append(slow, fast), gain(np.eye(2)))
    assert found == pytest.approx(highest_crossover(fast, gain(1.0)), rel=1e-9)


def test_the_highest_crossover_is_behind_the_last_resonance():
    s = control.tf("s")
    peaks = sum(1e-4 * w * s / (s**2 + 1e-4 * w * s + w**2) for w in (1.0, 20.0, 300.0))
    loop = control.ss(3 * peaks)
    found = highest_crossover(loop, gain(1.0))
    assert 300.0 < HZ * found < 300.1
    assert abs(loop(2j * np.pi * found)) == pytest.approx(1.0, rel=1e-7)


def test_a_crossing_at_a_frequency_of_the_grid_is_kept():
    loop = control.ss([[-1.0]], [[1.0]], [[np.sqrt(2.0)]], 0.0)  # |L| = 1 at the pole's size
    assert HZ * highest_crossover(loop, gain(1.0)) == pytest.approx(1.0, rel=1e-9)


def test_an_undamped_pole_at_a_frequency_of_the_grid():
    """|1 / (1 - w^2)| = 1 at the square root of 2, past the pole at 1 rad/s."""
    loop = control.ss([[0.0, 1.0], [-1.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], 0.0)
    assert HZ * highest_crossover(loop, gain(1.0)) == pytest.approx(np.sqrt(2.0), rel=1e-9)


def test_a_loop_without_a_crossover():
    unit = gain(1.0)
    assert highest_crossover(triple_lag(0.5), unit) == 0.0
    assert highest_crossover(gain(2.0), unit) == np.inf
    assert highest_crossover(gain(0.5), unit) == 0.0


def test_a_sampled_integrator_crosses_where_it_does():
    for dt in (True, 1e-3):
        period = 1.0 if dt is True else dt
        loop = control.ss([[1.0]], [[0.3]], [[1.0]], [[0.0]], dt)  # 0.3 / (z - 1)
        exact = 2 * np.arcsin(0.15) / period / HZ
        assert highest_crossover(loop, gain(1.0, dt)) == pytest.approx(exact)
