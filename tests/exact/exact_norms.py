"""Systems whose H-infinity norms are known, and what certifies a norm."""

import control
import numpy as np
from exact_cases import Case, Claim, ball, dyadic, larger, mixed, power, precise, root
from flint import arb

from workbench.certify.norms import certified_norm
from workbench.mu import peak, worst_case_gain
from workbench.structure import Complex, Full, Real, Structure

HADAMARD = np.array([[1.0, 1.0], [1.0, -1.0]])
"""Its singular values are sqrt(2), both."""


def lag(rng):
    """g / (s + a)."""
    a, g = dyadic(rng), dyadic(rng)
    return ([[-a]], [[1.0]], [[g]], [[0.0]], 0.0), ball(g) / ball(a)


def resonance(rng, lightest=-45):
    """1 / (s^2 + c s + k): the square of its gain is 1 / ((k - x)^2 + c^2 x), x = omega^2."""
    c, k = dyadic(rng, lightest, 2), dyadic(rng)
    c_, k_ = ball(c), ball(k)
    truth = 1 / root(c_**2 * k_ - c_**4 / 4) if c_**2 < 2 * k_ else 1 / k_
    return ([[0.0, 1.0], [-k, -c]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]], 0.0), truth


def defective(rng):
    """1 / (s + a)^n by a Jordan block."""
    a, n = dyadic(rng, -6, 3), int(rng.integers(2, 6))
    A = -a * np.eye(n) + np.eye(n, k=1)
    return (A, np.eye(n)[:, -1:], np.eye(n)[:1], [[0.0]], 0.0), 1 / ball(a) ** n


def repeated(rng):
    """A resonance to the power n: its equal halves in a chain."""
    (A, B, C, D, _), truth = resonance(rng, -20)
    n = int(rng.integers(2, 4))
    chain = np.kron(np.eye(n), A) + np.kron(np.eye(n, k=-1), np.array(B) @ C)
    first, last = np.eye(n)[:, :1], np.eye(n)[-1:]
    return (chain, np.kron(first, B), np.kron(last, C), D, 0.0), truth**n


def hidden(rng):
    """A lag, beside a light mode that is not driven or not seen."""
    (A, B, C, D, _), truth = lag(rng)
    mode, drive, _ = resonance(rng)[0][:3]
    A = np.block([[np.array(A), np.zeros((1, 2))], [np.zeros((2, 1)), np.array(mode)]])
    driven = bool(rng.integers(2))
    B = np.vstack([B, np.array(drive) * driven])
    C = np.hstack([C, np.array([[1.0, 2.0]]) * (not driven)])
    return (A, B, C, D, 0.0), truth


def cancelled(rng):
    """A resonance less itself: its direct term is left."""
    (A, B, C, _, _), _ = resonance(rng, -20)
    d = dyadic(rng)
    parts = np.kron(np.eye(2), A), np.vstack([B, B]), np.hstack([C, -np.array(C)])
    return (*parts, [[d]], 0.0), ball(d)


def nearly_cancelled(rng):
    """1 + e / (s + a), of a gain just above 1."""
    a, e = dyadic(rng), np.ldexp(1.0, -int(rng.integers(5, 45)))
    return ([[-a]], [[1.0]], [[e]], [[1.0]], 0.0), 1 + ball(e) / ball(a)


def sensitivity(rng):
    """s / (s + k): the sensitivity of an integrator."""
    k = dyadic(rng)
    return ([[-k]], [[k]], [[-1.0]], [[1.0]], 0.0), arb(1)


def with_integrator(rng):
    """An integrator beside a lag, driven and seen: no gain."""
    (A, B, C, D, _), _ = lag(rng)
    A = np.diag([A[0][0], 0.0])
    return (A, np.vstack([B, [[1.0]]]), np.hstack([C, [[1.0]]]), D, 0.0), arb(float("inf"))


def several_modes(rng):
    """H diag(g1, g2) H with H'H = 2: twice the larger gain."""
    (A1, B1, C1, _, _), one = resonance(rng, -30)
    (A2, _, _, _, _), other = resonance(rng, -30)
    zero = np.zeros((2, 2))
    A = np.block([[np.array(A1), zero], [zero, np.array(A2)]])
    B = np.kron(np.eye(2), B1) @ HADAMARD
    C = HADAMARD @ np.kron(np.eye(2), C1)
    return (A, B, C, np.zeros((2, 2)), 0.0), 2 * larger(one, other)


def static(rng):
    """H diag(d) H, or a row of integers, in any unit."""
    unit = power(rng)
    nothing = np.zeros((0, 0))
    if rng.integers(2):
        d = [dyadic(rng, -30, 30), dyadic(rng, -30, 30)]
        D = HADAMARD @ np.diag(d) @ HADAMARD
        sums = [ball(d[0]) + ball(d[1]), ball(d[0]) - ball(d[1])]
        if sums == [ball(x) for x in D[0].tolist()]:
            parts = nothing, np.zeros((0, 2)), np.zeros((2, 0)), D * unit, 0.0
            return parts, 2 * larger(*d) * ball(unit)
    row = rng.integers(-9, 10, 3) + np.array([1.0, 0.0, 0.5])
    truth = root(sum(ball(x) ** 2 for x in row.tolist())) * ball(unit)
    return (nothing, np.zeros((0, 3)), np.zeros((1, 0)), row[None] * unit, 0.0), truth


def _near_circle(rng):
    """A double within the circle, near 1 or -1."""
    return float(rng.choice([-1, 1])) * (1 - np.ldexp(1.0, -int(rng.integers(1, 45))))


def sampled_lag(rng):
    """1 / (z - p)."""
    p, dt = _near_circle(rng), dyadic(rng, -20, 10)
    return ([[p]], [[1.0]], [[1.0]], [[0.0]], dt), 1 / (1 - abs(ball(p)))


def sampled_defective(rng):
    """1 / (z - p)^n."""
    p, n, dt = _near_circle(rng), int(rng.integers(2, 4)), dyadic(rng, -20, 10)
    A = p * np.eye(n) + np.eye(n, k=1)
    return (A, np.eye(n)[:, -1:], np.eye(n)[:1], [[0.0]], dt), 1 / (1 - abs(ball(p))) ** n


def sampled_resonance(rng):
    """1 / (z^2 + a z + b): 1 / gain^2 is 4 b c^2 + 2 a (1 + b) c + (1 - b)^2 + a^2, c = cos."""
    b = 1 - np.ldexp(1.0, -int(rng.integers(2, 30)))
    a = float(rng.integers(-(2**20) + 1, 2**20)) / 2**20 * (1 + b)
    a_, b_ = ball(a), ball(b)

    def square(c):
        return 4 * b_ * c * c + 2 * a_ * (1 + b_) * c + (1 - b_) ** 2 + a_**2

    lowest = -a_ * (1 + b_) / (4 * b_)
    least = square(lowest) if abs(lowest) < 1 else square(-lowest / abs(lowest))
    parts = [[0.0, 1.0], [-b, -a]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]]
    return (*parts, dyadic(rng, -20, 10)), 1 / root(least)


def in_units(rng, parts, truth):
    """The same in another unit of time and of signals."""
    A, B, C, D, dt = parts
    time, signal = power(rng), power(rng, 50)
    if dt:
        return (A, np.array(B) * signal, C, np.array(D) * signal, dt * time), truth * ball(signal)
    A, B = np.array(A) * time, np.array(B) * time
    return (A, B, np.array(C) * signal, np.array(D) * signal, dt), truth * ball(signal)


SYSTEMS = {
    "light": resonance,
    "defective": defective,
    "repeated": repeated,
    "hidden": hidden,
    "cancelled": cancelled,
    "nearly cancelled": nearly_cancelled,
    "integrator closed": sensitivity,
    "integrator": with_integrator,
    "several modes": several_modes,
    "static": static,
    "sampled, near the circle": sampled_lag,
    "sampled, defective": sampled_defective,
    "sampled, light": sampled_resonance,
}


def known_system(rng, name):
    """A system of the family in coordinates and units by chance, and its norm."""
    (A, B, C, D, dt), truth = SYSTEMS[name](rng)
    A, B, C = mixed(rng, A, B, C)
    parts = (A, B, C, np.asarray(D, float), dt)
    if units := bool(rng.integers(3) == 0):
        parts, truth = in_units(rng, parts, truth)
    return control.ss(*parts), truth, units


@precise
def norm_case(rng):
    """A norm by one of the functions that prove one."""
    name = str(rng.choice(list(SYSTEMS)))
    system, truth, units = known_system(rng, name)
    function = str(rng.choice(["certified_norm", "peak"]))

    def ask():
        if function == "certified_norm":
            bound = certified_norm(system)
            return bound, [Claim("norm", 0.0, bound, truth)]
        found = peak(system, Structure([Full(system.ninputs, system.noutputs)]))
        return found, [Claim("peak", found.lower, found.upper, truth)]

    return Case(f"{name}{', units' * units}", function, ask)


@precise
def mu_case(rng):
    """g(s) u v' with complex blocks: mu is |g| times the sum of what each block sees."""
    name = str(rng.choice([one for one in SYSTEMS if one not in ("several modes", "static")]))
    (A, B, C, D, dt), truth = SYSTEMS[name](rng)
    u = rng.integers(-4, 5, 4).astype(float)
    v = rng.integers(-4, 5, 4).astype(float)
    u[0] = v[0] = 1.0
    kinds = [
        ([Complex(1)] * 4, [(0, 1), (1, 2), (2, 3), (3, 4)]),
        ([Complex(2), Full(2, 2)], [(0, 2), (2, 4)]),
        ([Full(3, 3), Complex(1)], [(0, 3), (3, 4)]),
        ([Full(4, 4)], [(0, 4)]),
    ]
    blocks, places = kinds[int(rng.integers(len(kinds)))]
    seen = arb(0)
    for block, (i, j) in zip(blocks, places, strict=True):
        if isinstance(block, Complex):
            seen += abs(ball(float(v[i:j] @ u[i:j])))
        else:
            seen += root(float(u[i:j] @ u[i:j])) * root(float(v[i:j] @ v[i:j]))
    parts = np.asarray(A, float), np.array(B) * v[None], u[:, None] * np.array(C)
    system = control.ss(*parts, np.outer(u, v) * D[0][0], dt)
    truth = truth * seen

    def ask():
        found = peak(system, Structure(blocks), tolerance=0.01)
        return found, [Claim("mu", found.lower, found.upper, truth)]

    return Case(f"rank one, {name}", "peak", ask)


@precise
def mixed_case(rng):
    """b delta_r + g delta_c about s^2 + c s + k, or a static gain: the nearest end of a stadium.

    The curve q = k - x + j c omega comes near the right end of the segment from -b t to b t first:
    |q - b t|^2 = (k - b t - x)^2 + c^2 x is least at x = k - b t - c^2 / 2, or at x = 0.
    """
    c, k = dyadic(rng, -12, 2), dyadic(rng)
    b, g = dyadic(rng, -3, 3), dyadic(rng, -3, 3)
    copies = int(rng.integers(1, 3))  # of the real scalar, of which each bears a half
    c_, k_, b_, g_ = map(ball, (c, k, b, g))
    # g^2 t^2 + c^2 b t - (c^2 k - c^4 / 4) = 0
    size = (-(c_**2) * b_ + root(c_**4 * b_**2 + 4 * g_**2 * (c_**2 * k_ - c_**4 / 4).max(0))) / (
        2 * g_**2
    )
    if not k_ - b_ * size > c_**2 / 2:
        size = k_ / (b_ + g_)
    time = power(rng) if rng.integers(3) == 0 else 1.0
    A = np.array([[0.0, 1.0], [-k, -c]]) * time
    into = np.array([b / copies] * copies + [g])
    B = np.vstack([np.zeros_like(into), into]) * time
    C = np.array([[1.0, 0.0]] * (copies + 1))
    structure = Structure([Real(copies), Complex(1)])
    system = control.ss(A, B, C, np.zeros((copies + 1, copies + 1)))

    def ask():
        found = peak(system, structure, tolerance=0.01)
        return found, [Claim("mu", found.lower, found.upper, 1 / size)]

    return Case("mixed, repeated" if copies > 1 else "mixed", "peak", ask)


@precise
def worst_of_no_set(rng):
    """A worst-case gain whose perturbation does nothing: the norm."""
    name = str(rng.choice(["light", "sampled, light", "defective", "static", "hidden"]))
    system, truth, units = known_system(rng, name)
    r, c = system.ninputs, system.noutputs
    n = system.nstates
    N = control.ss(
        system.A,
        np.hstack([np.zeros((n, 1)), system.B]),
        np.vstack([np.zeros((1, n)), system.C]),
        np.block([[np.zeros((1, 1)), np.zeros((1, r))], [np.zeros((c, 1)), system.D]]),
        system.dt or 0.0,
    )

    def ask():
        found = worst_case_gain(N, Structure([Complex(1)]))
        return found, [Claim("gain", found.lower, found.upper, truth)]

    return Case(f"no effect, {name}{', units' * units}", "worst_case_gain", ask)
