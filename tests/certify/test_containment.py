"""Containment at every frequency: it finds what a grid misses, and proves what holds."""

import numpy as np
import pytest
from lanes import thinned

from workbench.certify.known_plants.containment import escapes, largest_excess
from workbench.fitting.rational import Rational

ONE = Rational([], [], 1.0)


def constant(value):
    return Rational([], [], value)


def resonance(omega, damping, gain=1.0):
    """gain omega^2 / (s^2 + 2 damping omega s + omega^2), with exact conjugate poles."""
    pole = omega * complex(-damping, np.sqrt(1 - damping**2))
    return Rational([], [pole, np.conj(pole)], gain * omega**2)


def plus(one, other):
    """The parallel connection of two functions, by polynomials: for small orders."""
    numerator = np.polyadd(
        one.gain * np.polymul(np.poly(one.zeros), np.poly(other.poles)),
        other.gain * np.polymul(np.poly(other.zeros), np.poly(one.poles)),
    ).real
    poles = np.concatenate([one.poles, other.poles])
    return Rational(np.roots(numerator), poles, numerator[0])


def by_grid(plants, nominal, W_c, W_r, multiplicative, omega):
    """The largest excess on a grid, in floating-point numbers."""
    s = 1j * omega
    g = nominal(s)
    size = g if multiplicative else np.ones_like(g)
    end = size * (W_r(s) if W_r is not None else np.zeros_like(g))
    worst = -1.0
    for plant in plants:
        away = plant(s) - g
        along = np.clip((away / np.where(end == 0, 1, end)).real, -1, 1)
        worst = max(worst, (np.abs(away - along * end) / np.abs(size * W_c(s))).max() - 1)
    return worst


def random_function(rng, order, zeros, low=1.0, high=1e4):
    """A stable function of even order with random, partly light damping."""

    def roots(count):
        size, damping = 10 ** rng.uniform(np.log10(low), np.log10(high), count // 2), 0.0
        damping = 10 ** rng.uniform(-3, -0.1, count // 2)
        one = size * (-damping + 1j * np.sqrt(1 - damping**2))
        return np.concatenate([one, one.conj()])

    bare = Rational(roots(zeros), roots(order), 1.0)
    return bare.scaled(1 / abs(bare(1j * np.sqrt(low * high))))


@pytest.mark.parametrize("multiplicative", [True, False])
@pytest.mark.parametrize("mixed", [True, False])
@pytest.mark.parametrize("seed", thinned(range(5), 5))
def test_bound_lies_just_above_a_dense_grid(seed, mixed, multiplicative):
    rng = np.random.default_rng(seed)
    nominal = random_function(rng, 4, 4)
    plants = [random_function(rng, 4, 4) for _ in range(3)]
    W_c = random_function(rng, 4, 4)
    W_r = random_function(rng, 4, 4) if mixed else None
    found = largest_excess(plants, nominal, W_c, W_r, multiplicative=multiplicative)
    roots = [each for f in (*plants, nominal, W_c) for each in (*f.zeros, *f.poles)]
    around = [abs(r.imag) + abs(r.real) * np.linspace(-5, 5, 201) for r in roots]
    omega = np.abs(np.concatenate([np.geomspace(1e-4, 1e8, 20001), *around]))
    grid = by_grid(plants, nominal, W_c, W_r, multiplicative, omega)
    assert found.value >= grid * (1 - 1e-9)
    assert found.value == pytest.approx(grid, rel=1e-2)
    scaled = W_c.scaled((1 + found.value) * (1 + 1e-12))
    again = largest_excess(plants, nominal, scaled, W_r, multiplicative=multiplicative)
    assert -1e-9 < again.value <= 1e-12


def test_resonance_of_damping_1e_6_between_grid_points_is_found():
    """Its peak is 1e-5 of the frequency wide and a thousand times as high as the radius."""
    omega = np.geomspace(1, 1e5, 400)
    between = np.sqrt(omega[200] * omega[201])
    peaked = plus(ONE, resonance(between, 1e-6, gain=2e-3))
    assert by_grid([peaked], ONE, constant(0.1), None, True, omega) < 0
    found = largest_excess([peaked], ONE, constant(0.1))
    assert found.omega == pytest.approx(between, rel=1e-5)
    assert found.value == pytest.approx(1e3 / 0.1 - 1, rel=1e-3)
    assert largest_excess([peaked], ONE, constant(1001.0)).value < 0


def test_narrow_notch_of_the_weight_is_found():
    """The plant stays; the weight dips."""
    notch = Rational(resonance(50.0, 1e-7).poles, resonance(50.0, 0.1).poles, 0.2)
    found = largest_excess([constant(1.1)], ONE, notch)
    assert found.omega == pytest.approx(50.0, rel=1e-6)
    assert found.value > 1e5


def test_equal_plants_are_at_the_centre():
    plant = random_function(np.random.default_rng(1), 4, 2)
    assert largest_excess([plant] * 3, plant, constant(1e-12)).value == pytest.approx(-1, abs=1e-9)
    assert largest_excess([plant], plant, constant(1e-12), constant(0.3)).value < -0.999


@pytest.mark.parametrize("sign", [1, -1])
def test_plant_on_the_border_at_every_frequency_is_inside(sign):
    """G (1 + W_c) touches its circle everywhere; in exact arithmetic it does not leave it."""
    G = resonance(8.0, 0.25)
    W = Rational([-2.0], [-4.0], 0.5)  # 1 + W = (1.5 s + 5) / (s + 4), 1 - W = (s/2 + 3) / (s + 4)
    both = {1: Rational([-5 / 1.5], [-4.0], 1.5), -1: Rational([-6.0], [-4.0], 0.5)}[sign]
    plant = Rational(both.zeros, [*both.poles, *G.poles], both.gain * G.gain)
    exact = largest_excess([plant], G, W)
    assert abs(exact.value) < 1e-9
    # 6 and 0.5 are exact doubles, so that nothing at all is outside
    assert sign > 0 or escapes([plant], G, W, None, 0.0) == []


def test_plant_that_touches_its_border_at_one_frequency():
    """|W| of a resonance of damping 0.5 touches 1 / 0.866 at omega / sqrt(2): a double root."""
    touching = plus(ONE, resonance(1.0, 0.5))
    peak = 1 / np.sqrt(0.75)
    found = largest_excess([touching], ONE, constant(peak))
    assert abs(found.value) < 1e-9
    assert found.omega == pytest.approx(np.sqrt(0.5), rel=1e-3)
    assert escapes([touching], ONE, constant(peak * (1 + 1e-12)), None, 0.0) == []
    assert len(escapes([touching], ONE, constant(peak * (1 - 1e-12)), None, 0.0)) == 1


@pytest.mark.parametrize("scale", [1e-150, 1e150])
@pytest.mark.parametrize("speed", [1e-12, 1.0, 1e12])
def test_scales_do_not_matter(scale, speed):
    def at(f):
        roots = f.zeros * speed, f.poles * speed
        return Rational(*roots, f.gain * speed ** (f.poles.size - f.zeros.size))

    rng = np.random.default_rng(3)
    G, P, W, W_r = (random_function(rng, 2, 2) for _ in range(4))
    plain = largest_excess([P], G, W, W_r)
    found = largest_excess([at(P).scaled(scale)], at(G).scaled(scale), at(W), at(W_r))
    assert found.value == pytest.approx(plain.value, rel=1e-6)
    assert found.omega == pytest.approx(plain.omega * speed, rel=1e-2)


def test_zero_of_the_nominal_on_the_axis():
    """A relative set is a point there: a plant elsewhere is infinitely far out, one there is in."""
    poles = [-1 + 0j, -2 + 0j]
    G = Rational([3j, -3j], poles, 1.0)
    beside = Rational([-0.01 + 3j, -0.01 - 3j], poles, 1.0)
    found = largest_excess([beside], G, constant(0.5))
    assert np.isinf(found.value)
    assert found.omega == pytest.approx(3.0, rel=1e-2)
    assert largest_excess([G.scaled(1.2)], G, constant(0.5)).value == pytest.approx(-0.6)
    additive = largest_excess([beside], G, constant(0.05), multiplicative=False)
    assert additive.value < 0


def test_limits_at_zero_and_infinity():
    G = Rational([], [-1.0], 1.0)
    slower, steeper = Rational([], [-2.0], 2.0), Rational([], [-1.0, -1e6], 1e6)
    found = largest_excess([slower], G, constant(0.5))  # twice G at infinity
    assert np.isinf(found.omega)
    assert found.value == pytest.approx(1.0)
    assert largest_excess([steeper], G, constant(1.0)).value == pytest.approx(0.0, abs=1e-9)
    assert np.isinf(largest_excess([G], steeper, constant(1e9)).value)
    found = largest_excess([Rational([], [-1.0], 3.0)], G, constant(0.5), multiplicative=False)
    assert (found.value, found.omega) == (pytest.approx(3.0), 0.0)


def test_real_segment_counts_only_along_its_direction():
    G = ONE
    along, across = constant(1.5), plus(ONE, Rational([], [-1.0], 0.5))
    assert largest_excess([along], G, constant(0.01), constant(0.5)).value < 0
    found = largest_excess([across], G, constant(0.01), constant(0.5))
    assert found.value == pytest.approx(0.25 / 0.01 - 1, rel=1e-6)
    assert found.omega == pytest.approx(1.0, rel=1e-3)


@pytest.mark.parametrize("plant", [1.6, 0.4])
def test_both_ends_of_a_segment_are_round(plant):
    """The plant lies 0.1 beyond an end of the segment from 0.5 to 1.5, about which the radius is
    0.01; 1 is the nominal."""
    found = largest_excess([constant(plant)], ONE, constant(0.01), constant(0.5))
    assert found.value == pytest.approx(9.0, rel=1e-9)
    beside = largest_excess([constant(plant)], ONE, constant(0.1 * (1 + 1e-9)), constant(0.5))
    assert -1e-8 < beside.value < 0


@pytest.mark.parametrize("sign", [1, -1])
def test_a_plant_that_leaves_beyond_an_end_and_beside_the_segment(sign):
    """At s = j omega the plant is 1 + 0.6 sign / (1 + j omega): beyond an end of the segment of
    half-length 0.3 at first, then beside it. The circle of all its points decides where."""
    plant = plus(ONE, Rational([], [-1.0], 0.6 * sign))
    found = largest_excess([plant], ONE, constant(0.01), constant(0.3))
    omega = np.geomspace(1e-3, 1e3, 100_001)
    grid = by_grid([plant], ONE, constant(0.01), constant(0.3), True, omega)
    assert found.value == pytest.approx(grid, rel=1e-6)
