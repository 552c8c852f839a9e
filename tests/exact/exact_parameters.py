"""Sets of systems with parameters whose margins, worst cases and probabilities are known."""

import math
from fractions import Fraction

import numpy as np
from exact_cases import Case, Claim, ball, dyadic, larger, power, precise, root
from flint import arb
from scipy import stats

from workbench.mu import (
    guaranteed_probability,
    robust_performance,
    robust_stability,
    worst_case_gain,
)
from workbench.uncertainty import complex_scalar, dynamics, feedback, real, ss, tf

NEVER = arb(float("inf"))


def parameter(rng, name, nominal):
    """A parameter about its nominal, and its half-range as a fraction."""
    reach = math.ldexp(nominal, -int(rng.integers(0, 3))) * float(rng.integers(1, 4)) / 2
    return real(name, nominal, plus_minus=reach), Fraction(reach)


# --- margins of stability -------------------------------------------------------------------------


def second_order(rng):
    """s^2 + c s + k: the first coefficient that reaches 0."""
    time = power(rng) if rng.integers(3) == 0 else 1.0
    c0, k0 = dyadic(rng, -20, 2) * time, dyadic(rng) * time * time
    c, rc = parameter(rng, "c", c0)
    k, rk = parameter(rng, "k", k0)
    which = int(rng.integers(3))
    system = tf([time * time], [1, c if which != 1 else c0, k if which != 0 else k0])
    sizes = [Fraction(c0) / rc, Fraction(k0) / rk]
    return "second order", system, ball(min(sizes) if which == 2 else sizes[which])


def third_order(rng):
    """s^3 + a s^2 + b s + k is stable where a b > k > 0."""
    a, b = dyadic(rng, 0, 3), dyadic(rng, 0, 3)
    k0 = a * b / 2
    k, r = parameter(rng, "k", k0)
    sizes = (Fraction(k0) / r, (Fraction(a) * Fraction(b) - Fraction(k0)) / r)
    return "third order", tf([1], [1, a, b, k]), ball(min(sizes))


def repeated(rng):
    """s^3 + p s^2 + p s + q with p in two places: p^2 = q."""
    p0 = dyadic(rng, 1, 3)
    q = math.ldexp(float(int(p0 * p0 * 4)), -4)
    p, r = parameter(rng, "p", p0)
    return "repeated", tf([1], [1, p, p, q]), (ball(p0) - root(q)) / ball(r)


def correlated(rng):
    """s^2 + (p + q) s + (p - q) + k."""
    p0, q0 = dyadic(rng, 1, 3), dyadic(rng, -1, 1) / 4
    p, rp = parameter(rng, "p", p0)
    q, rq = parameter(rng, "q", q0)
    extra = dyadic(rng, -2, 0)
    sizes = ((Fraction(p0) + Fraction(q0)) / (rp + rq),)
    sizes += ((Fraction(p0) - Fraction(q0) + Fraction(extra)) / (rp + rq),)
    return "correlated", tf([1], [1, p + q, p - q + extra]), ball(min(sizes))


def sampled(rng):
    """z^2 + a z + b is stable where |a| < 1 + b and |b| < 1."""
    b0 = float(rng.integers(-30, 31)) / 32
    a0 = float(rng.integers(-31, 32)) / 32 * (1 + b0)
    a = real("a", a0, plus_minus=0.25)
    system = ss([[0, 1], [-b0, -1 * a]], [[0], [1]], [[1, 0]], [[0]], dyadic(rng, -20, 5))
    return "sampled", system, ball((1 + Fraction(b0) - abs(Fraction(a0))) * 4)


def small_gain(rng):
    """T = k / (s + k), or k / (s^2 + c s + k), with dynamics w delta at the plant's input."""
    k, w = dyadic(rng), dyadic(rng, -3, 1)
    around = 1 + w * dynamics("d", 1, 1)
    if rng.integers(2):
        return "small gain", feedback(tf([k], [1, 0]) * around, 1), 1 / ball(w)
    c = dyadic(rng, -10, 1)
    c_, k_ = ball(c), ball(k)
    peak = k_ / root(c_**2 * k_ - c_**4 / 4) if c_**2 < 2 * k_ else arb(1)
    return "small gain, light", feedback(tf([k], [1, c, 0]) * around, 1), 1 / (ball(w) * peak)


def static(rng):
    """1 / (1 - k), k about 0, or a complex scalar there: from k = 1 on there is none."""
    reach = dyadic(rng, -4, -1)
    kind = int(rng.integers(2))
    k = complex_scalar("k", 0.0, reach) if kind else real("k", 0.0, plus_minus=reach)
    return "static", 1 / (1 - k), 1 / ball(reach)


def without_effect(rng):
    """k / (s + a): no k makes it unstable."""
    k, _ = parameter(rng, "k", dyadic(rng))
    return "without effect", tf([k], [1, dyadic(rng)]), NEVER


MARGINS = (
    second_order,
    third_order,
    repeated,
    correlated,
    sampled,
    small_gain,
    static,
    without_effect,
)


@precise
def margin_case(rng):
    """A margin of robust stability."""
    family, system, truth = MARGINS[int(rng.integers(len(MARGINS)))](rng)

    def ask():
        found = robust_stability(system, tolerance=0.02, parts=300)
        return found, [Claim("margin", found.lower, found.upper, truth)]

    return Case(family, "robust_stability", ask)


# --- gains ----------------------------------------------------------------------------------------


@precise
def performance_case(rng):
    """g / (s + a) of a below g / level; or 1 / (s^2 + c s + k) of a c that is too light."""
    time = power(rng) if rng.integers(3) == 0 else 1.0
    if rng.integers(2):
        a0, g, level = dyadic(rng), dyadic(rng), dyadic(rng)
        a, r = parameter(rng, "a", a0)
        system = tf([g * time], [1, a * time])
        truth = larger((ball(a0) - ball(g) / ball(level)) / ball(r), 0)
        family = "lag"
    else:
        c0, k = dyadic(rng, -6, -1), dyadic(rng, 0, 2)
        c, r = parameter(rng, "c", c0)
        level = 8 / c0  # c^2 k - c^4 / 4 = 1 / level^2, of which the smaller root is meant
        k_, level_ = ball(k), ball(level)
        lightest = root(2 * k_ - 2 * root(k_**2 - 1 / level_**2))
        system = tf([time * time], [1, c * time, k * time * time])
        truth, family = larger((ball(c0) - lightest) / ball(r), 0), "light"

    def ask():
        found = robust_performance(system, gain=level, tolerance=0.01)
        return found, [Claim("margin", found.lower, found.upper, truth)]

    return Case(f"{family}{', units' * (time != 1)}", "robust_performance", ask)


@precise
def worst_case(rng):
    """The largest gain of a set."""
    family, system, truth = _largest_gain(rng)

    def ask():
        found = worst_case_gain(system, tolerance=0.02)
        return found, [Claim("gain", found.lower, found.upper, truth)]

    return Case(family, "worst_case_gain", ask)


def _largest_gain(rng):
    kind = int(rng.integers(5))
    if kind == 0:  # g (1 + w delta) / (s + a)
        a, g, w = dyadic(rng), dyadic(rng), dyadic(rng, -4, 1)
        system = tf([g], [1, a]) * (1 + w * dynamics("d", 1, 1))
        return "dynamics", system, ball(g) / ball(a) * (1 + ball(w))
    if kind == 1:  # 1 / (s^2 + c s + k) with the lightest c and the softest k
        time = power(rng) if rng.integers(3) == 0 else 1.0
        c0, k0 = dyadic(rng, -12, -1), dyadic(rng, 1, 3)
        c, k = real("c", c0, plus_minus=c0 / 4), real("k", k0, low=k0 * 0.75, high=k0 * 2)
        low, soft = ball(c0) * 3 / 4, ball(k0) * 3 / 4
        system = tf([time * time], [1, c * time, k * time * time])
        name = "light, uneven" + ", units" * (time != 1)
        return name, system, 1 / root(low**2 * soft - low**4 / 4)
    if kind == 2:  # k (1 + k), k repeated, in any unit
        unit = power(rng)
        k0 = dyadic(rng, -2, 2)
        k = real("k", k0, plus_minus=k0 / 2)
        most = ball(k0) * 3 / 2
        return "static, repeated", unit * (k * (1 + k)), ball(unit) * most * (1 + most)
    if kind == 3:  # a member without stability
        a = real("a", 1.0, plus_minus=dyadic(rng, 1, 2))
        return "unstable members", tf([1], [1, a]), NEVER
    # z^-1 lag of a pole near the circle
    p0 = 1 - np.ldexp(1.0, -int(rng.integers(2, 20)))
    reach = (1 - p0) / 2
    system = ss([[real("p", p0, plus_minus=reach)]], [[1]], [[1]], [[0]], dyadic(rng, -20, 5))
    return "sampled, near the circle", system, 1 / (1 - ball(p0) - ball(reach))


# --- probabilities --------------------------------------------------------------------------------


def _law(rng):
    """A distribution over [-1, 1] without mass near -0.5, and the mass above -0.5 in there."""
    kind = int(rng.integers(6))
    if kind == 0:
        return "uniform", None, Fraction(3, 4)
    if kind == 1:
        high = int(rng.integers(1, 5))  # -high .. high, of which -1, 0, 1 lie in the range
        return "atoms, integers", stats.randint(-high, high + 1), Fraction(2, 3)
    if kind == 2:
        places = sorted(float(x) for x in rng.choice(np.arange(-16, 17), 4, replace=False) / 16)
        masses = [float(x) for x in rng.multinomial(16, [0.25] * 4) / 16]
        law = stats.rv_discrete(values=(places, masses))
        good = sum(Fraction(m) for x, m in zip(places, masses, strict=True) if x > -0.5)
        return "atoms", law, None if -0.5 in places else good
    if kind == 3:
        return "normal", stats.norm(0, 1), "normal"
    if kind == 4:  # the density rises from 0 at -1: (x + 1)^2 / 4
        return "triangular", stats.triang(1.0, loc=-1.0, scale=2.0), Fraction(15, 16)
    return "exponential", stats.expon(loc=-1.0), "exponential"


@precise
def probability_case(rng):
    """Of p + 1/2 > 0, alone or with another parameter; of a gain; of a curved region."""
    name, law, mass = _law(rng)
    if mass is None:
        name, law, mass = "uniform", None, Fraction(3, 4)
    half, one = ball(Fraction(1, 2)), arb(1)
    if mass == "normal":
        r = root(2)
        mass = ((one / r).erf() + (half / r).erf()) / (2 * (one / r).erf())
    elif mass == "exponential":
        mass = ((-half).exp() - (-2 * one).exp()) / (1 - (-2 * one).exp())
    p = real("p", 0.0, plus_minus=1.0)
    gain, laws, truth = None, {} if law is None else {"p": law}, ball(mass)
    kind = int(rng.integers(4))
    if kind == 0:
        system = tf([1], [1, p + 0.5])
    elif kind == 1:  # two coefficients, each positive with a probability
        q = real("q", 1.0, low=-1.0, high=4.0)
        system, truth = tf([1], [1, q, p + 0.5]), truth * ball(Fraction(4, 5))
        name += ", two"
    elif kind == 2:  # 1 / (s + 2 + p) stays below the level where p > -1 / 2
        system, gain = tf([1.5], [1, 2 + p]), 1.0
        name += ", gain"
    else:
        shift = 0.5
        system = ss([[-1 * p + shift]], [[1]], [[1]], [[0]], 0.1)
        name += ", sampled"  # the pole 1/2 - p lies above -1 where p < 3 / 2

    def ask():
        found = guaranteed_probability(
            system, gain=gain, distributions=laws, tolerance=0.02, parts=60
        )
        return found, [Claim("probability", found.lower, found.upper, truth)]

    return Case(name, "guaranteed_probability", ask)


@precise
def curved_case(rng):
    """s^3 + x s^2 + y s + z, x and y uniform over 0 to 2: stable where x y > z."""
    z = float(rng.integers(1, 16)) / 16
    x, y = real("x", 1.0, plus_minus=1.0), real("y", 1.0, plus_minus=1.0)
    z_ = ball(z)
    truth = 1 - (z_ + z_ * (4 / z_).log()) / 4
    system = tf([1], [1, x, y, z])

    def ask():
        found = guaranteed_probability(system, width=0.1, parts=40)
        return found, [Claim("probability", found.lower, found.upper, truth)]

    return Case("curved", "guaranteed_probability", ask)
