"""Switched systems, containment and smallest shapes, of one or two plants, whose truth is known."""

import math
from fractions import Fraction

import control
import numpy as np
from exact_cases import Case, Claim, ball, dyadic, larger, mixed, power, precise, root
from flint import arb

import workbench as wb
from workbench.errors import SolverError
from workbench.synthesis import Mode, SwitchedStability
from workbench.uncertainty import Responses, UncertaintyModel, contains

CONTAINED = 1e-9
"""Rounding that containment is granted, relative to the radius."""


def solved(program):
    """The answer of a program; raises SolverError where there is none."""
    found = wb.solve(program)
    if found.certificate is None:
        raise SolverError(f"there is no answer: {found!r}")
    return found.answer


@precise
def switching_case(rng):
    """[a b; 0 a] and its transpose: after n samples each, the growth is that of a known product.

    A^n is a^n [1 m; 0 1] with m = n b / a. The product of both has the determinant a^(4 n) and the
    trace a^(2 n) (2 + m^2), and an eigenvalue above 1 where 1 + a^(4 n) < a^(2 n) (2 + m^2).
    """
    a, b = float(rng.integers(4, 15)) / 16, dyadic(rng, -3, 2)
    plants = int(rng.integers(1, 3))  # of two, the second is slower
    A = np.array([[a, b], [0.0, a]])
    matrices = [np.array([one, one / 2])[:plants] for one in (A, A.T)]

    def grows(n):
        a_, m = Fraction(a), n * Fraction(b) / Fraction(a)
        return 1 + a_ ** (4 * n) < a_ ** (2 * n) * (2 + m * m)

    def ask():
        modes = tuple(Mode(f"m{k}", one, shortest_samples=None) for k, one in enumerate(matrices))
        found = solved(SwitchedStability(modes))
        shortest = max((n for n in range(1, 200) if grows(n)), default=0) + 1
        # Below `shortest` some periodic switching is unstable.
        return found, [Claim("samples", float(shortest), math.inf, ball(found.samples))]

    return Case("one plant" if plants == 1 else "two plants", "SwitchedStability", ask)


@precise
def unstable_switching_case(rng):
    """A mode of spectral radius 1 or more, in coordinates of integers: never stable."""
    above = float(rng.choice([0.0, *np.ldexp(1.0, -np.arange(5, 45, 5))]))
    A = np.array([[1.0 + above, 1.0], [0.0, 0.5]])
    A, _, _ = mixed(rng, A, np.zeros((2, 1)), np.zeros((1, 2)), 8, 9)
    modes = (
        Mode("grows", A, shortest_samples=None),
        Mode("falls", np.eye(2) / 4, shortest_samples=1),
    )

    def ask():
        found = solved(SwitchedStability(modes))
        claimed = [Claim("radius", 0.0, math.nextafter(1.0, 0.0), ball(1.0 + above))]
        return found, claimed if found.holds else []

    return Case("unstable mode", "SwitchedStability", ask)


@precise
def containment_case(rng):
    """The largest distance of one or two plants beyond circles of radius w, over w, less 1.

    The nominal is g / (s + a) with the plants x g / (s + a), x real or complex, and the weight
    multiplicative: each is |x - 1| / w - 1 outside, at every frequency. Or all are gains.
    """
    w = dyadic(rng, -4, 1)
    count = 1 + int(rng.integers(4) > 0)
    factors = [complex(int(x), int(y)) / 16 + 1 for x, y in rng.integers(-40, 41, (count, 2))]
    if rng.integers(3) == 0:  # one on the border
        factors[0] = complex(1 + w)
    time, gain = power(rng, 20), power(rng, 30)
    a = dyadic(rng)
    omega = np.array([0.5, 1.0, 3.0]) * time
    nominal = gain / (1j * omega / time + a)
    values = nominal[:, None] * np.array(factors)
    model = UncertaintyModel(control.tf([gain * time], [1.0, a * time]), control.tf([w], [1.0]))
    far = [root(ball(f.real - 1) ** 2 + ball(f.imag) ** 2) / ball(w) - 1 for f in factors]
    truth = larger(*far)
    # The values of the plants are rounded, a few eps of |x|, which is at most 50 w here.
    room = CONTAINED * 10

    def ask():
        found = contains(model, Responses(omega=omega, values=values))
        inside = Claim("inside", 0.0, 1.0 if found.holds else 2.0, arb(0))
        claims = [Claim("worst", found.worst - room, found.worst + room, truth), inside]
        if bool(truth < -room) or bool(truth > room):
            verdict = float(found.holds)
            claims.append(Claim("verdict", verdict, verdict, arb(int(bool(truth < 0)))))
        return _Found(found), claims

    return Case("one plant" if count == 1 else "two plants", "contains", ask)


class _Found:
    """A containment whose ``holds`` is its verdict: its certificate is asked instead."""

    def __init__(self, found):
        self.certificate = found.certificate
        self.holds = self.certificate.holds or not found.holds


@precise
def circle_case(rng):
    """The smallest circle of one, two or three points; the narrowest stadium of one or two."""
    unit = power(rng)
    place = complex(*rng.integers(-9, 10, 2).tolist())
    x, y = (float(v) for v in rng.integers(1, 30, 2))
    count = int(rng.integers(1, 4))
    # Of a right angle at the first point, the circle about the others.
    points = [place, place + x, place + 1j * y][:count]
    truth = [arb(0), ball(x) / 2, root(ball(x) ** 2 + ball(y) ** 2) / 2][count - 1]
    stadium = count < 3 and bool(rng.integers(2))
    # The answer is the smallest up to a relative gap of 1e-6, its points inside up to 1e-9.
    given = np.array(points) * unit

    def ask():
        if stadium:
            found, radius = wb.narrowest_stadium(given), arb(0)
        else:
            found, radius = wb.smallest_circle(given), truth * ball(unit)
        size = float(np.abs(given).max(initial=0.0)) + unit
        value = float(found.radius)
        room = 1e-9 * size
        return found, [Claim("radius", value * (1 - 1e-6) - room, value + room, radius)]

    kind = "narrowest_stadium" if stadium else "smallest_circle"
    return Case(f"{count} points", kind, ask)
