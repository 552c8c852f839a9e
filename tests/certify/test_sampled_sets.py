"""Mu of a sampled loop for a set of sampled plants: against dense grids, and attacked."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from lanes import examples

from workbench.certify import sampled_sets
from workbench.certify.sampled_sets import _bounds, _well_conditioned, mu_at, sampled_set_peak
from workbench.errors import SolverError
from workbench.fitting.rational import Rational


def loop(seed, states, period):
    """A stable sampled system of one channel."""
    rng = np.random.default_rng(seed)
    poles = rng.uniform(0.2, 0.999, states) * np.exp(1j * rng.uniform(0, 3, states))
    parts = [np.array([[p.real, p.imag], [-p.imag, p.real]]) for p in poles]
    A = np.zeros((2 * states, 2 * states))
    for k, part in enumerate(parts):
        A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = part
    B, C = rng.normal(size=(2 * states, 1)), rng.normal(size=(1, 2 * states))
    return control.ss(A, B, C, rng.normal(size=(1, 1)), period)


def weight(seed):
    rng = np.random.default_rng(seed)
    pole = -rng.uniform(1, 50) + 1j * rng.uniform(0, 300)
    zero = rng.normal() * 30 + 1j * rng.uniform(0, 100)
    return Rational([zero, np.conj(zero)], [pole, np.conj(pole)], 0.3)


def dense(T, W_c, W_r, count=40_001):
    """Mu on a dense grid, by the least root over real deltas, with python-control's responses."""
    omega = np.linspace(0, np.pi / T.dt, count)[1:]
    value = T(np.exp(1j * omega * T.dt))
    c = np.abs(value * W_c.response(omega))
    if W_r is None:
        return c.max()
    r = value * W_r.response(omega)
    best = np.zeros(count - 1)
    for d in np.linspace(-1, 1, 201):
        # |1 + r d t| = c t at t = 1 / m: m^2 + 2 Re(r d) m + |r d|^2 - c^2 = 0
        root = (r * d).real ** 2 - np.abs(r * d) ** 2 + c**2
        m = np.where(root >= 0, -(r * d).real + np.sqrt(np.maximum(root, 0)), 0.0)
        best = np.maximum(best, m)
    return best.max()


@pytest.mark.cases(0)
@examples(8, 25)
@given(st.integers(0, 10_000), st.integers(1, 4), st.sampled_from([1e-4, 1e-2, 1.0]), st.booleans())
def test_bounds_enclose_what_a_dense_grid_finds(seed, states, period, mixed):
    T, W_c = loop(seed, states, period), weight(seed + 1)
    W_r = weight(seed + 2) if mixed else None
    found = sampled_set_peak(T, W_c, W_r)
    seen = dense(T, W_c, W_r)
    assert seen <= found.upper * (1 + 1e-9)
    assert found.upper <= found.lower * (1 + 1.001e-3)
    assert mu_at(T, W_c, W_r, np.array([found.omega]))[0] == pytest.approx(found.lower, rel=1e-6)


@pytest.mark.parametrize("damping", [1e-3, 1e-5, 1e-7])
def test_a_resonance_between_any_grid_points_is_found(damping):
    """A weight with a peak of height 1 / damping, far narrower than a step of the first grid."""
    T = control.ss([[0.5]], [[0.5]], [[1.0]], [[0.0]], 1e-3)
    pole = 1234.5 * (-damping + 1j * np.sqrt(1 - damping**2))
    W = Rational([], [pole, np.conj(pole)], 1234.5**2)
    found = sampled_set_peak(T, W, None)
    exact = np.abs(T(np.exp(1j * 1234.5 * 1e-3))) / (2 * damping)
    assert found.upper >= exact * (1 - 1e-3)
    assert found.upper == pytest.approx(exact, rel=3e-3)


@pytest.mark.parametrize("size", [1e-12, 1e-3, 1e3, 1e12])
def test_units_of_the_states_do_not_matter(size):
    T, W_c, W_r = loop(3, 3, 0.01), weight(1), weight(2)
    n = T.nstates
    scale = np.geomspace(1, size, n)
    graded = control.ss(T.A * scale[:, None] / scale, T.B * scale[:, None], T.C / scale, T.D, T.dt)
    assert sampled_set_peak(graded, W_c, W_r).upper == pytest.approx(
        sampled_set_peak(T, W_c, W_r).upper, rel=2e-3
    )


def test_a_companion_form_with_slow_poles_is_no_obstacle():
    """Twelve poles near 1 in a companion form, whose resolvent is 1e10 times what the poles say."""
    poles = np.exp(-1e-3 * np.linspace(1.0, 60.0, 8))
    coefficients = np.poly(poles)
    T = control.ss(control.tf([np.polyval(coefficients, 1.0)], coefficients, 1e-3))
    W = Rational([-10.0], [-1000.0], 0.5)
    try:
        found = sampled_set_peak(T, W, None)
    except SolverError as error:
        assert "not within" in str(error)
        return
    assert found.upper >= dense(T, W, None) * (1 - 1e-6)


def test_without_states_and_without_uncertainty():
    T = control.ss([], [], [], [[0.5]], 0.1)
    assert sampled_set_peak(T, Rational([], [-1.0], 0.0), None).upper == 0.0
    flat = sampled_set_peak(T, Rational([-1.0], [-1.0], 0.8), None)
    assert flat.lower == pytest.approx(0.4) and flat.upper == pytest.approx(0.4, rel=1e-3)
    real = sampled_set_peak(T, Rational([-1.0], [-1.0], 1e-9), Rational([-2.0], [-2.0], 0.8))
    assert real.upper == pytest.approx(0.4, rel=1e-3)


def test_a_purely_imaginary_segment_costs_nothing_alone():
    """T W_r = j at every frequency: a real delta never makes 1 + j delta vanish."""
    omega = np.array([1.0])
    T = control.ss([], [], [], [[1.0]], 1.0)
    W_r = Rational([], [-1e-9], 1.0)  # almost 1 / s, -j at 1 rad/s
    at = mu_at(T, Rational([-1.0], [-1.0], 0.1), W_r, omega)
    assert at[0] == pytest.approx(0.1, rel=1e-6)


def test_a_claim_that_cannot_be_closed_is_an_error(monkeypatch):
    monkeypatch.setattr(sampled_sets, "MOST_INTERVALS", 300)
    with pytest.raises(SolverError, match="its upper bound is not within"):
        sampled_set_peak(loop(1, 4, 0.01), weight(5), weight(6))


def resonant(distance, period=1e-3):
    """A sampled system with a pair of poles so far inside the unit circle, at an angle of 1."""
    pole = (1 - distance) * np.exp(1j)
    A = np.array([[pole.real, pole.imag], [-pole.imag, pole.real]])
    return control.ss(A, [[1.0], [0.5]], [[0.3, 1.0]], [[0.1]], period)


STILL = control.ss([], [], [], [[0.7]], 1e-3)
FLAT, TINY = (Rational([], [], gain) for gain in (0.3, 1e-9))
LIGHT = Rational([], [-1.0 + 950j, -1.0 - 950j], 1e3)


@pytest.mark.cases(1)
@pytest.mark.parametrize(
    ("T", "W_c", "W_r"),
    [
        (resonant(1e-3), FLAT, None),
        (resonant(1e-3), TINY, FLAT),
        (resonant(1e-3), FLAT, FLAT),
        (STILL, LIGHT, None),
        (STILL, TINY, LIGHT),
        (STILL, FLAT, LIGHT),
        (resonant(0.1), weight(3), weight(4)),
        (resonant(0.1), weight(5), weight(6).scaled(-1.0)),
    ],
)
def test_the_bound_of_an_interval_holds_all_along_it(T, W_c, W_r):
    """Intervals that end near a pole, by response and weights at points within."""
    form, period, told = _well_conditioned(T), float(T.dt), 0
    for middle in (300.0, 900.0, 949.0, 985.0, 1400.0, 2500.0):
        for half in np.geomspace(1e-2, 100.0, 17):
            ends = np.array([middle]), np.array([half])
            at, bound = (float(one[0]) for one in _bounds(form, W_c, W_r, period, *ends))
            points = mu_at(T, W_c, W_r, np.linspace(middle - half, middle + half, 21))
            assert at <= points[10] * (1 + 1e-9) + 1e-15
            assert points.max() <= bound * (1 + 1e-12), (middle, half)
            told += np.isfinite(bound)
    assert told > 20


@pytest.mark.parametrize(("W_c", "W_r"), [(FLAT, FLAT), (FLAT.scaled(0.0), None), (FLAT, None)])
def test_weights_without_roots_or_of_zero(W_c, W_r):
    """Intervals across a pole have no disc of the sensitivity: none of a weight of zero either."""
    found = sampled_set_peak(resonant(1e-3), W_c, W_r)
    omega = np.linspace(900.0, 1100.0, 20_001)
    seen = mu_at(resonant(1e-3), W_c, W_r, omega).max()
    assert seen <= found.upper * (1 + 1e-9) and found.upper <= seen * (1 + 2e-3) + 1e-300


def test_z_turns_as_s_does():
    """A delay of a sample and a weight that leads or lags: only one of them adds to it."""
    T = control.ss([[0.0]], [[1.0]], [[1.0]], [[0.0]], 1e-3)
    W_r = Rational([-500.0], [-5000.0], 1.0)
    omega = np.array([700.0])
    value = np.exp(-0.7j) * W_r.response(omega)[0]
    c = mu_at(T, FLAT, W_r, omega)[0]
    m = np.linspace(0, 2, 200_001)
    apart = np.abs(-m - np.clip(-m * value.real / abs(value) ** 2, -1, 1) * value)
    assert c == pytest.approx(m[apart < 0.3].max(), rel=1e-4)
