"""Loops whose margins are known, gaps of two plants, and switched systems."""

import math
from fractions import Fraction

import control
import numpy as np
from exact_cases import (
    Case,
    Claim,
    ball,
    dyadic,
    larger,
    largest_ratio,
    mixed,
    power,
    precise,
    root,
    smaller,
)
from flint import arb

from workbench.mu import coprime_margin, loop_margins, nu_gap
from workbench.uncertainty import real, tf

CROSSINGS = 1e-6
"""Rounding that `loop_margins` grants its crossings."""
NEVER = arb(float("inf"))


def about(name, value, truth):
    """That a checked number is the truth up to the rounding that it is granted."""
    room = CROSSINGS * abs(value) if math.isfinite(value) else 0.0
    return Claim(name, value - room, value + room, truth)


def degrees(angle):
    return angle * 180 / arb.pi()


def integrator(rng):
    """k / s: phase margin 90 degrees at k."""
    k = dyadic(rng)
    turn = arb.pi() / 2
    return ([[0.0]], [[1.0]], [[k]], 0.0), NEVER, (turn, ball(k)), arb(1)


def two_integrators_one_slow(rng):
    """k / (s (s + a)): x (x + a^2) = k^2 at the crossing x = omega^2."""
    k, a = dyadic(rng), dyadic(rng)
    k_, a_ = ball(k), ball(a)
    x = (-(a_**2) + root(a_**4 + 4 * k_**2)) / 2
    k2, a2 = Fraction(k) ** 2, Fraction(a) ** 2
    ratio = largest_ratio((0, a2, 1), (k2, a2 - 2 * Fraction(k), 1))
    parts = [[0.0, 1.0], [0.0, -a]], [[0.0], [1.0]], [[k, 0.0]], 0.0
    return parts, NEVER, ((a_ / root(x)).atan(), root(x)), 1 / root(ratio)


def three_lags(rng):
    """k / (s + a)^3: the gain margin is 8 a^3 / k."""
    a = dyadic(rng)
    k = a**3 * float(rng.integers(2, 8))
    k_, a_ = ball(k), ball(a)
    x = ((k_ * k_).log() / 3).exp() - a_**2
    phase = arb.pi() - 3 * (root(x) / a_).atan()
    A = -a * np.eye(3) + np.eye(3, k=1)
    parts = A, np.eye(3)[:, -1:], k * np.eye(3)[:1], 0.0
    return parts, 8 * a_**3 / k_, (phase, root(x)), None


def sampled_integrator(rng):
    """k / (z - 1): the gain margin is 2 / k, the phase margin 90 degrees less half the turn."""
    k, dt = float(rng.integers(1, 31)) / 32, dyadic(rng, -20, 5)
    turn = 2 * (ball(k) / 2).asin()
    phase = (arb.pi() / 2 - turn / 2, turn / ball(dt))
    return ([[1.0]], [[1.0]], [[k]], dt), 2 / ball(k), phase, 1 / larger(1, 2 / (2 - ball(k)))


LOOPS = {
    "integrator": integrator,
    "integrator and lag": two_integrators_one_slow,
    "three lags": three_lags,
    "sampled integrator": sampled_integrator,
}


def in_time(parts, dt, time, crossing):
    """A loop in another unit of time: rates are multiplied by a power of two."""
    A, B, C = parts
    phase, omega = crossing
    if dt:
        return (A, B, C), dt / time, (phase, omega * ball(time))
    return (np.array(A) * time, np.array(B) * time, C), dt, (phase, omega * ball(time))


@precise
def classical_case(rng):
    """Gain, phase, delay and modulus margins of a loop."""
    name = str(rng.choice(list(LOOPS)))
    (A, B, C, dt), gain, crossing, modulus = LOOPS[name](rng)
    time = power(rng) if rng.integers(3) == 0 else 1.0
    (A, B, C), dt, (phase, omega) = in_time(mixed(rng, A, B, C), dt, time, crossing)
    loop = control.ss(A, B, C, 0.0, dt)

    def ask():
        found = loop_margins(loop).classical["loop"]
        claims = [
            about("gain", found.gain[1], gain),
            about("phase", found.phase_deg, degrees(phase)),
            about("delay", found.delay, phase / omega),
        ]
        if modulus is not None:
            claims.append(Claim("modulus", found.modulus * (1 - CROSSINGS), math.inf, modulus))
        return found, claims

    return Case(f"{name}{', units' * (time != 1.0)}", "loop_margins, crossings", ask)


@precise
def disk_case(rng):
    """A disk margin: of k / s always 2, or 1 of a sensitivity; of k / (s (s + a)) a ratio."""
    skew = float(rng.choice([-1.0, 0.0, 1.0]))
    time = power(rng) if rng.integers(3) == 0 else 1.0
    k, a = dyadic(rng), dyadic(rng, -12, 3)
    if rng.integers(3) == 0:
        parts, truth, name = ([[0.0]], [[1.0]], [[k]]), arb(2 if skew == 0 else 1), "integrator"
    else:
        k_, a2 = Fraction(k), Fraction(a) ** 2
        below = (k_ * k_, a2 - 2 * k_, 1)
        above = {
            1.0: (0, a2, 1),  # |s^2 + a s|^2 over |s^2 + a s + k|^2: S
            -1.0: (k_ * k_, 0, 0),  # T
            0.0: (k_ * k_ / 4, (a2 + 2 * k_) / 4, Fraction(1, 4)),  # (S - T) / 2
        }[skew]
        truth = 1 / root(largest_ratio(above, below))
        parts, name = ([[0.0, 1.0], [0.0, -a]], [[0.0], [1.0]], [[k, 0.0]]), "integrator and lag"
    A, B, C = mixed(rng, *parts)
    loop = control.ss(A * time, B * time, C, 0.0)

    def ask():
        found = loop_margins(loop, skew=skew)
        disk = next(iter(found.disks.values()))
        return found, [Claim("disk", disk.lower, disk.upper, truth)]

    return Case(f"{name}{', units' * (time != 1.0)}", "loop_margins", ask)


@precise
def set_case(rng):
    """k / (s - p) with p of a range about 0: gain, phase and delay at the fastest p."""
    k = dyadic(rng, 2, 3)
    most = dyadic(rng, -1, 0)
    p = real("p", 0.0, plus_minus=most)
    k_, p_ = ball(k), ball(most)
    phase = (p_ / k_).acos()
    delay = phase / root(k_**2 - p_**2)

    def ask():
        margins = loop_margins(tf([k], [1, -1 * p]), tolerance=0.05, parts=200)
        found = margins.every_plant["loop"]
        return found, [
            Claim("fall", found.gain_lost[0], found.gain[0], p_ / k_),
            Claim("phase", found.phase_deg, found.phase_lost_deg, degrees(phase)),
            Claim("delay", found.delay, found.delay_lost, delay),
        ]

    return Case("unstable members", "loop_margins, every plant", ask)


# --- two plants -----------------------------------------------------------------------------------


def chordal(a, b):
    return abs(a - b) / root((1 + a * a) * (1 + b * b))


def two_gains(rng):
    a, b = (float(rng.choice([-1, 1])) * dyadic(rng, -12, 12) for _ in "ab")
    dt = float(rng.choice([0.0, 0.5]))
    truth = chordal(ball(a), ball(b))
    return [control.ss([], [], [], [[x]], dt) for x in (a, b)], truth


def two_integrators(rng):
    """a / s and b / s: the distance is largest at omega^2 = a b."""
    a, b = dyadic(rng), dyadic(rng)
    plants = [control.ss([[0.0]], [[1.0]], [[x]], 0.0) for x in (a, b)]
    return plants, abs(ball(a) - ball(b)) / (ball(a) + ball(b))


def two_lags(rng):
    """1 / (s + a) and 1 / (s + b), stable or not: they can be told alike where 1 + a b > 0."""
    a, b = (float(rng.choice([-1, 1])) * dyadic(rng, -6, 3) for _ in "ab")
    plants = [control.ss([[-x]], [[1.0]], [[1.0]], 0.0) for x in (a, b)]
    a_, b_ = ball(a), ball(b)
    apart = abs(a_ - b_) / root((a_**2 + 1) * (b_**2 + 1))
    return plants, apart if 1 + Fraction(a) * Fraction(b) > 0 else arb(1)


def two_channels(rng):
    """Integrators of two channels, each with a gain of its own: the larger distance."""
    a, b, c, d = (dyadic(rng) for _ in "abcd")
    plants = [
        control.ss(np.zeros((2, 2)), np.eye(2), np.diag(x), np.zeros((2, 2)))
        for x in ((a, b), (c, d))
    ]
    a_, b_, c_, d_ = map(ball, (a, b, c, d))
    return plants, larger(abs(a_ - c_) / (a_ + c_), abs(b_ - d_) / (b_ + d_))


PAIRS = {
    "two gains": two_gains,
    "two integrators": two_integrators,
    "two lags": two_lags,
    "two channels": two_channels,
}


@precise
def gap_case(rng):
    """The nu-gap of two plants, in any unit of time."""
    name = str(rng.choice(list(PAIRS)))
    plants, truth = PAIRS[name](rng)
    time = power(rng) if rng.integers(3) == 0 and plants[0].nstates else 1.0
    plants = [control.ss(one.A * time, one.B * time, one.C, one.D, one.dt) for one in plants]

    def ask():
        found = nu_gap(*plants)
        return found, [Claim("gap", found.lower, found.upper, truth)]

    return Case(f"{name}{', units' * (time != 1.0)}", "nu_gap", ask)


@precise
def coprime_case(rng):
    """p / s and a gain: min(1, K) / sqrt(1 + K^2); or two gains, 1 + p K over both lengths."""
    p, K = dyadic(rng), dyadic(rng)
    p_, K_ = ball(p), ball(K)
    if rng.integers(2):
        plant, truth = control.ss([[0.0]], [[1.0]], [[p]], 0.0), smaller(1, K_) / root(1 + K_**2)
    else:
        plant = control.ss([], [], [], [[p]])
        truth = (1 + p_ * K_) / root((1 + p_**2) * (1 + K_**2))

    def ask():
        found = coprime_margin(plant, K)
        return found, [Claim("margin", found.lower, found.upper, truth)]

    return Case("integrator" if plant.nstates else "two gains", "coprime_margin", ask)
