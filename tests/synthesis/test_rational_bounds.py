"""Bounds over cells of frequency, against exact arithmetic of rational numbers."""

from fractions import Fraction

import numpy as np
import pytest

from workbench.fitting.rational import Rational
from workbench.synthesis import AnalyticBasis
from workbench.synthesis.limits.intervals import Interval
from workbench.synthesis.limits.rational_bounds import (
    FrequencyCells,
    asymptote,
    direction,
    largest_magnitude,
    least_magnitude,
)

NONE = np.empty(0)
FUNCTIONS = {
    "damping 1e-6": Rational([-1.0, -50.0], [-1e-4 + 100j, -1e-4 - 100j, -3.0], 7.0),
    "undamped zero": Rational([30j, -30j], [-1.0, -20.0, -400.0], 2.0),
    "integrator": Rational([-2.0], [0.0, -1e4], -5.0),
    "steep": Rational(NONE, [-1.0, -1.1, -1.2, -1.3, -1.4, -1.5], 1e3),
    "right half-plane": Rational([8.0, 3.0 + 4j, 3.0 - 4j], [5.0, -6.0, -7.0], 0.1),
    "graded": Rational([-1e-7, -1e7], [-1e-5, -1e5], 1e-12),
}


def exact(function, omega):
    """R(j omega) as real and imaginary part, in fractions."""
    real, imag = Fraction(function.gain), Fraction(0)
    for roots, inverse in ((function.zeros, False), (function.poles, True)):
        for root in roots:
            a, b = -Fraction(root.real), omega - Fraction(root.imag)
            if inverse:
                square = a * a + b * b
                a, b = a / square, -b / square
            real, imag = real * a - imag * b, real * b + imag * a
    return real, imag


@pytest.fixture(scope="module")
def cells():
    """Wide and narrow ones, many about 30 and 100 rad/s."""
    rng = np.random.default_rng(0)
    low = np.concatenate([10 ** rng.uniform(-3, 5, 30), 100 + 1e-3 * rng.normal(size=10), [29.9]])
    return FrequencyCells(low, low * (1 + 10 ** rng.uniform(-12, 0, low.shape)))


@pytest.mark.parametrize("function", FUNCTIONS.values(), ids=FUNCTIONS)
def test_magnitudes_and_directions_over_cells_hold_every_exact_value(function, cells):
    least, most = least_magnitude(function, cells), largest_magnitude(function, cells)
    unit, turned = direction(function, cells)
    for k in range(len(cells.low)):
        for share in (0, Fraction(1, 3), Fraction(1, 2), 1):
            low, high = Fraction(cells.low[k]), Fraction(cells.high[k])
            real, imag = exact(function, low + share * (high - low))
            square = real * real + imag * imag
            assert Fraction(least[k]) ** 2 <= square
            assert most[k] == np.inf or square <= Fraction(most[k]) ** 2
            value = complex(real, imag) / abs(complex(real, imag)) if square else 1.0
            middle = complex(unit.real.low[k], unit.imag.low[k])
            assert square == 0 or abs(np.angle(value / middle)) <= turned[k] + 1e-12


def test_narrow_cells_cost_little_and_points_nothing():
    function = FUNCTIONS["damping 1e-6"]
    at = np.geomspace(0.1, 1e4, 50)
    point, narrow = FrequencyCells(at, at), FrequencyCells(at, at * (1 + 1e-4))
    for cells, spread in ((point, 1e-12), (narrow, 1e-2)):
        ratio = largest_magnitude(function, cells) / least_magnitude(function, cells)
        assert (ratio <= 1 + spread).all()


@pytest.mark.parametrize("function", FUNCTIONS.values(), ids=FUNCTIONS)
def test_asymptotes_hold_above_their_frequency(function):
    bounds = asymptote(function, 200.0)
    power = len(function.poles) - len(function.zeros)
    for omega in (200, 201, 1234, 10**9):
        real, imag = exact(function, Fraction(omega))
        size = (real * real + imag * imag) * Fraction(omega) ** (2 * power)
        assert Fraction(float(bounds.low)) ** 2 <= size <= Fraction(float(bounds.high)) ** 2


def test_sums_products_quotients_and_roots_hold_the_exact_ones():
    rng = np.random.default_rng(1)
    sizes = rng.choice([-1.0, 1.0], (2, 300)) * 10 ** rng.uniform(-150, 150, (2, 300))
    x, y = (Interval(np.minimum(a, 1.5 * a), np.maximum(a, 1.5 * a)) for a in sizes)
    found = {"+": x + y, "-": x - y, "*": x * y, "/": x / y}
    for k, (a, b) in enumerate(sizes.T):
        a, b = Fraction(a) * Fraction(5, 4), Fraction(b) * Fraction(6, 5)
        exact_ones = {"+": a + b, "-": a - b, "*": a * b, "/": a / b}
        for name, value in exact_ones.items():
            assert Fraction(found[name].low[k]) <= value <= Fraction(found[name].high[k])
    square = x.squared()
    again = square.root()
    assert (again.low <= x.size().low).all()
    assert (again.high >= x.size().high).all()


def test_what_is_divided_by_zero_or_is_no_number_proves_nothing():
    with np.errstate(all="ignore"):
        whole = Interval.of(np.ones(1)) / Interval(np.array([-1.0]), np.array([1.0]))
        assert whole.low[0] == -np.inf and whole.high[0] == np.inf
        lost = Interval.of(np.zeros(1)) * whole
        assert not (lost.low > -1.0).any()
        assert not (lost.high < 1.0).any()


def test_the_tangent_of_h_holds_it_over_cells():
    """At the ends, in exact fractions, and at random frequencies within."""
    basis = AnalyticBasis(
        np.geomspace(1.0, 1e4, 12), (1e-2, 1e4), zeros=[50.0, 3.0 + 400j], poles=[20 + 30j, 1e3]
    )
    rng = np.random.default_rng(2)
    x = rng.normal(size=basis.size)
    ends = np.geomspace(1.0, 1e5, 400)
    cells = FrequencyCells(ends[:-1], ends[1:])
    h = basis.tangent(x, cells)
    for share in (0.0, 0.2, 0.5, 0.9, 1.0):
        omega = cells.low + share * (cells.high - cells.low)
        away = basis.response(omega) @ x - h.value - h.slope * (omega - cells.middle)
        assert (np.abs(away) <= h.error + 1e-12 * np.abs(x).sum()).all()
    assert np.median(h.error / np.abs(h.value)) < 1e-2
    points = basis.tangent(x, FrequencyCells(ends, ends))
    assert (points.error < 1e-9).all()
    assert basis.decay(x, 1e5) >= np.abs(basis.response(np.array([1e6])) @ x)[0] * 1e6
